// The plots of the last ten minutes; phases are their background.

import { byId, make, setAttribute } from "./dom.js";
import { SPAN_S } from "./history.js";
import { number, position } from "./format.js";
import * as plot from "./plot.js";

const PLOTS = [
  { key: 1, name: "Altitude", unit: "m", digits: 1, least: 10 },
  { key: 2, name: "Speed", unit: "m/s", digits: 1, least: 4 },
  { key: 3, name: "Battery", unit: "V", digits: 2, least: 1 },
];

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
  ink = plot.inks();
  for (const one of plots) one.destroy();
  plots = PLOTS.map((one, index) => new plot.UPlot(options(one, index), data(one.key), boxes[index]));
  resize();
}

/** @param {typeof PLOTS[0]} one @param {number} index */
function options(one, index) {
  const isLast = index === PLOTS.length - 1;
  return {
    ...plot.BARE, width: 300, height: 90,
    scales: { x: { time: false, range: () => [end - SPAN_S, end] }, y: { range: (u, low, high) => plot.range(low, high, one.least, index === 0 ? plot.names(u.height - 14) : 0.08) } },
    series: [{}, plot.line(ink[`plot-${one.key}`], ink)],
    axes: [
      { ...plot.axis(ink), size: isLast ? 24 : 6, gap: 3, splits: () => ticks(), values: (_, at) => (isLast ? at.map(label) : at.map(() => "")) },
      { ...plot.axis(ink), size: 40, space: (u) => (u.height < 60 ? 11 : 20), values: (_, at) => at.map((v) => number(v, at.length > 1 && at[1] - at[0] < 1 ? 1 : 0)) },
    ],
    hooks: { drawClear: [(u) => plot.background(u, model.history.phases, end, ink, index === 0)] },
  };
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

/** @param {number} key */
function data(key) {
  return [model.history.columns[0], model.history.columns[key]];
}

function resize() {
  plots.forEach((one, index) => {
    const { clientWidth: width, clientHeight: height } = boxes[index];
    if (width > 60 && height > 30 && (one.width !== width || one.height !== height)) one.setSize({ width, height });
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
