// The map. Leaflet moves and zooms; what is seen is drawn here, on two canvases: what seldom changes, and the robot above it.
// The grid of metres needs no tiles, so there is a map without a network. Where the server has tiles, they lie below.

import { byId, make, setAttribute, setHidden, setText, themed } from "./dom.js";
import { bearing, distance, gridStep, metres, place, point } from "./geo.js";
import { age, latLon, mark, metres as inMetres, number, span } from "./format.js";

/** @typedef {import("./protocol.d.ts").LatLon} LatLon */
/** @typedef {import("./model.js").Model} Model */

/** Leaflet, which is no module. @type {any} */
const L = /** @type {any} */ (globalThis).L;

/** Least pixels between two lines of the grid. */
const GRID_PIXELS = 56;
const LEAST_ZOOM = 17;
/** A tile that is missing, or was too much for the server, is asked for again: after 5 s, then after twice as long each time, up to 5 min. */
const RETRY_MS = 5000;
const MOST_RETRY_MS = 300000;
/** How much wider the rim of a line is than the line, pixels: over imagery no colour alone can be seen everywhere. */
const RIM = 3;
/** The vector of speed shows where the robot is in so many seconds. */
const AHEAD_S = 5;

/** @type {any} */ let map;
/** @type {Model} */ let model;
/** @type {HTMLCanvasElement} */ let still;
/** @type {HTMLCanvasElement} */ let moving;
/** What is asked for by `pick`. @type {((place: LatLon) => void)|null} */ let picking = null;
/** @type {LatLon|null} */ let target = null;
let follows = true;
let isPlaced = false;
let ourMove = false;
let drawnTrack = 0;
let freshness = "never";
/** The layer of tiles; null without any. @type {any} */ let imagery = null;
/** @type {Record<string, string>} */ let ink = {};
let wide = 1;

/** @param {Model} ofModel @param {boolean} [scrolls] whether the map stands in a page that scrolls, so that a wheel and one finger move the page */
export function build(ofModel, scrolls = false) {
  model = ofModel;
  const box = byId("map");
  map = L.map(box, {
    scrollWheelZoom: !scrolls, dragging: !scrolls || !matchMedia("(pointer: coarse)").matches,
    center: [0, 0], zoom: 2, minZoom: 2, maxZoom: 23, zoomSnap: 0.25, zoomDelta: 0.5, wheelPxPerZoomLevel: 120, zoomControl: false,
    attributionControl: false, zoomAnimation: false, fadeAnimation: false, inertia: false, doubleClickZoom: false, worldCopyJump: true,
  });
  still = make("canvas", { class: "sheet-of-map", "aria-hidden": "true" });
  moving = make("canvas", { class: "sheet-of-map moving", "aria-hidden": "true" });
  box.append(still, moving);
  map.on("move zoom viewreset", () => {
    if (!ourMove) setFollow(false);
    redraw();
  });
  map.on("click", (event) => picking?.([event.latlng.lat, wrap(event.latlng.lng)]));
  new ResizeObserver(resized).observe(box);
  byId("zoom-in").addEventListener("click", () => zoom(1));
  byId("zoom-out").addEventListener("click", () => zoom(-1));
  byId("follow").addEventListener("click", () => setFollow(!follows));
  byId("whole").addEventListener("click", whole);
  themeChanged();
}

export function resized() {
  quietly(() => map.invalidateSize({ pan: false, animate: false }));
  keepInView();
  redraw();
}

/** Draws tiles under the grid. @param {import("./protocol.d.ts").Hello["tiles"]} range */
export function setTiles(range) {
  const zooms = range ? `${range.min_zoom} ${range.max_zoom}` : "";
  if (zooms === (imagery?.zooms ?? "")) return;
  imagery?.remove();
  imagery = null;
  if (range) {
    // One zoom further out is drawn by four tiles for one; further out there would be too many.
    imagery = L.tileLayer("/tiles/{z}/{x}/{y}", { minZoom: range.min_zoom - 1, minNativeZoom: range.min_zoom, maxNativeZoom: range.max_zoom, maxZoom: 23 });
    imagery.zooms = zooms;
    imagery.on("tileerror", ({ tile }) => again(tile));
    imagery.addTo(map);
  }
  redraw();
}

/** @param {HTMLImageElement} tile */
function again(tile) {
  const tries = Number(tile.dataset.tries ?? 0) + 1;
  tile.dataset.tries = String(tries);
  setTimeout(() => {
    if (tile.isConnected) tile.src = `${tile.src.split("?")[0]}?${tries}`;
  }, Math.min(RETRY_MS * 2 ** (tries - 1), MOST_RETRY_MS));
}

/** @param {number} lon */
const wrap = (lon) => ((((lon + 180) % 360) + 360) % 360) - 180;

/** @param {number} by */
function zoom(by) {
  const at = follows ? model.now?.position : null;
  quietly(() => (at ? map.setView(at, map.getZoom() + by) : map.setZoom(map.getZoom() + by)));
}

/** Moves the map without ending that it follows. @param {() => void} move */
function quietly(move) {
  ourMove = true;
  move();
  ourMove = false;
}

/** @param {boolean} is */
export function setFollow(is) {
  follows = is;
  setAttribute(byId("follow"), "aria-pressed", String(is));
  if (is) {
    const at = model.now?.position;
    if (at) quietly(() => map.setView(at, map.getZoom()));
  }
}

/** Another robot, or another server: the map is placed anew. */
export function forget() {
  isPlaced = false;
  target = null;
  setFollow(true);
  redraw();
}

/** All that is known in one view. */
export function whole() {
  /** @type {LatLon[]} */
  const all = [...model.history.track];
  for (const area of model.chart?.fence ?? []) all.push(...area.corners);
  for (const [lat, lon] of model.chart?.path ?? []) all.push([lat, lon]);
  if (model.chart?.home) all.push([model.chart.home[0], model.chart.home[1]]);
  if (model.now?.position) all.push(model.now.position);
  if (target) all.push(target);
  if (all.length === 0) return;
  setFollow(false);
  quietly(() => map.fitBounds(L.latLngBounds(all), { paddingTopLeft: [36, 68], paddingBottomRight: [20, 36], maxZoom: 20, animate: false }));
}

/** Colours and widths of the theme, read once. */
export function themeChanged() {
  for (const name of ["text", "muted", "panel", "grid", "track", "path", "inside", "outside", "robot", "home", "map", "dots", "alarm-ink", "warning-ink", "font"]) {
    ink[name] = themed(`--${name}`);
  }
  wide = Number(themed("--line-width")) || 1;
  redraw();
}

/** The next click is a place. @param {((place: LatLon) => void)|null} then */
export function pick(then) {
  picking = then;
  setAttribute(byId("map"), "data-picking", then ? "" : null);
}

/** @param {LatLon|null} place */
export function setTarget(place) {
  target = place;
  drawMoving();
}

/** @returns {LatLon} */
export function centre() {
  const at = map.getCenter();
  return [at.lat, wrap(at.lng)];
}

/** The zero of the grid: home, else the first place. @returns {LatLon|null} */
function origin() {
  const home = model.chart?.home;
  if (home) return [home[0], home[1]];
  return model.history.track[0] ?? model.now?.position ?? null;
}

function keepInView() {
  const at = model.now?.position ?? model.now?.lost_position ?? model.history.track.at(-1) ?? origin();
  if (!at) return;
  if (!isPlaced) {
    isPlaced = true;
    quietly(() => map.setView(at, 18));
    if (model.chart?.fence.length) {
      whole();
      // On a small map the whole fence would leave the robot a speck.
      if (map.getZoom() < LEAST_ZOOM) quietly(() => map.setView(at, LEAST_ZOOM));
      follows = true;
      setAttribute(byId("follow"), "aria-pressed", "true");
    }
    return;
  }
  if (!follows || picking) return;
  const size = map.getSize();
  const pixel = map.latLngToContainerPoint(at);
  const [x, y] = [Math.abs(pixel.x / size.x - 0.5), Math.abs(pixel.y / size.y - 0.5)];
  if (x > 0.3 || y > 0.25) quietly(() => map.panTo(at, { animate: false }));
}

/** A new `now`. @param {import("./protocol.d.ts").Freshness} as */
export function drawNow(as) {
  freshness = as;
  keepInView();
  drawMoving();
}

/** @param {HTMLCanvasElement} canvas */
function clean(canvas) {
  const { x, y } = map.getSize();
  const ratio = globalThis.devicePixelRatio || 1;
  const [width, height] = [Math.round(x * ratio), Math.round(y * ratio)];
  if (canvas.width !== width || canvas.height !== height) {
    [canvas.width, canvas.height] = [width, height];
    [canvas.style.width, canvas.style.height] = [`${x}px`, `${y}px`];
  }
  const pen = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, x, y);
  pen.lineJoin = pen.lineCap = "round";
  pen.font = `600 12px ${ink.font || "sans-serif"}`;
  return pen;
}

/** @param {readonly number[]} at @returns {[number, number]} */
function pixel(at) {
  const { x, y } = map.latLngToContainerPoint([at[0], at[1]]);
  return [x, y];
}

/** @param {CanvasRenderingContext2D} pen @param {readonly (readonly number[])[]} places @param {boolean} closed */
function trace(pen, places, closed) {
  pen.beginPath();
  places.forEach((at, index) => {
    const [x, y] = pixel(at);
    if (index === 0) pen.moveTo(x, y);
    else pen.lineTo(x, y);
  });
  if (closed) pen.closePath();
}

/**
 * For dashes: only what is near the view, since a browser makes every dash of a line, and one round the Earth has millions.
 * @param {CanvasRenderingContext2D} pen @param {readonly (readonly number[])[]} places @param {boolean} closed
 */
function traceSeen(pen, places, closed) {
  const seen = L.bounds([-50, -50], map.getSize().add([50, 50]));
  const all = places.map((at) => L.point(pixel(at)));
  if (closed) all.push(all[0]);
  pen.beginPath();
  for (let index = 1; index < all.length; index++) {
    const part = L.LineUtil.clipSegment(all[index - 1], all[index], seen);
    if (!part) continue;
    pen.moveTo(part[0].x, part[0].y);
    pen.lineTo(part[1].x, part[1].y);
  }
}

/** @param {CanvasRenderingContext2D} pen @param {string} colour @param {number} width @param {number[]} dashes */
function stroke(pen, colour, width, dashes = []) {
  // A line in the colour of the rim lies within another one.
  if (imagery && width > 1 && colour !== ink.map) {
    [pen.strokeStyle, pen.lineWidth] = [ink.map, width * wide + RIM];
    pen.stroke();
  }
  pen.setLineDash(dashes);
  [pen.strokeStyle, pen.lineWidth] = [colour, width * wide];
  pen.stroke();
  pen.setLineDash([]);
}

/** Text with a rim of the background. @param {CanvasRenderingContext2D} pen @param {string} text @param {number} x @param {number} y @param {string} colour @param {CanvasTextAlign} align */
function write(pen, text, x, y, colour, align = "left") {
  pen.textAlign = align;
  [pen.strokeStyle, pen.lineWidth, pen.fillStyle] = [ink.map, 4, colour];
  pen.strokeText(text, x, y);
  pen.fillText(text, x, y);
}

/** What seldom changes: grid, fence, path, track, home. */
export function redraw() {
  if (!map) return;
  const pen = clean(still);
  const zero = origin();
  const writeGrid = zero ? drawGrid(pen, zero) : () => {};
  for (const area of model.chart?.fence ?? []) drawArea(pen, area);
  const { track } = model.history;
  drawnTrack = track.length;
  if (track.length > 1) {
    trace(pen, track, false);
    stroke(pen, ink.track, 2.5);
  }
  drawPath(pen, model.chart?.path ?? []);
  const home = model.chart?.home;
  if (home) drawHome(pen, pixel(home));
  if (model.history.isWhole && track.length > 0) drawEnds(pen, pixel(track[0]), pixel(track[track.length - 1]));
  for (const one of model.marks) drawMark(pen, pixel(one.place), one);
  writeGrid();
  drawMoving();
}

/** Draws the lines; gives what writes their numbers, which stand above all else. @param {CanvasRenderingContext2D} pen @param {LatLon} zero */
function drawGrid(pen, zero) {
  const { x: width, y: height } = map.getSize();
  const at = (x, y) => {
    const { lat, lng } = map.containerPointToLatLng([x, y]);
    return metres(zero, [lat, lng]);
  };
  const [[west, south], [east, north]] = [at(0, height), at(width, 0)];
  const step = gridStep((east - west) / width, GRID_PIXELS);
  // No grid of half the Earth, nor at a pole, where metres to the east are nothing.
  if (!(east > west) || east - west > 4e6 || (north - south) / step > height) return () => {};
  const lines = [];
  pen.beginPath();
  for (let e = Math.ceil(west / step) * step; e <= east; e += step) {
    const [x] = pixel(place(zero, e, (south + north) / 2));
    pen.moveTo(Math.round(x) + 0.5, 0);
    pen.lineTo(Math.round(x) + 0.5, height);
    lines.push({ x, y: height - 8, text: number(e, step < 1 ? 1 : 0), isEast: true });
  }
  for (let n = Math.ceil(south / step) * step; n <= north; n += step) {
    const [, y] = pixel(place(zero, (west + east) / 2, n));
    pen.moveTo(0, Math.round(y) + 0.5);
    pen.lineTo(width, Math.round(y) + 0.5);
    lines.push({ x: 6, y: y + 4, text: number(n, step < 1 ? 1 : 0), isEast: false });
  }
  stroke(pen, ink.grid, 1 / wide, ink.dots ? [1, 5] : []);
  return () => {
    for (const { x, y, text, isEast } of lines) {
      // The corners belong to the words below and to the buttons above.
      const isFree = isEast ? x > 44 && x < width - 160 : y > 64 && y < height - 30;
      if (isFree) write(pen, text, x, y, ink.muted, isEast ? "center" : "left");
    }
    write(pen, `grid ${inMetres(step)}, north up`, width - 8, height - 8, ink.text, "right");
  };
}

/** @param {CanvasRenderingContext2D} pen @param {import("./protocol.d.ts").Area} area */
function drawArea(pen, area) {
  if (area.corners.length < 2) return;
  trace(pen, area.corners, true);
  if (area.inclusion) {
    // A double line, so that it differs from all others without colour.
    stroke(pen, ink.inside, 5);
    stroke(pen, ink.map, 1.6);
  } else {
    pen.save();
    pen.clip();
    hatch(pen, area.corners);
    pen.restore();
    traceSeen(pen, area.corners, true);
    stroke(pen, ink.outside, 2.5, [2, 6]);
  }
  const ceiling = area.ceiling_m === null ? "" : `, up to ${inMetres(area.ceiling_m)}`;
  const text = `${area.inclusion ? "stay inside" : "stay out"}: ${area.name}${ceiling}`;
  nameArea(pen, area.corners.map(pixel), text, area.inclusion);
}

/** Above the highest corner that is in sight, or in the middle of what is forbidden. @param {CanvasRenderingContext2D} pen @param {[number, number][]} pixels @param {string} text @param {boolean} inclusion */
function nameArea(pen, pixels, text, inclusion) {
  const { x: width, y: height } = map.getSize();
  const half = pen.measureText(text).width / 2 + 6;
  const mean = (of) => of.reduce((sum, value) => sum + value, 0) / of.length;
  const [xs, ys] = [pixels.map(([x]) => x), pixels.map(([, y]) => y)];
  const isWide = Math.max(...xs) - Math.min(...xs) > 2 * half;
  const places = inclusion ? [...pixels].sort((a, b) => a[1] - b[1]).map(([x, y]) => [x, y - 9]) : [[mean(xs), isWide ? mean(ys) + 4 : Math.min(...ys) - 8]];
  const seen = places.find(([x, y]) => x > 0 && x < width && y > 70 && y < height - 30);
  if (seen) write(pen, text, Math.min(Math.max(seen[0], half), width - half), seen[1], inclusion ? ink.inside : ink.outside, "center");
}

/** Lines across what is forbidden. @param {CanvasRenderingContext2D} pen @param {LatLon[]} corners */
function hatch(pen, corners) {
  const all = corners.map(pixel);
  const { x: width, y: height } = map.getSize();
  const left = Math.max(0, Math.min(...all.map(([x]) => x)));
  const right = Math.min(width, Math.max(...all.map(([x]) => x)));
  const high = Math.max(0, Math.min(...all.map(([, y]) => y)));
  const low = Math.min(height, Math.max(...all.map(([, y]) => y)));
  const tall = low - high;
  if (!(right > left) || !(tall > 0)) return;
  pen.beginPath();
  for (let x = left - tall; x < right; x += 10) {
    pen.moveTo(x, low);
    pen.lineTo(x + tall, high);
  }
  pen.globalAlpha = 0.45;
  stroke(pen, ink.outside, 1);
  pen.globalAlpha = 1;
}

/** @param {CanvasRenderingContext2D} pen @param {[number, number, number][]} path */
function drawPath(pen, path) {
  if (path.length === 0) return;
  traceSeen(pen, path, false);
  stroke(pen, ink.path, 2.5, [9, 7]);
  const reached = model.robot?.movement?.waypoints_reached ?? 0;
  let last = [-99, -99];
  path.forEach((at, index) => {
    const [x, y] = pixel(at);
    pen.beginPath();
    pen.arc(x, y, 4.5, 0, 2 * Math.PI);
    pen.fillStyle = index < reached ? ink.path : ink.map;
    pen.fill();
    stroke(pen, ink.path, 1.8);
    if (Math.hypot(x - last[0], y - last[1]) < 22) return;
    last = [x, y];
    write(pen, String(index + 1), x + 8, y - 6, ink.path);
  });
}

/** @param {CanvasRenderingContext2D} pen @param {[number, number]} at */
function drawHome(pen, [x, y]) {
  pen.beginPath();
  pen.arc(x, y, 10, 0, 2 * Math.PI);
  pen.fillStyle = ink.map;
  pen.fill();
  stroke(pen, ink.home, 2);
  pen.textAlign = "center";
  pen.fillStyle = ink.home;
  pen.fillText("H", x, y + 4.5);
}

/** Where a whole track begins and ends. @param {CanvasRenderingContext2D} pen @param {[number, number]} first @param {[number, number]} last */
function drawEnds(pen, first, last) {
  dot(pen, first, 6, ink.map, ink.track);
  dot(pen, last, 4, ink.track, ink.track);
  write(pen, "start", first[0] + 9, first[1] + 15, ink.text);
  if (Math.hypot(first[0] - last[0], first[1] - last[1]) > 40) write(pen, "end", last[0] + 9, last[1] + 15, ink.text);
}

/** Where something happened. @param {CanvasRenderingContext2D} pen @param {[number, number]} at @param {{severity: string, text: string}} of */
function drawMark(pen, at, { severity, text }) {
  const colour = ink[`${severity}-ink`];
  dot(pen, at, 5, ink.map, colour);
  write(pen, `${mark(severity)} ${text}`, at[0] + 9, at[1] + 4, colour);
}

/** @param {CanvasRenderingContext2D} pen @param {[number, number]} at @param {number} radius @param {string} fill @param {string} rim */
function dot(pen, [x, y], radius, fill, rim) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.fillStyle = fill;
  pen.fill();
  stroke(pen, rim, 2);
}

/** The robot, the newest piece of its track, where it is in five seconds, and the target. */
function drawMoving() {
  if (!map) return;
  const pen = clean(moving);
  const { now, history } = model;
  const tail = history.isWhole ? [] : history.track.slice(Math.max(0, drawnTrack - 1));
  if (now?.position && !history.isWhole) tail.push(now.position);
  if (tail.length > 1 && freshness === "fresh") {
    trace(pen, tail, false);
    stroke(pen, ink.track, 2.5);
  }
  // The canvas below is drawn again when the piece has become long.
  if (history.track.length - drawnTrack > 100 || history.track.length < drawnTrack) setTimeout(redraw, 0);
  if (target) drawTarget(pen, now?.position ?? null, target);
  if (now?.position) drawRobot(pen, now, now.position);
  else if (now?.lost_position) drawLost(pen, now.lost_position, now.lost_position_age_ms);
}

/** @param {CanvasRenderingContext2D} pen @param {LatLon|null} from @param {LatLon} to */
function drawTarget(pen, from, to) {
  const [x, y] = pixel(to);
  if (from) {
    traceSeen(pen, [from, to], false);
    stroke(pen, ink.text, 1.5, [2, 5]);
  }
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

/** @param {CanvasRenderingContext2D} pen @param {import("./protocol.d.ts").Now} now @param {LatLon} position */
function drawRobot(pen, now, position) {
  const old = freshness !== "fresh";
  const [x, y] = pixel(position);
  if (!old && now.ground_speed_mps !== null && now.course_deg !== null && now.ground_speed_mps > 0.3) {
    const course = (now.course_deg * Math.PI) / 180;
    const ahead = now.ground_speed_mps * AHEAD_S;
    trace(pen, [position, place(position, ahead * Math.sin(course), ahead * Math.cos(course))], false);
    stroke(pen, ink.map, 5);
    stroke(pen, ink.robot, 2);
  }
  pen.save();
  pen.translate(x, y);
  pen.beginPath();
  if (now.attitude) {
    pen.rotate((now.attitude.yaw_deg * Math.PI) / 180);
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
  if (old) beside(pen, `? ${freshness}`, x, y);
}

/** Where the robot was when that was last known: a hollow mark with its age. @param {CanvasRenderingContext2D} pen @param {LatLon} position @param {number|null} ms */
function drawLost(pen, position, ms) {
  const [x, y] = pixel(position);
  pen.beginPath();
  pen.arc(x, y, 10, 0, 2 * Math.PI);
  stroke(pen, ink.map, 6);
  stroke(pen, ink.robot, 2.5, [3, 4]);
  beside(pen, `? ${age(ms)} ago`, x, y);
}

/** Words on the side of a mark on which they fit. @param {CanvasRenderingContext2D} pen @param {string} words @param {number} x @param {number} y */
function beside(pen, words, x, y) {
  const fits = x + 24 + pen.measureText(words).width < map.getSize().x;
  write(pen, words, fits ? x + 18 : x - 18, y + 5, ink.text, fits ? "left" : "right");
}

/** The words over and about the map. @param {boolean} old whether the bridge's state is old */
export function drawWords(old) {
  const movement = model.robot?.movement ?? null;
  setHidden(byId("movement"), movement === null);
  if (movement) {
    const { text, waypoints_total: total, waypoints_reached: reached, distance_to_go_m: far, time_to_go_s: time } = movement;
    const parts = [total > 0 ? `waypoint ${Math.min(reached + 1, total)} of ${total}` : text];
    if (far !== null) parts.push(`${inMetres(far)} to go`);
    if (time !== null) parts.push(span(time));
    setText(byId("movement"), parts.join(" · ") + (old ? " ?" : ""));
  }
  const isFile = model.chart?.source === "file" && (model.chart.fence.length > 0 || model.chart.path.length > 0);
  setHidden(byId("source"), !isFile);
  if (isFile) setText(byId("source"), "▲ fence and path from a file, not confirmed by the bridge");
}

/** The map in words. */
export function speak() {
  const at = model.now?.position ?? null;
  const zero = origin();
  const lost = model.now?.lost_position ?? null;
  let words = at ? `Robot ${model.chosen} at ${latLon(at)}` : lost ? `No position, last at ${latLon(lost)}` : "No position";
  if (at && zero && freshness !== "fresh") words += `, ${freshness}`;
  if (at && zero) words += `, ${inMetres(distance(zero, at))} ${point(bearing(zero, at))} of ${model.chart?.home ? "home" : "the first place"}`;
  setText(byId("map-words"), words);
}
