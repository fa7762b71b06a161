// What banner, strip and orders say: pure, by what is known and how old that is. What is not known is never said as if it were.

import { bearing, distance, point } from "./geo.js";
import { UNKNOWN, age, mark, metres, span, word } from "./format.js";

/** @typedef {import("./protocol.d.ts").Freshness} Freshness */
/** @typedef {import("./model.js").Model} Model */

/**
 * What the helicopter does; marked when bridge or DSP do not say it any more.
 * @param {import("./protocol.d.ts").RobotState|null} robot @param {number|null} chosen @param {Freshness} bridge @param {number|null} ageMs of the bridge's state
 */
export function phase(robot, chosen, bridge, ageMs) {
  if (!robot) return { text: chosen === null ? "waiting for a robot" : "unknown", isOld: false };
  const { state, age_s } = robot.link;
  let before = "";
  if (bridge === "stale" || bridge === "gone") before = `${bridge.toUpperCase()} ${age(ageMs)}: `;
  else if (state !== "up" && state !== "unknown") before = `LINK ${state.toUpperCase()}${age_s === null ? "" : ` ${span(age_s)}`}: `;
  return { text: before + robot.phase, isOld: before !== "" };
}

/**
 * The worst alarm. That there is none, only a bridge that lives can say.
 * @param {Model} model @param {Freshness} bridge @param {boolean} isLate no newer message has come @param {number} at ms
 */
export function alarm(model, bridge, isLate, at) {
  const [worst, ...more] = model.alarms;
  if (worst) {
    const since = span(worst.since_s + Math.floor((at - model.robotAt) / 1000));
    return { severity: worst.severity, word: `${mark(worst.severity)} ${word(worst.severity)}`, text: worst.text, more: since + (more.length ? `, ${more.length} more` : "") };
  }
  const isKnown = model.robot !== null && !isLate && bridge === "fresh";
  return { severity: isKnown ? "ok" : "never", word: isKnown ? "● No alarm" : "– Alarms unknown", text: "", more: "" };
}

/** The mark of a robot in the list: a bridge that is silent does not say that all is well. @param {import("./protocol.d.ts").RobotLine} line */
export function robotMark({ severity, link }) {
  return link !== "fresh" && (severity === "ok" || severity === "note") ? UNKNOWN : mark(severity);
}

/** How far home is, and in which direction the helicopter is seen from there. @param {Model} model */
export function home(model) {
  const at = model.now?.position;
  const place = model.chart?.home;
  if (!at || !place) return UNKNOWN;
  const from = /** @type {[number, number]} */ ([place[0], place[1]]);
  const far = distance(from, at);
  const letters = point(bearing(from, at)).split("-").map((name) => name[0].toUpperCase());
  return far < 1 ? metres(far) : `${metres(far)} ${letters.join("")}`;
}

/** What this page may do. @param {Model} model @returns {"command"|"watch"|"lost"|"replay"} */
export function rights(model) {
  if (model.hello?.replay) return "replay";
  if (model.hello?.role !== "watch") return "command";
  return model.hadCommand ? "lost" : "watch";
}

/** Instead of what became of orders. @type {Record<string, string>} */
export const RIGHTS = {
  replay: "REPLAY: no orders",
  watch: "Watching only: this page may not give orders",
  lost: "▲ This page may only look now: the server was started with other tokens. Open the page anew by `ril view`, or by a new invitation; until then order from another page or by `ril`.",
};

/** Why an order of a page is not sent that may not order any more. */
export const LOST_RIGHTS = "the server does not know this page any more; open it anew by `ril view`";

/** What an order leads to, which is asked before. @param {number} robot @param {import("./protocol.d.ts").Lease|null} lease @param {boolean} wasKept another page was asked, and keeps command @returns {{text: string, button: string|null, severity: string|null}} */
export function lease(robot, lease, wasKept) {
  if (lease?.holder === "you") return { text: "", button: null, severity: null };
  if (lease?.holder !== "other") return { text: `No page commands robot ${robot}.`, button: "Take command", severity: null };
  if (lease.asks) return { text: "Asked. Without an answer command passes to this page after 5 s.", button: null, severity: null };
  if (lease.asked) return { text: `▲ Another page commands robot ${robot}, and a third one asks for it.`, button: null, severity: "warning" };
  if (wasKept) return { text: `▲ The other page keeps command of robot ${robot}. Hold and land work all the same.`, button: "Ask again", severity: "warning" };
  return { text: `▲ Another page commands robot ${robot}.`, button: "Ask for command", severity: "warning" };
}

/** Alarms as they begin: each sounds once. A page that comes is told of those that last. */
export class Bell {
  /** @type {Set<string>} */ #known = new Set();

  /** The worst that has begun; null if nothing has. @param {Model} model @returns {"alarm"|"warning"|null} */
  ring(model) {
    const own = model.alarms.map(({ id, severity }) => ({ id: `${model.chosen} ${id}`, severity }));
    const others = model.robots.filter(({ robot }) => robot !== model.chosen).map(({ robot, severity }) => ({ id: `of ${robot}`, severity }));
    const all = [...own, ...others].filter(({ severity }) => severity === "alarm" || severity === "warning");
    const keys = all.map(({ id, severity }) => `${severity} ${id}`);
    const begun = all.filter((_, index) => !this.#known.has(keys[index])).map(({ severity }) => severity);
    this.#known = new Set(keys);
    return begun.includes("alarm") ? "alarm" : begun.includes("warning") ? "warning" : null;
  }
}
