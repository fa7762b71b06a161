// The menu: what single keys do, and whether they act in this browser. The theme is in theme.js.

import { byId, make, recall, remember, setAttribute, setText } from "./dom.js";
import * as sheets from "./sheets.js";
import * as sound from "./sound.js";

/** Keys as the menu lists them. */
const KEYS = [
  ["Shift+H", "hold"], ["L", "land"], ["G", "go to"], ["R", "return home"], ["U", "take-off"], ["O", "more orders"], ["1 … 9", "robot"], ["F", "follow the robot"], ["A", "all on the map"],
  ["T", "theme"], ["M", "this menu"], ["Space", "play or pause a replay"],
  [", .", "a second back or on in a replay"], ["P N", "to the event before or the next one"], ["Escape", "closes a dialog"],
];

let keysAct = true;
/** Holds the screen on; null if the browser does not. @type {any} */
let wakeLock = null;

export function build() {
  keysAct = recall("local", "keys") !== "off";
  byId("set-up").addEventListener("click", menu);
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
  const alarms = sheets.button("", () => {
    sound.toggle();
    nameAlarms();
  }, { id: "sound" });
  const nameAlarms = () => {
    setText(alarms, `Sound of alarms: ${sound.on() ? "on" : "off"}`);
    setAttribute(alarms, "aria-pressed", String(sound.on()));
  };
  nameAlarms();
  const rows = KEYS.map(([key, act]) => make("div", {}, make("dt", {}, key), make("dd", {}, act)));
  const why = isSecureContext && "wakeLock" in navigator ? "this browser does not keep the screen on." : "keeping the screen on needs HTTPS or localhost.";
  const sleep = make("p", { class: "quiet" }, wakeLock && !wakeLock.released ? "The screen stays on while this page is visible." : `This device may go to sleep: ${why}`);
  sheets.open({ title: "Menu", kind: "menu", children: [make("dl", { class: "keys" }, ...rows), sleep, sheets.row(toggle, alarms, sheets.button("Close", sheets.close))] });
  byId("set-up").setAttribute("aria-expanded", "true");
}

/** Keeps the screen on while the page is seen; a browser that refuses, to save its battery for example, is no fault. */
export async function stayAwake() {
  try {
    if (document.visibilityState === "visible") wakeLock = await /** @type {any} */ (navigator).wakeLock?.request("screen");
  } catch {
    // The menu says so.
  }
}
