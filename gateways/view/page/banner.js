// The banner: robot, phase, worst alarm, and how old all this is. And the covers that take the picture away when it cannot be believed.

import { byId, make, setAttribute, setHidden, setText } from "./dom.js";
import { UNKNOWN, age, clock, latLon, mark, number, span, word } from "./format.js";
import * as words from "./words.js";

/** @typedef {import("./model.js").Model} Model */

const RANK = ["ok", "note", "order", "warning", "alarm"];

/**
 * @param {Model} model
 * @param {{telemetry: import("./protocol.d.ts").Freshness, bridge: import("./protocol.d.ts").Freshness, isLate: boolean}} fresh
 *    `isLate`: no newer message has come
 * @param {{telemetry: number|null, bridge: number|null}} ages at most, ms
 * @param {number} at ms
 */
export function draw(model, fresh, ages, at) {
  const { robot, hello, chosen } = model;
  const isReplay = Boolean(hello?.replay || robot?.replayed);
  setText(byId("robot-name"), chosen === null ? "No robot" : `Robot ${chosen}`);
  setHidden(byId("replay-word"), !isReplay);
  setAttribute(document.body, "data-replay", hello?.replay ? "" : null);
  drawOthers(model);
  const phase = words.phase(robot, chosen, fresh.bridge, ages.bridge);
  setText(byId("phase"), phase.text);
  setAttribute(byId("phase"), "data-old", phase.isOld ? "" : null);
  setText(byId("activity"), robot && robot.activity !== robot.phase ? robot.activity : "");
  const alarm = words.alarm(model, fresh.bridge, fresh.isLate, at);
  setAttribute(byId("alarm"), "data-severity", alarm.severity);
  for (const part of /** @type {const} */ (["word", "text", "more"])) setText(byId(`alarm-${part}`), alarm[part]);
  drawFresh(model, fresh.telemetry, ages.telemetry);
}

/** Another robot with an alarm must not be missed. @param {Model} model */
function drawOthers(model) {
  const others = model.robots.filter(({ robot }) => robot !== model.chosen);
  const worst = others.filter(({ severity }) => RANK.indexOf(severity) >= 3)
    .sort((a, b) => RANK.indexOf(b.severity) - RANK.indexOf(a.severity))[0];
  const node = byId("others");
  setHidden(node, others.length === 0);
  setText(node, worst ? `${mark(worst.severity)} robot ${worst.robot}` : `of ${model.robots.length}`);
  setAttribute(node, "data-severity", worst ? worst.severity : null);
  setAttribute(node, "title", worst ? word(worst.severity) : null);
}

/** @param {Model} model @param {import("./protocol.d.ts").Freshness} freshness @param {number|null} ms */
function drawFresh(model, freshness, ms) {
  const words = { fresh: "● LIVE", stale: "▲ STALE", gone: "■ GONE", never: "– NO DATA" };
  const paused = model.hello?.replay && freshness === "fresh";
  setAttribute(byId("fresh"), "data-fresh", freshness);
  setText(byId("fresh-word"), paused ? (model.replay?.playing ? "► PLAYS" : "– PAUSED") : words[freshness]);
  const leftOut = model.now?.left_out ? ` · ${model.now.left_out} left out` : "";
  setText(byId("fresh-age"), (paused || freshness === "never" ? "" : age(ms)) + leftOut);
}

/**
 * The cover. It hides the picture, because an old picture looks like a true one; what was known last stands on it, in words.
 * @param {Model} model @param {import("./contact.js").Contact} contact @param {number} at ms
 */
export function cover(model, contact, at) {
  const state = contact.state(at);
  const node = byId("cover");
  if (node.dataset.state !== state) {
    node.dataset.state = state;
    if (state === "lost") drawLast(model);
    else byId("cover-last").replaceChildren();
    if (state === "lost") setText(byId("announce"), "No contact with the server");
    for (const part of byId("main").children) part.inert = state !== "live";
    // What is covered does not scroll.
    setAttribute(byId("main"), "data-covered", state === "live" ? null : "");
  }
  setHidden(node, state === "live");
  const [title, text] = {
    live: ["", ""],
    connecting: ["CONNECTING", "Nothing has been heard of the server yet"],
    refused: ["REFUSED", contact.refusal ?? ""],
    waking: ["WAITING", "Nothing new has been drawn yet"],
    lost: [`NO CONTACT ${span(contact.silence(at) / 1000)}`.replaceAll(" ", "\u00a0"), "The server does not answer. The robot goes on with what it was ordered."],
  }[state];
  setText(byId("cover-word"), title);
  setText(byId("cover-text"), text);
  return state;
}

/** @param {Model} model */
function drawLast(model) {
  const { now, robot, heardUnixMs } = model;
  const heard = heardUnixMs === null ? UNKNOWN : `${clock(heardUnixMs)} by the server's clock`;
  const rows = now ? [
    ["Last heard", heard], ["Phase", robot?.phase ?? "unknown"], ["Place", latLon(now.position ?? now.lost_position)],
    ["Height", `${number(now.height_m, 1)} m`], ["Battery", `${number(now.battery_v, 2)} V`],
  ] : [];
  byId("cover-last").replaceChildren(...rows.map(([name, value]) => make("div", {}, make("dt", {}, name), make("dd", {}, value))));
}

/** Each restart costs the browser a further frame, so not every picture is one. By so much the cover comes earlier. */
const RESTART_MS = 200;

/** The animations that end in a cover unless the page goes on. */
export class DeadMan {
  /** @param {string} id */
  constructor(id) {
    this.node = byId(id);
    this.restarted = -Infinity;
  }

  /** Ends in the cover after so long. @param {number} ms */
  after(ms) {
    this.node.style.animationDuration = `${ms}ms`;
  }

  /** Begins anew. @param {number} at ms */
  restart(at) {
    if (at - this.restarted < RESTART_MS) return;
    this.restarted = at;
    const [animation] = this.node.getAnimations();
    if (!animation) return;
    animation.currentTime = 0;
    animation.play();
  }
}
