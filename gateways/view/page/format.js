// Numbers and times as they are shown. What is not known is a dash, never a zero.

/** What stands for a value that is not known. */
export const UNKNOWN = "–";

/** @param {number|null|undefined} value */
const known = (value) => typeof value === "number" && Number.isFinite(value);

/** @param {number|null|undefined} value @param {number} digits */
export function number(value, digits) {
  if (!known(value)) return UNKNOWN;
  const text = /** @type {number} */ (value).toFixed(digits);
  // A minus before a zero says nothing, and a hyphen is narrower than a digit.
  return /^-0(\.0*)?$/.test(text) ? text.slice(1) : text.replace("-", "\u2212");
}

/** With a sign, for what has two directions. @param {number|null|undefined} value @param {number} digits */
export function signed(value, digits) {
  const text = number(value, digits);
  return text === UNKNOWN || text.startsWith("\u2212") || Number(text) === 0 ? text : `+${text}`;
}

/** A direction, as three digits. @param {number|null|undefined} degrees */
export function direction(degrees) {
  if (!known(degrees)) return UNKNOWN;
  const whole = ((Math.round(/** @type {number} */ (degrees)) % 360) + 360) % 360;
  return `${String(whole).padStart(3, "0")}°`;
}

/** An age or a time to go, in ms. @param {number|null|undefined} ms */
export function age(ms) {
  if (!known(ms)) return UNKNOWN;
  const s = /** @type {number} */ (ms) / 1000;
  // Rounded up: an age is never shown smaller than it is.
  if (s < 10) return `${(Math.ceil(s * 10 - 1e-9) / 10).toFixed(1)} s`;
  return span(s);
}

/** A span of time, in s. @param {number|null|undefined} seconds */
export function span(seconds) {
  if (!known(seconds)) return UNKNOWN;
  const s = Math.ceil(/** @type {number} */ (seconds) - 1e-9);
  if (s < 100) return `${s} s`;
  if (s < 6000) return `${Math.floor(s / 60)} min ${String(s % 60).padStart(2, "0")} s`;
  return `${Math.floor(s / 3600)} h ${String(Math.floor((s % 3600) / 60)).padStart(2, "0")} min`;
}

/** A place in a recording, such as 1:05 or 1:02:05. @param {number} seconds */
export function position(seconds) {
  const s = Math.max(0, Math.floor(seconds));
  const two = (n) => String(n).padStart(2, "0");
  const hours = Math.floor(s / 3600);
  const minutes = Math.floor(s / 60) % 60;
  return hours > 0 ? `${hours}:${two(minutes)}:${two(s % 60)}` : `${minutes}:${two(s % 60)}`;
}

/** @param {number|null|undefined} metres */
export function metres(metres) {
  if (!known(metres)) return UNKNOWN;
  const m = /** @type {number} */ (metres);
  return Math.abs(m) < 1000 ? `${number(m, 0)} m` : `${number(m / 1000, Math.abs(m) < 10000 ? 2 : 1)} km`;
}

/** Time of day, UTC. @param {number|null|undefined} unixMs @param {boolean} [tenths] whether tenths of a second are of interest */
export function clock(unixMs, tenths = false) {
  if (!known(unixMs) || Math.abs(/** @type {number} */ (unixMs)) > 8.64e15) return UNKNOWN;
  return `${new Date(/** @type {number} */ (unixMs)).toISOString().slice(11, tenths ? 21 : 19)}Z`;
}

/** @param {readonly number[]|null|undefined} place */
export function latLon(place) {
  return place ? `${number(place[0], 6)}, ${number(place[1], 6)}` : UNKNOWN;
}

/** The shape and the word of a severity: colour alone says nothing to many, and to none in the sun. @type {Record<string, [string, string]>} */
export const SEVERITIES = {
  ok: ["●", "OK"],
  note: ["◆", "NOTE"],
  order: ["►", "ORDER"],
  warning: ["▲", "WARNING"],
  alarm: ["■", "ALARM"],
};

/** @param {string} severity */
export function mark(severity) {
  return (SEVERITIES[severity] ?? SEVERITIES.note)[0];
}

/** @param {string} severity */
export function word(severity) {
  return (SEVERITIES[severity] ?? SEVERITIES.note)[1];
}

/** A number with as many digits as a person compares. @param {number|null|undefined} value */
export function compared(value) {
  if (!known(value)) return UNKNOWN;
  const size = Math.abs(/** @type {number} */ (value));
  return number(value, size === 0 ? 0 : size < 0.01 ? 4 : size < 0.1 ? 3 : size < 1 ? 2 : size < 100 ? 1 : 0);
}

/** A time since the beginning of a recording, such as 7.3 s or 1:05. @param {number|null|undefined} seconds */
export function moment(seconds) {
  if (!known(seconds)) return UNKNOWN;
  const s = /** @type {number} */ (seconds);
  return s < 59.95 ? `${s.toFixed(1)} s` : position(Math.round(s));
}
