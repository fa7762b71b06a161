// The page's pure modules: node --test gateways/view/page/test/

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { Ages } from "../ages.js";
import { Contact } from "../contact.js";
import * as format from "../format.js";
import * as geo from "../geo.js";
import { History } from "../history.js";
import { Link, pause } from "../link.js";
import { Model } from "../model.js";
import { OrderBook, severityOf } from "../orders.js";
import { timeLabel, timeTicks, tint } from "../plot.js";
import { parse } from "../protocol.js";
import { eventFrom } from "../replay.js";
import { extent, lineAt } from "../report/figures.js";

test("what is no message is dropped", () => {
  for (const text of ["", "{", "null", "7", "[]", '{"type":7}', "{}", undefined, new ArrayBuffer(3)]) assert.equal(parse(text), null);
  assert.deepEqual(parse('{"type":"beat","sent_ms":1}'), { type: "beat", sent_ms: 1 });
});

test("an age is never too small, however the clocks and the ways differ", () => {
  // The server's clock is 5 s behind; the way to the page takes 30 ms, the way to the server 10 ms.
  const [offset, there, back] = [5000, 10, 30];
  const ages = new Ages();
  assert.equal(ages.of(40, 0, 9999), Infinity, "nothing is known before the first answer");
  ages.opened(10000);
  ages.arrived(10000 + there - offset + 100);
  const sent = 20000;
  const first = ages.of(40, sent - offset, sent + back);
  assert.ok(first >= 40 + back && first <= 40 + back + there + 100, String(first));
  ages.pinged("a", 15000);
  ages.ponged("a", 15000 + there - offset, 15000 + there + back);
  assert.equal(ages.roundTripMs, there + back);
  assert.equal(ages.of(40, sent - offset, sent + back), 40 + back + there);
  assert.equal(ages.of(40, sent - offset, sent + back + 700), 40 + back + there + 700, "it grows while nothing comes");
  assert.equal(ages.of(40, sent - offset, sent + 3000), 40 + 3000 + there, "a message that was late on its way is old");
  assert.equal(ages.of(null, sent, sent), null);
});

test("a round trip is forgotten with its connection, and after a minute of others", () => {
  const ages = new Ages();
  ages.opened(0);
  ages.arrived(0);
  for (let i = 1; i <= 60; i++) {
    ages.pinged(String(i), i * 1000);
    // The server's clock is slow.
    ages.ponged(String(i), i * 1000 * 0.999, i * 1000 + 1);
  }
  assert.ok(ages.since(60000 * 0.999, 60000) < 60);
  ages.opened(0);
  assert.equal(ages.since(0, 5), Infinity);
  ages.ponged("1", 0, 1);
  assert.equal(ages.since(0, 5), Infinity, "an answer to another connection's ping says nothing");
});

test("after a gap of the page's clock nothing is known of an age until a ping is answered", () => {
  const ages = new Ages();
  ages.opened(1000);
  ages.arrived(1000);
  // The page's clock stood still for 8 s of the server's.
  ages.gap();
  assert.equal(ages.since(9000, 2000), Infinity, "the bound of before would call it new");
  ages.pinged("a", 2000);
  ages.ponged("a", 10000, 2010);
  assert.equal(ages.since(9000, 5010), 4010);
});

test("no contact after the stated silence", () => {
  const contact = new Contact();
  assert.equal(contact.state(0), "connecting");
  contact.message(1000);
  contact.drawn();
  assert.equal(contact.state(2500), "live");
  assert.equal(contact.state(2501), "lost");
  assert.equal(contact.silence(4000), 3000);
  contact.message(4001);
  assert.equal(contact.state(4002), "live");
});

test("no contact when the server does not hear the page, though its messages come", () => {
  const contact = new Contact();
  contact.opened();
  const beat = (/** @type {number} */ at) => {
    contact.message(at);
    contact.drawn();
    return contact.state(at);
  };
  contact.pinged("1", 0);
  contact.ponged("1");
  contact.pinged("2", 1000);
  contact.pinged("3", 2000);
  assert.equal(beat(2500), "live");
  assert.equal(beat(2501), "lost");
  assert.equal(contact.isLive(2501), false);
  assert.equal(contact.silence(4000), 3000);
  contact.ponged("2");
  assert.equal(beat(3500), "live");
  contact.ponged("3");
  for (let i = 0; i < 100; i++) contact.pinged(String(4 + i), 4000 + i);
  assert.equal(beat(5501), "lost", "the oldest counts, however many there are");
  contact.ponged("103");
  assert.equal(beat(5501), "live");
  contact.pinged("104", 5600);
  contact.opened();
  assert.equal(beat(9000), "live", "a ping of another connection is not waited for");
});

test("after a gap of its own clock the page stays covered until what comes next is drawn", () => {
  const contact = new Contact();
  contact.message(0);
  assert.equal(contact.tick(0, 0), false, "the first tick is none");
  assert.equal(contact.tick(300, 300), false);
  assert.equal(contact.tick(5000, 5000), true, "the page was frozen");
  assert.equal(contact.tick(5250, 9e6), true, "the machine slept, and the page's clock with it");
  contact.wake(null);
  contact.message(5300);
  assert.equal(contact.state(5300), "waking");
  assert.equal(contact.isLive(5300), false);
  contact.drawn();
  assert.equal(contact.state(5300), "live");
});

test("what was queued while the page slept does not uncover it", () => {
  const contact = new Contact();
  contact.opened();
  contact.message(0);
  contact.wake("2");
  contact.message(1);
  contact.drawn();
  assert.equal(contact.state(1), "waking", "that was drawn, but it came before the answer");
  contact.ponged("2");
  contact.drawn();
  assert.equal(contact.state(1), "live");
  contact.refusal = "no token";
  assert.equal(contact.state(1), "refused");
});

test("metres and degrees", () => {
  const home = /** @type {[number, number]} */ ([37.4112, -6.001]);
  const [east, north] = geo.metres(home, geo.place(home, 120, -45));
  assert.ok(Math.abs(east - 120) < 0.01 && Math.abs(north + 45) < 0.01);
  assert.ok(Math.abs(geo.distance([0, 179.999], [0, -179.999]) - 222.6) < 0.2, "over the date line");
  assert.equal(Math.round(geo.bearing(home, geo.place(home, 10, 10))), 45);
  for (const [degrees, name] of [[0, "north"], [359, "north"], [91, "east"], [-90, "west"], [225, "south-west"]]) assert.equal(geo.point(Number(degrees)), name);
  for (const [scale, step] of [[1, 100], [0.1, 10], [0.05, 5], [0.02, 2], [0, 1], [NaN, 1]]) assert.equal(geo.gridStep(scale, 56), step);
});

test("numbers as people type them", () => {
  const cases = [["12", 12], [" -6,5 ", -6.5], ["−6.5", -6.5], ["+3.", 3], [".5", 0.5], ["", null], ["1e5", null], ["12m", null], ["91", null], ["--1", null], ["0x1", null]];
  for (const [text, value] of cases) assert.equal(geo.typedNumber(String(text), -90, 90), value, String(text));
});

test("numbers as they are shown", () => {
  assert.equal(format.number(null, 1), "–");
  assert.equal(format.number(NaN, 1), "–");
  assert.equal(format.number(-0.04, 1), "0.0");
  assert.equal(format.number(-1.25, 1), "−1.3");
  assert.equal(format.signed(0.3, 1), "+0.3");
  assert.equal(format.signed(-0.3, 1), "−0.3");
  assert.equal(format.signed(0.01, 1), "0.0");
  assert.equal(format.direction(-1), "359°");
  assert.equal(format.direction(359.7), "000°");
  assert.equal(format.direction(null), "–");
  const ages = [[0, "0.0 s"], [41, "0.1 s"], [1500, "1.5 s"], [1501, "1.6 s"], [10001, "11 s"], [125000, "2 min 05 s"], [7200000, "2 h 00 min"], [null, "–"]];
  for (const [ms, text] of ages) assert.equal(format.age(/** @type {any} */ (ms)), text);
  assert.equal(format.position(65), "1:05");
  assert.equal(format.position(3725), "1:02:05");
  assert.equal(format.metres(999.4), "999 m");
  assert.equal(format.metres(1625), "1.63 km");
  assert.equal(format.clock(0), "00:00:00Z");
  assert.equal(format.clock(1e300), "–");
});

const NOW = { type: "now", robot: 1, n: 1, sent_ms: 0, telemetry: { freshness: "fresh", age_ms: 40 }, bridge: { freshness: "fresh", age_ms: 40 }, position: [37, -6], altitude_m: 10, height_m: 0, attitude: null, ground_speed_mps: 0, climb_mps: 0, course_deg: null, battery_v: 24, fuel_percent: null, fix: null, flying: false, left_out: 0 };

test("ten minutes at five a second, and a gap where nothing was known", () => {
  const history = new History();
  for (let t = 0; t < 700; t += 0.05) history.add(t, /** @type {any} */ (NOW));
  const [times, altitudes] = history.columns;
  assert.ok(times.length > 2900 && times.length <= 3100, String(times.length));
  assert.ok(times[0] > 85);
  assert.equal(history.track.length, 1, "it stood still");
  history.add(705, /** @type {any} */ ({ ...NOW, telemetry: { freshness: "stale", age_ms: 3000 }, position: [38, -6] }));
  assert.deepEqual(altitudes.slice(-2), [null, null], "one for the pause, one for the old value");
  assert.equal(history.track.length, 1, "an old place is no track");
  assert.ok(times.every((t, i) => i === 0 || t > times[i - 1]));
});

test("the past replaces all, and phases go on", () => {
  const history = new History();
  history.add(90, /** @type {any} */ (NOW));
  const past = { type: "past", robot: 1, track: [[37, -6], [37.1, -6]], t_s: [-2, -1], altitude_m: [1, null], ground_speed_mps: [0, 1], battery_v: [24, 24], phases: [{ from_s: -2, to_s: -1.5, text: "on the ground" }, { from_s: -1.5, to_s: 0, text: "taking off" }], events: [] };
  history.replace(/** @type {any} */ (past), 100);
  assert.deepEqual(history.columns, [[98, 99], [1, null], [0, 1], [24, 24]]);
  history.phase(100, "taking off");
  history.phase(103, "hovering");
  assert.deepEqual(history.phases.map(({ from, to }) => [from, to]), [[98, 98.5], [98.5, 103], [103, null]]);
});

test("an order is sent at once or never, and a double click sends one", () => {
  const book = new OrderBook();
  const live = { live: true, seen: 7 };
  assert.deepEqual(book.give("hold", 1, { order: "aa", at: 0, ...live }), { type: "order", order: "aa", robot: 1, kind: "hold", seen: 7, position: null, altitude_m: null, confirm: null });
  assert.equal(book.give("hold", 1, { order: "bb", at: 300, ...live }), null);
  assert.equal(book.entries.length, 1);
  assert.ok(book.give("hold", 2, { order: "cc", at: 300, ...live }), "another robot is another order");
  assert.ok(book.give("hold", 1, { order: "dd", at: 1000, ...live }), "a second press that is meant");
  assert.equal(book.give("land", 1, { order: "ee", at: 2000, live: false, seen: 7 }), null);
  assert.equal(book.entries[0].stage, "not-sent");
  assert.ok(book.give("land", 1, { order: "ff", at: 2100, ...live }), "what was not sent can be given again");
  book.report(/** @type {any} */ ({ order: "gg", robot: 3, kind: "hold", stage: "sent", text: "", final: false }), 3000);
  assert.ok(book.give("hold", 3, { order: "hh", at: 3010, ...live }), "another page's order makes no press of this one a double click");
});

test("reports follow their order to its end", () => {
  const book = new OrderBook();
  const report = (/** @type {any} */ stage, /** @type {boolean} */ final) => /** @type {any} */ ({ type: "order", order: "aa", robot: 1, kind: "land", stage, text: "", final });
  book.give("land", 1, { order: "aa", live: true, seen: null, at: 0 });
  book.report(report("accepted", false), 10);
  assert.equal(book.entries[0].stage, "accepted");
  book.report(report("done", true), 20);
  book.report(report("accepted", false), 30);
  assert.equal(book.entries[0].stage, "done", "an echo changes nothing");
  assert.equal(book.shown(10000).length, 1);
  assert.equal(book.shown(10020).length, 0);
  book.report({ ...report("in-progress", false), order: "zz" }, 40);
  assert.equal(book.entries[0].order, "zz", "an order of before the reload");
  book.unheard("the server was started again", 50);
  assert.equal(book.entries[0].stage, "unknown");
  assert.equal(book.entries[1].stage, "done", "what has ended stays so");
  book.report({ ...report("done", true), order: "zz" }, 60);
  assert.equal(book.entries[0].stage, "done", "what became of it was told after all");
  assert.equal(severityOf("refused"), "alarm");
  for (let i = 0; i < 100; i++) book.report({ ...report("sent", false), order: `n${i}` }, 60);
  assert.equal(book.entries.length, 20);
});

const HELLO = { type: "hello", protocol: "hero.view.v1", build: "b", instance: "1", role: "command", robots: [1, 2], replay: null, report: false, tiles: null, stale_after_ms: 1500 };

test("the first robot is chosen, and what is about another one is dropped", () => {
  const model = new Model();
  assert.deepEqual(model.take(NOW, 0), []);
  assert.ok(model.take(HELLO, 0).includes("choose"));
  assert.equal(model.chosen, 1);
  assert.deepEqual(model.take({ ...NOW, robot: 2 }, 0), []);
  assert.deepEqual(model.take(NOW, 0), ["now"]);
  assert.deepEqual(model.take({ type: "new-of-a-later-version", robot: 1 }, 0), []);
});

test("another instance replaces everything, another build reloads", () => {
  const model = new Model();
  model.take(HELLO, 0);
  model.take(NOW, 0);
  model.take({ type: "event", robot: 1, at_unix_ms: 0, severity: "note", text: "x" }, 0);
  model.orders.give("hold", 1, { order: "aa", live: true, seen: 1, at: 0 });
  assert.ok(!model.take(HELLO, 5).includes("choose"));
  assert.ok(model.now, "the same instance keeps what is known");
  assert.equal(model.orders.entries[0].stage, "unknown", "whether it has reached the server, its reports will say");
  model.orders.report({ type: "order", order: "aa", robot: 1, kind: "hold", stage: "in-progress", text: "", final: false }, 5);
  assert.equal(model.orders.entries[0].stage, "in-progress");
  model.take({ ...HELLO, instance: "2" }, 5);
  assert.equal(model.now, null);
  assert.deepEqual(model.events, []);
  assert.equal(model.orders.entries[0].stage, "unknown");
  assert.deepEqual(model.take({ ...HELLO, instance: "2", build: "c" }, 6), ["reload"]);
});

test("values are as fresh as the server says, and never fresher than their message", () => {
  const model = new Model();
  assert.equal(model.freshness("telemetry", 0, Infinity), "never");
  model.take(HELLO, 0);
  model.take(NOW, 1000);
  assert.equal(model.freshness("telemetry", 1100, 100), "fresh");
  assert.equal(model.freshness("telemetry", 2600, 100), "stale", "beats alone do not keep it fresh");
  assert.equal(model.freshness("telemetry", 1100, 1600), "stale", "it was long on its way");
  assert.equal(model.freshness("bridge", 1100, 100), "fresh");
  assert.equal(model.freshness("bridge", 2600, 100), "stale");
  model.take({ ...NOW, telemetry: { freshness: "gone", age_ms: 9000 } }, 3000);
  assert.equal(model.freshness("telemetry", 3000, 0), "gone");
});

test("a replay has the time of the recording", () => {
  const model = new Model();
  model.take({ ...HELLO, replay: { file: "x", duration_s: 60, start_unix_ms: null, phases: [], events: [] } }, 0);
  model.take({ type: "replay", position_s: 10, playing: true, speed: 2 }, 1000);
  assert.equal(model.time(3000), 14);
  assert.equal(model.time(99000), 60);
  model.take({ type: "replay", position_s: 20, playing: false, speed: 2 }, 4000);
  assert.equal(model.time(9000), 20);
  model.take(NOW, 4000);
  assert.equal(model.freshness("telemetry", 60000, Infinity), "fresh", "a paused replay is not stale");
});

test("from event to event, over the one that has just passed", () => {
  const events = [3, 10, 10.2, 40].map((at_s) => ({ at_s }));
  assert.equal(eventFrom(events, 0, 1), 3);
  assert.equal(eventFrom(events, 9.6, 1), 10.2);
  assert.equal(eventFrom(events, 10.8, -1), 3);
  assert.equal(eventFrom(events, 40, 1), null);
  assert.equal(eventFrom(events, 3, -1), null);
  assert.equal(eventFrom([], 3, 1), null);
});

/** A connection whose time and sockets are made here. */
function fakeLink() {
  const made = [];
  const timers = [];
  const log = [];
  const clock = { now: 0 };
  const link = new Link("ws://x/", { opened: () => log.push("opened"), message: (text) => log.push(text), closed: () => log.push("closed") }, {
    now: () => clock.now,
    connect: () => {
      const socket = { readyState: 0, bufferedAmount: 0, sent: [], send: (/** @type {string} */ text) => socket.sent.push(text), close: () => (socket.readyState = 3) };
      made.push(socket);
      return /** @type {any} */ (socket);
    },
    after: (ms, then) => timers.push({ ms, then }),
    cancel: () => {},
    chance: () => 1,
  });
  return { link, made, timers, log, clock };
}

test("a lost connection is made again after growing pauses", () => {
  const { link, made, timers, log } = fakeLink();
  link.start();
  for (let i = 0; i < 6; i++) {
    made.at(-1).onclose();
    timers.at(-1).then();
  }
  assert.deepEqual(timers.map(({ ms }) => ms), [500, 1000, 2000, 3500, 5000, 5000]);
  assert.equal(made.length, 7);
  link.settled();
  made.at(-1).onclose();
  assert.equal(timers.at(-1).ms, 500);
  assert.equal(log.filter((entry) => entry === "closed").length, 7);
  assert.ok(pause(9, 0) >= 4000);
});

test("a message is sent now or never, and a silent connection is given up", () => {
  const { link, made, timers, log, clock } = fakeLink();
  link.start();
  const [socket] = made;
  assert.equal(link.send({ type: "seen" }), false);
  socket.readyState = 1;
  socket.onopen();
  assert.equal(link.send({ type: "seen" }), true);
  socket.bufferedAmount = 100000;
  assert.equal(link.send({ type: "seen" }), false, "nothing leaves the browser");
  clock.now = 10001;
  link.look();
  assert.equal(timers.length, 1);
  socket.onmessage({ data: "late" });
  assert.ok(!log.includes("late"), "a socket that was given up says nothing any more");
  link.stop();
  timers[0].then();
  assert.equal(made.length, 1, "a page that is hidden does not connect");
});

test("times and numbers of a report are as long as a person compares", () => {
  assert.deepEqual([0, 7.31, 59.94, 59.96, 65, 7205].map(format.moment), ["0.0 s", "7.3 s", "59.9 s", "1:00", "1:05", "2:00:05"]);
  assert.deepEqual([0, 0.123, 24.19, 1234.5, -0.004, null].map(format.compared), ["0", "0.12", "24.2", "1235", "\u22120.0040", "–"]);
});

test("ticks of time are those of a clock", () => {
  for (const [span, most, expected] of [
    [7, 8, "0.0 s 1.0 s 2.0 s 3.0 s 4.0 s 5.0 s 6.0 s 7.0 s"], [19.5, 5, "0 s 5 s 10 s 15 s"], [507, 6, "0:00 2:00 4:00 6:00 8:00"], [3600, 6, "0:00 10:00 20:00 30:00 40:00 50:00 1:00:00"],
  ]) assert.equal(timeTicks(span, most).map((at) => timeLabel(at, span)).join(" "), expected);
  assert.ok(timeTicks(1e9, 6).length <= 7);
});

test("the axis of a plot holds all that was measured, whatever was asked for", () => {
  const line = (kind, values) => ({ kind, values });
  const auto = { scale: { kind: "auto", least_span: 4 } };
  const [low, high] = extent(auto, [line("line", [10, null, 10.5]), line("dashes", [0, 99])]);
  assert.ok(low < 10 && high > 10.5 && high - low >= 4 && high < 20, `${low} ${high}`);
  assert.ok(extent(auto, [line("dashes", [0, 99])])[1] > 99, "what was asked for is shown where nothing was measured");
  assert.deepEqual(extent({ scale: { kind: "from-zero", least_top: 100 } }, [line("line", [3])]), [0, 108]);
  assert.deepEqual(extent({ scale: { kind: "from-zero", least_top: 1 } }, [{ kind: "bars", bars: [[0, 1, 50]] }]), [0, 54]);
  assert.deepEqual(extent({ scale: { kind: "logarithmic", least: 0.1 } }, [line("line", [800])]), [0.1, 1000]);
  assert.deepEqual(extent({ scale: { kind: "logarithmic", least: 0.1 } }, [line("line", [-5])]), [0.1, 1]);
  for (const value of [1e12, -1e12]) {
    const [from, to] = extent(auto, [line("line", [value, value])]);
    assert.ok(from < to);
  }
});

test("a value at the playhead is the last one before it, and none where the line is interrupted", () => {
  const [t, values] = [[1, 2, 2.001, 5], [10, 20, null, 30]];
  assert.deepEqual([0.5, 1, 1.9, 2, 3, 5, 5.5, 7].map((at) => lineAt(t, values, at)), [null, 10, 10, 20, null, 30, 30, null]);
  assert.equal(lineAt([], [], 0), null);
});

/** Contrast of two colours as WCAG 2 defines it. */
function contrast(one, other) {
  const linear = (part) => (part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4);
  const full = (colour) => (colour.length === 4 ? colour.replace(/[0-9a-f]/gi, "$&$&") : colour);
  const light = (colour) => [1, 3, 5].map((at) => linear(Number.parseInt(full(colour).slice(at, at + 2), 16) / 255)).reduce((sum, part, at) => sum + part * [0.2126, 0.7152, 0.0722][at], 0);
  const [a, b] = [light(one), light(other)];
  return (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
}

test("every line is seen on every background of every theme", () => {
  const css = readFileSync(new URL("../theme.css", import.meta.url), "utf8");
  const colours = (selector) => {
    const rules = css.slice(css.indexOf(`${selector} {`)).split("}")[0];
    return Object.fromEntries([...rules.matchAll(/--([\w-]+): (#[0-9a-f]{3,6});/gi)].map(([, name, colour]) => [name, colour]));
  };
  const light = colours(":root");
  for (const theme of [light, { ...light, ...colours(':root[data-theme="dark"]') }, { ...light, ...colours(':root[data-theme="sun"]') }]) {
    const backgrounds = ["panel", ...Object.keys(theme).filter((name) => name.startsWith("tint-"))];
    assert.equal(backgrounds.length, 7);
    for (const background of backgrounds) {
      for (const line of ["plot-1", "plot-2", "plot-3", "path", "alarm-ink", "warning-ink", "muted"]) assert.ok(contrast(theme[line], theme[background]) >= 3, `${line} on ${background}`);
      assert.ok(contrast(theme.text, theme[background]) >= 7, background);
    }
    for (const line of ["track", "path", "inside", "outside", "alarm-ink", "warning-ink"]) assert.ok(contrast(theme[line], theme.map) >= 3, `${line} on the map`);
  }
});

test("a phase has the tint of its kind", () => {
  const phases = ["on the ground", "taking off", "hovering", "landing", "stopping", "flying the path", "in the air"];
  assert.deepEqual(phases.map(tint), ["ground", "takeoff", "hover", "landing", "stopping", "path", "path"].map((kind) => `tint-${kind}`));
});
