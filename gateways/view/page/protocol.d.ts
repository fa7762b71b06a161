// The messages of `hero.view.v1`, for the checker alone: no browser reads this. What is not known is null.

export type Severity = "ok" | "note" | "order" | "warning" | "alarm";
export type Freshness = "fresh" | "stale" | "gone" | "never";
/** Latitude and longitude, degrees. */
export type LatLon = [number, number];
/** Seconds: before now in `past`, of the recording in a replay. */
export type Phase = { from_s: number; to_s: number | null; text: string };
export type EventLine = { at_unix_ms: number; severity: Severity; text: string };
export type ReplayInfo = {
  file: string; duration_s: number; start_unix_ms: number | null; phases: Phase[];
  events: { at_s: number; severity: Severity; text: string }[];
};
export type Hello = {
  type: "hello"; protocol: string; build: string; instance: string; role: "watch" | "command"; robots: number[];
  replay: ReplayInfo | null; report: boolean; tiles: { min_zoom: number; max_zoom: number } | null; stale_after_ms: number;
};
export type RobotLine = { robot: number; severity: Severity; text: string; flying: boolean | null; battery_v: number | null; link: Freshness };
export type Alarm = { id: string; severity: Severity; text: string; next_step: string | null; since_s: number };
export type Movement = {
  text: string; waypoints_total: number; waypoints_reached: number; distance_to_go_m: number | null; time_to_go_s: number | null;
};
export type RobotState = {
  type: "robot"; robot: number; phase: string; activity: string; module: string; blocked: boolean;
  link: { text: string; state: string; age_s: number | null }; switch: "auto" | "manual" | null; commander: { text: string } | null;
  control: { exclusive: boolean; holder: string | null }; alarms: Alarm[]; movement: Movement | null; flown_s: number | null; replayed: boolean; relayed: boolean;
};
export type Area = { name: string; inclusion: boolean; floor_m: number | null; ceiling_m: number | null; corners: LatLon[] };
export type Chart = {
  type: "chart"; robot: number; source: "bridge" | "file"; number: number; fence: Area[]; floor_m: number | null; ceiling_m: number | null;
  path: [number, number, number][]; home: [number, number, number] | null;
};
export type Age = { freshness: Freshness; age_ms: number | null };
export type Now = {
  type: "now"; robot: number; n: number; sent_ms: number; telemetry: Age; bridge: Age; position: LatLon | null;
  lost_position: LatLon | null; lost_position_age_ms: number | null; altitude_m: number | null;
  height_m: number | null; attitude: { roll_deg: number; pitch_deg: number; yaw_deg: number } | null; ground_speed_mps: number | null;
  climb_mps: number | null; course_deg: number | null; battery_v: number | null; fuel_percent: number | null; fix: string | null;
  flying: boolean | null; left_out: number;
};
export type Past = {
  type: "past"; robot: number; track: (LatLon | null)[]; t_s: number[]; altitude_m: (number | null)[]; ground_speed_mps: (number | null)[];
  battery_v: (number | null)[]; phases: Phase[]; events: EventLine[];
};
export type OrderKind = "hold" | "land" | "goto" | "takeoff" | "start" | "stop";
export type Stage = "not-sent" | "sent" | "accepted" | "in-progress" | "done" | "refused" | "aborted" | "replaced" | "unknown";
export type OrderReport = { type: "order"; order: string; robot: number; kind: OrderKind; stage: Stage; text: string; final: boolean };
export type CheckReport = {
  type: "check"; order: string; robot: number; severity: Severity; findings: { severity: Severity; text: string; next_step: string | null }[];
  distance_m: number | null; duration_s: number | null;
};
export type Lease = { type: "lease"; robot: number; holder: "you" | "other" | "none"; asked: boolean; asks: boolean; expires_ms: number | null };
export type Beat = { type: "beat"; sent_ms: number; unix_ms: number | null };
export type ReplayState = { type: "replay"; position_s: number; playing: boolean; speed: number };

/** From a text; which of the above it is, is said by `type`. */
export type Message = any;
export const PROTOCOL: string;
export function parse(text: unknown): Message | null;
export function orderNumber(): string;
