// The last ten minutes of a robot: values for the plots, phases, and the track. Bounded: what is older goes first.

import { distance, isSamePlace } from "./geo.js";

/** @typedef {import("./protocol.d.ts").LatLon} LatLon */

/** What a plot spans, s. */
export const SPAN_S = 600;
/** Five values a second are more than a plot has pixels. */
const PERIOD_S = 0.2;
/** Messages come a little early or late. */
const JITTER_S = 0.02;
/** After such a pause the line of a plot is broken, and that of the track. */
const GAP_S = 1.5;
/** What is quicker than this, and farther, is no flight, but another fix: m/s, m. */
const MOST_MPS = 100;
const JUMP_M = 5;
const TRACK_POINTS = 6000;
const PHASES = 200;

/** Whether a flight that was seen leads from one place to the next. @param {LatLon} from @param {LatLon} to @param {number} took s */
function isFlown(from, to, took) {
  const far = distance(from, to);
  return far <= JUMP_M || far <= MOST_MPS * took;
}

/**
 * A track with a null wherever no flight was seen: in a gap, and where it jumps.
 * @param {LatLon[]} track @param {number[]} times s, beside the places @param {[number, number][]} gaps s
 * @returns {(LatLon|null)[]}
 */
export function pieces(track, times, gaps) {
  return track.flatMap((at, index) => {
    if (index === 0) return [at];
    const [from, to] = [times[index - 1], times[index]];
    const isGap = gaps.some(([begin, end]) => begin < to && end > from);
    return isGap || !isFlown(track[index - 1], at, to - from) ? [null, at] : [at];
  });
}

export class History {
  /** Columns as the plots take them: time in s, then altitude, speed, battery. @type {[number[], (number|null)[], (number|null)[], (number|null)[]]} */
  columns = [[], [], [], []];
  /** Null where it is not known how the robot came from one place to the next. @type {(LatLon|null)[]} */
  track = [];
  /** When the robot was where the track ends, s. */
  #placeAt = -Infinity;
  /** @type {{from: number, to: number|null, text: string}[]} */
  phases = [];
  /** Whether the track is that of a whole flight, and so does not lead to where the robot is. */
  isWhole = false;
  /** Counts each change of the track that is more than a further point at its end. */
  version = 0;

  clear() {
    this.columns = [[], [], [], []];
    this.track = [];
    this.#placeAt = -Infinity;
    this.phases = [];
    this.version++;
  }

  /** @returns {LatLon|null} */
  lastPlace() {
    return this.track.at(-1) ?? null;
  }

  /** Takes the past instead of all that is here. @param {import("./protocol.d.ts").Past} past @param {number} t now, s */
  replace(past, t) {
    this.clear();
    const count = Math.min(past.t_s.length, past.altitude_m.length, past.ground_speed_mps.length, past.battery_v.length);
    for (let i = 0; i < count; i++) {
      this.#push(t + past.t_s[i], past.altitude_m[i], past.ground_speed_mps[i], past.battery_v[i]);
    }
    this.track = past.track.slice(-TRACK_POINTS);
    // Where nothing was known at the end, the robot has gone on unseen.
    this.#placeAt = past.altitude_m.at(-1) == null ? -Infinity : t;
    for (const { from_s, to_s, text } of past.phases.slice(-PHASES)) {
      this.phases.push({ from: t + from_s, to: to_s === null ? null : t + to_s, text });
    }
    // The last phase goes on until another one is named.
    const last = this.phases.at(-1);
    if (last && last.to !== null && last.to >= t - 1) last.to = null;
  }

  /** @param {number} t @param {import("./protocol.d.ts").Now} now */
  add(t, now) {
    const times = this.columns[0];
    const last = times.at(-1);
    if (last !== undefined && t < last - 1) this.clear();
    const isFresh = now.telemetry.freshness === "fresh";
    if (isFresh && now.position) this.#place(t, now.position);
    if (last !== undefined && t - last < PERIOD_S - JITTER_S && t >= last) return;
    if (last !== undefined && t - last > GAP_S) this.#push(last + 0.01, null, null, null);
    // A value that no longer holds is a gap, not a level line.
    if (isFresh) this.#push(t, now.altitude_m, now.ground_speed_mps, now.battery_v);
    else this.#push(t, null, null, null);
    this.#forget(t);
  }

  /** @param {number} t @param {LatLon} at */
  #place(t, at) {
    const last = this.lastPlace();
    const took = t - this.#placeAt;
    this.#placeAt = t;
    if (last && took <= GAP_S && isSamePlace(last, at)) return;
    if (last && (took > GAP_S || !isFlown(last, at, took))) this.track.push(null);
    this.track.push(at);
    if (this.track.length <= TRACK_POINTS) return;
    this.track.splice(0, TRACK_POINTS / 10);
    if (this.track[0] === null) this.track.shift();
    this.version++;
  }

  /** @param {number} t @param {string} text */
  phase(t, text) {
    const last = this.phases.at(-1);
    if (last && last.to === null && last.text === text) return;
    if (last && last.to === null) last.to = t;
    this.phases.push({ from: t, to: null, text });
    if (this.phases.length > PHASES) this.phases.shift();
  }

  /** @param {number} t @param {number|null} a @param {number|null} s @param {number|null} b */
  #push(t, a, s, b) {
    const [times, altitudes, speeds, batteries] = this.columns;
    const last = times.at(-1);
    if (last !== undefined && t <= last) return;
    times.push(t);
    altitudes.push(a ?? null);
    speeds.push(s ?? null);
    batteries.push(b ?? null);
  }

  /** @param {number} t */
  #forget(t) {
    const times = this.columns[0];
    if (times[0] > t - SPAN_S - 10) return;
    let old = 0;
    while (old < times.length && times[old] < t - SPAN_S) old++;
    for (const column of this.columns) column.splice(0, old);
    while (this.phases.length > 1 && (this.phases[0].to ?? t) < t - SPAN_S) this.phases.shift();
  }
}
