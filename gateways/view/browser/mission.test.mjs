// The page on a real `ril view`, and a simulated helicopter that it flies: the mission of the README, two pages, links that break.
//   RIL_BINARY          the binary (target/debug/ril)
//   RIL_WRITE_PICTURES  writes the pictures of the documentation anew

import assert from "node:assert/strict";
import { createServer } from "node:http";
import { after } from "node:test";
import { fileURLToPath } from "node:url";
import { WebSocket } from "ws";
import { SLACK_MS, STALE_MS, attempted, closeBrowser, live, skipped, theBrowser, timeUntil, watch } from "./harness.mjs";
import { picture } from "./picture.mjs";
import { Proxy } from "./proxy.mjs";
import { HAS_RIL, RIL, Robot } from "./robot.mjs";

const PHONE = { viewport: { width: 360, height: 740 }, hasTouch: true, isMobile: true };
const WIDE = { viewport: { width: 1920, height: 1080 } };
const PICTURES = Boolean(process.env.RIL_WRITE_PICTURES);
const document = (name) => fileURLToPath(new URL(`../../../docs/${name}`, import.meta.url));
/** How long a flight may take, ms: none of these takes more than half a minute. */
const FLIGHT_MS = 180000;
const CASE_MS = 600000;

after(closeBrowser);

/** A test with a robot and a function that opens its page. */
function flown(name, body) {
  const skip = skipped({ ci: true }) || (HAS_RIL ? false : `no program at ${RIL}`);
  attempted(name, { skip, timeout: CASE_MS }, async () => {
    const browser = await theBrowser();
    const robot = await new Robot().start();
    const contexts = [];
    const problems = [];
    const open = async (options = WIDE, port = robot.port) => {
      const context = await browser.newContext(options);
      contexts.push(context);
      const page = await context.newPage();
      const url = `http://127.0.0.1:${port}/`;
      watch(page, url, problems);
      await page.goto(`${url}#token=${robot.token}`);
      return page;
    };
    try {
      await body({ robot, open, problems });
    } finally {
      for (const context of contexts) await context.close();
      await robot.stop();
    }
  });
}

/** Orders by `act`, and waits until that order is at a stage, or at its end. */
async function ordered(page, kind, act, stages = ["done"]) {
  const known = await page.evaluate(() => [...document.querySelectorAll("#progress .entry")].map(({ dataset }) => dataset.order));
  await act();
  const isThere = ([kind, stages, known]) => [...document.querySelectorAll("#progress .entry")].some(({ dataset }) => dataset.kind === kind && stages.includes(dataset.stage) && !known.includes(dataset.order));
  await page.waitForFunction(isThere, [kind, stages, known], { timeout: FLIGHT_MS });
}

const UNDER_WAY = ["in-progress", "done"];

async function start(page) {
  await page.click("#order-more");
  await page.click("#order-start");
  await page.locator("#confirm-start:enabled").click();
}

async function stop(page) {
  await page.click("#order-more");
  await page.click("#order-stop");
  await page.fill("#stop-word", "stop");
  await page.locator("#confirm-stop:enabled").click();
}

async function takeOff(page, height) {
  await page.click("#order-takeoff");
  await page.fill("#takeoff-height", String(height));
  await page.locator("#takeoff-word:enabled").pressSequentially("takeoff");
}

async function land(page) {
  await page.keyboard.press("l");
  await page.click("#confirm-land");
}

/** Aims by the fields, or by the map if there is no place. */
async function goTo(page, place, altitude) {
  await page.click("#order-goto");
  if (place) {
    await page.fill("#goto-lat", String(place[0]));
    await page.fill("#goto-lon", String(place[1]));
  } else {
    const map = await page.locator("#map").boundingBox();
    await page.mouse.click(map.x + map.width * 0.55, map.y + map.height * 0.45);
  }
  await page.fill("#goto-altitude", String(altitude));
  await page.locator("#confirm-goto:enabled").click();
}

flown("the README's mission, by mouse and keyboard, and a phone beside it", async ({ open, problems }) => {
  const page = await open();
  await live(page);
  await ordered(page, "start", () => start(page));
  await ordered(page, "takeoff", () => takeOff(page, 10));
  await timeUntil(page, "#phase", /hovering/i, FLIGHT_MS);
  await page.click("#order-goto");
  const base = Number(await page.inputValue("#goto-altitude"));
  await page.keyboard.press("Escape");
  for (const place of PICTURES ? [[37.4112, -6.001], [37.4112, -6.0006], [37.4116, -6.0006], [37.4118, -6.0014]] : [[37.4112, -6.001]]) {
    await ordered(page, "goto", () => goTo(page, place, base + 5));
  }
  await ordered(page, "goto", () => goTo(page, [37.4112, -6.0002], base + 5), UNDER_WAY);

  // A phone looks on, and stops it by touch: it needs no command for that.
  const phone = await open({ ...PHONE, deviceScaleFactor: 1 });
  await live(phone);
  if (PICTURES) {
    await picture(page, await theBrowser(), document("view-wide.png"));
    await picture(phone, await theBrowser(), document("view-phone.png"));
  }
  await ordered(phone, "hold", () => phone.tap("#order-hold"));
  await timeUntil(page, "#phase", /hovering/i, FLIGHT_MS);
  await phone.tap("#order-goto");
  await timeUntil(phone, "#sheet", "Another page commands");
  await phone.locator("#sheet").getByRole("button", { name: "Cancel" }).tap();

  // On by the map, and held by a key.
  await ordered(page, "goto", () => goTo(page, null, base + 6), UNDER_WAY);
  await ordered(page, "hold", () => page.keyboard.press("Shift+H"));
  // What the fence forbids is not sent.
  await page.click("#order-goto");
  await page.fill("#goto-lat", "37.42");
  await page.fill("#goto-lon", "-6.001");
  await timeUntil(page, "#sheet", "REFUSED");
  assert.equal(await page.isDisabled("#confirm-goto"), true);
  await page.keyboard.press("Escape");

  await ordered(page, "land", () => land(page));
  await timeUntil(page, "#phase", /on the ground/i, FLIGHT_MS);
  await ordered(page, "stop", () => stop(page));
  assert.deepEqual(problems, []);
});

flown("what breaks is shown, and comes back: slow and stalled line, stopped and killed server, killed bridge", async ({ robot, open }) => {
  const proxy = new Proxy(robot.port);
  const port = await proxy.start();
  const page = await open(WIDE, port);
  await live(page);
  const isCovered = async (what) => {
    const took = await timeUntil(page, "#cover-word", /NO.CONTACT/);
    assert.ok(took < STALE_MS + SLACK_MS, `${what}: ${took} ms`);
  };
  // Half of what a page gets: the newest values come, the others are left out, and there is contact all the time.
  await page.evaluate(() => {
    window.covered = 0;
    const cover = document.getElementById("cover");
    new MutationObserver(() => (window.covered += cover.hidden ? 0 : 1)).observe(cover, { attributes: true });
  });
  proxy.rate = 6000;
  await timeUntil(page, "#fresh-age", "left out");
  assert.match(await page.locator("#fresh-word").innerText(), /LIVE|STALE/);
  assert.equal(await page.evaluate(() => window.covered), 0, "a slow line is contact");
  proxy.rate = Infinity;
  proxy.stall(true);
  await isCovered("a stalled line");
  proxy.stall(false);
  await live(page);
  robot.signal("view", "SIGSTOP");
  await isCovered("a stopped server");
  robot.signal("view", "SIGCONT");
  await live(page);
  await robot.end("bridge", "SIGKILL");
  const took = await timeUntil(page, "#fresh-word", "GONE");
  assert.ok(took < STALE_MS + SLACK_MS, `a killed bridge: ${took} ms`);
  await timeUntil(page, "#alarm", "bridge");
  await robot.run("bridge", ["--port", "dsp"]);
  await timeUntil(page, "#fresh-word", "LIVE");
  await robot.end("view", "SIGKILL");
  await isCovered("a killed server");
  await robot.startView();
  await live(page);
  await timeUntil(page, "#progress", "No page commands");
  await proxy.stop();
});

flown("a foreign page gets nothing", async ({ robot, open }) => {
  const page = await open();
  await live(page);
  const own = `127.0.0.1:${robot.port}`;
  const answer = (origin) => new Promise((done) => {
    const socket = new WebSocket(`ws://${own}/`, ["hero.view.v1"], { origin });
    socket.on("open", () => done("open")).on("error", (error) => done(error.message));
  });
  for (const origin of ["https://evil.example", `http://localhost:${robot.port}`, "null"]) assert.match(await answer(origin), /403/, origin);

  // In the browser, from a page of another port of this machine.
  const stranger = createServer((_, response) => response.setHeader("content-type", "text/html").end("<title>stranger</title>"));
  await new Promise((listening) => stranger.listen(0, "127.0.0.1", listening));
  const other = await page.context().newPage();
  await other.goto(`http://127.0.0.1:${stranger.address().port}/`);
  const got = await other.evaluate(async (host) => {
    const socket = await new Promise((done) => {
      const one = new WebSocket(`ws://${host}/`, ["hero.view.v1"]);
      one.onopen = () => done("open");
      one.onerror = () => done("refused");
    });
    const read = await fetch(`http://${host}/app.js`).then(() => "read", () => "refused");
    const script = await new Promise((done) => {
      const one = document.createElement("script");
      one.src = `http://${host}/app.js`;
      one.onload = () => done("loaded");
      one.onerror = () => done("refused");
      document.head.append(one);
    });
    const frame = await new Promise((done) => {
      const one = document.createElement("iframe");
      one.onload = () => done(one.contentDocument === null ? "refused" : "shown");
      one.src = `http://${host}/`;
      document.body.append(one);
    });
    return { socket, read, frame, script };
  }, own);
  stranger.close();
  assert.equal(got.socket, "refused");
  assert.equal(got.read, "refused");
});
