// A stand-in for `ril view`: serves the page and speaks hero.view.v1 about robots that it makes up. For the tests of the page alone.
// Run by itself it serves until it is ended: node stand-in.mjs [PORT] [--replay]

import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";
import { WebSocketServer } from "ws";

const PAGE = fileURLToPath(new URL("../page/", import.meta.url));
const TYPES = { ".html": "text/html; charset=utf-8", ".js": "text/javascript; charset=utf-8", ".css": "text/css; charset=utf-8", ".svg": "image/svg+xml" };
const HOME = [37.4112, -6.001, 10];
const PER_LAT = 110990;
const PER_LON = 88540;
const PATH = [[40, 60], [95, 80], [120, 20], [70, -45], [0, 0]];

const at = (east, north) => [HOME[0] + north / PER_LAT, HOME[1] + east / PER_LON];
const hex = () => createHash("sha256").update(String(Math.random())).digest("hex").slice(0, 16);

/** Where the made-up flight is after so many seconds. */
function flight(t) {
  if (t < 5) return { phase: "on the ground", activity: "waiting for a take-off", east: 0, north: 0, height: 0, speed: 0, climb: 0, course: 0, flying: false };
  if (t < 15) return { phase: "taking off", activity: "climbing to 25 m", east: 0, north: 0, height: (t - 5) * 2.5, speed: 0, climb: 2.5, course: 0, flying: true };
  let left = (t - 15) * 4.2;
  let from = [0, 0];
  for (const [index, to] of PATH.entries()) {
    const long = Math.hypot(to[0] - from[0], to[1] - from[1]);
    if (left < long) {
      const share = left / long;
      const course = (Math.atan2(to[0] - from[0], to[1] - from[1]) * 180) / Math.PI;
      return { phase: "flying the path", activity: "flying the path", east: from[0] + share * (to[0] - from[0]), north: from[1] + share * (to[1] - from[1]), height: 25 + 6 * Math.sin(t / 9), speed: 4.2, climb: 0.67 * Math.cos(t / 9), course: (course + 360) % 360, flying: true, reached: index, togo: long - left };
    }
    left -= long;
    from = to;
  }
  return { phase: "hovering", activity: "hovering", east: 0, north: 0, height: 25 + 0.2 * Math.sin(t / 3), speed: 0.1, climb: 0, course: 180, flying: true };
}

export class StandIn {
  /** @param {{port?: number, role?: string, robots?: number[], replay?: boolean, token?: string|null, start_s?: number}} [how] */
  constructor(how = {}) {
    this.how = { port: 0, role: "command", robots: [1], replay: false, token: null, start_s: 150, ...how };
    this.instance = hex();
    this.build = "build-1";
    this.began = performance.now() - this.how.start_s * 1000;
    /** All that pages have sent, newest last. */
    this.received = [];
    this.requests = [];
    this.pages = new Set();
    this.orders = new Map();
    this.holders = new Map();
    /** What tests set. */
    this.frozen = false;
    /** What pages sent meanwhile: it is answered late, as a stopped process does. */
    this.unread = [];
    /** How long each message is on its way to the page, ms. */
    this.lag_ms = 0;
    this.telemetry = { freshness: "fresh", age_ms: 40 };
    this.bridge = { freshness: "fresh", age_ms: 60 };
    this.alarms = [];
    this.left_out = 0;
    this.answers = true;
    /** No `now`, no `beat`. */
    this.quiet = false;
    this.mute = false;
    this.unknown = false;
    /** Since when the GPS has had no fix, s of the flight. */
    this.lostFix = null;
    this.playhead = { position_s: this.how.start_s, playing: true, speed: 1, at: performance.now() };
  }

  async start() {
    this.http = createServer((request, response) => this.serve(request, response));
    this.sockets = new Set();
    this.http.on("connection", (socket) => {
      this.sockets.add(socket);
      socket.on("close", () => this.sockets.delete(socket));
    });
    const upgrade = new WebSocketServer({ server: this.http, handleProtocols: (names) => (names.has("hero.view.v1") ? "hero.view.v1" : false) });
    upgrade.on("connection", (socket) => this.join(socket));
    this.upgrade = upgrade;
    await new Promise((done) => this.http.listen(this.how.port, "127.0.0.1", done));
    this.port = this.http.address().port;
    this.timers = [setInterval(() => this.each20th(), 50), setInterval(() => this.beat(), 500), setInterval(() => this.eachSecond(), 1000)];
    return this;
  }

  freeze() {
    this.frozen = true;
  }

  thaw() {
    this.frozen = false;
    for (const [page, message] of this.unread.splice(0)) this.answer(page, message);
  }

  /** Ends all connections; pages may connect again. */
  cut() {
    for (const page of this.pages) page.socket.terminate();
  }

  get url() {
    return `http://127.0.0.1:${this.port}/`;
  }

  /** Ends the server at once, as a killed process does. */
  async stop() {
    for (const timer of this.timers) clearInterval(timer);
    for (const page of this.pages) page.socket.terminate();
    for (const socket of this.sockets) socket.destroy();
    this.upgrade.close();
    await new Promise((done) => this.http.close(done));
  }

  /** The same port again, with another life. */
  async again() {
    this.instance = hex();
    this.how.port = this.port;
    this.pages.clear();
    await this.start();
  }

  serve(request, response) {
    this.requests.push(request.url);
    const path = new URL(request.url, "http://x").pathname;
    if (path.startsWith("/tiles/")) return this.tile(request, response);
    const file = normalize(path === "/" ? "/index.html" : path);
    const type = TYPES[extname(file)];
    try {
      if (!type || file.includes("..") || request.method !== "GET") throw new Error("none");
      const body = readFileSync(join(PAGE, file));
      const host = request.headers.host;
      response.writeHead(200, {
        "content-type": type, "cache-control": "no-cache", "x-content-type-options": "nosniff", "referrer-policy": "no-referrer",
        "content-security-policy": `default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self' ws://${host}; frame-ancestors 'none'; base-uri 'none'; form-action 'none'`,
      });
      response.end(body);
    } catch {
      response.writeHead(404, { "content-type": "text/plain" }).end("not found\n");
    }
  }

  /** A tile of one colour; the first request for each is answered as missing where the test wants that. */
  tile(request, response) {
    const again = request.url.includes("?");
    if (this.how.missing && !again) return response.writeHead(404, { "content-length": 0 }).end();
    response.writeHead(200, { "content-type": "image/png" });
    response.end(Buffer.from("iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGNgaGAAAAEEAIEW1rjTAAAAAElFTkSuQmCC", "base64"));
  }

  send(page, message) {
    if (this.frozen) return;
    const text = JSON.stringify(message);
    const send = () => page.socket.readyState === 1 && page.socket.send(text);
    if (this.lag_ms > 0) setTimeout(send, this.lag_ms);
    else send();
  }

  toRobot(robot, message) {
    for (const page of this.pages) if (page.robot === robot) this.send(page, { ...message, robot });
  }

  join(socket) {
    const page = { socket, robot: null, n: 0, seen: 0, hidden: false, id: hex() };
    socket.on("message", (text) => this.take(page, JSON.parse(String(text))));
    socket.on("close", () => {
      this.pages.delete(page);
      for (const [robot, holder] of this.holders) if (holder === page) this.lease(robot, null);
    });
  }

  take(page, message) {
    this.received.push(message);
    if (this.frozen) this.unread.push([page, message]);
    else this.answer(page, message);
  }

  answer(page, message) {
    const replay = this.how.replay;
    switch (message.type) {
      case "open":
        if (this.how.token !== null && message.token !== this.how.token) {
          this.send(page, { type: "refused", text: "This address needs a token; open the page with `ril view`." });
          return page.socket.close();
        }
        // What was sent of another robot is not drawn any more.
        page.seen = page.n;
        page.robot = this.how.robots.includes(message.robot) ? message.robot : this.how.robots[0];
        if (!this.pages.has(page)) {
          this.pages.add(page);
          this.send(page, { type: "hello", protocol: "hero.view.v1", build: this.build, instance: this.instance, role: this.how.role, robots: this.how.robots, replay: replay ? this.info() : null, report: replay, tiles: this.how.tiles ?? null, stale_after_ms: 1500 });
        }
        return this.welcome(page);
      case "ping":
        return this.send(page, { type: "pong", id: message.id, sent_ms: performance.now() });
      case "seen":
        page.seen = Math.max(page.seen, message.n);
        return;
      case "hidden":
        page.hidden = message.hidden;
        if (!message.hidden) this.past(page);
        return;
      case "check":
        return this.check(page, message);
      case "order":
        return this.order(page, message);
      case "lease":
        return this.asked(page, message);
      case "replay":
        return this.play(message);
    }
  }

  welcome(page) {
    this.send(page, this.robotsMessage());
    this.send(page, this.robotMessage(page.robot));
    this.send(page, this.chart(page.robot));
    this.past(page);
    this.sendLease(page);
    for (const report of this.orders.values()) if (report.robot === page.robot && !report.final) this.send(page, report);
    if (this.how.replay) this.send(page, { type: "replay", ...this.head() });
  }

  head() {
    const { position_s, playing, speed, at: since } = this.playhead;
    const on = playing ? ((performance.now() - since) / 1000) * speed : 0;
    return { position_s: Math.min(position_s + on, 180), playing, speed };
  }

  play({ action, position_s, speed }) {
    const head = this.head();
    if (action === "seek") head.position_s = position_s;
    if (action === "speed") head.speed = speed;
    if (action === "play" || action === "pause") head.playing = action === "play";
    this.playhead = { ...head, at: performance.now() };
    for (const page of this.pages) {
      this.send(page, { type: "replay", ...head });
      if (action === "seek") this.past(page);
    }
  }

  info() {
    const phases = [];
    for (let s = 0; s < 180; s++) {
      const { phase } = flight(s);
      if (phases.at(-1)?.text === phase) phases.at(-1).to_s = s + 1;
      else phases.push({ from_s: s, to_s: s + 1, text: phase });
    }
    return { file: "hero(1)_2026-11-22T16-16-31Z.mcap", duration_s: 180, start_unix_ms: 1795364191000, phases, events: [{ at_s: 44.9, severity: "alarm", text: "the link to the DSP is silent" }, { at_s: 64, severity: "warning", text: "the GPS lost its fix" }, { at_s: 120, severity: "order", text: "land" }] };
  }

  get t() {
    return this.how.replay ? this.head().position_s : (performance.now() - this.began) / 1000;
  }

  robotsMessage() {
    const robots = this.how.robots.map((robot, index) => {
      const { phase, flying } = flight(this.t - index * 37);
      const severity = robot === 1 ? this.alarms[0]?.severity ?? "ok" : index === 1 ? "warning" : "ok";
      const text = severity === "ok" ? phase : robot === 1 ? this.alarms[0].text : "battery 22.1 V, 0.4 V below the WARN limit";
      return { robot, severity, text, flying, battery_v: 24.6 - index, link: index === 2 ? "stale" : "fresh" };
    });
    return { type: "robots", robots };
  }

  robotMessage(robot) {
    const f = flight(this.t);
    const movement = f.reached === undefined ? null : { text: "path of 5 waypoints", waypoints_total: 5, waypoints_reached: f.reached, distance_to_go_m: f.togo, time_to_go_s: f.togo / 4.2 };
    return {
      type: "robot", robot, phase: f.phase, activity: f.activity, module: "running", blocked: false, link: { text: "up", state: "up", age_s: 0.1 }, switch: "auto",
      commander: { text: "ril plan, process 812" }, control: { exclusive: false, holder: null }, alarms: this.alarms, movement, flown_s: f.flying ? Math.floor(this.t) - 5 : null, replayed: this.how.replay, relayed: false,
    };
  }

  chart(robot) {
    const fence = [
      { name: "field", inclusion: true, floor_m: 0, ceiling_m: 60, corners: [at(-50, 110), at(150, 130), at(165, -70), at(-40, -80)] },
      { name: "mast", inclusion: false, floor_m: null, ceiling_m: null, corners: [at(38, 10), at(62, 14), at(58, 34), at(36, 30)] },
    ];
    return { type: "chart", robot, source: "bridge", number: 3, fence, floor_m: 0, ceiling_m: 60, path: PATH.map(([e, n]) => [...at(e, n), 35]), home: HOME };
  }

  nowMessage(robot, n) {
    const t = this.t;
    const f = flight(t);
    const known = !this.unknown;
    const roll = f.speed > 1 ? 6 * Math.sin(t / 2) : Math.sin(t);
    const lost = this.lostFix === null ? null : flight(this.lostFix);
    const unfixed = lost && { position: null, lost_position: at(lost.east, lost.north), lost_position_age_ms: (t - this.lostFix) * 1000, altitude_m: null, height_m: null, ground_speed_mps: null, climb_mps: null, course_deg: null, fix: "no fix" };
    return {
      type: "now", robot, n, sent_ms: performance.now(), telemetry: this.telemetry, bridge: this.bridge, position: known ? at(f.east, f.north) : null, altitude_m: known ? f.height + 10 : null, height_m: known ? f.height : null,
      attitude: known ? { roll_deg: roll, pitch_deg: f.speed > 1 ? -4 + Math.sin(t / 3) : 0.5, yaw_deg: f.course } : null, ground_speed_mps: known ? f.speed : null, climb_mps: known ? f.climb : null, course_deg: known && f.speed > 0.3 ? f.course : null,
      battery_v: known ? 25.1 - t * 0.004 : null, fuel_percent: null, fix: known ? "RTK fixed" : null, flying: known ? f.flying : null, left_out: this.left_out,
      ...unfixed,
    };
  }

  past(page) {
    const t = this.t;
    const past = { type: "past", robot: page.robot, track: [], t_s: [], altitude_m: [], ground_speed_mps: [], battery_v: [], phases: [], events: [] };
    for (let s = Math.max(0, t - 600); s < t; s += 0.5) {
      const f = flight(s);
      past.t_s.push(s - t);
      past.altitude_m.push(f.height + 10);
      past.ground_speed_mps.push(f.speed + 0.2 * Math.sin(s * 3));
      past.battery_v.push(25.1 - s * 0.004);
      past.track.push(at(f.east, f.north));
      const last = past.phases.at(-1);
      if (last?.text === f.phase) last.to_s = s - t;
      else {
        past.phases.push({ from_s: s - t, to_s: 0, text: f.phase });
        past.events.push({ at_unix_ms: Date.now() - (t - s) * 1000, severity: s === 0 ? "note" : "order", text: s === 0 ? "link to the DSP up" : `${f.phase}, requested by ril plan` });
      }
    }
    past.events.push({ at_unix_ms: Date.now() - 20000, severity: "warning", text: "GPS fix lost for 0.8 s" });
    this.send(page, past);
  }

  each20th() {
    for (const page of this.pages) {
      if (this.quiet || page.hidden || page.robot === null || page.n - page.seen >= 2) continue;
      page.n += 1;
      this.send(page, this.nowMessage(page.robot, page.n));
    }
  }

  beat() {
    if (!this.mute) for (const page of this.pages) this.send(page, { type: "beat", sent_ms: performance.now(), unix_ms: Date.now() });
  }

  eachSecond() {
    for (const page of this.pages) {
      this.send(page, this.robotsMessage());
      this.send(page, this.robotMessage(page.robot));
      if (this.how.replay) this.send(page, { type: "replay", ...this.head() });
    }
  }

  /** Says at once what a test has set. */
  say() {
    this.eachSecond();
  }

  event(severity, text, robot = 1) {
    this.toRobot(robot, { type: "event", at_unix_ms: Date.now(), severity, text });
  }

  check(page, { order, robot, kind, position, altitude_m }) {
    const east = position ? (position[1] - HOME[1]) * PER_LON : 0;
    const isOut = kind === "goto" && (east > 150 || altitude_m > 70);
    const findings = isOut ? [{ severity: "alarm", text: altitude_m > 70 ? `${altitude_m} m is above the fence's ceiling of 60 m` : "the leg leaves the area `field`", next_step: "choose a place inside the fence" }]
      : kind === "takeoff" ? [{ severity: "warning", text: "battery 24.1 V; 24.5 V are advised", next_step: "charge or replace the battery" }] : [];
    this.send(page, { type: "check", order, robot, severity: isOut ? "alarm" : findings.length ? "warning" : "ok", findings, distance_m: kind === "goto" ? 84.2 : null, duration_s: kind === "goto" ? 21 : null });
  }

  order(page, { order, robot, kind }) {
    const report = (stage, text, final) => {
      const message = { type: "order", order, robot, kind, stage, text, final };
      this.orders.set(order, message);
      this.send(page, message);
    };
    if (this.orders.has(order)) return this.send(page, this.orders.get(order));
    if (!this.answers) return;
    report("sent", "", false);
    if (!["hold", "land"].includes(kind) && this.holders.get(robot) !== page) return report("refused", "another page commands this robot", true);
    this.event("order", `${kind}, requested by a page`, robot);
    report("accepted", "request 000f21", false);
    if (kind === "hold") report("done", "hovers where it is", true);
    else setTimeout(() => report("in-progress", "request 000f21", false), 50);
  }

  lease(robot, page, asked = null) {
    this.holders.set(robot, page);
    this.asker = asked;
    for (const other of this.pages) if (other.robot === robot) this.sendLease(other);
  }

  sendLease(page) {
    const holder = this.holders.get(page.robot) ?? null;
    this.send(page, { type: "lease", robot: page.robot, holder: holder === page ? "you" : holder ? "other" : "none", asked: Boolean(this.asker), asks: this.asker === page, expires_ms: holder ? 10000 : null });
  }

  asked(page, { robot, action }) {
    const holder = this.holders.get(robot) ?? null;
    if (action === "take") this.lease(robot, holder && holder !== page ? holder : page, holder && holder !== page ? page : null);
    if (holder !== page) return;
    if (action === "release") this.lease(robot, null);
    if (action === "give") this.lease(robot, this.asker);
    if (action === "keep") this.lease(robot, page);
  }
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const server = await new StandIn({ port: Number(process.argv[2] ?? 8766), replay: process.argv.includes("--replay"), robots: [1, 2, 3] }).start();
  console.log(server.url);
}
