// What the map draws at one place: robot, home, target, ends of a track, events, this device; and how it draws lines and words. It is
// given pixels, and knows neither Leaflet nor the model.

import { mark } from "./format.js";

/** How much wider the rim of a line is than the line, pixels: over imagery no colour alone can be seen everywhere. */
const RIM = 3;

/** Colours and widths of the theme, and whether imagery lies below. @type {{ink: Record<string, string>, wide: number, hasImagery: boolean}} */
export const look = { ink: {}, wide: 1, hasImagery: false };
const { ink } = look;

/** @typedef {[number, number]} Pixel */

/** @param {CanvasRenderingContext2D} pen @param {string} colour @param {number} width @param {number[]} dashes */
export function stroke(pen, colour, width, dashes = []) {
  // A line in the colour of the rim lies within another one.
  if (look.hasImagery && width > 1 && colour !== ink.map) {
    [pen.strokeStyle, pen.lineWidth] = [ink.map, width * look.wide + RIM];
    pen.stroke();
  }
  pen.setLineDash(dashes);
  [pen.strokeStyle, pen.lineWidth] = [colour, width * look.wide];
  pen.stroke();
  pen.setLineDash([]);
}

/** Text with a rim of the background. @param {CanvasRenderingContext2D} pen @param {string} text @param {number} x @param {number} y @param {string} colour @param {CanvasTextAlign} align */
export function write(pen, text, x, y, colour, align = "left") {
  pen.textAlign = align;
  [pen.strokeStyle, pen.lineWidth, pen.fillStyle] = [ink.map, 4, colour];
  pen.strokeText(text, x, y);
  pen.fillText(text, x, y);
}

/** @param {CanvasRenderingContext2D} pen @param {Pixel} at */
export function home(pen, [x, y]) {
  pen.beginPath();
  pen.arc(x, y, 10, 0, 2 * Math.PI);
  pen.fillStyle = ink.map;
  pen.fill();
  stroke(pen, ink.home, 2);
  pen.textAlign = "center";
  pen.fillStyle = ink.home;
  pen.fillText("H", x, y + 4.5);
}

/** Where a whole track begins and ends. @param {CanvasRenderingContext2D} pen @param {Pixel} first @param {Pixel} last */
export function ends(pen, first, last) {
  dot(pen, first, 6, ink.map, ink.track);
  dot(pen, last, 4, ink.track, ink.track);
  write(pen, "start", first[0] + 9, first[1] + 15, ink.text);
  if (Math.hypot(first[0] - last[0], first[1] - last[1]) > 40) write(pen, "end", last[0] + 9, last[1] + 15, ink.text);
}

/** Where something happened. @param {CanvasRenderingContext2D} pen @param {Pixel} at @param {{severity: string, text: string}} of */
export function event(pen, at, { severity, text }) {
  const colour = ink[`${severity}-ink`];
  dot(pen, at, 5, ink.map, colour);
  write(pen, `${mark(severity)} ${text}`, at[0] + 9, at[1] + 4, colour);
}

/** @param {CanvasRenderingContext2D} pen @param {Pixel} at @param {number} radius @param {string} fill @param {string} rim */
function dot(pen, [x, y], radius, fill, rim) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.fillStyle = fill;
  pen.fill();
  stroke(pen, rim, 2);
}

/** Where this device is, with how well that is known. @param {CanvasRenderingContext2D} pen @param {Pixel} at @param {number} radius */
export function own(pen, [x, y], radius) {
  pen.beginPath();
  pen.arc(x, y, Math.max(8, radius), 0, 2 * Math.PI);
  stroke(pen, ink.muted, 1.5, [4, 4]);
  dot(pen, [x, y], 4, ink.text, ink.map);
  write(pen, "me", x + 9, y + 15, ink.text);
}

/** @param {CanvasRenderingContext2D} pen @param {Pixel} at */
export function target(pen, [x, y]) {
  pen.beginPath();
  pen.arc(x, y, 11, 0, 2 * Math.PI);
  for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
    pen.moveTo(x + dx * 5, y + dy * 5);
    pen.lineTo(x + dx * 18, y + dy * 18);
  }
  stroke(pen, ink.map, 5);
  stroke(pen, ink.text, 2);
  write(pen, "target", x + 20, y - 8, ink.text);
}

/**
 * An arrow, or a circle where the heading is not known; hollow when it is old.
 * @param {CanvasRenderingContext2D} pen @param {Pixel} at @param {number|null} yaw_deg @param {string|null} old what is written beside it then
 */
export function robot(pen, [x, y], yaw_deg, old) {
  pen.save();
  pen.translate(x, y);
  pen.beginPath();
  if (yaw_deg !== null) {
    pen.rotate((yaw_deg * Math.PI) / 180);
    pen.moveTo(0, -17);
    pen.lineTo(11, 13);
    pen.lineTo(0, 7);
    pen.lineTo(-11, 13);
    pen.closePath();
  } else pen.arc(0, 0, 10, 0, 2 * Math.PI);
  stroke(pen, ink.map, 6);
  pen.fillStyle = old ? ink.map : ink.robot;
  pen.fill();
  stroke(pen, ink.robot, 2.5, old ? [3, 4] : []);
  pen.restore();
  if (old) beside(pen, old, x, y);
}

/** Where the robot was when that was last known: a hollow mark with its age. @param {CanvasRenderingContext2D} pen @param {Pixel} at @param {string} words */
export function lost(pen, [x, y], words) {
  pen.beginPath();
  pen.arc(x, y, 10, 0, 2 * Math.PI);
  stroke(pen, ink.map, 6);
  stroke(pen, ink.robot, 2.5, [3, 4]);
  beside(pen, words, x, y);
}

/** Words on the side of a mark on which they fit. @param {CanvasRenderingContext2D} pen @param {string} words @param {number} x @param {number} y */
function beside(pen, words, x, y) {
  const fits = x + 24 + pen.measureText(words).width < pen.canvas.clientWidth;
  write(pen, words, fits ? x + 18 : x - 18, y + 5, ink.text, fits ? "left" : "right");
}
