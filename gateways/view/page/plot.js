// What all plots have, those of the live view and those of a report: the looks of axes and lines, and phases as background.

import { themed } from "./dom.js";
import { position } from "./format.js";

/** uPlot, which is no module. @type {any} */
export const UPlot = /** @type {any} */ (globalThis).uPlot;

/** A plot without what uPlot would add of its own. */
export const BARE = { legend: { show: false }, cursor: { show: false }, select: { show: false }, pxAlign: 1, padding: [6, 18, 0, 0] };

/** Height of the name of a phase, pixels. */
const NAME = 18;

const INKS = [
  "text", "muted", "panel", "grid", "line", "soft", "plot-1", "plot-2", "plot-3", "path", "alarm-ink", "warning-ink", "tint-ground", "tint-takeoff", "tint-hover", "tint-landing",
  "tint-stopping", "tint-path", "dots", "line-width", "font",
];

/** Colours and widths of the theme, read once. @returns {Record<string, string>} */
export function inks() {
  return Object.fromEntries(INKS.map((name) => [name, themed(`--${name}`)]));
}

/** @param {Record<string, string>} ink */
export function font(ink) {
  return `12px ${ink.font || "sans-serif"}`;
}

/** @param {Record<string, string>} ink */
export function axis(ink) {
  return { stroke: ink.muted, font: font(ink), gap: 4, grid: { stroke: ink.grid, width: 1, dash: ink.dots ? [1, 4] : [] }, ticks: { stroke: ink.grid, width: 1, size: 4 } };
}

/** A series that is a line. @param {string} colour @param {Record<string, string>} ink @param {number[]} dash */
export function line(colour, ink, dash = []) {
  return { stroke: colour, width: Number(ink["line-width"]) * 1.6, dash, spanGaps: false, points: { show: false }, pxAlign: 0 };
}

/** The share above the values that the names of phases need. @param {number} height */
export const names = (height) => NAME / Math.max(height - NAME, NAME);

/** @param {number|null} low @param {number|null} high @param {number} least @param {number} above room for the names of phases, as a share */
export function range(low, high, least, above) {
  if (low === null || high === null || !Number.isFinite(low)) return [0, least];
  const lacking = Math.max(0, least - (high - low)) / 2;
  const whole = high - low + 2 * lacking;
  return [low - lacking - 0.08 * whole, high + lacking + above * whole];
}

/** Draws within the area of the plot, in pixels of the canvas. @param {any} u @param {Record<string, string>} ink @param {(pen: CanvasRenderingContext2D, ratio: number) => void} draw */
export function within(u, ink, draw) {
  const { ctx: pen, bbox } = u;
  const ratio = globalThis.devicePixelRatio || 1;
  pen.save();
  pen.beginPath();
  pen.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  pen.clip();
  pen.font = `${12 * ratio}px ${ink.font || "sans-serif"}`;
  draw(pen, ratio);
  pen.restore();
}

/**
 * The phases; a plot with names has their words too.
 * @param {any} u @param {{from: number, to: number|null, text: string}[]} phases @param {number} end @param {Record<string, string>} ink @param {boolean} named
 */
export function background(u, phases, end, ink, named) {
  const { bbox } = u;
  within(u, ink, (pen, ratio) => {
    [pen.textAlign, pen.textBaseline] = ["left", "top"];
    for (const { from, to, text } of phases) {
      const left = Math.max(u.valToPos(from, "x", true), bbox.left);
      const right = Math.min(u.valToPos(to ?? end, "x", true), bbox.left + bbox.width);
      if (!(right > left)) continue;
      pen.fillStyle = ink[tint(text)];
      pen.fillRect(left, bbox.top, right - left, bbox.height);
      pen.fillStyle = ink.line;
      pen.fillRect(left, bbox.top, ratio, bbox.height);
      if (!named || pen.measureText(text).width > right - left - 8 * ratio) continue;
      pen.fillStyle = ink.text;
      pen.fillText(text, left + 4 * ratio, bbox.top + 3 * ratio);
    }
  });
}

/** The same phase has the same tint everywhere. @param {string} text */
export function tint(text) {
  const kinds = [[/ground|ended|not start/, "ground"], [/tak/, "takeoff"], [/hover|hold/, "hover"], [/land/, "landing"], [/stop|error|gone/, "stopping"]];
  const kind = kinds.find(([words]) => /** @type {RegExp} */ (words).test(text));
  return `tint-${kind ? kind[1] : "path"}`;
}

/** Steps of a clock, s. */
const STEPS_S = [0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200];
const DAY_S = 86400;

/** Times from 0 to `span` for at most so many steps between them. @param {number} span s @param {number} most */
export function timeTicks(span, most) {
  const step = STEPS_S.find((one) => span / one <= most) ?? Math.ceil(span / most / DAY_S) * DAY_S;
  return Array.from({ length: Math.floor(span / step + 1e-9) + 1 }, (_, index) => index * step);
}

/** What stands at a time of an axis. @param {number} at s @param {number} span s */
export function timeLabel(at, span) {
  return span < 10 ? `${at.toFixed(1)} s` : span < 60 ? `${at.toFixed(0)} s` : position(at);
}
