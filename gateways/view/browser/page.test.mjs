// The page in a real browser: npm ci && npm test. See harness.mjs for what can be set.

import assert from "node:assert/strict";
import { createRequire } from "node:module";
import { after } from "node:test";
import { SLACK_MS, STALE_MS, WAIT_MS, closeBrowser, live, scenario, timeUntil } from "./harness.mjs";

const AXE = createRequire(import.meta.url).resolve("axe-core/axe.min.js");
const PHONE = { viewport: { width: 360, height: 740 }, hasTouch: true, isMobile: true, deviceScaleFactor: 2 };
const WIDE = { viewport: { width: 1920, height: 1080 } };
const LINK_ALARM = { id: "dsp-link", severity: "alarm", text: "the link to the DSP is silent", next_step: "check cable and power of the DSP", since_s: 3 };

after(closeBrowser);

/** Orders of a kind that the stand-in has got. */
const orders = (server, kind) => server.received.filter((message) => message.type === "order" && message.kind === kind);
const text = (page, selector) => page.locator(selector).innerText();
const progress = (page, words) => timeUntil(page, "#progress", words);

scenario("it loads without an error, asks no other host, and telemetry appears", { ci: true }, async ({ page, problems, shot }) => {
  await live(page);
  assert.match(await text(page, "#fresh-word"), /LIVE/);
  assert.match(await text(page, "#robot-name"), /Robot \d/);
  const before = await text(page, "#fresh-age");
  assert.match(before, /^\d+\.\d s/);
  await page.waitForTimeout(1500);
  assert.equal(await page.locator("#cover").isVisible(), false);
  await shot("live");
  assert.deepEqual(problems, []);
});

scenario("the token leaves the address, and a reload works", { needs: "stand-in", server: { token: "5ec2e7" } }, async ({ page, server }) => {
  await live(page);
  assert.doesNotMatch(page.url(), /token/);
  await page.reload();
  await live(page);
  const opens = server.received.filter(({ type }) => type === "open");
  assert.ok(opens.length >= 2 && opens.every(({ token }) => token === "5ec2e7"));
  assert.ok(server.requests.every((url) => !url.includes("5ec2e7")));
});

scenario("a refusal is shown in its own words", { needs: "stand-in" }, async ({ page, server, open }) => {
  await live(page);
  server.how.token = "another";
  const second = await open();
  await timeUntil(second, "#cover", "needs a token");
  assert.match(await text(second, "#cover-word"), /REFUSED/);
});

for (const [name, needs, act] of [["killed", "stand-in", (server) => server.stop()], ["frozen, with its connection open", "freeze", (server) => server.freeze()]]) {
  scenario(`a server that is ${name}: NO CONTACT over everything, an order is NOT SENT, and all comes back`, { needs, ci: true }, async ({ page, server }) => {
    await live(page);
    await act(server);
    const took = await timeUntil(page, "#cover-word", /NO.CONTACT/);
    assert.ok(took < STALE_MS + SLACK_MS, `${took} ms`);
    const cover = await page.locator("#cover").boundingBox();
    const main = await page.locator("#main").boundingBox();
    assert.ok(cover.y === 0 && cover.height >= main.y + main.height - 1, "it covers banner and values");
    for (const press of [() => page.click("#order-hold"), () => page.click("#order-land"), () => page.keyboard.press("Shift+H")]) {
      await press();
      await progress(page, "NOT SENT");
    }
    assert.match(await text(page, "#cover-last"), /Last heard/);
    await (name === "killed" ? server.again() : server.thaw());
    await live(page);
    await page.waitForTimeout(500);
    if (!server.isReal) assert.equal(server.received.filter(({ type }) => type === "order").length, 0, "nothing was sent later");
    assert.doesNotMatch(await text(page, "#progress"), /DONE|ACCEPTED/);
  });
}

scenario("a page that hangs is covered without script", {}, async ({ page, context }) => {
  await live(page);
  const cdp = await context.newCDPSession(page);
  const pictures = [];
  cdp.on("Page.screencastFrame", ({ data, sessionId, metadata }) => {
    pictures.push({ data, at: metadata.timestamp * 1000 });
    cdp.send("Page.screencastFrameAck", { sessionId }).catch(() => {});
  });
  await cdp.send("Page.startScreencast", { format: "png", everyNthFrame: 1 });
  const hung = await page.evaluate(() => {
    const animations = ["dead", "bar-dead"].map((id) => document.getElementById(id).getAnimations()[0]);
    setTimeout(() => {
      const end = performance.now() + 4000;
      while (performance.now() < end);
      window.shown = ["dead", "bar-dead"].map((id) => getComputedStyle(document.getElementById(id)).opacity);
    }, 50);
    return { at: Date.now(), states: animations.map(({ playState }) => playState) };
  });
  assert.deepEqual(hung.states, ["running", "running"]);
  await new Promise((done) => setTimeout(done, 3600));
  // A hung page draws nothing by itself: what is new on the screen is the cover.
  const during = pictures.filter(({ at }) => at > hung.at + 1200 && at < hung.at + 3500);
  assert.ok(during.length >= 1, "the compositor drew the cover while the script hung");
  const isThere = await page.waitForFunction(() => window.shown, null, { timeout: 10000 });
  assert.deepEqual(await isThere.jsonValue(), ["1", "1"]);
  await live(page);
  await page.waitForTimeout(300);
  assert.equal(await page.evaluate(() => getComputedStyle(document.getElementById("dead")).opacity), "0");
});

scenario("stale and gone are as the server says, with age and question marks", { needs: "stand-in", ci: true }, async ({ page, server, shot }) => {
  await live(page);
  for (const [freshness, word] of [["stale", "STALE"], ["gone", "GONE"]]) {
    server.telemetry = { freshness, age_ms: 4200 };
    await timeUntil(page, "#fresh-word", word);
    assert.match(await text(page, "#fresh-age"), /^4\.[2-9] s$/);
    assert.match(await text(page, "#value-battery"), /\?$/);
    assert.equal(await page.locator("#tile-battery[data-old]").count(), 1);
    assert.match(await page.locator("#horizon").innerHTML(), new RegExp(`ATTITUDE ${word}`));
    await shot(freshness);
  }
  server.telemetry = { freshness: "fresh", age_ms: 40 };
  await timeUntil(page, "#fresh-word", "LIVE");
  assert.doesNotMatch(await text(page, "#value-battery"), /\?/);
});

scenario("messages that are late on their way are old, though they come without a pause", { needs: "stand-in" }, async ({ page, server }) => {
  await live(page);
  server.lag_ms = 2500;
  await timeUntil(page, "#fresh-word", "STALE");
  await page.locator("#fresh-age").filter({ hasText: /^([3-9]|2\.[5-9])/ }).waitFor();
  await page.waitForTimeout(4000);
  assert.match(await text(page, "#fresh-word"), /STALE/);
  assert.match(await text(page, "#fresh-age"), /^(2\.[5-9]|[3-5]\.\d) s/);
  server.lag_ms = 0;
  await timeUntil(page, "#fresh-word", "LIVE");
});

scenario("what is not known is a dash", { needs: "stand-in" }, async ({ page, server }) => {
  await live(page);
  server.unknown = true;
  await timeUntil(page, "#value-height", "–");
  for (const key of ["height", "speed", "climb", "battery"]) assert.equal(await text(page, `#value-${key}`), "–");
  assert.match(await page.locator("#horizon").innerHTML(), /NO ATTITUDE/);
});

scenario("the worst alarm is in the banner and is announced once", { needs: "stand-in" }, async ({ page, server }) => {
  await live(page);
  await page.evaluate(() => {
    window.said = [];
    new MutationObserver(() => window.said.push(document.getElementById("announce").textContent)).observe(document.getElementById("announce"), { childList: true, characterData: true, subtree: true });
  });
  server.alarms = [LINK_ALARM];
  server.say();
  await timeUntil(page, "#alarm", "the link to the DSP is silent");
  assert.match(await text(page, "#alarm-word"), /■ ALARM/);
  await timeUntil(page, "#alarms", "check cable and power");
  server.say();
  await page.waitForTimeout(1200);
  assert.deepEqual(await page.evaluate(() => window.said), ["Robot 1, alarm: the link to the DSP is silent"]);
});

scenario("hold is answered", {}, async ({ page }) => {
  await live(page);
  await page.click("#order-hold");
  await progress(page, /Hold robot \d+: (DONE|REFUSED|ABORTED|REPLACED)/);
});

scenario("hold: one press by mouse, by keyboard, by touch", { needs: "stand-in", ci: true }, async ({ page, server, open }) => {
  await live(page);
  await page.click("#order-hold");
  await progress(page, "Hold robot 1: DONE");
  assert.equal(orders(server, "hold").length, 1);
  const [sent] = orders(server, "hold");
  assert.match(sent.order, /^[0-9a-f]{16}$/);
  assert.ok(sent.seen > 0 && sent.confirm === null && sent.robot === 1);
  await page.waitForTimeout(800);
  await page.keyboard.press("Shift+H");
  await page.waitForFunction(() => true);
  await timeUntil(page, "#log", /hold.*\n?.*hold/s);
  assert.equal(orders(server, "hold").length, 2);
  const phone = await open(PHONE);
  await live(phone);
  await phone.tap("#order-hold");
  await progress(phone, "Hold robot 1: DONE");
  assert.equal(orders(server, "hold").length, 3);
});

scenario("hold is in reach while a dialog is open, and in a field", { needs: "stand-in" }, async ({ page, server }) => {
  await live(page);
  await page.click("#order-takeoff");
  await page.focus("#takeoff-height");
  await page.keyboard.press("Shift+H");
  await progress(page, "Hold robot 1");
  await page.waitForTimeout(800);
  await page.click("#order-hold");
  await page.waitForTimeout(200);
  assert.equal(orders(server, "hold").length, 2);
});

scenario("land: a dialog names robot and effect; mouse, keyboard, touch; a double click sends one", { needs: "stand-in", ci: true }, async ({ page, server, open, shot }) => {
  await live(page);
  const button = await page.locator("#order-land").boundingBox();
  await page.click("#order-land");
  assert.match(await text(page, "#sheet"), /Land robot 1\?[^]*Closes in \d+ s/);
  await shot("land");
  const confirm = await page.locator("#confirm-land").boundingBox();
  assert.ok(confirm.y + confirm.height < button.y, "it is confirmed in another place");
  const colours = await page.evaluate(() => ["order-land", "confirm-land"].map((id) => getComputedStyle(document.getElementById(id)).backgroundColor));
  assert.notEqual(colours[0], colours[1]);
  assert.equal(orders(server, "land").length, 0);
  await page.keyboard.press("Escape");
  assert.equal(await page.locator("#sheet").isVisible(), false);
  await page.click("#order-land");
  await page.dblclick("#confirm-land");
  await progress(page, "Land robot 1: IN PROGRESS");
  assert.equal(orders(server, "land").length, 1);

  await page.waitForTimeout(800);
  await page.keyboard.press("l");
  await page.keyboard.press("Enter");
  assert.equal(orders(server, "land").length, 1, "Enter at once confirms nothing");
  await page.keyboard.press("Tab");
  await page.keyboard.press("Enter");
  await page.waitForTimeout(200);
  assert.equal(orders(server, "land").length, 2);

  const phone = await open(PHONE);
  await live(phone);
  await phone.tap("#order-land");
  await phone.tap("#confirm-land");
  await phone.waitForFunction(() => document.querySelectorAll('#progress [data-kind="land"]').length === 3);
  assert.equal(orders(server, "land").length, 3);
});

scenario("a double click on HOLD sends one order", { needs: "stand-in" }, async ({ page, server }) => {
  await live(page);
  await page.dblclick("#order-hold");
  await progress(page, "DONE");
  await page.waitForTimeout(200);
  assert.equal(orders(server, "hold").length, 1);
});

scenario("a dialog to land is over after ten seconds", { needs: "stand-in" }, async ({ page, server }) => {
  await live(page);
  await page.click("#order-land");
  await page.locator("#sheet").waitFor({ state: "hidden", timeout: 12000 });
  assert.equal(orders(server, "land").length, 0);
});

scenario("go to: tap, check, confirm; a refused leg cannot be sent", { needs: "stand-in", context: WIDE }, async ({ page, server, shot }) => {
  await live(page);
  await page.click("#order-goto");
  assert.equal(await page.isDisabled("#confirm-goto"), true);
  const map = await page.locator("#map").boundingBox();
  await page.mouse.click(map.x + map.width * 0.5, map.y + map.height * 0.6);
  await timeUntil(page, "#sheet", "Nothing against it");
  assert.match(await text(page, "#sheet"), /84 m · 21 s/);
  await shot("goto");
  await page.fill("#goto-altitude", "100");
  await timeUntil(page, "#sheet", "REFUSED");
  assert.equal(await page.isDisabled("#confirm-goto"), true);
  await page.fill("#goto-altitude", "abc");
  assert.equal(await page.isDisabled("#confirm-goto"), true);
  await page.fill("#goto-altitude", "31.5");
  await timeUntil(page, "#sheet", "Nothing against it");
  await page.click("#confirm-goto");
  await progress(page, "Go to robot 1: IN PROGRESS");
  const [sent] = orders(server, "goto");
  assert.equal(sent.altitude_m, 31.5);
  assert.ok(Math.abs(sent.position[0] - 37.4112) < 0.01 && Math.abs(sent.position[1] + 6.001) < 0.01);
});

scenario("take-off: findings, then held down or typed", { needs: "stand-in" }, async ({ page, server, shot }) => {
  await live(page);
  await page.click("#order-takeoff");
  await timeUntil(page, "#sheet", "battery 24.1 V");
  await shot("takeoff");
  const button = await page.locator("#confirm-takeoff").boundingBox();
  await page.mouse.move(button.x + 20, button.y + 20);
  await page.mouse.down();
  await page.waitForTimeout(700);
  await page.mouse.up();
  await page.waitForTimeout(1200);
  assert.equal(orders(server, "takeoff").length, 0, "not held long enough");
  await page.mouse.down();
  await progress(page, "Take-off robot 1");
  await page.mouse.up();
  assert.deepEqual(orders(server, "takeoff").map(({ altitude_m, confirm }) => [altitude_m, confirm]), [[10, "takeoff"]]);
  await page.waitForTimeout(800);
  await page.click("#order-takeoff");
  await timeUntil(page, "#sheet", "battery 24.1 V");
  await page.locator("#takeoff-word:enabled").pressSequentially("takeoff");
  await page.waitForTimeout(200);
  assert.equal(orders(server, "takeoff").length, 2);
});

scenario("a take-off is not ordered when its dialog is closed while the button is held down", { needs: "stand-in" }, async ({ page, server }) => {
  await live(page);
  await page.click("#order-takeoff");
  await page.locator("#confirm-takeoff:enabled").waitFor();
  await page.hover("#confirm-takeoff");
  await page.mouse.down();
  await page.keyboard.press("Escape");
  await page.waitForTimeout(2000);
  await page.mouse.up();
  assert.equal(orders(server, "takeoff").length, 0);
  // The button of the right hand is no confirmation either.
  await page.click("#order-takeoff");
  await page.locator("#confirm-takeoff:enabled").waitFor();
  await page.hover("#confirm-takeoff");
  await page.mouse.down({ button: "right" });
  await page.waitForTimeout(2000);
  await page.mouse.up({ button: "right" });
  assert.equal(orders(server, "takeoff").length, 0);
});

scenario("without new values phase and alarms are old, too", { needs: "stand-in" }, async ({ page, server }) => {
  await live(page);
  assert.match(await text(page, "#alarm-word"), /No alarm/);
  server.quiet = true;
  await timeUntil(page, "#phase", /^STALE \d/);
  assert.match(await text(page, "#alarm-word"), /Alarms unknown/);
  assert.match(await text(page, "#strip-module"), /\?$/);
  server.quiet = false;
  await timeUntil(page, "#alarm-word", "No alarm");
  assert.doesNotMatch(await text(page, "#phase"), /STALE/);
});

scenario("after a reconnection the picture of before is covered until a new one is drawn", { needs: "stand-in" }, async ({ page, server }) => {
  await live(page);
  server.quiet = server.mute = true;
  server.cut();
  await timeUntil(page, "#cover-word", "WAITING");
  await page.waitForTimeout(1000);
  assert.equal(await page.locator("#cover").isVisible(), true);
  server.quiet = server.mute = false;
  await live(page);
});

scenario("an order whose connection broke before an answer is not shown as waiting", { needs: "stand-in" }, async ({ page, server }) => {
  await live(page);
  server.answers = false;
  await page.click("#order-hold");
  await progress(page, "Hold robot 1: WAITING");
  server.cut();
  await progress(page, "Hold robot 1: UNKNOWN the connection was lost");
  assert.equal(orders(server, "hold").length, 1, "nothing was sent later");
});

scenario("an order for a robot that is looked at no more is not shown as under way", { needs: "stand-in", server: { robots: [1, 2] } }, async ({ page, server }) => {
  await live(page);
  await page.click("#order-land");
  await page.click("#confirm-land");
  await progress(page, "Land robot 1: IN PROGRESS");
  await page.keyboard.press("2");
  await progress(page, "Land robot 1: UNKNOWN this page looked at another robot");
  await page.keyboard.press("1");
  await progress(page, "Land robot 1: IN PROGRESS");
});

scenario("a robot that was not there when the page connected again is looked at once it is back", { needs: "stand-in", server: { robots: [1, 3] } }, async ({ page, server }) => {
  await live(page);
  await page.keyboard.press("2");
  await timeUntil(page, "#robot-name", "Robot 3");
  await live(page);
  server.how.robots = [1];
  server.cut();
  await timeUntil(page, "#fresh-word", "STALE");
  assert.match(await text(page, "#robot-name"), /Robot 3/, "HOLD goes to no other robot");
  server.how.robots = [1, 3];
  await timeUntil(page, "#fresh-word", "LIVE");
  assert.match(await text(page, "#robot-name"), /Robot 3/);
});

scenario("a page that comes back by the browser's history is live", { needs: "stand-in" }, async ({ page, server }) => {
  await live(page);
  await page.goto(`${server.url}icon.svg`);
  await page.goBack();
  await live(page);
  assert.match(await text(page, "#fresh-word"), /LIVE/);
});

scenario("the menu of orders follows the lease while it is open", { needs: "stand-in" }, async ({ page, server, open }) => {
  const second = await open();
  await Promise.all([live(page), live(second)]);
  await page.click("#order-more");
  await timeUntil(page, "#lease-change", "Take command");
  await second.click("#order-more");
  await second.click("#lease-change");
  await timeUntil(page, "#lease-change", "Ask for command");
});

scenario("stop wants its word", { needs: "stand-in" }, async ({ page, server }) => {
  await live(page);
  await page.click("#order-more");
  await page.click("#order-stop");
  assert.equal(await page.isDisabled("#confirm-stop"), true);
  await page.fill("#stop-word", "stop");
  await page.locator("#confirm-stop:enabled").click();
  await progress(page, "Stop robot 1");
  assert.equal(orders(server, "stop")[0].confirm, "stop");
});

scenario("two pages and the lease: asked, kept, given", { needs: "stand-in", ci: true }, async ({ page, server, open }) => {
  const second = await open();
  await Promise.all([live(page), live(second)]);
  await page.click("#order-more");
  await page.click("#lease-change");
  await timeUntil(page, "#progress", "This page commands");
  await timeUntil(second, "#progress", "Another page commands");
  await second.click("#order-takeoff");
  await timeUntil(second, "#sheet", "battery 24.1 V");
  assert.equal(await second.isDisabled("#confirm-takeoff"), true);
  await second.click("text=Ask for command");
  await timeUntil(page, "#lease-row", "Another page asks");
  await page.click("#lease-keep");
  await page.locator("#lease-row").waitFor({ state: "hidden" });
  await timeUntil(second, "#sheet", "The other page keeps command");
  await second.click("text=Ask again");
  await page.click("#lease-give");
  await second.locator("#confirm-takeoff:enabled").waitFor();
  await timeUntil(page, "#progress", "Another page commands");
  await page.click("#order-hold");
  await timeUntil(page, "#progress", "DONE");
  assert.equal(orders(server, "hold").length, 1, "hold needs no lease");
});

scenario("a page that may only watch offers no orders", { needs: "stand-in", server: { role: "watch" } }, async ({ page, server }) => {
  await live(page);
  await timeUntil(page, "#progress", "Watching only");
  assert.equal(await page.locator("#order-hold").isVisible(), false);
  await page.keyboard.press("Shift+H");
  await page.keyboard.press("l");
  await page.waitForTimeout(300);
  assert.equal(server.received.filter(({ type }) => type === "order").length, 0);
});

scenario("single keys can be switched off", { needs: "stand-in" }, async ({ page, server }) => {
  await live(page);
  await page.keyboard.press("m");
  await page.click("#keys");
  await page.keyboard.press("Escape");
  await page.keyboard.press("Shift+H");
  await page.keyboard.press("l");
  await page.waitForTimeout(300);
  assert.equal(orders(server, "hold").length, 0);
  assert.equal(await page.locator("#sheet").isVisible(), false);
});

scenario("another life of the server replaces everything; another build reloads the page", { needs: "stand-in" }, async ({ page, server }) => {
  await live(page);
  server.event("warning", "of the first life");
  await timeUntil(page, "#log", "of the first life");
  await page.evaluate(() => (window.mark = 1));
  await server.stop();
  await server.again();
  await page.locator("#log").filter({ hasNotText: "of the first life" }).waitFor();
  await live(page);
  assert.equal(await page.evaluate(() => window.mark), 1);
  await server.stop();
  server.build = "build-2";
  await server.again();
  await page.waitForFunction(() => window.mark === undefined, null, { timeout: 10000 });
  await live(page);
});

scenario("a slow viewer answers what it drew, and no more", { needs: "stand-in" }, async ({ page, server }) => {
  await live(page);
  await page.waitForTimeout(1000);
  const seen = server.received.filter(({ type }) => type === "seen").map(({ n }) => n);
  assert.ok(seen.length > 2 && seen.every((n, i) => i === 0 || n > seen[i - 1]));
  server.left_out = 7;
  await timeUntil(page, "#fresh-age", "7 left out");
});

scenario("several robots: the list, another robot, and a neighbour's alarm", { needs: "stand-in", server: { robots: [1, 2, 3] } }, async ({ page, server }) => {
  await live(page);
  await timeUntil(page, "#others", "robot 2");
  await page.keyboard.press("3");
  await timeUntil(page, "#robot-name", "Robot 3");
  await live(page);
  assert.equal(server.received.filter(({ type }) => type === "open").at(-1).robot, 3);
  await page.click('[data-robot="1"]');
  await timeUntil(page, "#robot-name", "Robot 1");
  await page.hover('[data-robot="2"]');
  await page.mouse.down();
  await page.waitForTimeout(1300);
  await page.mouse.up();
  await timeUntil(page, "#robot-name", "Robot 2");
});

scenario("a replay: its banner, its scrubber, and no orders", { needs: "stand-in", server: { replay: true, start_s: 60 }, context: WIDE }, async ({ page, server, shot }) => {
  await live(page);
  assert.equal(await page.locator("#replay-word").isVisible(), true);
  assert.equal(await page.locator("#order-hold").isVisible(), false);
  await page.waitForTimeout(1200);
  await shot("replay");
  await page.click("#play");
  await timeUntil(page, "#fresh-word", "PAUSED");
  await page.waitForTimeout(2500);
  assert.match(await text(page, "#fresh-word"), /PAUSED/, "a pause is no silence");
  assert.equal(await page.locator("#cover").isVisible(), false);
  await page.focus("#scrub");
  await page.keyboard.press("Home");
  await timeUntil(page, "#replay-at", /^0:0/);
  await timeUntil(page, "#phase", "on the ground");
  await page.selectOption("#speed", "5");
  await page.click("#play");
  await timeUntil(page, "#replay-at", /^0:1/);
  await page.click("text=Next event");
  await timeUntil(page, "#replay-at", /^0:4/);
  await page.keyboard.press("Shift+H");
  assert.equal(server.received.filter(({ type }) => type === "order").length, 0);
});

scenario("a hidden page closes its connection after 30 s and begins anew when it is back", { needs: "stand-in", ci: true }, async ({ page, server }) => {
  await live(page);
  await page.clock.install();
  await page.clock.resume();
  const hide = (state) => page.evaluate((to) => {
    Object.defineProperty(document, "visibilityState", { value: to, configurable: true });
    document.dispatchEvent(new Event("visibilitychange"));
  }, state);
  await hide("hidden");
  await page.waitForTimeout(300);
  assert.equal(server.received.filter(({ type }) => type === "hidden").at(-1).hidden, true);
  assert.equal(server.pages.size, 1);
  await page.clock.fastForward(31000);
  await page.waitForTimeout(500);
  assert.equal(server.pages.size, 0);
  await hide("visible");
  await live(page);
  assert.equal(server.pages.size, 1);
});

scenario("a page that stood still, as when the machine slept, is covered until it has drawn what is new", { needs: "stand-in", ci: true }, async ({ page, server }) => {
  await live(page);
  await page.evaluate(() => {
    window.covers = [];
    const cover = document.getElementById("cover");
    new MutationObserver(() => window.covers.push(cover.hidden ? "hidden" : document.getElementById("cover-word").textContent)).observe(cover, { attributes: true, childList: true, subtree: true, characterData: true });
    window.standStill = (ms) => setTimeout(() => {
      window.covers = [];
      const end = performance.now() + ms;
      while (performance.now() < end);
    }, 0);
  });
  // The server goes on meanwhile, and its messages wait in the browser: the page is covered before it believes them.
  await page.evaluate(() => window.standStill(3000));
  await page.waitForFunction(() => window.covers.length > 0, null, { timeout: WAIT_MS });
  assert.match((await page.evaluate(() => window.covers))[0], /WAITING|NO.CONTACT/);
  await live(page);
  // The server is silent before the page goes on: only messages of before wait for it.
  await page.evaluate(() => window.standStill(3000));
  await new Promise((done) => setTimeout(done, 1000));
  server.freeze();
  await timeUntil(page, "#cover-word", /NO.CONTACT/);
  assert.ok(!(await page.evaluate(() => window.covers)).includes("hidden"), "no old picture was shown as live");
  server.thaw();
  await live(page);
});

scenario("tiles lie under the grid, and one that is missing is asked for again", { needs: "stand-in", server: { tiles: { min_zoom: 15, max_zoom: 19 }, missing: true }, context: WIDE }, async ({ page, server, shot }) => {
  await live(page);
  const loaded = () => page.waitForFunction(() => [...document.querySelectorAll("#map img.leaflet-tile-loaded")].some((tile) => tile.naturalWidth > 0), null, { timeout: 4 * WAIT_MS });
  await loaded();
  await shot("tiles");
  const asked = server.requests.filter((url) => url.startsWith("/tiles/"));
  assert.ok(asked.every((url) => /^\/tiles\/\d+\/\d+\/\d+(\?\d+)?$/.test(url)), asked.join(" "));
  assert.ok(asked.every((url) => Number(url.split("/")[2]) <= 19), "no zoom that the server has not");
  // The grid is above, and the panels are opaque.
  assert.ok(await page.evaluate(() => Number(getComputedStyle(document.querySelector(".sheet-of-map")).zIndex) > Number(getComputedStyle(document.querySelector(".leaflet-pane")).zIndex)));
});

for (const [name, context] of [["forced colours", { forcedColors: "active" }], ["reduced motion", { reducedMotion: "reduce" }]]) {
  scenario(`${name}: live, old values marked, and NO CONTACT over everything`, { needs: "stand-in", context }, async ({ page, server, shot }) => {
    await live(page);
    server.telemetry = { freshness: "stale", age_ms: 4200 };
    await timeUntil(page, "#fresh-word", "STALE");
    assert.match(await text(page, "#value-battery"), /\?$/);
    await shot(name.replace(" ", "-"));
    server.freeze();
    const took = await timeUntil(page, "#cover-word", /NO.CONTACT/);
    assert.ok(took < STALE_MS + SLACK_MS, `${took} ms`);
    // The cover hides what is below it also in the colours of the system.
    const paint = await page.evaluate(() => getComputedStyle(document.getElementById("cover")).backgroundImage);
    assert.match(paint, /gradient/);
    server.thaw();
    await live(page);
  });
}

scenario("text of twice the size: nothing is cut off, and HOLD is in reach", { needs: "stand-in", context: { viewport: { width: 1280, height: 900 } } }, async ({ page, server, shot }) => {
  await live(page);
  await page.evaluate(() => (document.documentElement.style.fontSize = "200%"));
  await page.waitForTimeout(500);
  await shot("text-200");
  const found = await page.evaluate(() => {
    const out = [];
    if (document.documentElement.scrollWidth > innerWidth) out.push(`the page is ${document.documentElement.scrollWidth} px wide`);
    for (const node of document.querySelectorAll("#banner *, .tile *, .cell *, #buttons button, #tabs button")) {
      if (node.clientWidth > 0 && node.scrollWidth > node.clientWidth + 1) out.push(`clipped: ${node.id} ${node.textContent} ${node.scrollWidth} > ${node.clientWidth}`);
    }
    return out;
  });
  assert.deepEqual(found, []);
  await page.click("#order-hold");
  await progress(page, "DONE");
  assert.equal(orders(server, "hold").length, 1);
});

for (const [name, context] of [["360 px", PHONE], ["1920 px", WIDE]]) {
  scenario(`${name}: all fits, nothing overlaps, every target is large`, { ci: true, context, server: { robots: [1, 2, 3] } }, async ({ page, server, shot }) => {
    await live(page);
    if (!server.isReal) {
      server.alarms = [LINK_ALARM];
      server.say();
      await timeUntil(page, "#alarm", "silent");
    }
    const found = await page.evaluate(() => {
      const out = [];
      const root = document.documentElement;
      if (root.scrollWidth > innerWidth || root.scrollHeight > innerHeight) out.push(`page scrolls: ${root.scrollWidth} x ${root.scrollHeight}`);
      const main = document.getElementById("main");
      if (main.scrollHeight > main.clientHeight + 1 || main.scrollWidth > main.clientWidth) out.push(`main scrolls: ${main.scrollWidth} x ${main.scrollHeight} in ${main.clientWidth} x ${main.clientHeight}`);
      for (const node of document.querySelectorAll("button, input, select")) {
        const { width, height } = node.getBoundingClientRect();
        if (width > 0 && (width < 47.5 || height < 47.5)) out.push(`small target ${node.id || node.textContent}: ${width} x ${height}`);
      }
      for (const node of document.querySelectorAll("#banner *, .tile *, .cell *, #buttons button, #tabs button")) {
        if (node.clientWidth > 0 && node.scrollWidth > node.clientWidth + 1) out.push(`clipped: ${node.id} ${node.textContent} ${node.scrollWidth} > ${node.clientWidth}`);
      }
      const boxes = [...document.querySelectorAll("#who, #doing, #alarm, #fresh, #tools, #map-panel, .tile, #horizon, .cell, #tabs, .panel, #bar")].map((node) => [node.id || node.className, node.getBoundingClientRect()]).filter(([, box]) => box.width > 0);
      boxes.forEach(([a, one], i) => boxes.slice(i + 1).forEach(([b, two]) => {
        if (one.left < two.right - 1 && two.left < one.right - 1 && one.top < two.bottom - 1 && two.top < one.bottom - 1) out.push(`${a} overlaps ${b}`);
      }));
      return out;
    });
    await shot(`${name.replace(" ", "")}-alarm`);
    assert.deepEqual(found, []);
  });
}

for (const theme of ["light", "dark", "sun"]) {
  for (const [size, context] of [["360", PHONE], ["1920", WIDE]]) {
    scenario(`axe-core finds nothing: ${theme}, ${size} px`, { ci: `${theme}${size}` === "light360" || `${theme}${size}` === "dark1920", server: { robots: [1, 2, 3] }, context: { ...context, colorScheme: theme === "dark" ? "dark" : "light", contrast: theme === "sun" ? "more" : "no-preference", bypassCSP: true } }, async ({ page, server, shot }) => {
      await live(page);
      assert.equal(await page.getAttribute("html", "data-theme"), theme, "the system's wish is followed");
      await page.addScriptTag({ path: AXE });
      await page.waitForTimeout(1100);
      const judge = async (state) => {
        await shot(`${size}-${theme}-${state}`);
        const { violations } = await page.evaluate(() => window.axe.run(document, { resultTypes: ["violations"] }));
        const short = violations.map(({ id, nodes }) => `${state}: ${id}: ${nodes.slice(0, 4).map(({ target, failureSummary }) => `${target} ${failureSummary}`).join("; ")}`);
        assert.deepEqual(short, []);
      };
      await judge("live");
      if (server.isReal) return;
      server.alarms = [LINK_ALARM, { id: "battery", severity: "warning", text: "battery 22.1 V, 0.4 V below the WARN limit", next_step: null, since_s: 40 }];
      server.telemetry = { freshness: "stale", age_ms: 4200 };
      server.say();
      await timeUntil(page, "#fresh-word", "STALE");
      await judge("stale");
      for (const key of ["l", "g", "u", "o", "m"]) {
        await page.keyboard.press(key);
        await page.waitForTimeout(450);
        await judge(`dialog-${key}`);
        await page.keyboard.press("Escape");
      }
      if (size === "360") {
        for (const tab of ["events", "robots"]) {
          await page.click(`#tab-${tab}`);
          await judge(tab);
        }
      }
      await page.click("#order-hold");
      await timeUntil(page, "#progress", "DONE");
      await judge("order");
      server.freeze();
      await timeUntil(page, "#cover-word", /NO.CONTACT/);
      await judge("no-contact");
    });
  }
}
