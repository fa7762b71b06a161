// All that the page knows. Pure: messages and the time of the page's clock in, changes by name out.

import { History } from "./history.js";
import { OrderBook } from "./orders.js";

/** @typedef {import("./protocol.d.ts").Message} Message */
/** @typedef {"hello"|"reload"|"robots"|"robot"|"chart"|"now"|"past"|"events"|"order"|"check"|"lease"|"replay"|"choose"} Part */

/** Most events that are kept. */
const EVENTS = 300;

/** Within so long no helicopter lands and takes off again, ms: after a longer silence it is not known since when it flies. */
const UNSEEN_LANDING_MS = 10000;

export class Model {
  /** @type {import("./protocol.d.ts").Hello|null} */ hello = null;
  /** The robot that is looked at. @type {number|null} */ chosen = null;
  /** @type {import("./protocol.d.ts").RobotLine[]} */ robots = [];
  /** @type {import("./protocol.d.ts").RobotState|null} */ robot = null;
  /** When `robot` came, ms. */ robotAt = 0;
  /** @type {import("./protocol.d.ts").Chart|null} */ chart = null;
  /** @type {import("./protocol.d.ts").Now|null} */ now = null;
  /** When `now` came, ms. */ nowAt = 0;
  history = new History();
  /** Events with their places, of a recorded flight. @type {{place: import("./protocol.d.ts").LatLon, severity: import("./protocol.d.ts").Severity, text: string}[]} */ marks = [];
  /** The newest first. @type {import("./protocol.d.ts").EventLine[]} */ events = [];
  orders = new OrderBook();
  /** @type {import("./protocol.d.ts").CheckReport|null} */ check = null;
  /** @type {import("./protocol.d.ts").Lease|null} */ lease = null;
  /** Whether another page was asked for command, and has kept it. */ wasKept = false;
  /** Whether this page may order, or could do so before: it says why it does no more. */ hadCommand = false;
  /** The robot that this page commanded when its server ended. @type {number|null} */ #led = null;
  /** Since when the helicopter flies, ms; null if it does not, or that is not known. @type {number|null} */ #airborne = null;
  /** When something of the robot came last, ms. */ #seenAt = -Infinity;
  /** The server's wall clock less its monotonic one, ms. @type {number|null} */ #wall = null;
  /** The server's monotonic time of the newest message that has one, ms. @type {number|null} */ #heard = null;
  /** @type {import("./protocol.d.ts").ReplayState|null} */ replay = null;
  /** When `replay` came, ms. */ replayAt = 0;

  /**
   * Takes a message; gives the names of what changed.
   * @param {Message} message @param {number} at ms of the page's clock
   * @returns {Part[]}
   */
  take(message, at) {
    if (message.type === "hello") return this.#hello(message, at);
    if (Number.isFinite(message.sent_ms)) this.#heard = message.sent_ms;
    if (message.type === "beat") this.#wall = Number.isFinite(message.unix_ms) ? message.unix_ms - message.sent_ms : null;
    if (message.type === "robots") {
      this.robots = message.robots;
      return this.#choose(message.robots.map((line) => line.robot), at, ["robots"]);
    }
    if (message.type === "replay") {
      [this.replay, this.replayAt] = [message, at];
      return ["replay"];
    }
    if (message.type === "order") {
      this.orders.report(message, at);
      return ["order"];
    }
    // What is about another robot was on its way when this one was chosen.
    if (message.robot !== this.chosen || this.chosen === null) return [];
    return this.#ofRobot(message, at);
  }

  /** @param {Message} message @param {number} at @returns {Part[]} */
  #ofRobot(message, at) {
    switch (message.type) {
      case "robot":
        [this.robot, this.robotAt] = [message, at];
        this.#fly(message.flown_s === null ? undefined : at - message.flown_s * 1000, at);
        this.history.phase(this.time(at), message.phase);
        return ["robot"];
      case "chart":
        this.chart = message;
        return ["chart"];
      case "now":
        [this.now, this.nowAt] = [message, at];
        this.#fly(message.flying === false ? null : undefined, at);
        this.history.add(this.time(at), message);
        return ["now"];
      case "past":
        this.history.replace(message, this.time(at));
        this.events = message.events.slice(-EVENTS).reverse();
        return ["past", "events"];
      case "event":
        this.events.unshift({ at_unix_ms: message.at_unix_ms, severity: message.severity, text: message.text });
        this.events.length = Math.min(this.events.length, EVENTS);
        return ["events"];
      case "check":
        this.check = message;
        return ["check"];
      case "lease":
        this.#lease(message);
        return ["lease"];
      default:
        return [];
    }
  }

  /** @param {import("./protocol.d.ts").Lease} lease */
  #lease(lease) {
    const wasAsked = this.wasKept || this.lease?.asks === true;
    this.wasKept = wasAsked && lease.holder === "other" && !lease.asked;
    if (lease.holder !== "none") this.#led = null;
    this.lease = lease;
  }

  /** Whether to take command at once: this page had it when its server ended, and no page has had it since. */
  takesAgain() {
    const does = this.#led !== null && this.#led === this.chosen && this.lease?.holder === "none" && this.hello?.role === "command";
    if (does) this.#led = null;
    return does;
  }

  /** What was heard of the flight. @param {number|null|undefined} since ms, null on the ground, undefined if it is not said @param {number} at */
  #fly(since, at) {
    if (since !== undefined) this.#airborne = since;
    else if (at - this.#seenAt > UNSEEN_LANDING_MS) this.#airborne = null;
    this.#seenAt = at;
  }

  /** For how long it flies, s; null if it does not, or that is not known. @param {number} at ms */
  flownS(at) {
    if (this.hello?.replay) return this.robot?.flown_s ?? null;
    return this.#airborne === null || at - this.#seenAt > UNSEEN_LANDING_MS ? null : Math.max(0, Math.floor((at - this.#airborne) / 1000));
  }

  /** When the newest message was sent, by the server's wall clock; null if that is not known. */
  get heardUnixMs() {
    return this.#wall === null || this.#heard === null ? null : this.#wall + this.#heard;
  }

  /** @param {import("./protocol.d.ts").Hello} hello @param {number} at @returns {Part[]} */
  #hello(hello, at) {
    const before = this.hello;
    if (before && before.build !== hello.build) return ["reload"];
    this.hadCommand ||= hello.role === "command";
    const isAnother = before !== null && before.instance !== hello.instance;
    if (isAnother) {
      if (this.holder === "you") this.#led = this.chosen;
      this.#wall = this.#heard = null;
      this.#forgetRobot();
      this.robots = [];
      this.replay = null;
    }
    // After its greeting the server reports what goes on; an order that it does not name has not reached it.
    this.orders.unheard(isAnother ? "the server was started again" : "the connection was lost before an answer", at);
    this.hello = hello;
    return this.#choose(hello.robots, at, ["hello", "robots", "robot", "chart", "events", "order", "lease", "replay"]);
  }

  /** @param {number[]} robots @param {number} at @param {Part[]} parts @returns {Part[]} */
  #choose(robots, at, parts) {
    if (robots.length === 0 || (this.chosen !== null && robots.includes(this.chosen))) return parts;
    // A robot that has left stays chosen once something is known of it: its last place matters.
    if (this.chosen !== null && this.robot !== null) return parts;
    this.choose(robots[0], at);
    return [...parts, "choose"];
  }

  /** Looks at another robot. @param {number} robot @param {number} at ms */
  choose(robot, at) {
    this.chosen = robot;
    this.#airborne = this.#led = null;
    this.#forgetRobot();
    // Reports are of the robot that is looked at.
    this.orders.unheard("this page looked at another robot", at);
  }

  #forgetRobot() {
    this.robot = this.chart = this.now = this.check = this.lease = null;
    this.wasKept = false;
    this.events = [];
    this.history.clear();
  }

  /** The time of the plots, s: of the page's clock, in a replay that of the recording. @param {number} at ms */
  time(at) {
    if (!this.hello?.replay) return at / 1000;
    if (!this.replay) return 0;
    const { position_s, playing, speed } = this.replay;
    const on = playing ? ((at - this.replayAt) / 1000) * speed : 0;
    return Math.min(position_s + on, this.hello.replay.duration_s);
  }

  /** The alarms that last, the worst first. */
  get alarms() {
    return this.robot?.alarms ?? [];
  }

  /**
   * How telemetry or the bridge's state is: as the server says, and no better than stale when nothing newer has come.
   * @param {"telemetry"|"bridge"} what
   * @param {number} at ms @param {number} sinceMs how long ago the newest was sent, at most
   * @returns {import("./protocol.d.ts").Freshness}
   */
  freshness(what, at, sinceMs) {
    if (!this.now) return "never";
    const said = this.now[what].freshness;
    return said === "fresh" && this.isLate(at, sinceMs) ? "stale" : said;
  }

  /** Whether something newer should have come. @param {number} at ms @param {number} sinceMs as above */
  isLate(at, sinceMs) {
    if (this.hello?.replay && !this.replay?.playing) return false;
    const most = this.hello?.stale_after_ms ?? 1500;
    return at - this.nowAt > most || (Number.isFinite(sinceMs) && sinceMs > most);
  }

  /** The lease in one word; "none" without a `lease` message. */
  get holder() {
    return this.lease?.holder ?? "none";
  }
}
