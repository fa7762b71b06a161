// Alarms, events and robots.

import { byId, make, setAttribute, setText } from "./dom.js";
import { clock, mark, number, span, word } from "./format.js";
import { robotMark } from "./words.js";

/** @typedef {import("./model.js").Model} Model */

/** Alarms that were announced: each is announced once, when it begins. @type {Set<string>} */
let said = new Set();

/** @param {Model} model @param {number} at ms */
export function drawAlarms(model, at) {
  const passed = Math.floor((at - model.robotAt) / 1000);
  byId("alarms").replaceChildren(...model.alarms.map(({ severity, text, next_step, since_s }) => {
    const item = make("li", { "data-severity": severity },
      make("strong", {}, `${mark(severity)} ${word(severity)}`), make("span", { class: "text" }, text),
      make("span", { class: "since" }, span(since_s + passed)));
    if (next_step) item.append(make("span", { class: "step" }, `→ ${next_step}`));
    return item;
  }));
}

/** @param {Model} model */
export function announce(model) {
  const lasting = new Set(model.alarms.map(({ id }) => `${model.chosen} ${id}`));
  const fresh = model.alarms.filter(({ id }) => !said.has(`${model.chosen} ${id}`));
  said = lasting;
  if (fresh.length === 0) return;
  setText(byId("announce"), fresh.map(({ severity, text }) => `Robot ${model.chosen}, ${word(severity).toLowerCase()}: ${text}`).join(". "));
}

/** @param {Model} model */
export function drawEvents(model) {
  const rows = model.events.map(({ at_unix_ms, severity, text }) =>
    make("li", { "data-severity": severity }, make("time", {}, clock(at_unix_ms)),
      make("span", { class: "mark", role: "img", "aria-label": word(severity).toLowerCase() }, severity === "note" ? "·" : mark(severity)), make("span", { class: "text" }, text)));
  byId("log").replaceChildren(...rows);
}

/** Buttons by robot. They stay while the words change: a button that is made anew under a finger is not pressed. @type {Map<number, any>} */
const buttons = new Map();

/** @param {Model} model @param {(robot: number) => void} choose */
export function drawRobots(model, choose) {
  const listed = new Set(model.robots.map(({ robot }) => robot));
  for (const [robot, button] of buttons) {
    if (listed.has(robot)) continue;
    button.parentElement.remove();
    buttons.delete(robot);
  }
  model.robots.forEach((line, index) => {
    const { robot, severity, text, flying, battery_v, link } = line;
    if (!buttons.has(robot)) {
      const button = make("button", { type: "button", "data-robot": robot, onclick: () => choose(robot) }, make("strong"), make("span", { class: "state" }), make("span", { class: "text" }));
      buttons.set(robot, button);
      const list = byId("robots-list");
      list.insertBefore(make("li", {}, button), list.children[index] ?? null);
    }
    const button = buttons.get(robot);
    const state = link === "fresh" ? (flying === null ? "air or ground?" : flying ? "in the air" : "on the ground") : link === "never" ? "no data" : link.toUpperCase();
    const volts = battery_v === null ? "" : ` · ${number(battery_v, 1)} V${link === "fresh" ? "" : "?"}`;
    setAttribute(button, "aria-pressed", String(robot === model.chosen));
    setAttribute(button, "data-severity", severity);
    [`${robotMark(line)} Robot ${robot}`, state + volts, text].forEach((words, at) => setText(button.children[at], words));
  });
}
