// The controls of a replay: play, pause, speed, and a scrubber with the phases and events of the recording.

import { byId, make, setAttribute, setHidden, setText, svg } from "./dom.js";
import { clock, mark, position, word } from "./format.js";

/** @typedef {import("./model.js").Model} Model */

/** Where the playhead is shown: where it was sought, until the server says that it is there. Pure. */
export class Sought {
  #position = 0;
  #at = -Infinity;

  /** @param {number} position s @param {number} at ms */
  seek(position, at) {
    [this.#position, this.#at] = [position, at];
  }

  /** The server has said where it is. @param {number} position s @param {number} at ms @param {number} rate seconds of the recording in a second */
  heard(position, at, rate) {
    if (Math.abs(position - this.shown(position, at, rate)) <= NEAR_S + rate) this.#at = -Infinity;
  }

  /** @param {number} position that the server has said, s @param {number} at ms @param {number} rate */
  shown(position, at, rate) {
    const since = at - this.#at;
    return since <= SEEK_MS ? this.#position + (rate * since) / 1000 : position;
  }
}

const sought = new Sought();
/** @type {unknown} */ let heard = null;

const SPEEDS = [0.25, 0.5, 1, 2, 5, 10];
/** A seek that the server has not taken after so long is over. */
const SEEK_MS = 1000;
/** A position so near to the one that was sought is that of after the seek, s. */
const NEAR_S = 0.5;

/** @type {Model} */ let model;
/** @type {(message: object) => boolean} */ let send;
/** @type {any} */ let box = null;
/** @type {unknown} */ let drawnInfo = null;

/** @param {Model} ofModel @param {(message: object) => boolean} bySend */
export function build(ofModel, bySend) {
  [model, send] = [ofModel, bySend];
}

/** @param {string} action @param {{position_s?: number, speed?: number}} [more] */
function order(action, more = {}) {
  send({ type: "replay", action, position_s: more.position_s ?? null, speed: more.speed ?? null });
}

export function playOrPause() {
  if (model.hello?.replay) order(model.replay?.playing ? "pause" : "play");
}

/** Where the playhead is shown, s. @param {number} at ms */
function here(at) {
  const rate = model.replay?.playing ? model.replay.speed : 0;
  if (heard !== model.replay) {
    heard = model.replay;
    sought.heard(model.time(at), at, rate);
  }
  return Math.min(sought.shown(model.time(at), at, rate), model.hello?.replay?.duration_s ?? 0);
}

/** @param {number} position_s */
function seek(position_s) {
  sought.seek(position_s, performance.now());
  order("seek", { position_s });
}

/** @param {number} by s */
export function step(by) {
  const info = model.hello?.replay;
  if (info) seek(Math.min(Math.max(here(performance.now()) + by, 0), info.duration_s));
}

/**
 * When the next event is, or the one before; null if there is none. One that has just passed is not the one before while it plays.
 * @param {{at_s: number}[]} events @param {number} here s @param {1|-1} way
 * @returns {number|null}
 */
export function eventFrom(events, here, way) {
  const times = events.map(({ at_s }) => at_s).filter((at) => (way > 0 ? at > here + 0.5 : at < here - 1.5));
  if (times.length === 0) return null;
  return times.reduce((one, other) => (way > 0 ? Math.min(one, other) : Math.max(one, other)));
}

/** To the next event, or the one before. @param {1|-1} way */
export function jump(way) {
  const info = model.hello?.replay;
  const at = info ? eventFrom(info.events, here(performance.now()), way) : null;
  if (at !== null) seek(at);
}

function make_() {
  const info = /** @type {import("./protocol.d.ts").ReplayInfo} */ (model.hello?.replay);
  const press = (text, act, more = {}) => make("button", { type: "button", onclick: act, ...more }, text);
  const scrub = make("input", { type: "range", id: "scrub", min: 0, max: info.duration_s, step: 0.1, value: 0, "aria-label": "Position in the recording",
    oninput: () => seek(Number(scrub.value)) });
  const speed = make("select", { id: "speed", "aria-label": "Speed", onchange: () => order("speed", { speed: Number(speed.value) }) },
    ...SPEEDS.map((value) => make("option", { value }, `${value}×`)));
  speed.value = "1";
  box = make("div", { id: "replay" },
    make("div", { class: "row" }, press("Play", playOrPause, { id: "play", "aria-keyshortcuts": "Space" }), press("−10 s", () => step(-10)),
      press("−1 s", () => step(-1), { class: "fine", "aria-keyshortcuts": "," }), press("+1 s", () => step(1), { class: "fine", "aria-keyshortcuts": "." }), press("+10 s", () => step(10)),
      press("Event before", () => jump(-1), { "aria-keyshortcuts": "P" }), press("Next event", () => jump(1), { "aria-keyshortcuts": "N" }), speed,
      ...(model.hello?.report ? [make("a", { id: "report", class: "press", href: "/report", target: "_blank", rel: "noopener" }, "Report")] : []), make("span", { id: "replay-at" })),
    make("div", { class: "lane" }, lane(info), scrub));
  byId("bar").append(box);
}

/** @param {import("./protocol.d.ts").ReplayInfo} info */
function lane(info) {
  const share = (s) => `${(100 * Math.min(Math.max(s / Math.max(info.duration_s, 0.001), 0), 1)).toFixed(3)}%`;
  const drawing = svg("svg", { class: "phases", "aria-hidden": "true", width: "100%", height: "100%" });
  info.phases.forEach(({ from_s, to_s, text }, index) => {
    const wide = (to_s ?? info.duration_s) - from_s;
    drawing.append(svg("rect", { x: share(from_s), y: 0, width: share(wide), height: "100%", class: index % 2 ? "odd" : "even" }, svg("title", {}, text)));
    if (wide / info.duration_s > 0.12) drawing.append(svg("text", { x: share(from_s), dx: 4, y: 13 }, text));
  });
  for (const { at_s, severity, text } of info.events) {
    if (severity === "note") continue;
    drawing.append(svg("text", { x: share(at_s), y: 30, class: "event", "data-severity": severity }, mark(severity), svg("title", {}, `${word(severity)}: ${text}`)));
  }
  return drawing;
}

/** @param {number} at ms */
export function draw(at) {
  const info = model.hello?.replay ?? null;
  if (info !== drawnInfo) {
    drawnInfo = info;
    box?.remove();
    box = null;
    if (info) make_();
  }
  if (!info || !box) return;
  const shown = here(at);
  const scrub = byId("scrub");
  scrub.value = String(shown);
  setAttribute(scrub, "aria-valuetext", `${position(shown)} of ${position(info.duration_s)}`);
  setText(byId("play"), model.replay?.playing ? "Pause" : "Play");
  if (model.replay && document.activeElement !== byId("speed")) byId("speed").value = String(model.replay.speed);
  const wall = info.start_unix_ms === null ? "" : ` · ${clock(info.start_unix_ms + shown * 1000)}`;
  setText(byId("replay-at"), `${position(shown)} of ${position(info.duration_s)}${wall}`);
  setHidden(box, false);
}
