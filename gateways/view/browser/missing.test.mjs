// What the page does when something is missing: the server's memory, an answer, contact, script, room on the screen. And what leads home.

import assert from "node:assert/strict";
import { createRequire } from "node:module";
import { after } from "node:test";
import { SLACK_MS, STALE_MS, WAIT_MS, closeBrowser, live, scenario, timeUntil } from "./harness.mjs";

const AXE = createRequire(import.meta.url).resolve("axe-core/axe.min.js");
const SMALL = { viewport: { width: 360, height: 640 }, hasTouch: true, isMobile: true, deviceScaleFactor: 2 };
const LINK_ALARM = { id: "dsp-link", severity: "alarm", text: "the link to the DSP is silent", next_step: null, since_s: 3 };

after(closeBrowser);

const orders = (server, kind) => server.received.filter((message) => message.type === "order" && message.kind === kind);
const progress = (page, words) => timeUntil(page, "#progress", words);

scenario("a server that was started again with other tokens: HOLD and LAND stay, and the page says why nothing is sent", { needs: "stand-in", ci: true }, async ({ page, server }) => {
  await live(page);
  server.answers = false;
  await page.click("#order-hold");
  await progress(page, "WAITING");
  await server.stop();
  server.how.role = "watch";
  await server.again();
  await live(page);
  await progress(page, "UNKNOWN");
  for (const id of ["#order-hold", "#order-land"]) {
    await page.click(id);
    await progress(page, "NOT SENT the server does not know this page any more");
  }
  assert.equal(orders(server, "land").length, 0);
  await page.reload();
  await live(page);
  await progress(page, "may only look now");
  assert.equal(await page.locator("#order-hold").isVisible(), true, "also after a reload");
});

scenario("an order without an answer is UNKNOWN as soon as there is no contact, and goes on with it", { needs: "stand-in", ci: true }, async ({ page, server }) => {
  await live(page);
  server.answers = false;
  await page.click("#order-hold");
  await progress(page, "WAITING");
  server.freeze();
  const took = await progress(page, "UNKNOWN");
  assert.ok(took < STALE_MS + SLACK_MS, `${took} ms`);
  server.thaw();
  await live(page);
  await progress(page, "WAITING");
});

scenario("the page that commanded commands again when its server was started again", { needs: "stand-in" }, async ({ page, server }) => {
  await live(page);
  await page.click("#order-more");
  await page.click("#lease-change");
  await progress(page, "This page commands");
  await server.stop();
  server.holders.clear();
  await server.again();
  await live(page);
  await progress(page, "This page commands");
});

scenario("without a fix no zeros look live: values are unknown, and the last place is named as the last one", { needs: "stand-in", ci: true, server: { start_s: 60 } }, async ({ page, server, shot, problems }) => {
  await live(page);
  await timeUntil(page, "#map-words", /^Robot 1 at 37\.4/);
  server.lostFix = server.t;
  await timeUntil(page, "#map-words", /^No position, last at 37\.4/);
  const text = (selector) => page.locator(selector).innerText();
  assert.match(await text("#fresh-word"), /LIVE/, "the telemetry goes on");
  for (const key of ["height", "speed", "climb"]) assert.equal(await text(`#value-${key}`), "–", key);
  assert.match(await text("#sub-height"), /altitude –/i);
  assert.match(await text("#sub-speed"), /course –/i);
  assert.match(await text("#value-battery"), /^\d/);
  assert.match(await text("#strip-fix"), /^no fix$/);
  assert.equal(await text("#strip-home"), "–");
  await shot("no-fix");
  server.lostFix = null;
  await timeUntil(page, "#map-words", /^Robot 1 at 37\.4/);
  assert.match(await text("#value-height"), /^\d/);
  assert.deepEqual(problems, []);
});

scenario("the token is not in the tab's history, and a new invitation in the same tab is taken", { needs: "stand-in", server: { token: "5ec2e7" } }, async ({ page, server, context }) => {
  await live(page);
  const cdp = await context.newCDPSession(page);
  const known = async () => JSON.stringify(await cdp.send("Page.getNavigationHistory"));
  assert.doesNotMatch(await known(), /5ec2e7/);
  server.how.token = "0ther7";
  await page.evaluate(() => (location.hash = "#token=0ther7"));
  await page.waitForFunction(() => sessionStorage.getItem("token") === "0ther7" && location.hash === "");
  await live(page);
  assert.equal(server.received.filter(({ type }) => type === "open").at(-1).token, "0ther7");
  assert.doesNotMatch(await known(), /0ther7/);
});

scenario("home is a key away, at the altitude of now", { needs: "stand-in", server: { start_s: 60 } }, async ({ page, server }) => {
  await live(page);
  assert.match(await page.locator("#strip-home").innerText(), /^\d+ m [NESW]+$/);
  assert.match(await page.locator("#strip-flown").innerText(), /^\d+ s$/);
  await page.keyboard.press("r");
  await timeUntil(page, "#sheet-title", "returns home");
  await page.locator("#confirm-goto:enabled").click();
  await progress(page, "Go to robot 1");
  const [order] = orders(server, "goto");
  assert.deepEqual(order.position, [37.4112, -6.001]);
  assert.ok(order.altitude_m > 20);
});

scenario("steps of a replay add up, however fast the keys are", { needs: "stand-in", server: { replay: true, start_s: 60 } }, async ({ page, server }) => {
  await live(page);
  await page.click("#play");
  await timeUntil(page, "#fresh-word", "PAUSED");
  server.received.length = 0;
  await page.evaluate(() => {
    for (let i = 0; i < 4; i++) document.body.dispatchEvent(new KeyboardEvent("keydown", { key: ".", bubbles: true }));
  });
  await page.waitForTimeout(200);
  const [first, ...more] = server.received.filter(({ type }) => type === "replay").map(({ position_s }) => position_s);
  assert.deepEqual(more.map((at) => Math.round(at - first)), [1, 2, 3]);
});

scenario("an alarm is felt once when it begins", { needs: "stand-in" }, async ({ page, server }) => {
  await live(page);
  await page.click("#whole");
  await page.evaluate(() => {
    window.shakes = [];
    Object.defineProperty(navigator, "vibrate", { value: (shakes) => window.shakes.push(shakes.length) });
  });
  server.alarms = [LINK_ALARM];
  server.say();
  await timeUntil(page, "#alarm", "silent");
  server.say();
  await page.waitForTimeout(300);
  assert.deepEqual(await page.evaluate(() => window.shakes), [5]);
});

scenario("where this device is, stays in the browser", { needs: "stand-in", context: { permissions: ["geolocation"], geolocation: { latitude: 37.4113, longitude: -6.0012, accuracy: 12 } } }, async ({ page, server, problems }) => {
  await live(page);
  await page.click("#own");
  assert.equal(await page.getAttribute("#own", "aria-pressed"), "true");
  await page.waitForTimeout(500);
  assert.ok(!JSON.stringify(server.received).includes("37.4113"));
  await page.click("#own");
  assert.equal(await page.getAttribute("#own", "aria-pressed"), "false");
  assert.deepEqual(problems, []);
});

scenario("no bridge: no green word about alarms, and a silent link marks the phase", { needs: "stand-in" }, async ({ page, server }) => {
  await live(page);
  const said = server.robotMessage.bind(server);
  server.robotMessage = (robot) => ({ ...said(robot), link: { text: "", state: "silent", age_s: 5 } });
  server.say();
  await timeUntil(page, "#phase", "LINK SILENT");
  server.bridge = { freshness: "never", age_ms: null };
  await timeUntil(page, "#alarm", "Alarms unknown");
});

scenario("without script the page says so", { needs: "stand-in", context: { javaScriptEnabled: false } }, async ({ page }) => {
  assert.equal(await page.locator("noscript p").isVisible(), true);
  assert.match(await page.locator("#cover").innerText(), /needs JavaScript/);
});

scenario("a small phone: the map has room, the button that confirms is in sight, and nothing that is covered scrolls", { needs: "stand-in", ci: true, context: { ...SMALL, bypassCSP: true } }, async ({ page, server }) => {
  await live(page);
  const height = (id) => page.evaluate((of) => document.getElementById(of).getBoundingClientRect().height, id);
  assert.ok((await height("map-panel")) >= 220, String(await height("map-panel")));
  const scrolls = () => page.evaluate(() => ((main) => main.scrollHeight - main.clientHeight)(document.getElementById("main")));
  assert.ok((await scrolls()) <= 1);
  await page.click("#tab-state");
  for (const id of ["module", "control", "commander", "home", "flown"]) assert.equal(await page.locator(`#strip-${id}`).isVisible(), true, id);
  const said = server.robotMessage.bind(server);
  server.robotMessage = (robot) => ({ ...said(robot), phase: "flying the path, waypoint 2 of 3" });
  server.bridge = { freshness: "stale", age_ms: 4200 };
  server.say();
  await timeUntil(page, "#phase", "STALE");
  const lines = await page.evaluate(() => ((node) => node.getBoundingClientRect().height / parseFloat(getComputedStyle(node).lineHeight))(document.getElementById("phase")));
  assert.ok(lines < 2.5, `${lines} lines`);
  await page.click("#order-takeoff");
  await timeUntil(page, "#sheet", "battery 24.1 V");
  const [sheet, button] = [await page.locator("#sheet").boundingBox(), await page.locator("#confirm-takeoff").boundingBox()];
  assert.ok(button.y >= sheet.y && button.y + button.height <= sheet.y + sheet.height, JSON.stringify([sheet, button]));
  server.freeze();
  await timeUntil(page, "#cover-word", /NO.CONTACT/, WAIT_MS);
  assert.match(await page.locator("#cover-last").innerText(), /by the server's clock/);
  await page.addScriptTag({ path: AXE });
  const { violations } = await page.evaluate(() => window.axe.run(document, { resultTypes: ["violations"] }));
  assert.deepEqual(violations.map(({ id }) => id), []);
});
