// What the page costs: its share of a slow processor, and its memory over hours. It prints figures, which docs/view.md has.

import assert from "node:assert/strict";
import { after, test } from "node:test";
import { WAIT_MS, closeBrowser, live, scenario, skipped, theBrowser } from "./harness.mjs";
import { StandIn } from "./stand-in.mjs";

const PHONE = { viewport: { width: 360, height: 740 }, hasTouch: true, isMobile: true, deviceScaleFactor: 2 };
const WIDE = { viewport: { width: 1920, height: 1080 } };
/** How much slower than this machine the processor is made. */
const SLOWER = 4;
const MEASURED_MS = 10000;

after(closeBrowser);

/** Numbers that the browser counts. */
async function counted(cdp) {
  const { metrics } = await cdp.send("Performance.getMetrics");
  return Object.fromEntries(metrics.map(({ name, value }) => [name, value]));
}

for (const [name, context] of [["a phone of 360 px", PHONE], ["a screen of 1920 px", WIDE]]) {
  scenario(`the share of a processor that is four times slower, on ${name}`, { needs: "stand-in", context, server: { start_s: 600, robots: [1, 2, 3] } }, async ({ page, context, t }) => {
    await live(page);
    const cdp = await context.newCDPSession(page);
    // Time that the thread had a processor, so that other programs of the machine change little.
    await cdp.send("Performance.enable", { timeDomain: "threadTicks" });
    await cdp.send("Emulation.setCPUThrottlingRate", { rate: SLOWER });
    await page.waitForTimeout(3000);
    const [began, before] = [performance.now(), await counted(cdp)];
    await page.waitForTimeout(MEASURED_MS);
    const [ended, after] = [performance.now(), await counted(cdp)];
    const share = (what) => `${((100 * 1000 * (after[what] - before[what])) / (ended - began)).toFixed(1)} %`;
    t.diagnostic(`${name}: script ${share("ScriptDuration")}, layout ${share("LayoutDuration")}, style ${share("RecalcStyleDuration")}, all of the page's thread ${share("TaskDuration")}`);
  });
}

/** Replaces the page's clocks, timers, frames and its WebSocket: time goes on as fast as the page draws. Runs in the page before its own scripts. */
function makeVirtual() {
  let now = 0;
  const began = Date.now();
  const timers = new Map();
  let frames = [];
  let ids = 0;
  const later = setTimeout.bind(window);
  const add = (then, ms, every) => {
    timers.set(++ids, { then, at: now + ms, every });
    return ids;
  };
  performance.now = () => now;
  Date.now = () => began + now;
  window.setTimeout = (then, ms = 0) => add(then, ms, 0);
  window.setInterval = (then, ms) => add(then, ms, ms);
  window.clearTimeout = window.clearInterval = (id) => timers.delete(id);
  window.requestAnimationFrame = (then) => {
    frames.push(then);
    return ++ids;
  };
  window.cancelAnimationFrame = () => {};
  let socket = null;
  window.WebSocket = class {
    readyState = 0;
    bufferedAmount = 0;
    constructor() {
      socket = this;
      add(() => {
        this.readyState = 1;
        this.onopen();
      }, 0, 0);
    }
    send(text) {
      const message = JSON.parse(text);
      if (message.type === "ping") add(() => say({ type: "pong", id: message.id, sent_ms: now }), 0, 0);
    }
    close() {}
  };
  const say = (message) => socket.onmessage({ data: JSON.stringify(message) });
  const severities = ["note", "order", "warning", "alarm"];
  let n = 0;
  const values = (t) => {
    const angle = t / 25;
    say({
      type: "now", robot: 1, n: ++n, sent_ms: now, telemetry: { freshness: "fresh", age_ms: 20 }, bridge: { freshness: "fresh", age_ms: 60 },
      position: [37.4112 + 0.0009 * Math.sin(angle), -6.001 + 0.001 * Math.cos(angle)], altitude_m: 35 + 6 * Math.sin(t / 9), height_m: 25 + 6 * Math.sin(t / 9),
      attitude: { roll_deg: 6 * Math.sin(t / 2), pitch_deg: -4, yaw_deg: (angle * 57.3) % 360 }, ground_speed_mps: 4 + Math.sin(t), climb_mps: Math.cos(t / 9), course_deg: (angle * 57.3) % 360,
      battery_v: 25 - (t % 1200) * 0.003, fuel_percent: 80, fix: "RTK fixed", flying: true, left_out: 0,
    });
  };
  const words = (t) => {
    const alarms = t % 60 < 20 ? [{ id: "gps", severity: "warning", text: `the GPS lost its fix at ${t} s`, next_step: "look at the sky", since_s: t % 60 }] : [];
    const phase = t % 120 < 60 ? "hovering" : "flying the path";
    say({ type: "robots", robots: [1, 2, 3].map((robot) => ({ robot, severity: robot === 1 && alarms.length ? "warning" : "ok", text: `${phase} ${t}`, flying: true, battery_v: 24, link: "fresh" })) });
    say({
      type: "robot", robot: 1, phase, activity: `${phase} since ${t % 60} s`, module: "running", blocked: false, link: { text: "up", state: "up", age_s: 0.1 }, switch: "auto", commander: { text: `process ${t}` },
      control: { exclusive: false, holder: null }, alarms, movement: { text: "path", waypoints_total: 5, waypoints_reached: t % 5, distance_to_go_m: 50 - (t % 50), time_to_go_s: 10 }, replayed: false, relayed: false,
    });
    if (t % 6 === 0) say({ type: "event", robot: 1, at_unix_ms: began + now, severity: severities[(t / 6) % 4], text: `something happened at ${t} s` });
    if (t % 30 === 0) say({ type: "order", order: `n${t}`, robot: 1, kind: "hold", stage: "done", text: "hovers where it is", final: true });
    if (t % 10 === 0) say({ type: "chart", robot: 1, source: "bridge", number: t, fence: [], floor_m: 0, ceiling_m: 60, path: [[37.411, -6.001, 30], [37.412, -6.002, 30]], home: [37.4112, -6.001, 10] });
  };
  const pass = (ms) => {
    now += ms;
    for (const [id, timer] of [...timers]) {
      if (timer.at > now || !timers.has(id)) continue;
      if (timer.every > 0) timer.at += timer.every;
      else timers.delete(id);
      timer.then();
    }
    const due = frames;
    frames = [];
    for (const frame of due) frame(now);
  };
  /** So many seconds, with so many values in each. The browser has its own time in between, for what it collects and lays out. */
  window.fly = async (seconds, rate) => {
    if (n === 0) {
      pass(1);
      say({ type: "hello", protocol: "hero.view.v1", build: "b", instance: "i", role: "command", robots: [1, 2, 3], replay: null, report: false, tiles: null, stale_after_ms: 1500 });
      say({ type: "lease", robot: 1, holder: "you", asked: false, expires_ms: 10000 });
    }
    for (let second = 0; second < seconds; second += 1) {
      words(Math.round(now / 1000));
      for (let i = 0; i < rate; i += 1) {
        values(now / 1000);
        pass(1000 / rate);
      }
      if (second % 20 === 0) await new Promise((done) => later(done, 0));
    }
    return { live: document.getElementById("cover").hidden, events: document.querySelectorAll("#log li").length };
  };
}

const HOURS = 8;
/** A track and a list of events are full by then. */
const FULL_S = 1800;
/** As many as the plots keep; more are drawn and forgotten. */
const RATE = 5;
const GROWTH_BYTES = 5e6;

test("eight hours of telemetry leave the page as large as the first half hour", { skip: skipped({}), timeout: 1800000 }, async (t) => {
  const server = await new StandIn().start();
  const context = await (await theBrowser()).newContext(WIDE);
  try {
    const page = await context.newPage();
    await page.addInitScript(makeVirtual);
    await page.goto(server.url);
    await page.waitForFunction(() => document.body.hasAttribute("data-ready"), null, { timeout: WAIT_MS, polling: 100 });
    const cdp = await context.newCDPSession(page);
    await cdp.send("Performance.enable");
    const size = async () => {
      await cdp.send("HeapProfiler.collectGarbage");
      const { JSHeapUsedSize: heap, Nodes: nodes, JSEventListeners: listeners } = await counted(cdp);
      return { heap, nodes, listeners };
    };
    const began = performance.now();
    assert.deepEqual(await page.evaluate(([s, rate]) => window.fly(s, rate), [FULL_S, RATE]), { live: true, events: 300 });
    const full = await size();
    const left = HOURS * 3600 - FULL_S;
    const parts = 15;
    for (let part = 0; part < parts; part += 1) await page.evaluate(([s, rate]) => window.fly(s, rate), [left / parts, RATE]);
    const last = await size();
    t.diagnostic(`after ${FULL_S} s ${JSON.stringify(full)}, after ${HOURS} h ${JSON.stringify(last)}, in ${((performance.now() - began) / 1000).toFixed(0)} s`);
    assert.ok(last.heap - full.heap < GROWTH_BYTES, `${last.heap - full.heap} bytes more`);
    assert.ok(last.nodes <= full.nodes + 50, `${last.nodes - full.nodes} nodes more`);
    assert.ok(last.listeners <= full.listeners + 10, `${last.listeners - full.listeners} listeners more`);
  } finally {
    await context.close();
    await server.stop();
  }
});
