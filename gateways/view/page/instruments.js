// The artificial horizon, the four large values, and the strip of short states below them.

import { byId, make, setAttribute, setText, svg } from "./dom.js";
import { UNKNOWN, age, direction, number, signed, span } from "./format.js";
import * as words from "./words.js";

/** Pixels of the drawing for a degree of pitch. */
const PITCH = 2.4;

/** What moves by pitch, and what turns by roll: the ground, and the ladder above it. @type {any[]} */ let pitched;
/** @type {any[]} */ let rolled;
/** @type {any} */ let pointer;
/** @type {any} */ let heading;
/** @type {any} */ let missing;

/** Draws what stands still, once. */
export function build() {
  byId("horizon").append(horizon());
  const tiles = { height: "Height", speed: "Speed", climb: "Climb", battery: "Battery" };
  const units = { height: "m", speed: "m/s", climb: "m/s", battery: "V" };
  for (const [key, name] of Object.entries(tiles)) {
    byId("values").append(make("div", { class: "tile", id: `tile-${key}` },
      make("dt", {}, name),
      make("dd", { class: "value" }, make("span", { class: "digits", id: `value-${key}` }, UNKNOWN),
        make("span", { class: "unit" }, /** @type {any} */ (units)[key])),
      make("dd", { class: "sub", id: `sub-${key}` }, UNKNOWN)));
  }
  for (const key of ["Fix", "DSP link", "Switch", "Home", "Flown", "Module", "Control", "Commander"]) {
    byId("strip").append(make("div", { class: "cell" }, make("dt", {}, key), make("dd", { id: `strip-${key.split(" ")[0].toLowerCase()}` }, UNKNOWN)));
  }
}

function horizon() {
  const line = (x1, y1, x2, y2, kind) =>
    svg("line", { x1, y1, x2, y2, class: kind });
  const ball = svg("g", {}, svg("rect", { x: -400, y: -800, width: 800, height: 800, class: "sky" }),
    svg("rect", { x: -400, y: 0, width: 800, height: 800, class: "ground" }), line(-400, 0, 400, 0, "edge"));
  const ladder = svg("g");
  for (let pitch = -60; pitch <= 60; pitch += 5) {
    if (pitch === 0) continue;
    const [y, half] = [-pitch * PITCH, pitch % 10 === 0 ? 24 : 11];
    const side = pitch > 0 ? "up" : "down";
    ladder.append(line(-half, y, half, y, `rung ${side}`));
    if (pitch % 10 !== 0) continue;
    for (const x of [-36, 36]) ladder.append(svg("text", { x, y: y + 4, class: `mark ${side}` }, String(Math.abs(pitch))));
  }
  pitched = [ball, ladder];
  rolled = pitched.map((part) => svg("g", {}, part));
  // The ladder ends before the scale of roll and the heading.
  const hole = svg("clipPath", { id: "ladder-hole" }, svg("circle", { r: 70 }));
  const clipped = svg("g", { "clip-path": "url(#ladder-hole)" }, rolled[1]);
  const scale = svg("g", {});
  for (const at of [-60, -45, -30, -20, -10, 0, 10, 20, 30, 45, 60]) {
    scale.append(svg("line", { x1: 0, y1: -86, x2: 0, y2: at % 30 === 0 ? -96 : -92, transform: `rotate(${at})`, class: "roll" }));
  }
  pointer = svg("path", { d: "M0 -86l-6 11h12z", class: "pointer" });
  const wings = "M-58 0h30l8 9M58 0h-30l-8 9";
  const craft = svg("g", { class: "craft" }, svg("path", { d: wings, class: "rim" }), svg("path", { d: wings }), svg("circle", { r: 2.5 }));
  heading = svg("text", { x: 0, y: 90, class: "heading" }, UNKNOWN);
  const plate = svg("rect", { x: -26, y: 75, width: 52, height: 21, rx: 2, class: "plate" });
  missing = svg("g", { class: "missing" }, svg("rect", { x: -400, y: -400, width: 800, height: 800 }),
    svg("path", { d: "M-100 -100L100 100M100 -100L-100 100" }), svg("rect", { x: -72, y: -16, width: 144, height: 32, class: "plate" }),
    svg("text", { x: 0, y: 6, class: "missing-word" }, "NO ATTITUDE"));
  return svg("svg", { viewBox: "-100 -100 200 200", preserveAspectRatio: "xMidYMid slice", "aria-hidden": "true" },
    hole, rolled[0], clipped, scale, pointer, craft, plate, heading, missing);
}

/**
 * @param {import("./protocol.d.ts").Now|null} now
 * @param {import("./protocol.d.ts").Freshness} freshness
 */
export function draw(now, freshness) {
  const old = now !== null && freshness !== "fresh";
  setAttribute(byId("instruments"), "data-old", old ? freshness : null);
  const attitude = now?.attitude ?? null;
  setAttribute(missing, "visibility", attitude && !old ? "hidden" : "visible");
  setText(missing.lastChild, attitude && old ? `ATTITUDE ${freshness.toUpperCase()}` : "NO ATTITUDE");
  if (attitude) {
    for (const part of [...rolled, pointer]) part.setAttribute("transform", `rotate(${-attitude.roll_deg})`);
    for (const part of pitched) part.setAttribute("transform", `translate(0 ${attitude.pitch_deg * PITCH})`);
  }
  setText(heading, attitude ? direction(attitude.yaw_deg) + (old ? "?" : "") : UNKNOWN);
  tile("height", number(now?.height_m, 1), `altitude ${number(now?.altitude_m, 1)}`, old);
  tile("speed", number(now?.ground_speed_mps, 1), `course ${direction(now?.course_deg)}`, old);
  tile("climb", signed(now?.climb_mps, 1), flying(now?.flying ?? null), old);
  const fuel = now?.fuel_percent ?? null;
  tile("battery", number(now?.battery_v, 2), fuel === null ? "no fuel gauge" : `fuel ${number(fuel, 0)} %`, old);
  cell("fix", now?.fix ?? UNKNOWN, now?.fix ? null : "warning", old);
}

/** @param {boolean|null} is */
function flying(is) {
  return is === null ? "air or ground?" : is ? "in the air" : "on the ground";
}

/** @param {string} key @param {string} digits @param {string} sub @param {boolean} old */
function tile(key, digits, sub, old) {
  const mark = old && digits !== UNKNOWN ? "?" : "";
  setText(byId(`value-${key}`), digits + mark);
  setText(byId(`sub-${key}`), sub + (old && /\d|^in |^on /.test(sub) ? "?" : ""));
  setAttribute(byId(`tile-${key}`), "data-old", old ? "" : null);
}

/** @param {string} key @param {string} text @param {string|null} severity @param {boolean} old */
function cell(key, text, severity, old) {
  const node = byId(`strip-${key}`);
  setText(node, text + (old && text !== UNKNOWN ? "?" : ""));
  setAttribute(node.parentElement, "data-severity", severity);
  setAttribute(node.parentElement, "data-old", old ? "" : null);
}

/**
 * The short states. Gives whether one of them is to be watched.
 * @param {import("./model.js").Model} model @param {boolean} old whether those that come with the bridge's state are @param {boolean} wasHere whether telemetry is old
 * @param {number} at ms
 */
export function drawStrip(model, old, wasHere, at) {
  const { robot } = model;
  const link = robot?.link ?? null;
  const since = link?.age_s != null && link.age_s >= 1 ? ` ${age(link.age_s * 1000)}` : "";
  cell("dsp", link ? link.state + since : UNKNOWN, link && link.state !== "up" ? "warning" : null, old);
  cell("home", words.home(model), null, wasHere);
  cell("flown", span(model.flownS(at)), null, wasHere);
  cell("switch", robot?.switch ?? UNKNOWN, robot?.switch === "manual" ? "warning" : null, old);
  cell("module", robot ? robot.module + (robot.blocked ? ", blocked" : "") : UNKNOWN, robot?.blocked ? "warning" : null, old);
  const control = robot?.control ?? null;
  cell("control", control ? control.holder ?? (control.exclusive ? "free" : "open to all") : UNKNOWN, null, old);
  cell("commander", robot?.commander?.text ?? UNKNOWN, null, old);
  return [...byId("strip").children].some(({ dataset }) => dataset.severity === "warning");
}

/** The horizon in words, for screen readers. @param {import("./protocol.d.ts").Now|null} now @param {string} freshness */
export function speak(now, freshness) {
  const attitude = now?.attitude;
  const words = attitude
    ? `Roll ${Math.abs(Math.round(attitude.roll_deg))}° ${attitude.roll_deg < 0 ? "left" : "right"}, ` +
      `pitch ${Math.abs(Math.round(attitude.pitch_deg))}° ${attitude.pitch_deg < 0 ? "down" : "up"}, heading ${direction(attitude.yaw_deg)}`
    : "No attitude";
  setAttribute(byId("horizon"), "aria-label", freshness === "fresh" || !attitude ? words : `${words}, ${freshness}`);
}
