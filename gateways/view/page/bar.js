// The orders: buttons, dialogs, and what became of each. What may be ordered is decided by the server; here it is asked for.

import { byId, make, setAttribute, setHidden, setText } from "./dom.js";
import { distance, typedNumber } from "./geo.js";
import { mark, metres, number, span } from "./format.js";
import * as map from "./map.js";
import { NAMES, severityOf, stageWords } from "./orders.js";
import { orderNumber } from "./protocol.js";
import * as sheets from "./sheets.js";
import * as words from "./words.js";

/** @typedef {import("./protocol.d.ts").OrderKind} OrderKind */
/** @typedef {import("./protocol.d.ts").LatLon} LatLon */
/**
 * What the bar needs of the page. `seen`: the number of the newest `now` that was drawn.
 * @typedef {{model: import("./model.js").Model, isLive: () => boolean, seen: () => number|null, send: (message: object) => boolean,
 *    redraw: () => void}} Page
 */

/** A dialog for landing is over after so long. */
const LAND_S = 10;
const HOLD_DOWN_MS = 1500;

/** @type {Page} */ let page;
/** Draws the open sheet anew when a check or a lease has come. @type {(() => void)|null} */ let refresh = null;
/** The check that the open sheet waits for. @type {string|null} */ let asked = null;
/** @type {any} */ let checkTimer = 0;

/** @param {Page} ofPage */
export function build(ofPage) {
  page = ofPage;
  const keys = { hold: "Shift+H", land: "L", home: "R", goto: "G", takeoff: "U", more: "O" };
  const acts = { hold, land, home: goHome, goto: goTo, takeoff: takeOff, more };
  const names = { ...NAMES, hold: "HOLD", home: "Home", more: "More" };
  for (const [id, act] of Object.entries(acts)) {
    byId("buttons").append(sheets.button(/** @type {any} */ (names)[id], act, { id: `order-${id}`, "aria-keyshortcuts": /** @type {any} */ (keys)[id], title: `Key ${/** @type {any} */ (keys)[id]}` }));
  }
}

/** @param {OrderKind} kind @param {{position?: LatLon, altitude_m?: number, confirm?: string}} [more] */
function give(kind, more = {}) {
  const { model } = page;
  const rights = words.rights(model);
  if (model.chosen === null || rights === "watch" || rights === "replay") return;
  const at = performance.now();
  const order = orderNumber();
  const message = model.orders.give(kind, model.chosen, { order, live: page.isLive(), seen: page.seen(), at, ...more });
  if (message !== null && rights === "lost") model.orders.notSent(order, at, words.LOST_RIGHTS);
  else if (message !== null && !page.send(message)) model.orders.notSent(order, at);
  page.redraw();
}

/** One press, no question. */
export function hold() {
  give("hold");
}

/** Whether to ask in a dialog; without contact, and without the right to order, the press is answered at once. @param {OrderKind} kind */
function canAsk(kind) {
  const rights = words.rights(page.model);
  if (page.model.chosen === null || rights === "watch" || rights === "replay") return false;
  const can = page.isLive() && rights === "command";
  if (!can) give(kind);
  return can;
}

export function land() {
  if (!canAsk("land")) return;
  const robot = page.model.chosen;
  sheets.open({
    title: `Land robot ${robot}?`, kind: "land", seconds: LAND_S,
    children: [
      make("p", {}, `Robot ${robot} lands where it is now. A path under way is given up.`),
      sheets.row(sheets.button(`Land robot ${robot} now`, () => {
        sheets.close();
        give("land");
      }, { class: "confirm", id: "confirm-land" }), sheets.button("Do not land", sheets.close)),
    ],
  });
}

/** What stands in a dialog about the lease; and whether this page commands. @param {any} node */
function drawLease(node) {
  const { model } = page;
  const { text, button, severity } = words.lease(/** @type {number} */ (model.chosen), model.lease, model.wasKept);
  if (node.dataset.text !== text) {
    node.dataset.text = text;
    const parts = text ? [make("p", { "data-severity": severity, role: "status" }, text)] : [];
    node.replaceChildren(...parts, ...(button ? [sheets.row(sheets.button(button, take))] : []));
  }
  return model.holder === "you";
}

/** Asks for command. */
export function take() {
  page.send({ type: "lease", robot: page.model.chosen, action: "take" });
}

/** What the server found, as a list. @param {any} node */
function drawCheck(node) {
  const { check } = page.model;
  if (!check || check.order !== asked) {
    node.replaceChildren(make("p", { class: "quiet" }, asked ? "Checking …" : "Not checked yet"));
    return false;
  }
  const parts = [];
  if (check.distance_m !== null) parts.push(metres(check.distance_m));
  if (check.duration_s !== null) parts.push(span(check.duration_s));
  const findings = check.findings.map(({ severity, text, next_step }) =>
    make("li", { "data-severity": severity }, `${mark(severity)} ${text}`, ...(next_step ? [make("span", { class: "step" }, `→ ${next_step}`)] : [])));
  const isRefused = check.severity === "alarm";
  const verdict = isRefused ? "■ REFUSED: this would not be taken" : check.severity === "warning" ? "▲ Possible, with warnings" : "● Nothing against it";
  node.replaceChildren(make("p", { "data-severity": check.severity }, make("strong", {}, verdict), parts.length ? ` · ${parts.join(" · ")}` : ""), make("ul", {}, ...findings));
  return !isRefused;
}

/** @param {"goto"|"takeoff"} kind @param {LatLon|null} position @param {number} altitude_m */
function ask(kind, position, altitude_m) {
  asked = orderNumber();
  page.send({ type: "check", order: asked, robot: page.model.chosen, kind, position, altitude_m });
  refresh?.();
}

/** Opens a dialog for an order that needs the lease. @param {{title: string, kind: string, children: Node[], closed?: () => void, draw: () => void}} what */
function openLeased({ title, kind, children, closed, draw }) {
  asked = null;
  sheets.open({
    title, kind, children, closed: () => {
      clearTimeout(checkTimer);
      refresh = asked = null;
      closed?.();
    },
  });
  refresh = draw;
  if (page.model.holder === "none") take();
  draw();
}

export function goTo() {
  if (canAsk("goto")) openGoTo(`Where shall robot ${page.model.chosen} go?`, "Tap the map, or type. The altitude is that of telemetry.", "", null);
}

/** To where it took off. It hovers there: where it lands, the pilot says then. */
export function goHome() {
  const { chosen, chart } = page.model;
  if (!canAsk("goto")) return;
  const text = "It flies straight to where it took off, at this altitude, and hovers there. The altitude is that of telemetry.";
  if (chart?.home) openGoTo(`Robot ${chosen} returns home?`, text, " home", [chart.home[0], chart.home[1]]);
  else openGoTo(`Where shall robot ${chosen} go?`, "▲ Where it took off is not known: tap the map, or type.", "", null);
}

/** @param {string} title @param {string} text @param {string} whereto of the button @param {LatLon|null} place */
function openGoTo(title, text, whereto, place) {
  const { model } = page;
  const robot = model.chosen;
  const now = model.now;
  const fields = { lat: sheets.field("Latitude °", { inputmode: "decimal", id: "goto-lat" }), lon: sheets.field("Longitude °", { inputmode: "decimal", id: "goto-lon" }), alt: sheets.field("Altitude m", { inputmode: "decimal", id: "goto-altitude" }) };
  fields.alt.input.value = now?.altitude_m != null ? now.altitude_m.toFixed(1) : "";
  const note = make("p", { class: "quiet" });
  const lease = make("div", { class: "lease" });
  const found = make("div", { class: "found", role: "status" });
  const typed = () => {
    const [lat, lon, alt] = [typedNumber(fields.lat.input.value, -90, 90), typedNumber(fields.lon.input.value, -180, 180), typedNumber(fields.alt.input.value, -1000, 10000)];
    return { place: lat === null || lon === null ? null : /** @type {LatLon} */ ([lat, lon]), alt };
  };
  const confirm = sheets.button(`Send robot ${robot}${whereto}`, () => {
    const { place, alt } = typed();
    if (confirm.disabled || !place || alt === null) return;
    sheets.close();
    give("goto", { position: place, altitude_m: alt });
  }, { class: "confirm", id: "confirm-goto" });
  const draw = () => {
    const leads = drawLease(lease);
    const passes = drawCheck(found);
    confirm.disabled = !(leads && passes);
  };
  const changed = () => {
    asked = null;
    const { place, alt } = typed();
    map.setTarget(place);
    setText(note, describe(place, alt));
    draw();
    clearTimeout(checkTimer);
    // Checked when the typing rests, so that not every digit is a question.
    if (place && alt !== null) checkTimer = setTimeout(() => ask("goto", place, alt), 300);
  };
  const aim = (place) => {
    [fields.lat.input.value, fields.lon.input.value] = [place[0].toFixed(6), place[1].toFixed(6)];
    changed();
  };
  for (const { input } of Object.values(fields)) input.addEventListener("input", changed);
  openLeased({
    title, kind: "goto", draw,
    children: [
      make("p", { class: "quiet" }, text),
      make("div", { class: "fields" }, fields.lat.label, fields.lon.label, fields.alt.label),
      note, found, lease, sheets.row(confirm, sheets.button("Centre of map", () => aim(map.centre())), sheets.button("Cancel", sheets.close)),
    ],
    closed: () => {
      map.pick(null);
      map.setTarget(null);
    },
  });
  map.pick(aim);
  if (place) aim(place);
}

/** @param {LatLon|null} place @param {number|null} alt */
function describe(place, alt) {
  const { now } = page.model;
  const parts = [];
  if (place && now?.position) parts.push(`${metres(distance(now.position, place))} from here`);
  if (alt !== null && now?.altitude_m != null && now.height_m !== null) parts.push(`${number(alt - now.altitude_m + now.height_m, 1)} m above take-off`);
  if (alt !== null && now?.altitude_m != null) parts.push(Math.abs(alt - now.altitude_m) < 0.05 ? "as high as now" : `${number(Math.abs(alt - now.altitude_m), 1)} m ${alt > now.altitude_m ? "up" : "down"}`);
  return parts.join(" · ");
}

export function takeOff() {
  if (!canAsk("takeoff")) return;
  const robot = page.model.chosen;
  const height = sheets.field("Height above take-off, m", { inputmode: "decimal", id: "takeoff-height", value: "10" });
  const typed = sheets.field("or type takeoff", { id: "takeoff-word", autocapitalize: "off" });
  const lease = make("div", { class: "lease" });
  const found = make("div", { class: "found", role: "status" });
  let ready = false;
  const act = () => {
    const metres = typedNumber(height.input.value, 0.1, 10000);
    if (!ready || metres === null) return;
    sheets.close();
    give("takeoff", { altitude_m: metres, confirm: "takeoff" });
  };
  const held = sheets.holdButton("Hold down 1.5 s to take off", HOLD_DOWN_MS, act);
  held.id = "confirm-takeoff";
  const draw = () => {
    const leads = drawLease(lease);
    ready = drawCheck(found) && leads;
    held.disabled = !ready;
    typed.input.disabled = !ready;
  };
  const changed = () => {
    asked = null;
    draw();
    clearTimeout(checkTimer);
    const metres = typedNumber(height.input.value, 0.1, 10000);
    if (metres !== null) checkTimer = setTimeout(() => ask("takeoff", null, metres), 300);
  };
  height.input.addEventListener("input", changed);
  typed.input.addEventListener("input", () => {
    if (typed.input.value.trim().toLowerCase() === "takeoff") act();
  });
  openLeased({
    title: `Robot ${robot} takes off`, kind: "takeoff", draw,
    children: [make("div", { class: "fields" }, height.label, typed.label), found, lease, sheets.row(held, sheets.button("Cancel", sheets.close))],
  });
  changed();
}

/** What is seldom needed. */
export function more() {
  const { model } = page;
  if (model.chosen === null || words.rights(model) !== "command") return;
  const robot = model.chosen;
  let drawn = "";
  const draw = () => {
    if (drawn === model.holder) return;
    drawn = model.holder;
    const mine = drawn === "you";
    const rows = [
      sheets.button("Start: the module takes orders", () => canAsk("start") && start(), { id: "order-start" }),
      sheets.button("Stop: no movement until a start", () => canAsk("stop") && stop(), { id: "order-stop" }),
      sheets.button(mine ? "Give up command" : drawn === "other" ? "Ask for command" : "Take command", () => {
        page.send({ type: "lease", robot, action: mine ? "release" : "take" });
        sheets.close();
      }, { id: "lease-change" }),
      sheets.button("Close", sheets.close),
    ];
    byId("more-rows")?.replaceChildren(...rows);
  };
  sheets.open({ title: `More for robot ${robot}`, kind: "more", children: [make("div", { id: "more-rows", class: "column" })], closed: () => (refresh = null) });
  refresh = draw;
  draw();
}

function start() {
  const robot = page.model.chosen;
  const lease = make("div", { class: "lease" });
  const confirm = sheets.button(`Start robot ${robot}`, () => {
    sheets.close();
    give("start");
  }, { class: "confirm", id: "confirm-start" });
  openLeased({
    title: `Start robot ${robot}?`, kind: "start", draw: () => (confirm.disabled = !drawLease(lease)),
    children: [make("p", {}, "From then on its module takes orders. Nothing flies by this alone."), lease, sheets.row(confirm, sheets.button("Cancel", sheets.close))],
  });
}

function stop() {
  const robot = page.model.chosen;
  const typed = sheets.field("Type stop", { id: "stop-word", autocapitalize: "off" });
  const lease = make("div", { class: "lease" });
  const confirm = sheets.button(`Stop robot ${robot}`, () => {
    if (confirm.disabled) return;
    sheets.close();
    give("stop", { confirm: "stop" });
  }, { class: "confirm", id: "confirm-stop" });
  const draw = () => (confirm.disabled = !drawLease(lease) || typed.input.value.trim().toLowerCase() !== "stop");
  typed.input.addEventListener("input", draw);
  openLeased({
    title: `Stop robot ${robot}?`, kind: "stop", draw,
    children: [make("p", {}, "It hovers, discards all that was planned, and takes no movement until a start."), typed.label, lease, sheets.row(confirm, sheets.button("Cancel", sheets.close))],
  });
}

/** A check or a lease has come. */
export function changed() {
  refresh?.();
  drawAsked();
}

/** Another page asks for command. */
function drawAsked() {
  const { lease } = page.model;
  const row = byId("lease-row");
  const isAsked = lease?.holder === "you" && lease.asked;
  if (isAsked === !row.hidden) return;
  setHidden(row, !isAsked);
  if (!isAsked) return row.replaceChildren();
  const answer = (action) => () => page.send({ type: "lease", robot: page.model.chosen, action });
  row.replaceChildren(make("strong", { role: "alert" }, `▲ Another page asks for command of robot ${page.model.chosen}`), sheets.button("Give", answer("give"), { id: "lease-give" }), sheets.button("Keep", answer("keep"), { id: "lease-keep" }));
}

/** Contact was lost: a question that is open is over, and what became of orders is not known. */
export function lost() {
  if (isOrder(byId("sheet").dataset.kind)) sheets.close();
  page.model.orders.doubt();
}

/** @param {string} [kind] */
const isOrder = (kind) => kind !== undefined && kind !== "menu";

/** What became of the orders, and what can be ordered. */
export function draw() {
  const { model } = page;
  const rights = words.rights(model);
  const off = rights === "watch" || rights === "replay";
  setHidden(byId("buttons"), off);
  setAttribute(byId("bar"), "data-contact", page.isLive() && rights !== "lost" ? null : "lost");
  for (const button of byId("buttons").children) button.disabled = model.chosen === null && page.isLive();
  const line = byId("progress");
  const shown = off ? [] : model.orders.shown(performance.now()).slice(0, 3);
  const key = shown.map((entry) => `${entry.order}${entry.stage}${entry.text}`).join("|") + `${model.holder}${page.isLive()}${rights}`;
  if (line.dataset.key === key) return;
  line.dataset.key = key;
  if (shown.length === 0) {
    const lease = { you: "This page commands.", other: "Another page commands.", none: "No page commands." }[model.holder];
    const text = page.isLive() ? words.RIGHTS[rights] ?? `No order under way. ${lease}` : off ? words.RIGHTS[rights] : "NO CONTACT: what is pressed now is not sent";
    return line.replaceChildren(make("span", { class: "quiet" }, text));
  }
  line.replaceChildren(...shown.map(({ order, kind, robot, stage, text }) => {
    const severity = severityOf(stage);
    return make("span", { class: "entry", "data-severity": severity, "data-kind": kind, "data-stage": stage, "data-order": order },
      make("strong", {}, `${mark(severity)} ${NAMES[kind] ?? kind} robot ${robot}: ${stageWords(stage)}`), text ? ` ${text}` : "");
  }));
}
