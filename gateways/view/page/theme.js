// The theme: that of the system, or the one that the user chose for this browser.

import { byId, recall, remember, setAttribute, setText } from "./dom.js";

const THEMES = ["light", "dark", "sun"];
const NAMES = { light: "Light", dark: "Dark", sun: "Sun" };

let theme = "light";
/** @type {() => void} */ let changed = () => {};

/** @param {() => void} whenChanged draws anew what has colours of its own */
export function build(whenChanged) {
  changed = whenChanged;
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const contrast = matchMedia("(prefers-contrast: more)");
  const bySystem = () => (contrast.matches ? "sun" : dark.matches ? "dark" : "light");
  const own = recall("local", "theme");
  set(own !== null && THEMES.includes(own) ? own : bySystem());
  for (const query of [dark, contrast]) {
    query.addEventListener("change", () => {
      if (recall("local", "theme") === null) set(bySystem());
    });
  }
  byId("theme").addEventListener("click", next);
}

/** @param {string} name */
function set(name) {
  theme = name;
  show(name);
  setText(byId("theme"), /** @type {any} */ (NAMES)[name]);
  setAttribute(byId("theme"), "aria-label", `Theme: ${name}; press for the next one`);
}

/** @param {string} name */
function show(name) {
  setAttribute(document.documentElement, "data-theme", name);
  changed();
}

/** Paper is white, whatever the screen is. @param {boolean} is whether the page is printed */
export function onPaper(is) {
  show(is ? "light" : theme);
}

export function next() {
  set(THEMES[(THEMES.indexOf(theme) + 1) % THEMES.length]);
  remember("local", "theme", theme);
}
