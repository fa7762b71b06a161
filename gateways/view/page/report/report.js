// A recorded flight in one file: the modules of the live view draw it, and the playhead is this page's own.

import { byId, make, recall, remember, setAttribute, setHidden, setText } from "../dom.js";
import { latLon, mark, metres as inMetres } from "../format.js";
import { metres } from "../geo.js";
import { pieces } from "../history.js";
import * as map from "../map.js";
import { Model } from "../model.js";
import * as replay from "../replay.js";
import * as theme from "../theme.js";
import * as figures from "./figures.js";
import * as tables from "./tables.js";

/** An event so near to the playhead is the one that it stands at, s; of a long flight as many of its thousandths. */
const AT_S = 0.05;

const flight = JSON.parse(byId("flight").textContent);
const model = new Model();
const hasMap = flight.map.track.length + flight.map.plan.length + flight.map.fence.length > 0;
let frame = 0;

/** The recording as the modules of the live view know it. */
function load() {
  model.hello = /** @type {any} */ ({
    replay: {
      file: "", duration_s: flight.span_s, start_unix_ms: flight.start_unix_ms,
      phases: flight.phases.map(({ from_s, to_s, name }) => ({ from_s, to_s, text: name })),
      events: flight.events.map(({ at_s, weight, text }) => ({ at_s: at_s ?? 0, severity: weight, text })),
    },
  });
  model.take({ type: "replay", position_s: 0, playing: false, speed: 1 }, performance.now());
  model.chart = /** @type {any} */ ({ source: "bridge", fence: flight.map.fence, path: flight.map.plan, home: null });
  [model.history.track, model.history.isWhole] = [pieces(flight.map.track, flight.map.track_s, flight.gaps), true];
  model.marks = flight.events.flatMap(({ place, weight }, index) => (place && weight !== "note" ? [{ place, severity: weight, text: String(index + 1) }] : []));
}

/** What the server does in a replay. @param {any} order */
function act({ action, position_s, speed }) {
  const at = performance.now();
  const now = /** @type {import("../protocol.d.ts").ReplayState} */ (model.replay);
  const here = model.time(at);
  const next = { ...now, position_s: here };
  if (action === "seek") next.position_s = position_s;
  if (action === "speed") next.speed = speed;
  if (action === "pause") next.playing = false;
  if (action === "play") Object.assign(next, { playing: true, position_s: here >= flight.span_s ? 0 : here });
  model.take(next, at);
  draw();
  return true;
}

/** @param {number} position_s */
const seek = (position_s) => act({ action: "seek", position_s });

/** @param {number} index of an event */
const jump = (index) => seek(flight.events[index].at_s ?? 0);

/** Where the robot was. @param {number} here s @returns {import("../protocol.d.ts").LatLon|null} */
function placeAt(here) {
  const { track, track_s } = flight.map;
  let index = track_s.findIndex((at) => at > here + 1e-6) - 1;
  if (index === -2) index = track_s.length - 1;
  if (index < 0) return track[0] ?? null;
  const [from, to] = [track[index], track[index + 1] ?? track[index]];
  const share = Math.min(Math.max((here - track_s[index]) / Math.max((track_s[index + 1] ?? here) - track_s[index], 1e-6), 0), 1);
  return [from[0] + (to[0] - from[0]) * share, from[1] + (to[1] - from[1]) * share];
}

function draw() {
  frame = 0;
  const at = performance.now();
  const here = model.time(at);
  if (model.replay?.playing && here >= flight.span_s) model.take({ ...model.replay, position_s: flight.span_s, playing: false }, at);
  const isGap = flight.gaps.some(([from, to]) => here > from && here < to);
  model.now = /** @type {any} */ ({ position: placeAt(here), attitude: null, ground_speed_mps: null, course_deg: null });
  if (hasMap) map.drawNow(isGap ? "stale" : "fresh");
  figures.draw(here);
  replay.draw(at);
  drawHere(here);
  if (model.replay?.playing && frame === 0) frame = requestAnimationFrame(draw);
}

/** What it did there, and the event that the playhead stands at. @param {number} here s */
function drawHere(here) {
  const near = Math.max(AT_S, flight.span_s / 1000);
  const far = (index) => Math.abs((flight.events[index].at_s ?? 0) - here);
  const index = [...flight.events.keys()].filter((one) => far(one) <= near).reduce((best, one) => (best === null || far(one) < far(best) ? one : best), /** @type {number|null} */ (null));
  const phase = flight.phases.findLast(({ from_s, to_s }) => from_s <= here && here <= to_s)?.name ?? "";
  const words = [make("span", {}, phase)];
  if (index !== null) {
    const { weight, text } = flight.events[index];
    words.push(" ", make("a", { href: `#event-${index + 1}`, "data-severity": weight }, `${mark(weight)} ${text}`));
  }
  const box = byId("here");
  if (box.dataset.event !== String(index) || box.firstChild?.textContent !== phase) {
    box.dataset.event = String(index);
    box.replaceChildren(...words);
    tables.point(index);
  }
}

/** The map, and what it has, in words. */
function buildMap() {
  if (!hasMap) return;
  setHidden(byId("track"), false);
  const { track, plan, fence } = flight.map;
  map.build(model, true);
  const has = (inclusion) => fence.some((area) => area.inclusion === inclusion);
  const keys = [[track.length > 0, "track", "line", "blue"], [plan.length > 0, "plan", "dashes", "purple"], [has(true), "fence: stay inside", "double", "green"], [has(false), "fence: stay out", "dashes", "red"]];
  byId("track-key").append(...keys.filter(([is]) => is).map(([, name, kind, inked]) => figures.key(String(name), String(kind), String(inked))));
  const zero = track[0] ?? null;
  const about = zero ? `North up. The zero of the grid is the first place of the track, ${latLon(zero)}.` : "North up.";
  setText(byId("track-about"), about + (model.marks.length > 0 ? " Numbers beside rings are those of the events." : ""));
  const extent = (axis) => {
    const all = track.map((place) => metres(track[0], place)[axis]);
    return inMetres(all.reduce((a, b) => Math.max(a, b), -Infinity) - all.reduce((a, b) => Math.min(a, b), Infinity));
  };
  const words = track.length > 0 ? `Track seen from above, ${extent(0)} from west to east and ${extent(1)} from south to north` : "No position is known";
  setText(byId("map-words"), words + (plan.length > 0 ? `; plan of ${plan.length} waypoints` : "") + (fence.length > 0 ? `; fence of ${fence.length} areas` : ""));
}

/** Single keys, which can be switched off for this browser. @param {KeyboardEvent} event */
function key(event) {
  const target = /** @type {Element} */ (event.target);
  if (recall("local", "keys") === "off" || event.ctrlKey || event.altKey || event.metaKey || event.shiftKey || event.repeat) return;
  if (target.closest("input, select, textarea") || (event.key === " " && target.closest("button, a, summary"))) return;
  /** @type {Record<string, () => void>} */
  const acts = { " ": replay.playOrPause, ",": () => replay.step(-1), ".": () => replay.step(1), p: () => replay.jump(-1), n: () => replay.jump(1), f: () => map.setFollow(true), a: map.whole, t: theme.next };
  const one = "fa".includes(event.key) && !hasMap ? undefined : acts[event.key];
  if (!one) return;
  event.preventDefault();
  one();
}

function nameKeys() {
  const isOn = recall("local", "keys") !== "off";
  setText(byId("keys"), `Keys: ${isOn ? "on" : "off"}`);
  setAttribute(byId("keys"), "aria-pressed", String(isOn));
}

/** @param {boolean} is */
function paper(is) {
  document.documentElement.classList.toggle("on-paper", is);
  theme.onPaper(is);
  if (hasMap) {
    map.resized();
    map.whole();
  }
  // Paper has the table that is folded on the screen.
  for (const one of document.querySelectorAll(is ? "details:not([open])" : "details[data-unfolded]")) {
    one.toggleAttribute("open", is);
    one.toggleAttribute("data-unfolded", is);
  }
}

function main() {
  load();
  buildMap();
  figures.build(flight, { seek, jump });
  tables.build(flight, jump);
  tables.parts(flight);
  replay.build(model, act);
  setHidden(byId("bar"), flight.plots.every(({ curves }) => curves.length === 0) && !hasMap);
  theme.build(() => {
    if (hasMap) map.themeChanged();
    figures.themeChanged();
  });
  nameKeys();
  byId("keys").addEventListener("click", () => {
    remember("local", "keys", recall("local", "keys") === "off" ? "on" : "off");
    nameKeys();
  });
  document.addEventListener("keydown", key);
  addEventListener("beforeprint", () => paper(true));
  addEventListener("afterprint", () => paper(false));
  draw();
  if (hasMap) map.whole();
  setAttribute(document.body, "data-ready", "");
}

main();
