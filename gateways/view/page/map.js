// The map. Leaflet moves and zooms; what is seen is drawn here, on two canvases: what seldom changes, and the robot above it.
// The grid of metres needs no tiles, so there is a map without a network. Where the server has tiles, they lie below.

import { byId, make, setAttribute, setHidden, setText, themed } from "./dom.js";
import { bearing, distance, gridStep, metres, place, point } from "./geo.js";
import { age, latLon, metres as inMetres, number, span } from "./format.js";
import * as marks from "./marks.js";

/** @typedef {import("./protocol.d.ts").LatLon} LatLon */
/** @typedef {import("./model.js").Model} Model */

/** Leaflet, which is no module. @type {any} */
const L = /** @type {any} */ (globalThis).L;

const { stroke, write } = marks;
const { ink } = marks.look;

/** Least pixels between two lines of the grid. */
const GRID_PIXELS = 56;
const LEAST_ZOOM = 17;
/** A tile that is missing, or was too much for the server, is asked for again: after 5 s, then after twice as long each time, up to 5 min. */
const RETRY_MS = 5000;
const MOST_RETRY_MS = 300000;
/** The vector of speed shows where the robot is in so many seconds. */
const AHEAD_S = 5;

/** @type {any} */ let map;
/** @type {Model} */ let model;
/** @type {HTMLCanvasElement} */ let still;
/** @type {HTMLCanvasElement} */ let moving;
/** What is asked for by `pick`. @type {((place: LatLon) => void)|null} */ let picking = null;
/** @type {LatLon|null} */ let target = null;
/** Where this phone is. @type {{place: LatLon, accuracy_m: number}|null} */ let own = null;
let follows = true;
let isPlaced = false;
let ourMove = false;
let drawnTrack = 0;
let freshness = "never";
/** The layer of tiles; null without any. @type {any} */ let imagery = null;

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
  marks.look.hasImagery = imagery !== null;
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
  const all = model.history.track.filter((at) => at !== null);
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
  marks.look.wide = Number(themed("--line-width")) || 1;
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

/** @param {{place: LatLon, accuracy_m: number}|null} at */
export function setOwn(at) {
  own = at;
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
  const at = model.now?.position ?? model.now?.lost_position ?? model.history.lastPlace() ?? origin();
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

/** A line through places; it is interrupted by a null. @param {CanvasRenderingContext2D} pen @param {readonly (readonly number[]|null)[]} places @param {boolean} closed */
function trace(pen, places, closed) {
  pen.beginPath();
  places.forEach((at, index) => {
    if (at === null) return;
    const [x, y] = pixel(at);
    if (index === 0 || places[index - 1] === null) pen.moveTo(x, y);
    // A piece of one place is a dot.
    pen.lineTo(x, y);
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
  if (home) marks.home(pen, pixel(home));
  const [first, last] = [track[0], model.history.lastPlace()];
  if (model.history.isWhole && first && last) marks.ends(pen, pixel(first), pixel(last));
  for (const one of model.marks) marks.event(pen, pixel(one.place), one);
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
  stroke(pen, ink.grid, 1 / marks.look.wide, ink.dots ? [1, 5] : []);
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
  if (own) marks.own(pen, pixel(own.place), Math.abs(pixel(place(own.place, 0, own.accuracy_m))[1] - pixel(own.place)[1]));
  if (target) drawTarget(pen, now?.position ?? null, target);
  if (now?.position) drawRobot(pen, now, now.position);
  else if (now?.lost_position) marks.lost(pen, pixel(now.lost_position), `? ${age(now.lost_position_age_ms)} ago`);
}

/** @param {CanvasRenderingContext2D} pen @param {LatLon|null} from @param {LatLon} to */
function drawTarget(pen, from, to) {
  if (from) {
    traceSeen(pen, [from, to], false);
    stroke(pen, ink.text, 1.5, [2, 5]);
  }
  marks.target(pen, pixel(to));
}

/** @param {CanvasRenderingContext2D} pen @param {import("./protocol.d.ts").Now} now @param {LatLon} position */
function drawRobot(pen, now, position) {
  const old = freshness !== "fresh";
  if (!old && now.ground_speed_mps !== null && now.course_deg !== null && now.ground_speed_mps > 0.3) {
    const course = (now.course_deg * Math.PI) / 180;
    const ahead = now.ground_speed_mps * AHEAD_S;
    trace(pen, [position, place(position, ahead * Math.sin(course), ahead * Math.cos(course))], false);
    stroke(pen, ink.map, 5);
    stroke(pen, ink.robot, 2);
  }
  marks.robot(pen, pixel(position), now.attitude?.yaw_deg ?? null, old ? `? ${freshness}` : null);
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
