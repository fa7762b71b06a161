// Places: metres around an origin, distances, the step of a grid, and what a pilot types.

/** @typedef {import("./protocol.d.ts").LatLon} LatLon */

const RADIANS = Math.PI / 180;

/** Metres of one degree of latitude and of longitude there, on WGS 84. @param {number} lat @returns {[number, number]} */
export function metresPerDegree(lat) {
  const p = lat * RADIANS;
  return [
    111132.954 - 559.822 * Math.cos(2 * p) + 1.175 * Math.cos(4 * p),
    111412.84 * Math.cos(p) - 93.5 * Math.cos(3 * p) + 0.118 * Math.cos(5 * p),
  ];
}

/** East and north of `from` to `to`, m. @param {LatLon} from @param {LatLon} to @returns {[number, number]} */
export function metres(from, to) {
  const [perLat, perLon] = metresPerDegree(from[0]);
  let lon = to[1] - from[1];
  if (lon > 180) lon -= 360;
  if (lon < -180) lon += 360;
  return [lon * perLon, (to[0] - from[0]) * perLat];
}

/** The place so many metres east and north of `from`. @param {LatLon} from @param {number} east @param {number} north @returns {LatLon} */
export function place(from, east, north) {
  const [perLat, perLon] = metresPerDegree(from[0]);
  return [from[0] + north / perLat, from[1] + east / perLon];
}

/** @param {LatLon} from @param {LatLon} to */
export function distance(from, to) {
  return Math.hypot(...metres(from, to));
}

/** Direction from north over east, 0 to 360. @param {LatLon} from @param {LatLon} to */
export function bearing(from, to) {
  const [east, north] = metres(from, to);
  return (Math.atan2(east, north) / RADIANS + 360) % 360;
}

const POINTS = ["north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west"];

/** A direction in a word. @param {number} degrees */
export function point(degrees) {
  return POINTS[Math.round((((degrees % 360) + 360) % 360) / 45) % 8];
}

/**
 * The step of a grid, m: 1, 2 or 5 times a power of ten, and at least so many pixels.
 * @param {number} metresPerPixel @param {number} leastPixels
 */
export function gridStep(metresPerPixel, leastPixels) {
  const least = metresPerPixel * leastPixels;
  if (!(least > 0) || !Number.isFinite(least)) return 1;
  const power = 10 ** Math.floor(Math.log10(least));
  const factor = [1, 2, 5, 10].find((f) => f * power >= least * 0.999999) ?? 10;
  return factor * power;
}

/**
 * A number that was typed, with a point or a comma; null if it is none or out of bounds.
 * @param {string} text @param {number} least @param {number} most
 */
export function typedNumber(text, least, most) {
  const plain = text.trim().replace(",", ".").replace(/^\u2212/, "-");
  if (!/^[-+]?(\d+\.?\d*|\.\d+)$/.test(plain)) return null;
  const value = Number(plain);
  return value >= least && value <= most ? value : null;
}

/** Whether two places are so close that a track needs only one of them. @param {LatLon} a @param {LatLon} b */
export function isSamePlace(a, b) {
  return distance(a, b) < 0.4;
}
