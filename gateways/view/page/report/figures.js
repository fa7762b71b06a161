// The flight over time: lanes of states and plots of values, on one axis of time, with events and the playhead in all of them.

import { byId, make, setAttribute, setText } from "../dom.js";
import { compared, mark, moment } from "../format.js";
import * as plot from "../plot.js";

/** Colours of curves and states by their names in the flight. @type {Record<string, string>} */
const INKS = { blue: "plot-1", orange: "plot-2", green: "plot-3", purple: "path", yellow: "warning-ink", red: "alarm-ink", grey: "muted" };
/** @type {Record<string, string>} */
const WEIGHTS = { note: "muted", warning: "warning-ink", alarm: "alarm-ink" };
/** @type {Record<string, string>} */
const OUTCOMES = { done: "purple", refused: "red", aborted: "red", open: "grey" };
/** Where colours are all black, curves differ by their dashes. */
const DASHES = [[], [9, 4], [2, 4], [9, 4, 2, 4]];

const LANE = 28;
const FOOT = 30;
/** Width of the axis of values, and of the names of lanes: the same for all, so that a time stands in one line. */
const SIDE = 62;
const HEIGHT = 210;
/** More requests at the same time are drawn over each other in the last lane. */
const REQUEST_LANES = 3;
/** A click so near to an event means it, pixels. */
const NEAR = 7;
/** Spans of a lane that are named for those who do not see it. */
const NAMED = 12;

/** @type {any} */ let flight;
/** @type {{phases: any[], span: number}} */ let time = { phases: [], span: 1 };
/** @type {any[]} */ let figures = [];
/** @type {{seek: (at: number) => void, jump: (event: number) => void}} */ let acts;
/** @type {Record<string, string>} */ let ink = {};
let here = 0;

/** @param {any} ofFlight @param {{seek: (at: number) => void, jump: (event: number) => void}} ofActs */
export function build(ofFlight, ofActs) {
  [flight, acts] = [ofFlight, ofActs];
  const phases = flight.phases.map(({ from_s, to_s, name }) => ({ from: inside(from_s), to: inside(to_s), text: name }));
  time = { phases, span: flight.span_s };
  const lanes = lanesOf();
  if (lanes.length > 0) figures.push(laneFigure(lanes));
  figures.push(...flight.plots.filter(({ curves }) => curves.length > 0).map(plotFigure));
  byId("figures").append(...figures.map(({ node }) => node));
  const missing = flight.plots.filter(({ curves }) => curves.length === 0).map(({ title }) => title.toLowerCase());
  if (missing.length > 0) byId("figures").append(make("p", {}, `Nothing to draw: ${missing.join(", ")}.`));
  new ResizeObserver(resized).observe(byId("figures"));
}

/** A time within the plots. @param {number|null} at */
function inside(at) {
  return Math.min(Math.max(at ?? 0, 0), flight.span_s);
}

/** Phases, requests in as few lanes as hold them side by side, and further states. */
function lanesOf() {
  /** @type {{name: string, spans: any[]}[]} */
  const asked = [];
  for (const { from_s, to_s, name, outcome } of flight.requests) {
    const span = { from_s, to_s: to_s ?? flight.span_s, name, ink: OUTCOMES[outcome] };
    const free = asked.find(({ spans }) => spans[spans.length - 1].to_s <= from_s);
    if (free) free.spans.push(span);
    else if (asked.length < REQUEST_LANES) asked.push({ name: asked.length === 0 ? "requests" : "", spans: [span] });
    else asked[REQUEST_LANES - 1].spans.push(span);
  }
  return [{ name: "phase", spans: flight.phases, tinted: true }, ...asked, ...flight.lanes].filter(({ spans }) => spans.length > 0);
}

/** @param {string} name @param {string} kind @param {string} inked */
export function key(name, kind, inked) {
  return make("li", {}, make("span", { class: `swatch ${kind}`, "data-ink": inked, "aria-hidden": "true" }), name);
}

/** @param {any[]} lanes */
function laneFigure(lanes) {
  const signs = ["alarm", "warning"].filter((weight) => flight.events.some((event) => event.weight === weight));
  const keys = signs.map((weight) => make("li", {}, make("span", { class: "swatch sign", "data-ink": weight === "alarm" ? "red" : "yellow", "aria-hidden": "true" }, mark(weight)), weight));
  const names = [...new Set(flight.phases.map(({ name }) => name))];
  keys.unshift(...names.map((name) => key(name, "area", plot.tint(name))));
  if (flight.gaps.length > 0) keys.push(key("no sample", "area", "grey"));
  if (flight.requests.length > 0) keys.push(key("request", "dashes", "purple"));
  const box = make("div", { class: "plot-box", role: "img", "aria-label": laneWords(lanes) });
  const node = make("figure", { id: "timeline" }, make("figcaption", {}, make("h3", {}, "What it did"), make("ul", { class: "key" }, ...keys)), box);
  const height = lanes.length * LANE + FOOT;
  const middles = lanes.map((_, index) => lanes.length - index - 0.5);
  const options = () => ({
    ...common(height), scales: { x: X, y: { range: () => [0, lanes.length] } }, series: [{}, {}],
    axes: [timeAxis(), { ...plot.axis(ink), size: SIDE, grid: { show: false }, ticks: { show: false }, splits: () => middles, values: () => lanes.map(({ name }) => name) }],
    hooks: { drawClear: [drawGaps], draw: [(u) => drawLanes(u, lanes, middles), drawMarks], ready: [attend] },
  });
  return { node, box, options, height, data: EMPTY(), curves: [], outputs: [] };
}

/** Of a plot that draws everything itself. */
const EMPTY = () => [[0, flight.span_s], [null, null]];
const X = { time: false, range: () => [0, flight.span_s] };

/** @param {number} height */
const common = (height) => ({ ...plot.BARE, width: 600, height, padding: [8, 14, 0, 0] });

function timeAxis() {
  return { ...plot.axis(ink), size: 26, splits: (u) => plot.timeTicks(flight.span_s, u.width < 500 ? 4 : 8), values: (_, at) => at.map((t) => plot.timeLabel(t, flight.span_s)) };
}

/** @param {any} of */
function plotFigure(of) {
  const curves = of.curves.map((curve, index) => ({ ...curve, index, ...(curve.kind === "bars" ? {} : { t: curve.t_ms.map((ms) => ms / 1000), lone: alone(curve.values) }) }));
  const lines = curves.filter(({ kind }) => kind !== "bars");
  const outputs = curves.map(() => make("output", {}));
  const keys = curves.map(({ name, kind, ink: inked }, index) => {
    const item = key(name, kind, inked);
    item.append(outputs[index]);
    return item;
  });
  keys.push(...of.limits.map(({ name, value }) => key(`${name}: ${value.toFixed(1)} ${of.unit}`, "dashes", "red")));
  const caption = make("figcaption", {}, make("h3", {}, of.title, " ", make("span", { class: "unit" }, `in ${of.unit}`)), make("ul", { class: "key" }, ...keys));
  if (of.about) caption.append(make("p", { class: "about" }, of.about));
  const box = make("div", { class: "plot-box", role: "img", "aria-label": plotWords(of) });
  const least = of.scale.kind === "logarithmic" ? of.scale.least : -Infinity;
  const data = lines.length === 0 ? EMPTY() : plot.UPlot.join(lines.map(({ t, values }) => [t, values.map((value) => (value === null ? null : Math.max(value, least)))]));
  const [low, high] = extent(of, curves);
  const isLog = of.scale.kind === "logarithmic";
  const options = () => ({
    ...common(HEIGHT), scales: { x: X, y: { ...(isLog ? { distr: 3, log: 10 } : {}), range: () => [low, high] } },
    series: [{}, ...(lines.length === 0 ? [{}] : lines.map((curve) => series(curve, data)))],
    axes: [timeAxis(), valueAxis(isLog, low, high)],
    hooks: {
      drawClear: [drawGaps, (u) => plot.background(u, time.phases, time.span, ink, false)],
      drawAxes: [(u) => curves.filter(({ kind }) => kind === "bars").forEach((curve) => drawBars(u, curve))],
      draw: [(u) => drawLimits(u, of.limits), drawMarks], ready: [attend],
    },
  });
  const node = make("figure", { id: `plot-${of.id}` }, caption, box);
  return { node, box, options, height: HEIGHT, data, curves, outputs, unit: of.unit };
}

/** Values between two gaps: they are drawn as points, since no line leads to them. @param {(number|null)[]} values */
function alone(values) {
  return new Set([...values.keys()].filter((index) => values[index] !== null && (values[index - 1] ?? null) === null && (values[index + 1] ?? null) === null));
}

/** @param {any} curve @param {any[]} data */
function series(curve, data) {
  const colour = ink[INKS[curve.ink]];
  const dash = curve.kind === "dashes" ? [6, 5] : ink.dots ? DASHES[curve.index % DASHES.length] : [];
  const times = new Set([...curve.lone].map((index) => curve.t[index]));
  const lone = [...data[0].keys()].filter((index) => times.has(data[0][index]));
  return { ...plot.line(colour, ink, dash), points: { show: () => lone.length > 0, filter: () => lone, size: 4, width: 0, fill: colour, stroke: colour } };
}

/** @param {boolean} isLog @param {number} low @param {number} high */
function valueAxis(isLog, low, high) {
  const decades = () => Array.from({ length: Math.round(Math.log10(high / low)) + 1 }, (_, index) => low * 10 ** index);
  return { ...plot.axis(ink), size: SIDE, space: 30, ...(isLog ? { splits: decades } : {}), values: (_, at) => at.map(label) };
}

/** What stands at a value of an axis; uPlot leaves some of a logarithmic one out. @param {number|null} value */
function label(value) {
  return value === null ? "" : (Math.abs(value) >= 1e6 ? value.toExponential(0) : String(Number(value.toPrecision(6)))).replace("-", "\u2212");
}

/** From which value to which one an axis goes. @param {any} of @param {any[]} curves @returns {[number, number]} */
export function extent(of, curves) {
  // What was asked for must not hide what was: its dashes end where the plot ends.
  const measured = curves.filter(({ kind }) => kind !== "dashes");
  const ranges = (measured.length > 0 ? measured : curves).map(({ kind, bars, values }) => (kind === "bars" ? [0, ...bars.map((bar) => bar[2])] : values.filter((value) => value !== null)));
  const ends = ranges.map((all) => [all.reduce((a, b) => Math.min(a, b)), all.reduce((a, b) => Math.max(a, b))]);
  const low = Math.min(...ends.map(([least]) => least));
  const high = Math.max(...ends.map(([, greatest]) => greatest));
  const { kind } = of.scale;
  if (kind === "from-zero") return [0, 1.08 * Math.max(high, of.scale.least_top)];
  if (kind === "logarithmic") {
    const from = Math.floor(Math.log10(of.scale.least));
    return [10 ** from, 10 ** Math.max(Math.ceil(Math.log10(Math.max(high, of.scale.least))), from + 1)];
  }
  const [from, to] = plot.range(low, high, of.scale.least_span, 0.08);
  // Numbers so large that steps between them vanish.
  return to > from ? [from, to] : [from - Math.abs(from) * 0.01 - 1, from + Math.abs(from) * 0.01 + 1];
}

/** Where nothing is known. @param {any} u */
function drawGaps(u) {
  plot.within(u, ink, (pen, ratio) => {
    [pen.strokeStyle, pen.lineWidth] = [ink.muted, ratio];
    const { top, height } = u.bbox;
    for (const [from, to] of flight.gaps) {
      const [left, right] = [u.valToPos(inside(from), "x", true), u.valToPos(inside(to), "x", true)];
      pen.save();
      pen.beginPath();
      pen.rect(left, top, Math.max(right - left, ratio), height);
      pen.clip();
      pen.globalAlpha = 0.6;
      pen.beginPath();
      for (let x = left - height; x < right; x += 7 * ratio) {
        pen.moveTo(x, top + height);
        pen.lineTo(x + height, top);
      }
      pen.stroke();
      pen.restore();
    }
  });
}

/** @param {any} u @param {any[]} lanes @param {number[]} middles */
function drawLanes(u, lanes, middles) {
  plot.within(u, ink, (pen, ratio) => {
    [pen.textAlign, pen.textBaseline, pen.lineWidth] = ["left", "middle", ratio];
    lanes.forEach(({ spans, tinted }, index) => {
      const top = u.valToPos(middles[index] + 0.42, "y", true);
      const height = u.valToPos(middles[index] - 0.42, "y", true) - top;
      for (const { from_s, to_s, name, ink: inked } of spans) {
        const left = u.valToPos(inside(from_s), "x", true);
        // What lasts shorter than a pixel is seen as well.
        const wide = Math.max(u.valToPos(inside(to_s), "x", true) - left, ratio);
        pen.fillStyle = tinted ? ink[plot.tint(name)] : ink[INKS[inked]];
        pen.globalAlpha = tinted ? 1 : 0.28;
        pen.fillRect(left, top, wide, height);
        pen.globalAlpha = 1;
        pen.strokeStyle = tinted ? ink.line : ink[INKS[inked]];
        pen.strokeRect(left, top, wide, height);
        if (pen.measureText(name).width > wide - 8 * ratio) continue;
        pen.fillStyle = ink.text;
        pen.fillText(name, left + 4 * ratio, top + height / 2);
      }
    });
  });
}

/** @param {any} u @param {any} curve */
function drawBars(u, curve) {
  plot.within(u, ink, (pen, ratio) => {
    pen.fillStyle = ink[INKS[curve.ink]];
    pen.globalAlpha = 0.75;
    const zero = u.valToPos(0, "y", true);
    for (const [from, to, rate] of curve.bars) {
      const left = Math.floor(u.valToPos(inside(from), "x", true));
      const wide = Math.max(Math.floor(u.valToPos(inside(to), "x", true)) - left, ratio);
      const top = Math.min(u.valToPos(rate, "y", true), zero - 2 * ratio);
      pen.fillRect(left, top, wide, zero - top);
    }
  });
}

/** Limits that lie where values are. @param {any} u @param {{value: number}[]} limits */
function drawLimits(u, limits) {
  plot.within(u, ink, (pen, ratio) => {
    [pen.strokeStyle, pen.lineWidth] = [ink["alarm-ink"], 1.5 * ratio];
    pen.setLineDash([7 * ratio, 5 * ratio]);
    for (const { value } of limits) {
      const y = u.valToPos(value, "y", true);
      pen.beginPath();
      pen.moveTo(u.bbox.left, y);
      pen.lineTo(u.bbox.left + u.bbox.width, y);
      pen.stroke();
    }
  });
}

/** A line at each request and event; what must be looked at has its shape on it. @param {any} u */
function drawMarks(u) {
  plot.within(u, ink, (pen, ratio) => {
    const { top, height } = u.bbox;
    const draw = (at, colour, dash, width) => {
      const x = u.valToPos(inside(at), "x", true);
      [pen.strokeStyle, pen.lineWidth] = [colour, width * ratio];
      pen.setLineDash(dash.map((length) => length * ratio));
      pen.beginPath();
      pen.moveTo(x, top);
      pen.lineTo(x, top + height);
      pen.stroke();
      return x;
    };
    pen.globalAlpha = 0.7;
    for (const { from_s } of flight.requests) draw(from_s, ink.path, [9, 5], 1);
    for (const { at_s, weight } of flight.events) if (weight === "note") draw(at_s, ink.muted, [2, 6], 1);
    pen.globalAlpha = 1;
    [pen.textAlign, pen.textBaseline] = ["center", "top"];
    for (const { at_s, weight } of flight.events) {
      if (weight === "note") continue;
      const x = draw(at_s, ink[WEIGHTS[weight]], weight === "alarm" ? [] : [6, 4], 1.5);
      pen.fillStyle = ink[WEIGHTS[weight]];
      pen.fillText(mark(weight), x, top);
    }
  });
}

/** A click moves the playhead, to an event if one is near. @param {any} u */
function attend(u) {
  u.over.append(make("div", { class: "playhead" }));
  u.over.addEventListener("click", (event) => {
    const { left, width } = u.over.getBoundingClientRect();
    const at = ((event.clientX - left) / width) * flight.span_s;
    const far = (index) => Math.abs(inside(flight.events[index].at_s) - at);
    const near = [...flight.events.keys()].filter((index) => far(index) <= (NEAR / width) * flight.span_s);
    if (near.length > 0) acts.jump(near.reduce((one, other) => (far(other) < far(one) ? other : one)));
    else acts.seek(inside(at));
  });
}

/** Colours and widths are given to uPlot once, so another theme means other plots. */
export function themeChanged() {
  ink = plot.inks();
  for (const figure of figures) {
    figure.plot?.destroy();
    figure.plot = new plot.UPlot(figure.options(), figure.data, figure.box);
  }
  resized();
}

export function resized() {
  for (const { plot: one, box, height } of figures) {
    const width = box.clientWidth;
    if (one && width > 100 && one.width !== width) one.setSize({ width, height });
  }
  draw(here);
}

/** The playhead and the values there. @param {number} at s */
export function draw(at) {
  here = at;
  for (const { plot: one, curves, outputs, unit } of figures) {
    const line = one?.over.querySelector(".playhead");
    if (line) line.style.left = `${(100 * inside(at)) / flight.span_s}%`;
    curves.forEach((curve, index) => setText(outputs[index], valueAt(curve, at, unit)));
  }
}

/** @param {any} curve @param {number} at @param {string} unit */
function valueAt(curve, at, unit) {
  const value = curve.kind === "bars" ? (curve.bars.find(([from, to]) => at >= from && at < to)?.[2] ?? 0) : lineAt(curve.t, curve.values, at);
  return value === null ? "–" : `${compared(value)} ${unit}`;
}

/** The value that a line has at a time: that of the last point before; null where it is interrupted. @param {number[]} t @param {(number|null)[]} values @param {number} at */
export function lineAt(t, values, at) {
  let [low, high] = [0, t.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (t[middle] <= at + 0.0005) low = middle + 1;
    else high = middle;
  }
  return low === 0 || (low === t.length && at > t[low - 1] + 1) ? null : values[low - 1];
}

/** @param {any[]} lanes */
function laneWords(lanes) {
  const words = lanes.map(({ name, spans }) => {
    const named = spans.slice(0, NAMED).map((span) => `${span.name} from ${moment(span.from_s)}`).join(", ");
    return `${name || "also"}: ${named}${spans.length > NAMED ? ` and ${spans.length - NAMED} more` : ""}`;
  });
  return `States over time. ${words.join(". ")}`;
}

/** @param {any} of */
function plotWords({ title, unit, curves }) {
  const words = curves.map(({ name, kind, bars, total, values }) => {
    if (kind === "bars") return `${name}: ${compared(total)} in all, at most ${compared(bars.map((bar) => bar[2]).reduce((a, b) => Math.max(a, b), 0))} ${unit}`;
    const known = values.filter((value) => value !== null);
    const [low, high] = [known.reduce((a, b) => Math.min(a, b)), known.reduce((a, b) => Math.max(a, b))];
    return `${name} between ${compared(low)} and ${compared(high)} ${unit}, ${compared(known[0])} at first and ${compared(known[known.length - 1])} at last`;
  });
  return `${title} over time. ${words.join(". ")}`;
}
