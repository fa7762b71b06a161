// The plots of the last ten minutes; phases are their background.

import { byId, make, setAttribute, themed } from "./dom.js";
import { SPAN_S } from "./history.js";
import { number, position } from "./format.js";

/** uPlot, which is no module. @type {any} */
const UPlot = /** @type {any} */ (globalThis).uPlot;

const PLOTS = [
  { key: 1, name: "Altitude", unit: "m", digits: 1, least: 10 },
  { key: 2, name: "Speed", unit: "m/s", digits: 1, least: 4 },
  { key: 3, name: "Battery", unit: "V", digits: 2, least: 1 },
];

/** Height of the name of a phase, pixels. */
const NAME = 18;

/** @type {any[]} */ let plots = [];
/** @type {any[]} */ let boxes = [];
/** @type {import("./model.js").Model} */ let model;
/** @type {Record<string, string>} */ let ink = {};
let end = 0;

/** @param {import("./model.js").Model} ofModel */
export function build(ofModel) {
  model = ofModel;
  boxes = PLOTS.map(({ name, unit }) => {
    const box = make("div", { class: "plot" }, make("p", {}, make("strong", {}, name), unit), make("div", { class: "plot-box" }));
    byId("plot-area").append(box);
    return box.lastChild;
  });
  new ResizeObserver(() => resize()).observe(byId("plot-area"));
  themeChanged();
}

/** Colours and widths are given to uPlot once, so another theme means other plots. */
export function themeChanged() {
  for (const name of ["text", "muted", "grid", "line", "plot-1", "plot-2", "plot-3", "tint-ground", "tint-takeoff", "tint-hover", "tint-landing", "tint-stopping", "tint-path"]) {
    ink[name] = themed(`--${name}`);
  }
  for (const plot of plots) plot.destroy();
  plots = PLOTS.map((plot, index) => new UPlot(options(plot, index), data(plot.key), boxes[index]));
  resize();
}

/** @param {typeof PLOTS[0]} plot @param {number} index */
function options(plot, index) {
  const font = `12px ${themed("--font") || "sans-serif"}`;
  const axis = { stroke: ink.muted, font, grid: { stroke: ink.grid, width: 1, dash: themed("--dots") ? [1, 4] : [] }, ticks: { stroke: ink.grid, width: 1, size: 4 } };
  const isLast = index === PLOTS.length - 1;
  return {
    width: 300, height: 90, legend: { show: false }, cursor: { show: false }, select: { show: false }, pxAlign: 1,
    padding: [6, 18, 0, 0],
    scales: { x: { time: false, range: () => [end - SPAN_S, end] }, y: { range: (u, low, high) => range(low, high, plot.least, index === 0 ? names(u.height - 14) : 0.08) } },
    series: [{}, { stroke: ink[`plot-${plot.key}`], width: Number(themed("--line-width")) * 1.6, spanGaps: false, points: { show: false }, pxAlign: 0 }],
    axes: [
      { ...axis, size: isLast ? 24 : 6, gap: 3, splits: () => ticks(), values: (_, at) => (isLast ? at.map(label) : at.map(() => "")) },
      { ...axis, size: 40, gap: 4, space: (u) => (u.height < 60 ? 11 : 20), values: (_, at) => at.map((v) => number(v, at.length > 1 && at[1] - at[0] < 1 ? 1 : 0)) },
    ],
    hooks: { drawClear: [(u) => background(u, index === 0)] },
  };
}

/** The share above the values that the names of phases need. @param {number} height */
const names = (height) => NAME / Math.max(height - NAME, NAME);

/** @param {number|null} low @param {number|null} high @param {number} least @param {number} above room for the names of phases, as a share */
function range(low, high, least, above) {
  if (low === null || high === null || !Number.isFinite(low)) return [0, least];
  const lacking = Math.max(0, least - (high - low)) / 2;
  const whole = high - low + 2 * lacking;
  return [low - lacking - 0.08 * whole, high + lacking + above * whole];
}

function ticks() {
  if (model.hello?.replay) {
    const first = Math.ceil((end - SPAN_S) / 120) * 120;
    return [0, 1, 2, 3, 4, 5].map((i) => first + i * 120).filter((t) => t <= end);
  }
  const isNarrow = boxes[0].clientWidth < 400;
  return (isNarrow ? [-600, -300, 0] : [-600, -480, -360, -240, -120, 0]).map((t) => end + t);
}

/** @param {number} t */
function label(t) {
  if (model.hello?.replay) return t < 0 ? "" : position(t);
  const minutes = Math.round((t - end) / 60);
  return minutes === 0 ? "now" : `\u2212${-minutes} min`;
}

/** The phases; the first plot has their names. @param {any} u @param {boolean} named */
function background(u, named) {
  const { ctx: pen, bbox } = u;
  const ratio = globalThis.devicePixelRatio || 1;
  pen.save();
  pen.beginPath();
  pen.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  pen.clip();
  pen.font = `${12 * ratio}px ${themed("--font") || "sans-serif"}`;
  [pen.textAlign, pen.textBaseline] = ["left", "top"];
  model.history.phases.forEach(({ from, to, text }) => {
    const left = Math.max(u.valToPos(from, "x", true), bbox.left);
    const right = Math.min(u.valToPos(to ?? end, "x", true), bbox.left + bbox.width);
    if (!(right > left)) return;
    pen.fillStyle = tint(text);
    pen.fillRect(left, bbox.top, right - left, bbox.height);
    pen.fillStyle = ink.line;
    pen.fillRect(left, bbox.top, ratio, bbox.height);
    if (!named || pen.measureText(text).width > right - left - 8 * ratio) return;
    pen.fillStyle = ink.text;
    pen.fillText(text, left + 4 * ratio, bbox.top + 3 * ratio);
  });
  pen.restore();
}

/** The same phase has the same tint, which is that of the report. @param {string} text */
function tint(text) {
  const kinds = [[/ground|ended|not start/, "ground"], [/tak/, "takeoff"], [/hover|hold/, "hover"], [/land/, "landing"], [/stop|error|gone/, "stopping"]];
  const kind = kinds.find(([words]) => /** @type {RegExp} */ (words).test(text));
  return ink[`tint-${kind ? kind[1] : "path"}`];
}

/** @param {number} key */
function data(key) {
  return [model.history.columns[0], model.history.columns[key]];
}

function resize() {
  plots.forEach((plot, index) => {
    const { clientWidth: width, clientHeight: height } = boxes[index];
    if (width > 60 && height > 30 && (plot.width !== width || plot.height !== height)) plot.setSize({ width, height });
  });
}

/** Once a second. @param {number} t the time of the right edge, s */
export function draw(t) {
  end = t;
  if (byId("plot-area").clientWidth === 0) return;
  resize();
  PLOTS.forEach(({ key }, index) => plots[index].setData(data(key)));
  setAttribute(byId("plot-area"), "aria-label", words());
}

function words() {
  const parts = PLOTS.flatMap(({ key, name, unit, digits }) => {
    const values = /** @type {number[]} */ (model.history.columns[key].filter((value) => value !== null));
    if (values.length === 0) return [];
    const [low, high] = [Math.min(...values), Math.max(...values)];
    return [`${name} ${number(values.at(-1), digits)} ${unit}, from ${number(low, digits)} to ${number(high, digits)}`];
  });
  const phases = model.history.phases.slice(-3).map(({ text }) => text);
  return parts.length === 0 ? "Nothing recorded yet" : `${parts.join("; ")}. Phases: ${phases.join(", then ")}`;
}
