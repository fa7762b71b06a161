// A flight in one file, opened from the disk as a user opens it: `ril log report` makes it of a log with faults, and of a recorded flight.
//   RIL_BINARY          the binary (target/debug/ril)
//   RIL_WRITE_PICTURES  writes the picture of the documentation anew

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, statSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before } from "node:test";
import { fileURLToPath, pathToFileURL } from "node:url";
import { WAIT_MS, attempted, closeBrowser, skipped, theBrowser } from "./harness.mjs";
import { picture } from "./picture.mjs";
import { HAS_RIL, RIL, Robot, freePort } from "./robot.mjs";

const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const PHONE = { viewport: { width: 360, height: 740 }, hasTouch: true, isMobile: true, deviceScaleFactor: 2 };
const WIDE = { viewport: { width: 1280, height: 900 } };
const PERIOD_MS = 20;
/** Ten minutes: thousands of samples, many for each column of a plot. */
const SAMPLES = 30000;
/** The one sample that stands out. */
const PEAK = { at: 12345, altitude: 400 };

const COLUMNS = ["flying", "sequence", "received_ns", "utc", "dsp_time_ms", "latitude_deg", "longitude_deg", "altitude_m", "gps_quality", "battery_mv", "fuel_percent", "auto_switch", "dsp_errors", "last_dsp_error_code"];

const skip = skipped({ ci: true }) || (HAS_RIL ? false : `no program at ${RIL}`);
const folder = mkdtempSync(join(tmpdir(), "hero-report-"));

/** A round flight: a gap of 4 s, lost samples, a fix that is lost, a pilot who takes over, and an altitude that jumps for one sample. */
function log() {
  const rows = [COLUMNS.join("\t")];
  for (let i = 0; i < SAMPLES; i += 1) {
    const ms = i * PERIOD_MS + (i > 20000 ? 4000 : 0);
    const flying = i > 1000 && i < 29000;
    const angle = (i / SAMPLES) * 2 * Math.PI;
    const altitude = i === PEAK.at ? PEAK.altitude : 10 + (flying ? 15 : 0) + Math.sin(i / 300);
    const utc = new Date(Date.UTC(2026, 10, 22, 10, 0, 0, ms)).toISOString().replace("Z", "000Z");
    rows.push([flying ? 1 : 0, i + 1 + (i > 8000 ? 3 : 0), (5000 + ms) * 1e6, utc, 100 + ms, 37.411 + 0.0008 * Math.sin(angle), -6.001 + 0.001 * (1 - Math.cos(angle)), altitude.toFixed(2),
      i > 24000 && i < 24500 ? 0 : 4, 25200 - Math.floor(i / 20), 90, i > 26000 ? 0 : 1, 0, 0].join("\t"));
  }
  return `${rows.join("\n")}\n`;
}

const FENCE = '[[fence.area]]\nname = "field <b>"\nkind = "inclusion"\npolygon = [[37.4098, -6.0015], [37.4122, -6.0015], [37.4122, -5.9982], [37.4098, -5.9982]]\n';
let file = "";

before(() => {
  if (skip) return;
  writeFileSync(join(folder, "hero(1)_22_11_26-10_00_00.tsv"), log());
  writeFileSync(join(folder, "bridge.toml"), FENCE);
  writeFileSync(join(folder, "plan.waypoints"), "QGC WPL 110\n1\t0\t3\t16\t0\t0\t0\t0\t37.4113\t-6.001\t18\t1\n2\t0\t3\t16\t0\t0\t0\t0\t37.4117\t-6.0003\t18\t1\n");
  execFileSync(RIL, ["log", "report", "hero(1)_22_11_26-10_00_00.tsv", "--output", "flight.html", "--plan", "plan.waypoints"], { cwd: folder });
  file = join(folder, "flight.html");
});

after(async () => {
  await closeBrowser();
  rmSync(folder, { recursive: true, force: true });
});

/** A test with the page open. It asks for nothing but its own file, and says nothing in the console. */
function shown(name, options, body) {
  attempted(name, { skip, timeout: 360000 }, async () => {
    const context = await (await theBrowser()).newContext(options);
    try {
      const page = await context.newPage();
      const problems = [];
      const own = pathToFileURL(file).href;
      // That pixels are read is this test's doing.
      page.on("console", (message) => !message.text().includes("willReadFrequently") && problems.push(`${message.type()}: ${message.text()}`));
      page.on("pageerror", (error) => problems.push(String(error.stack)));
      page.on("request", (request) => request.url().split("#")[0] !== own && request.url() !== "data:," && problems.push(`request for ${request.url()}`));
      await page.goto(own);
      await page.locator("body[data-ready]").waitFor({ timeout: WAIT_MS });
      await body(page, problems);
      assert.deepEqual(problems, []);
    } finally {
      await context.close();
    }
  });
}

const text = (page, selector) => page.locator(selector).innerText();

/** How many pixels of a colour, by the name of its variable, lie in a part of the canvas of a figure; shares of it from its left and top. */
const pixels = (page, figure, colour, [left, right], [top, bottom]) => page.evaluate(([figure, colour, left, right, top, bottom]) => {
  const canvas = document.querySelector(`${figure} canvas`);
  const probe = document.createElement("canvas").getContext("2d");
  probe.fillStyle = getComputedStyle(document.documentElement).getPropertyValue(colour);
  probe.fillRect(0, 0, 1, 1);
  const [red, green, blue] = probe.getImageData(0, 0, 1, 1).data;
  const [x, y] = [Math.floor(left * canvas.width), Math.floor(top * canvas.height)];
  const { data } = canvas.getContext("2d").getImageData(x, y, Math.ceil(right * canvas.width) - x, Math.ceil(bottom * canvas.height) - y);
  let found = 0;
  for (let at = 0; at < data.length; at += 4) found += Math.abs(data[at] - red) + Math.abs(data[at + 1] - green) + Math.abs(data[at + 2] - blue) < 30;
  return found;
}, [figure, colour, left, right, top, bottom]);

/** Where a time lies in a plot, as a share of the canvas. */
const share = (page, figure, seconds) => page.evaluate(([figure, seconds]) => {
  const over = document.querySelector(`${figure} .u-over`).getBoundingClientRect();
  const canvas = document.querySelector(`${figure} canvas`).getBoundingClientRect();
  const span = Number(document.getElementById("scrub").max);
  return (over.left - canvas.left + (seconds / span) * over.width) / canvas.width;
}, [figure, seconds]);

shown("the page has headings, alternatives and tables, of texts that stay texts", WIDE, async (page) => {
  const headings = await page.locator("h1, h2, h3").filter({ visible: true }).allInnerTexts();
  assert.deepEqual(headings, ["Flight of robot 1", "Summary", "Track", "Over time", "What it did", "Altitude in m", "Battery in V", "Fuel in %", "Link in 1/s", "Ages in ms", "Events", "Recording"]);
  assert.equal(await page.title(), "Flight of robot 1");
  const words = await page.locator("figure [role=img]").evaluateAll((all) => all.map((one) => one.getAttribute("aria-label")));
  assert.equal(words.length, 6);
  assert.match(words[0], /^States over time\. phase: on the ground from 0\.0 s, in the air from 20\.0 s/);
  assert.match(words[1], /GPS between 9\.0 and 400 m, 10\.0 at first/);
  assert.match(await text(page, "#map-words"), /m from west to east and \d+ m from south to north; plan of 2 waypoints; fence of 1 areas/);
  assert.match(await text(page, "#over-time"), /Nothing to draw: speed, main rotor\./);
  await page.locator("summary").click();
  assert.match(await text(page, "#over-time table"), /Altitude: GPS\s+m\s+9\.0\s+400\s+10\.0/);
  const events = await page.locator("#events tbody tr").allInnerTexts();
  for (const event of ["took off", "3 samples were lost", "no sample for 4.0 s in flight", "the GPS lost its fix", "the pilot took control", "landed"]) assert.ok(events.some((row) => row.includes(event)), event);
  assert.match(events[0], /^1\s+20\.0 s\s+10:00:20\.0Z\s+◆ note\s+took off$/);
  assert.match(await text(page, "#recording"), /hero\(1\)_22_11_26-10_00_00\.tsv/);
  assert.match(await text(page, ".worst"), /no sample for 4\.0 s in flight/);
  assert.equal(await page.locator("#main b").count(), 0);
  // No link leads out of the page, or nowhere.
  const links = await page.locator("a").evaluateAll((all) => all.map((one) => one.getAttribute("href")));
  assert.deepEqual(links.filter((link) => !/^#[\w-]+$/.test(link)), []);
  for (const link of new Set(links)) assert.equal(await page.locator(link).count(), 1, link);
});

shown("a peak of one sample among thousands is seen, and so is the gap", WIDE, async (page) => {
  const at = await share(page, "#plot-altitude", (PEAK.at * PERIOD_MS) / 1000);
  assert.ok(await pixels(page, "#plot-altitude", "--plot-1", [at - 0.003, at + 0.003], [0.1, 0.5]) > 20, "the peak");
  assert.equal(await pixels(page, "#plot-altitude", "--plot-1", [at + 0.02, at + 0.1], [0, 0.5]), 0, "nothing beside it");
  const from = await share(page, "#plot-battery", 400.5);
  const to = await share(page, "#plot-battery", 403.5);
  const before = await share(page, "#plot-battery", 380);
  assert.equal(await pixels(page, "#plot-battery", "--plot-1", [from, to], [0.05, 0.8]), 0, "no line in the gap");
  assert.ok(await pixels(page, "#plot-battery", "--plot-1", [before, from], [0.05, 0.8]) > 0);
});

shown("events, keys, clicks and the scrubber move one playhead", WIDE, async (page) => {
  const heads = () => page.locator(".playhead").evaluateAll((all) => all.map((one) => Number.parseFloat(one.style.left)));
  const row = page.locator("#events tr").filter({ hasText: "the GPS lost its fix" });
  await row.locator("a").click();
  const there = (484.02 / 603.98) * 100;
  for (const head of await heads()) assert.ok(Math.abs(head - there) < 0.2, `${head}`);
  assert.equal((await heads()).length, 6);
  assert.equal(await row.getAttribute("aria-current"), "true");
  assert.match(await text(page, "#here"), /in the air ■ the GPS lost its fix/);
  assert.match(await text(page, "#replay-at"), /^8:04 of 10:03 · 10:08:04Z$/);
  assert.equal(await text(page, "#plot-battery output"), "24.0 V");
  assert.equal(page.url().split("#")[1], "over-time");
  await page.locator("#timeline").scrollIntoViewIfNeeded();
  await page.keyboard.press("n");
  assert.match(await text(page, "#here"), /the GPS fix is/);
  await page.keyboard.press("p");
  assert.match(await text(page, "#here"), /the GPS lost its fix/);
  // In the gap nothing is known.
  await page.locator("#scrub").fill("402");
  assert.equal(await text(page, "#plot-battery output"), "–");
  // A click leads there, and one beside an event leads to the event.
  const over = page.locator("#plot-battery .u-over");
  const { width } = await over.boundingBox();
  await over.click({ position: { x: width / 4, y: 20 } });
  assert.ok(Math.abs((await heads())[0] - 25) < 0.5);
  await over.click({ position: { x: (there / 100) * width + 3, y: 20 } });
  assert.match(await text(page, "#here"), /the GPS lost its fix/);
  await page.locator("#here a").click();
  assert.match(page.url(), /#event-\d+$/);
  // It plays by itself, and stops at the end.
  await page.locator("#scrub").fill("602");
  await page.selectOption("#speed", "10");
  await page.click("#play");
  await page.locator("#replay-at").filter({ hasText: "10:03 of 10:03" }).waitFor({ timeout: WAIT_MS });
  await page.locator("#play").filter({ hasText: "Play" }).waitFor({ timeout: WAIT_MS });
});

for (const [name, options] of [["on a phone", PHONE], ["wide", { viewport: { width: 1920, height: 1080 } }], ["in the dark", { ...WIDE, colorScheme: "dark" }], ["with strong contrast", { ...WIDE, contrast: "more" }]]) {
  shown(`axe finds nothing, and nothing is wider than the screen: ${name}`, options, async (page) => {
    await page.evaluate(AXE);
    const { violations } = await page.evaluate(() => window.axe.run());
    assert.deepEqual(violations.map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html).join(" ")}`), []);
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= window.innerWidth));
    const theme = { "in the dark": "dark", "with strong contrast": "sun" }[name] ?? "light";
    assert.equal(await page.locator("html").getAttribute("data-theme"), theme);
    assert.ok(await pixels(page, "#plot-battery", "--plot-1", [0.1, 0.9], [0.05, 0.85]) > 20, "the line has the colour of the theme");
  });
}

shown("it is printed as wide as paper, light, and without what only a screen has", { ...WIDE, colorScheme: "dark" }, async (page) => {
  const before = await page.locator("#plot-altitude canvas").evaluate(({ width }) => width);
  await page.evaluate(() => {
    window.printed = [];
    for (const name of ["beforeprint", "afterprint"]) {
      addEventListener(name, () => queueMicrotask(() => window.printed.push({
        name, theme: document.documentElement.dataset.theme, ratio: document.querySelector("#plot-altitude canvas").width / document.querySelector("#plot-altitude .plot-box").clientWidth,
        map: document.querySelector(".sheet-of-map").clientWidth - document.getElementById("map").clientWidth, open: document.querySelector("details").open,
      })));
    }
  });
  const pdf = (await page.pdf({ format: "A4" })).toString("latin1");
  assert.ok((pdf.match(/\/Type ?\/Page\b/g) ?? []).length >= 3);
  const printed = await page.evaluate(() => window.printed);
  assert.deepEqual(printed.map(({ name, theme, open }) => [name, theme, open]), [["beforeprint", "light", true], ["afterprint", "dark", false]]);
  for (const { ratio, map } of printed) assert.ok(Math.abs(ratio - 2) < 0.02 && map === 0, JSON.stringify(printed));
  assert.equal(await page.locator("#plot-altitude canvas").evaluate(({ width }) => width), before);
  await page.emulateMedia({ media: "print" });
  for (const screenOnly of ["#bar", "#tools", "#parts", "#map-tools"]) assert.equal(await page.locator(screenOnly).isVisible(), false, screenOnly);
});

shown("no script but its own runs, and nothing is loaded or sent", WIDE, async (page, problems) => {
  const got = await page.evaluate(async () => {
    const script = document.createElement("script");
    script.textContent = "window.foreign = true";
    document.body.append(script);
    document.body.insertAdjacentHTML("beforeend", '<img src="https://example.invalid/x.png" onerror="window.foreign = true"><iframe src="https://example.invalid/"></iframe>');
    const sent = await fetch("https://example.invalid/").then(() => "sent", () => "refused");
    return [sent, "foreign" in window];
  });
  assert.deepEqual(got, ["refused", false]);
  const refusals = problems.splice(0).map((text) => /Content Security Policy/.test(text));
  assert.ok(refusals.length >= 4 && refusals.filter((is) => !is).length <= 1, JSON.stringify(refusals));
});

shown("what is chosen stays, and single keys can be switched off", WIDE, async (page) => {
  await page.click("#theme");
  assert.equal(await page.locator("html").getAttribute("data-theme"), "dark");
  await page.click("#keys");
  await page.keyboard.press("n");
  assert.match(await text(page, "#replay-at"), /^0:00 of/);
  await page.reload();
  await page.locator("body[data-ready]").waitFor({ timeout: WAIT_MS });
  assert.equal(await page.locator("html").getAttribute("data-theme"), "dark");
  assert.equal(await text(page, "#keys"), "Keys: off");
});

/** What goes wrong in the flight of the picture, and what it is flown within. */
const FAULTS = `seed = 1
[[fault]]
kind = "outage"
from_s = 40.0
until_s = 42.0
[[fault]]
kind = "lose_fix"
at_s = 55.0
for_s = 3.0
[[fault]]
kind = "pilot_takes_over"
at_s = 66.0
for_s = 5.0
`;
const BRIDGE_OF_PICTURE = `
[link]
pc_timeout_ms = 20000
ack_timeout_ms = 2000
[movement]
begin_within_ms = 60000
[fence]
ceiling_m = 60.0
[[fence.area]]
name = "field"
kind = "inclusion"
polygon = [[37.4106, -6.0016], [37.4119, -6.0018], [37.4121, -5.9998], [37.4105, -5.9997]]
[[fence.area]]
name = "trees"
kind = "exclusion"
centre = [37.4113, -6.0008]
radius_m = 9.0
`;

const PICTURES = Boolean(process.env.RIL_WRITE_PICTURES);

attempted("a recorded flight has its phases, its requests and the fence that was in force", { skip, timeout: 600000 }, async () => {
  const robot = new Robot();
  const context = await (await theBrowser()).newContext({ viewport: { width: 1000, height: 900 } });
  try {
    const page = await context.newPage();
    if (PICTURES) writeFileSync(join(robot.folder, "faults.toml"), FAULTS);
    await (PICTURES ? robot.startRobot(["--faults", "faults.toml"], BRIDGE_OF_PICTURE) : robot.startRobot(["--speed", "5"]));
    await robot.begin("record", ["record"], /recording file=/);
    await robot.command("start");
    await robot.command("takeoff 10m");
    const path = "37.4116,-6.0013,25m 37.4117,-6.0005,28m 37.4112,-6.0002,30m 37.4108,-6.0006,24m 37.4109,-6.0012,26m 37.4115,-6.0014,26m 37.4117,-6.0005,28m";
    // The pilot takes over before its end.
    await robot.command(PICTURES ? `goto ${path}` : "goto 37.4111,-6.001,25m --timeout 600s", PICTURES ? [0, 5, 6] : [0]);
    await robot.command("wait --for hovering --timeout 60s");
    // The pilot has it for some seconds more.
    if (PICTURES) await page.waitForTimeout(9000);
    await robot.command("land --timeout 600s");
    await robot.end("record", "SIGINT");
    const record = readdirSync(join(robot.folder, "log")).find((name) => name.endsWith(".mcap"));
    await robot.command(`log report ${join("log", record)} --output flight.html`);
    const problems = [];
    page.on("pageerror", (error) => problems.push(String(error.stack)));
    await page.goto(pathToFileURL(join(robot.folder, "flight.html")).href);
    await page.locator("body[data-ready]").waitFor({ timeout: WAIT_MS });
    const timeline = await page.locator("#timeline [role=img]").getAttribute("aria-label");
    for (const phase of ["taking off", "flying the path", "landing"]) assert.ok(timeline.includes(phase), timeline);
    const requests = await page.locator("#requests tbody tr").allInnerTexts();
    for (const request of ["takeoff", "goto", "land"]) assert.ok(requests.some((row) => row.includes(request)), JSON.stringify(requests));
    assert.match(await text(page, "#plot-altitude figcaption"), /GPS[^]*asked for/);
    assert.match(await text(page, "#track-key"), /fence: stay inside/);
    assert.match(await text(page, "#map-words"), /plan of \d waypoints?; fence of \d areas/);
    assert.match(await text(page, "#events"), /took off/);
    assert.deepEqual(problems, []);
    // The view that plays the record has the same page behind a link, where it is of no origin and works all the same.
    const port = await freePort();
    await robot.begin("view", ["view", join("log", record), "--no-browser", "--port", String(port)], / ready[ \n]/);
    const view = await context.newPage();
    view.on("pageerror", (error) => problems.push(String(error.stack)));
    await view.goto(`http://127.0.0.1:${port}/`);
    const [report] = await Promise.all([context.waitForEvent("page"), view.locator("#report").click({ timeout: WAIT_MS })]);
    report.on("pageerror", (error) => problems.push(String(error.stack)));
    await report.locator("body[data-ready]").waitFor({ timeout: WAIT_MS });
    assert.equal(await text(report, "#title"), await text(page, "#title"));
    assert.equal(await report.evaluate(() => origin), "null");
    await report.click("#theme");
    await report.locator("#events a.jump").first().click();
    assert.deepEqual(problems, []);
    if (PICTURES) {
      await page.locator("#replay-at").waitFor();
      const alarm = page.locator("#events tr").filter({ hasText: "the GPS lost its fix" });
      await alarm.locator("a").click();
      // The first screens of the page, as one picture.
      await page.setViewportSize({ width: 1000, height: 2090 });
      await page.evaluate(() => scrollTo(0, 0));
      await page.waitForTimeout(1000);
      await picture(page, await theBrowser(), fileURLToPath(new URL("../../../docs/report.png", import.meta.url)));
    }
  } finally {
    await context.close();
    await robot.stop();
  }
});

attempted("numbers that no flight has are drawn, too", { skip, timeout: 360000 }, async () => {
  const [before, rest] = readFileSync(file, "utf8").split('<script type="application/json" id="flight">');
  const flight = JSON.parse(rest.slice(0, rest.indexOf("</script>")));
  const at = [null, -5, 0, 1e12, 3];
  const damaged = {
    ...flight, start_unix_ms: 8.64e18,
    phases: at.map((from_s, index) => ({ from_s, to_s: at[at.length - index - 1], name: "x".repeat(400), ink: "blue" })),
    lanes: [{ name: "y".repeat(400), spans: at.map((from_s) => ({ from_s, to_s: null, name: "", ink: "red" })) }],
    requests: at.map((from_s) => ({ from_s, to_s: from_s, name: "", sender: "", outcome: "open", reason: "" })),
    events: at.map((at_s, index) => ({ at_s, weight: ["note", "warning", "alarm"][index % 3], text: "", place: [90 - index, 180 - index] })),
    gaps: at.map((from) => [from, null]),
    map: { track: [[90, 180], [-90, -180], [0, 0]], track_s: [null, 1e12, 0], plan: [[89.9, 0]], fence: [{ name: "", inclusion: false, floor_m: null, ceiling_m: -1e12, corners: [[90, 0], [-90, 0], [0, 180]] }] },
    plots: [["auto", { least_span: 1 }], ["from-zero", { least_top: 1 }], ["logarithmic", { least: 0.1 }]].map(([kind, more]) => ({
      id: kind, title: "", unit: "", about: "", scale: { kind, ...more }, limits: [{ name: "", value: 1e12 }],
      curves: [{ name: "", ink: "blue", kind: "line", t_ms: [0, 1, 2, 1e15], values: [1e12, null, -1e12, 0] }, { name: "", ink: "red", kind: "dashes", t_ms: [5], values: [0] },
        { name: "", ink: "grey", kind: "bars", total: 1e12, bars: [[0, 1, 1e12], [2, 1, 0.1]] }],
    })),
  };
  const own = join(folder, "damaged.html");
  writeFileSync(own, `${before}<script type="application/json" id="flight">${JSON.stringify(damaged)}${rest.slice(rest.indexOf("</script>"))}`);
  const context = await (await theBrowser()).newContext(WIDE);
  try {
    const page = await context.newPage();
    const problems = [];
    page.on("pageerror", (error) => problems.push(String(error.stack)));
    await page.goto(pathToFileURL(own).href);
    await page.locator("body[data-ready]").waitFor({ timeout: WAIT_MS });
    for (const link of await page.locator("#events .jump").all()) await link.click();
    await page.click("#zoom-in");
    assert.equal(await page.locator("figure canvas").count(), 4);
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= window.innerWidth));
    assert.deepEqual(problems, []);
  } finally {
    await context.close();
  }
});

attempted("a recording without a sample is a page that says so", { skip, timeout: 360000 }, async () => {
  const cwd = join(folder, "empty");
  mkdirSync(cwd, { recursive: true });
  writeFileSync(join(cwd, "empty.tsv"), "flying\tsequence\treceived_ns\n");
  execFileSync(RIL, ["log", "report", "empty.tsv"], { cwd });
  const file = join(cwd, "empty.html");
  assert.ok(statSync(file).size < 500000);
  const context = await (await theBrowser()).newContext(PHONE);
  try {
    const page = await context.newPage();
    const problems = [];
    page.on("pageerror", (error) => problems.push(String(error.stack)));
    await page.goto(pathToFileURL(file).href);
    await page.locator("body[data-ready]").waitFor({ timeout: WAIT_MS });
    assert.match(await text(page, "#summary"), /The recording has no sample\./);
    assert.match(await text(page, "#events"), /The recording has none\./);
    assert.equal(await page.locator("#track").isVisible(), false);
    assert.deepEqual(problems, []);
  } finally {
    await context.close();
  }
});
