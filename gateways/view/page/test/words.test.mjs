// What the page's pure modules make of what is not known, of a server that was started again, and of a playhead: node --test gateways/view/page/test/

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { History, pieces } from "../history.js";
import { Model } from "../model.js";
import { OrderBook } from "../orders.js";
import { Sought } from "../replay.js";
import * as words from "../words.js";

const HELLO = { type: "hello", protocol: "hero.view.v1", build: "b", instance: "1", role: "command", robots: [1, 2], replay: null, report: false, tiles: null, stale_after_ms: 1500 };
const ROBOT = { type: "robot", robot: 1, phase: "hovering", activity: "hovering", module: "running", blocked: false, link: { text: "", state: "up", age_s: 9 }, switch: "auto", commander: null, control: { exclusive: false, holder: null }, alarms: [], movement: null, flown_s: 60, replayed: false, relayed: false };
const NOW = { type: "now", robot: 1, n: 1, sent_ms: 0, telemetry: { freshness: "fresh", age_ms: 40 }, bridge: { freshness: "fresh", age_ms: 40 }, position: [37, -6], altitude_m: 20, height_m: 10, attitude: null, ground_speed_mps: 0, climb_mps: 0, course_deg: null, battery_v: 24, fuel_percent: null, fix: null, flying: true, left_out: 0 };
const CHART = { type: "chart", robot: 1, source: "bridge", number: 1, fence: [], floor_m: null, ceiling_m: null, path: [], home: [37, -6.001, 10] };
const LEASE = { type: "lease", robot: 1, holder: "other", asked: false, asks: false, expires_ms: 9000 };
const ALARM = { id: "dsp-link", severity: "alarm", text: "silent", next_step: null, since_s: 3 };

/** A page that has seen this. */
function page(...messages) {
  const model = new Model();
  for (const message of [HELLO, ...messages]) model.take(message, 0);
  return /** @type {any} */ (model);
}

test("a phase is marked when the bridge or the DSP does not say it any more", () => {
  const robot = /** @type {any} */ (ROBOT);
  const link = (state, age_s) => ({ ...robot, link: { text: "", state, age_s } });
  for (const [of, bridge, text, isOld] of [
    [robot, "fresh", "hovering", false],
    [robot, "stale", "STALE 4.2 s: hovering", true],
    [robot, "gone", "GONE 4.2 s: hovering", true],
    [link("silent", 5), "fresh", "LINK SILENT 5 s: hovering", true],
    [link("gone", null), "fresh", "LINK GONE: hovering", true],
    [link("silent", 5), "stale", "STALE 4.2 s: hovering", true],
    [{ ...link("unknown", null), phase: "no bridge runs" }, "never", "no bridge runs", false],
    [null, "never", "unknown", false],
  ]) assert.deepEqual(words.phase(of, 1, /** @type {any} */ (bridge), 4200), { text, isOld });
  assert.equal(words.phase(null, null, "never", null).text, "waiting for a robot");
});

test("that there is no alarm, only a bridge that lives can say", () => {
  const model = page(ROBOT);
  for (const [bridge, isLate, severity] of [["fresh", false, "ok"], ["fresh", true, "never"], ["stale", false, "never"], ["gone", false, "never"], ["never", false, "never"]]) {
    const said = words.alarm(model, /** @type {any} */ (bridge), /** @type {any} */ (isLate), 0);
    assert.equal(said.severity, severity, `${bridge} ${isLate}`);
    assert.equal(said.word, severity === "ok" ? "● No alarm" : "– Alarms unknown");
  }
  assert.equal(words.alarm(page(), "never", false, 0).severity, "never");
  assert.equal(words.alarm(page({ ...ROBOT, alarms: [ALARM] }), "stale", true, 0).severity, "alarm", "one that lasted is still shown");
  const line = { robot: 1, severity: "ok", text: "", flying: null, battery_v: null, link: "never" };
  assert.equal(words.robotMark(/** @type {any} */ (line)), "–");
  assert.equal(words.robotMark(/** @type {any} */ ({ ...line, link: "fresh" })), "●");
  assert.equal(words.robotMark(/** @type {any} */ ({ ...line, severity: "alarm" })), "■");
});

test("home is as far as both places say, and unknown without one of them", () => {
  assert.equal(words.home(page(ROBOT, CHART, NOW)), "89 m E");
  assert.equal(words.home(page(ROBOT, NOW)), "–");
  assert.equal(words.home(page(CHART, { ...NOW, position: null })), "–");
  assert.equal(words.home(page({ ...CHART, home: [37, -6, 10] }, NOW)), "0 m");
});

test("what is said about command follows what was asked and answered", () => {
  const model = page(LEASE);
  const said = () => words.lease(1, model.lease, model.wasKept);
  assert.equal(said().button, "Ask for command");
  model.take({ ...LEASE, asked: true, asks: true }, 0);
  assert.match(said().text, /^Asked\. Without an answer/);
  assert.equal(said().button, null);
  model.take(LEASE, 0);
  assert.match(said().text, /keeps command/, "an answer ends the words about waiting");
  assert.equal(said().button, "Ask again");
  model.take({ ...LEASE, asked: true }, 0);
  assert.match(said().text, /third one asks/);
  model.take({ ...LEASE, asked: true, asks: true }, 0);
  model.take({ ...LEASE, holder: "you" }, 0);
  assert.deepEqual(said(), { text: "", button: null, severity: null });
  model.take({ ...LEASE, holder: "none" }, 0);
  assert.equal(said().button, "Take command");
  assert.equal(words.lease(1, null, false).button, "Take command");
});

test("a page that commanded says why it does no more, and one that never did only watches", () => {
  assert.equal(words.rights(page()), "command");
  assert.equal(words.rights(page({ ...HELLO, instance: "2", role: "watch" })), "lost");
  const watch = /** @type {any} */ (new Model());
  watch.take({ ...HELLO, role: "watch" }, 0);
  assert.equal(words.rights(watch), "watch");
  watch.hadCommand = true;
  assert.equal(words.rights(watch), "lost", "also after it was loaded again");
  assert.match(words.RIGHTS.lost, /ril view/);
  assert.equal(words.rights(page({ ...HELLO, instance: "2", replay: { file: "x", duration_s: 1, start_unix_ms: null, phases: [], events: [] } })), "replay");
});

test("a server that was started again: the order under way is unknown, command is taken again, and the flight goes on", () => {
  const model = page(ROBOT, { ...LEASE, holder: "you" });
  model.take(NOW, 0);
  model.orders.give("land", 1, { order: "aa", live: true, seen: 1, at: 0 });
  assert.equal(model.takesAgain(), false);
  model.take({ ...HELLO, instance: "2" }, 3000);
  assert.equal(model.orders.entries[0].stage, "unknown");
  model.take({ ...LEASE, holder: "none" }, 3000);
  assert.equal(model.takesAgain(), true);
  assert.equal(model.takesAgain(), false, "once");
  model.take({ ...ROBOT, flown_s: null }, 4000);
  assert.equal(model.flownS(4000), 64, "this page has seen the take-off");
  model.take({ ...NOW, flying: false }, 5000);
  assert.equal(model.flownS(5000), null);

  const other = page(ROBOT, { ...LEASE, holder: "you" });
  other.take({ ...HELLO, instance: "2" }, 3000);
  other.take(LEASE, 3000);
  other.take({ ...LEASE, holder: "none" }, 9000);
  assert.equal(other.takesAgain(), false, "another page has had it since");

  const late = page({ ...ROBOT }, NOW);
  late.take({ ...HELLO, instance: "2" }, 60000);
  late.take({ ...ROBOT, flown_s: null }, 61000);
  assert.equal(late.flownS(61000), null, "it may have landed meanwhile");
});

test("without contact an order that goes on is unknown at once, and goes on when nothing was missed", () => {
  const book = new OrderBook();
  book.give("land", 1, { order: "aa", live: true, seen: 1, at: 0 });
  book.report(/** @type {any} */ ({ order: "bb", robot: 1, kind: "goto", stage: "in-progress", text: "30 m", final: false }), 0);
  book.report(/** @type {any} */ ({ order: "cc", robot: 1, kind: "hold", stage: "done", text: "", final: true }), 0);
  const stages = () => Object.fromEntries(book.entries.map(({ order, stage }) => [order, stage]));
  book.doubt();
  assert.deepEqual(stages(), { aa: "unknown", bb: "unknown", cc: "done" });
  assert.equal(book.shown(90000).length, 2, "they stay until something is known");
  book.doubt();
  book.trust();
  assert.deepEqual(stages(), { aa: "given", bb: "in-progress", cc: "done" });
  book.doubt();
  book.report(/** @type {any} */ ({ order: "aa", robot: 1, kind: "land", stage: "accepted", text: "", final: false }), 10);
  assert.equal(stages().aa, "accepted", "a report is news");
  book.unheard("the connection was lost", 20);
  book.trust();
  assert.deepEqual(stages(), { aa: "unknown", bb: "unknown", cc: "done" });
});

test("an alarm sounds once, when it begins, and so does that of a neighbour", () => {
  const bell = new words.Bell();
  const model = page(ROBOT);
  assert.equal(bell.ring(model), null);
  model.robot.alarms = [ALARM];
  assert.equal(bell.ring(model), "alarm");
  assert.equal(bell.ring(model), null);
  model.robot.alarms = [ALARM, { ...ALARM, id: "battery", severity: "warning" }];
  assert.equal(bell.ring(model), "warning");
  model.robots = [{ robot: 2, severity: "alarm" }, { robot: 1, severity: "alarm" }];
  assert.equal(bell.ring(model), "alarm");
  model.robot.alarms = [];
  assert.equal(bell.ring(model), null);
  model.robot.alarms = [ALARM];
  assert.equal(bell.ring(model), "alarm", "it has begun again");
});

test("a track is broken where no flight was seen: after a pause, and where it jumped", () => {
  const history = new History();
  const move = (t, lat, freshness = "fresh") => history.add(t, /** @type {any} */ ({ ...NOW, position: [lat, -6], telemetry: { freshness, age_ms: 40 } }));
  move(0, 37);
  move(1, 37.0001);
  move(2, 37.0002);
  move(3, 37.0003, "stale");
  move(9, 37.001);
  move(10, 37.0011);
  move(10.5, 37.1);
  assert.deepEqual(history.track.map((at) => at?.[0] ?? null), [37, 37.0001, 37.0002, null, 37.001, 37.0011, null, 37.1]);
  for (let t = 0; t < 100; t++) move(11 + t, 37.1);
  assert.equal(history.track.length, 8, "a robot that hovers has no pauses");
  assert.equal(history.lastPlace()?.[0], 37.1);
  const whole = pieces([[37, -6], [37.0001, -6], [37.0002, -6], [37.1, -6]], [0, 1, 60, 61], [[2, 59]]);
  assert.deepEqual(whole.map((at) => at?.[0] ?? null), [37, 37.0001, null, 37.0002, null, 37.1]);
});

test("a step goes on from where the last one led, however late the server's answer is", () => {
  const sought = new Sought();
  assert.equal(sought.shown(10, 0, 1), 10);
  sought.seek(11, 0);
  assert.equal(sought.shown(10, 50, 1), 11.05);
  sought.seek(sought.shown(10, 50, 0) + 1, 50);
  assert.equal(sought.shown(10, 60, 0), 12);
  sought.heard(10.2, 100, 0);
  assert.equal(sought.shown(10.2, 100, 0), 12, "a message of before the seek moves nothing");
  sought.heard(12, 200, 0);
  assert.equal(sought.shown(12.5, 300, 0), 12.5);
  sought.seek(30, 400);
  assert.equal(sought.shown(12, 2000, 0), 12, "a seek that the server has not taken is over");
});

test("the time of the last message is that of the server's clock", () => {
  const model = page(ROBOT, NOW);
  assert.equal(model.heardUnixMs, null);
  model.take({ type: "beat", sent_ms: 1000, unix_ms: 1800000001000 }, 0);
  model.take({ ...NOW, sent_ms: 1500 }, 0);
  assert.equal(model.heardUnixMs, 1800000001500);
  model.take({ type: "beat", sent_ms: 2000, unix_ms: null }, 0);
  assert.equal(model.heardUnixMs, null);
});

test("without script the page says that it needs it", () => {
  const html = readFileSync(new URL("../index.html", import.meta.url), "utf8");
  const [, said] = html.match(/<noscript>([^]*?)<\/noscript>/) ?? [];
  assert.match(said ?? "", /JavaScript/);
  assert.ok(html.indexOf('id="cover"') < html.indexOf("<noscript>"), "above what covers the page");
});
