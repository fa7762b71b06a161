// What the user may choose for this browser: the theme, and whether single keys act.

import { byId, make, recall, remember, setAttribute, setText } from "./dom.js";
import * as sheets from "./sheets.js";

const THEMES = ["light", "dark", "sun"];
const NAMES = { light: "Light", dark: "Dark", sun: "Sun" };

/** Keys as the menu lists them. */
const KEYS = [
  ["Shift+H", "hold"], ["L", "land"], ["G", "go to"], ["U", "take-off"], ["O", "more orders"], ["1 … 9", "robot"], ["F", "follow the robot"], ["A", "all on the map"],
  ["T", "theme"], ["M", "this menu"], ["Space", "play or pause a replay"],
  [", .", "a second back or on in a replay"], ["P N", "to the event before or the next one"], ["Escape", "closes a dialog"],
];

let theme = "light";
let keysAct = true;
/** @type {() => void} */ let themeChanged = () => {};

/** @param {() => void} whenThemeChanges */
export function build(whenThemeChanges) {
  themeChanged = whenThemeChanges;
  keysAct = recall("local", "keys") !== "off";
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const contrast = matchMedia("(prefers-contrast: more)");
  const bySystem = () => (contrast.matches ? "sun" : dark.matches ? "dark" : "light");
  const own = recall("local", "theme");
  setTheme(own !== null && THEMES.includes(own) ? own : bySystem());
  for (const query of [dark, contrast]) {
    query.addEventListener("change", () => {
      if (recall("local", "theme") === null) setTheme(bySystem());
    });
  }
  byId("theme").addEventListener("click", nextTheme);
  byId("set-up").addEventListener("click", menu);
}

/** @param {string} name */
function setTheme(name) {
  theme = name;
  setAttribute(document.documentElement, "data-theme", name);
  setText(byId("theme"), /** @type {any} */ (NAMES)[name]);
  setAttribute(byId("theme"), "aria-label", `Theme: ${name}; press for the next one`);
  themeChanged();
}

export function nextTheme() {
  setTheme(THEMES[(THEMES.indexOf(theme) + 1) % THEMES.length]);
  remember("local", "theme", theme);
}

export function keysAreOn() {
  return keysAct;
}

export function menu() {
  if (sheets.isOpen() && byId("sheet").dataset.kind === "menu") return sheets.close();
  const toggle = sheets.button("", () => {
    keysAct = !keysAct;
    remember("local", "keys", keysAct ? "on" : "off");
    name();
  }, { id: "keys" });
  const name = () => {
    setText(toggle, `Single keys: ${keysAct ? "on" : "off"}`);
    setAttribute(toggle, "aria-pressed", String(keysAct));
  };
  name();
  const rows = KEYS.map(([key, act]) => make("div", {}, make("dt", {}, key), make("dd", {}, act)));
  const sleep = make("p", { class: "quiet" }, isSecureContext && "wakeLock" in navigator ? "The screen stays on while this page is visible." : "This device may go to sleep: keeping the screen on needs HTTPS or localhost.");
  sheets.open({ title: "Menu", kind: "menu", children: [make("dl", { class: "keys" }, ...rows), sleep, sheets.row(toggle, sheets.button("Close", sheets.close))] });
  byId("set-up").setAttribute("aria-expanded", "true");
}

/** Keeps the screen on while the page is seen; a browser that refuses is no fault. */
export async function stayAwake() {
  try {
    if (document.visibilityState === "visible") await /** @type {any} */ (navigator).wakeLock?.request("screen");
  } catch {
    // The menu says so.
  }
}
