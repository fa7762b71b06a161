// What the browser tests stand on: Chromium, and a server. Either the stand-in, whose scenarios a test can set, or a real `ril view`:
//   HERO_VIEW_URL    its address, such as http://127.0.0.1:8765/ ; without it the stand-in is started
//   HERO_VIEW_TOKEN  the token that it wants
//   HERO_VIEW_PID    its process, for tests that stop and continue it
//   HERO_CHROMIUM    the browser (/usr/bin/chromium)
//   HERO_VIEW_CI     a form for machines that stall: the cases marked so, each in three attempts, with watchdogs for limits
//   HERO_VIEW_SHOTS  a folder for screenshots

import { existsSync, mkdirSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { chromium } from "playwright-core";
import { StandIn } from "./stand-in.mjs";

const BROWSER = process.env.HERO_CHROMIUM ?? "/usr/bin/chromium";
const REAL = process.env.HERO_VIEW_URL ?? null;
const PID = Number(process.env.HERO_VIEW_PID ?? 0);
const SHOTS = process.env.HERO_VIEW_SHOTS ?? null;

/** What a test can do to a real server. */
const real = { isReal: true, freeze: () => process.kill(PID, "SIGSTOP"), thaw: () => process.kill(PID, "SIGCONT") };

const IS_CI = Boolean(process.env.HERO_VIEW_CI);
const ATTEMPTS = IS_CI ? 3 : 1;

/** The page says NO CONTACT after 1.5 s; a busy machine draws later. */
export const STALE_MS = 1500;
export const SLACK_MS = IS_CI ? 60000 : 1500;

/** How long something may take that has no limit of its own. */
export const WAIT_MS = IS_CI ? 60000 : 10000;

let browser = null;

export async function closeBrowser() {
  await browser?.close();
  browser = null;
}

/** A test, again if it fails where attempts are left. @param {string} name @param {object} options @param {(t: any) => Promise<void>} body */
export function attempted(name, options, body) {
  test(name, options, async (t) => {
    for (let attempt = 1; ; attempt += 1) {
      try {
        return await body(t);
      } catch (error) {
        if (attempt === ATTEMPTS) throw error;
        t.diagnostic(`attempt ${attempt}: ${error}`);
      }
    }
  });
}

/** The one browser of all tests. */
export async function theBrowser() {
  browser ??= await chromium.launch({ executablePath: BROWSER, args: ["--no-sandbox"], timeout: WAIT_MS });
  return browser;
}

/** What no page of ours does: errors, warnings, requests to others. @param {any} page @param {string} url @param {string[]} problems */
export function watch(page, url, problems) {
  page.on("console", (message) => ["error", "warning"].includes(message.type()) && problems.push(`${message.type()}: ${message.text()}`));
  page.on("pageerror", (error) => problems.push(String(error.stack)));
  page.on("request", (request) => {
    const { protocol, host } = new URL(request.url());
    if (protocol !== "data:" && host !== new URL(url).host) problems.push(`request to ${request.url()}`);
  });
}

/** Why a test is skipped; false if it is not. @param {{ci?: boolean}} how */
export function skipped(how) {
  if (!existsSync(BROWSER)) return `no browser at ${BROWSER}`;
  return IS_CI && !how.ci ? "not of the form for machines that stall" : false;
}

/**
 * A test with a server and a page. `ci`: also in the form for machines that stall. What it needs: `stand-in`, because it sets scenarios; `freeze`, because it stops the process.
 * @param {string} name
 * @param {{ci?: boolean, needs?: "stand-in"|"freeze", server?: object, context?: object, query?: string}} how
 * @param {(at: {page: any, server: any, context: any, open: (context?: object) => Promise<any>, shot: (name: string, page?: any) => Promise<void>, problems: string[], t: any}) => Promise<void>} body
 */
export function scenario(name, how, body) {
  const skip = skipped(how) || (REAL && how.needs === "stand-in" ? "needs the stand-in" : REAL && how.needs === "freeze" && !PID ? "needs HERO_VIEW_PID" : false);
  attempted(name, { skip, timeout: ATTEMPTS * 120000 }, async (t) => {
    const browser = await theBrowser();
    const server = REAL ? real : await new StandIn(how.server).start();
    const problems = [];
    const contexts = [];
    const open = async (options = {}) => {
      const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, ...how.context, ...options });
      contexts.push(context);
      const page = await context.newPage();
      const url = REAL ?? server.url;
      watch(page, url, problems);
      const token = REAL ? process.env.HERO_VIEW_TOKEN : how.server?.token;
      await page.goto(url + (how.query ?? "") + (token ? `#token=${token}` : ""));
      return page;
    };
    try {
      const page = await open();
      const shot = async (file, of = page) => {
        if (SHOTS === null) return;
        mkdirSync(SHOTS, { recursive: true });
        await of.screenshot({ path: join(SHOTS, `${file}.png`) });
      };
      await body({ page, server, context: contexts[0], open, shot, problems, t });
    } finally {
      for (const context of contexts) await context.close();
      if (!REAL) await server.stop();
    }
  });
}

/** Until the picture is live. */
export async function live(page) {
  await page.locator("#cover").waitFor({ state: "hidden", timeout: WAIT_MS });
  await page.locator("#value-height").filter({ hasText: /\d/ }).waitFor({ timeout: WAIT_MS });
}

/** How long until a text is there, ms. */
export async function timeUntil(page, selector, text, most = WAIT_MS) {
  const began = performance.now();
  await page.locator(selector).filter({ hasText: text }).waitFor({ timeout: most });
  return performance.now() - began;
}
