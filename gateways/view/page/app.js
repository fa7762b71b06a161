// The page's own program: it joins the connection, the model and the screen, and says when to draw what.

import { Ages } from "./ages.js";
import * as banner from "./banner.js";
import * as bar from "./bar.js";
import { Contact } from "./contact.js";
import { byId, recall, remember, setAttribute, setText } from "./dom.js";
import * as instruments from "./instruments.js";
import { Link } from "./link.js";
import * as lists from "./lists.js";
import * as map from "./map.js";
import * as ownPlace from "./own_place.js";
import { Model } from "./model.js";
import * as plots from "./plots.js";
import { orderNumber, parse } from "./protocol.js";
import * as replay from "./replay.js";
import * as settings from "./settings.js";
import * as sheets from "./sheets.js";
import * as sound from "./sound.js";
import * as tabs from "./tabs.js";
import * as theme from "./theme.js";
import { Bell } from "./words.js";

/** How often the page asks for a picture, at most. */
const RATE_HZ = 20;
const TICK_MS = 250;
const PING_MS = 1000;
/** A page that is not seen closes its connection after so long. */
const HIDDEN_MS = 30000;

const model = new Model();
const ages = new Ages();
const contact = new Contact();
const token = takeToken();
/** What this tab calls itself, also after it was loaded again. */
const name = recall("session", "page") ?? orderNumber();
remember("session", "page", name);

/** What is to be drawn at the next frame. @type {Set<string>} */
const dirty = new Set();
let frame = 0;
/** The newest `now` that was drawn. @type {number|null} */
let seen = null;
/** Whether what is drawn next came as `now` or `beat`. */
let isAlive = false;
let pings = 0;
let pinged = -Infinity;
let second = -1;
/** @type {any} */ let hiddenTimer = 0;
/** The robot that the last `open` named. @type {number|null} */
let opened = null;
let isReset = true;
const bell = new Bell();

const picture = new banner.DeadMan("dead");
const hands = new banner.DeadMan("bar-dead");

const link = new Link(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/`, { opened: open, message: take, closed: schedule }, {
  now: () => performance.now(),
  connect: (address, protocol) => new WebSocket(address, protocol),
  after: (ms, then) => setTimeout(then, ms),
  cancel: (timer) => clearTimeout(timer),
  chance: Math.random,
});

/**
 * The token behind `#` goes from the address into the memory of this tab, and the page is loaded again without it: an address that is only
 * rewritten stays in the tab's history as it was typed. @returns {string|null}
 */
function takeToken() {
  const given = new URLSearchParams(location.hash.slice(1)).get("token");
  if (!given) return recall("session", "token");
  const plain = location.pathname + location.search;
  remember("session", "token", given);
  if (recall("session", "token") === given) location.replace(plain);
  // A browser that keeps nothing would lose it.
  else history.replaceState(null, "", plain);
  return given;
}

function open() {
  contact.opened();
  ages.opened(performance.now());
  opened = model.chosen;
  isAlive = false;
  link.send({ type: "open", token, robot: opened, rate_hz: RATE_HZ, page: name });
  if (document.visibilityState === "hidden") link.send({ type: "hidden", hidden: true });
  // What is on the screen is of the connection before.
  contact.wake(ping());
}

/** @returns {string|null} */
function ping() {
  const id = String(++pings);
  pinged = performance.now();
  if (!link.send({ type: "ping", id })) return null;
  ages.pinged(id, pinged);
  contact.pinged(id, pinged);
  return id;
}

/** @param {number} robot */
function choose(robot) {
  if (robot === model.chosen && robot === opened) return;
  sheets.close();
  if (robot !== model.chosen) model.choose(robot, performance.now());
  remember("session", "robot", String(robot));
  seen = null;
  opened = robot;
  link.send({ type: "open", token, robot, rate_hz: RATE_HZ, page: name });
  map.forget();
  isReset = true;
  for (const part of ["robot", "robots", "chart", "now", "events", "past", "order"]) dirty.add(part);
  schedule();
}

/** @param {unknown} text */
function take(text) {
  const message = parse(text);
  if (message === null) return;
  const at = performance.now();
  contact.message(at);
  if (Number.isFinite(message.sent_ms)) ages.arrived(message.sent_ms);
  if (message.type === "pong") {
    ages.ponged(String(message.id), message.sent_ms, at);
    contact.ponged(String(message.id));
  }
  if (message.type === "refused") contact.refusal = String(message.text);
  if (message.type === "hello") hello(message);
  const parts = model.take(message, at);
  if (parts.includes("reload")) return location.reload();
  if (message.type === "hello") listed(message.robots);
  if (message.type === "robots") listed(message.robots.map(({ robot }) => robot));
  for (const part of parts) dirty.add(part);
  if (model.takesAgain()) bar.take();
  if (parts.includes("robot") || parts.includes("robots")) ring();
  isAlive ||= message.type === "now" || message.type === "beat";
  dirty.add(message.type);
  schedule();
}

/** An alarm is heard and felt when it begins; one of a recording is not. */
function ring() {
  const severity = bell.ring(model);
  if (severity && !model.hello?.replay) sound.play(severity);
}

/** The robots that are shown. Instead of one that is not, the server shows its first one until this page asks again. @param {number[]} robots */
function listed(robots) {
  const { chosen } = model;
  if (opened !== null && !robots.includes(opened)) opened = null;
  if (chosen !== null && chosen !== opened && robots.includes(chosen)) choose(chosen);
}

/** @param {import("./protocol.d.ts").Hello} message */
function hello(message) {
  link.settled();
  if (message.role === "command") remember("session", "role", "command");
  contact.staleAfterMs = message.stale_after_ms;
  picture.after(message.stale_after_ms);
  map.setTiles(message.tiles);
  if (model.hello?.instance === message.instance) return;
  seen = null;
  isReset = true;
  if (model.hello !== null) {
    sheets.close();
    map.forget();
  }
}

function schedule() {
  if (frame === 0) frame = requestAnimationFrame(draw);
}

function draw() {
  frame = 0;
  const at = performance.now();
  const since = model.now ? ages.since(model.now.sent_ms, at) : Infinity;
  const freshness = model.freshness("telemetry", at, since);
  const bridge = model.freshness("bridge", at, since);
  const has = (/** @type {string[]} */ ...parts) => parts.some((part) => dirty.has(part));
  if (has("now", "tick", "robot", "robots", "hello")) {
    const isLate = model.isLate(at, since);
    banner.draw(model, { telemetry: freshness, bridge, isLate }, { telemetry: ageOf("telemetry", at), bridge: ageOf("bridge", at) }, at);
  }
  if (has("now", "tick", "hello")) {
    instruments.draw(model.now, freshness);
    map.drawNow(freshness);
  }
  if (has("robot", "now", "chart", "hello", "tick")) tabs.flag(model, instruments.drawStrip(model, bridge !== "fresh", freshness !== "fresh", at));
  if (has("robot", "hello", "tick")) map.drawWords(bridge !== "fresh");
  if (has("chart", "past", "hello") || isReset) map.redraw();
  if (has("robot", "hello", "second")) lists.drawAlarms(model, at);
  if (has("robot")) lists.announce(model);
  if (has("events", "hello")) lists.drawEvents(model);
  if (has("robots", "hello")) lists.drawRobots(model, choose);
  if (has("check", "lease")) bar.changed();
  if (has("replay", "now", "tick", "hello")) replay.draw(at);
  drawSecond(at, freshness);
  if (isAlive) contact.drawn();
  const state = banner.cover(model, contact, at);
  if (state === "live") model.orders.trust();
  if (has("order", "lease", "hello", "tick", "robots") || state !== "live") bar.draw();
  dirty.clear();
  isReset = false;
  answer();
}

/** After drawing: only what is on the screen was seen, and only that keeps the covers away. */
function answer() {
  // An answer that did not leave is given again: without it the server sends nothing newer.
  if (model.now && model.now.n !== seen && link.send({ type: "seen", n: model.now.n })) seen = model.now.n;
  if (!isAlive) return;
  isAlive = false;
  picture.restart(performance.now());
}

/** What is renewed once a second: plots, and the words for screen readers. @param {number} at @param {string} freshness */
function drawSecond(at, freshness) {
  if (!dirty.has("second") && !dirty.has("past") && !isReset) return;
  plots.draw(model.time(at));
  instruments.speak(model.now, freshness);
  map.speak();
}

/** @param {"telemetry"|"bridge"} what @param {number} at */
function ageOf(what, at) {
  const { now } = model;
  if (!now) return null;
  // In a replay values have the age that they had then, however long the page waits for the next ones.
  if (model.hello?.replay) return now[what].age_ms;
  const age = ages.of(now[what].age_ms, now.sent_ms, at);
  return age === Infinity ? null : age;
}

/** The page's own clock. */
function tick() {
  const at = performance.now();
  const gap = contact.tick(at, Date.now());
  if (document.visibilityState !== "visible") return;
  hands.restart(at);
  if (gap) {
    ages.gap();
    contact.wake(ping());
  }
  if (at - pinged >= PING_MS) ping();
  link.look();
  if (["lost", "refused"].includes(contact.state(at))) bar.lost();
  dirty.add("tick");
  if (Math.floor(at / 1000) !== second) {
    second = Math.floor(at / 1000);
    dirty.add("second");
    if (second % 10 === 0) map.redraw();
  }
  schedule();
}

function visibility() {
  clearTimeout(hiddenTimer);
  const isHidden = document.visibilityState === "hidden";
  link.send({ type: "hidden", hidden: isHidden });
  if (isHidden) {
    hiddenTimer = setTimeout(() => link.stop(), HIDDEN_MS);
    return;
  }
  settings.stayAwake();
  link.start();
  contact.wake(ping());
  tick();
}

/** @param {KeyboardEvent} event */
function key(event) {
  if (event.key === "Escape") return sheets.close();
  if (event.ctrlKey || event.altKey || event.metaKey || event.repeat || !settings.keysAreOn()) return;
  // Also in a field: no field takes a capital H.
  if (event.shiftKey && event.key.toLowerCase() === "h") {
    event.preventDefault();
    return bar.hold();
  }
  const at = /** @type {Element} */ (event.target);
  if (event.shiftKey || at.closest("input, select, textarea")) return;
  if (event.key === " " && at.closest("button, [role=tab]")) return;
  /** @type {Record<string, () => void>} */
  const acts = {
    l: bar.land, r: bar.goHome, g: bar.goTo, u: bar.takeOff, o: bar.more, f: () => map.setFollow(true), a: map.whole, t: theme.next, m: settings.menu, " ": replay.playOrPause, ",": () => replay.step(-1), ".": () => replay.step(1), p: () => replay.jump(-1), n: () => replay.jump(1),
  };
  const robot = /^[1-9]$/.test(event.key) ? model.robots[Number(event.key) - 1] : undefined;
  const act = robot ? () => choose(robot.robot) : acts[event.key.toLowerCase()];
  if (!act) return;
  event.preventDefault();
  act();
}

function main() {
  const last = Number(recall("session", "robot"));
  if (Number.isInteger(last) && last > 0) model.chosen = last;
  model.hadCommand = recall("session", "role") === "command";
  instruments.build();
  map.build(model);
  plots.build(model);
  tabs.build();
  bar.build({
    model, isLive: () => contact.isLive(performance.now()), seen: () => seen, send: (message) => link.send(message),
    redraw: () => {
      dirty.add("order");
      schedule();
    },
  });
  replay.build(model, (message) => link.send(message));
  settings.build();
  sound.build();
  ownPlace.build();
  theme.build(() => {
    map.themeChanged();
    plots.themeChanged();
  });
  document.addEventListener("keydown", key);
  document.addEventListener("visibilitychange", visibility);
  addEventListener("pageshow", (event) => event.persisted && visibility());
  setAttribute(document.body, "data-ready", "");
  setText(byId("cover-text"), "Nothing has been heard of the server yet");
  setInterval(tick, TICK_MS);
  // A new invitation in a tab in which the page is open loads nothing by itself.
  addEventListener("hashchange", takeToken);
  visibility();
}

// The page that is being left for one without the token does nothing.
if (!new URLSearchParams(location.hash.slice(1)).has("token")) main();
