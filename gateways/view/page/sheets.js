// The sheet: one dialog at a time. It is not modal, so that HOLD is always in reach.

import { byId, make, setHidden, setText } from "./dom.js";

/** What is called when the open sheet closes. @type {(() => void)|null} */ let closing = null;
/** @type {Element|null} */ let before = null;
/** @type {any} */ let timer = 0;

export function isOpen() {
  return !byId("sheet").hidden;
}

/**
 * Opens a sheet instead of what is open.
 * @param {{title: string, kind: string, children: (Node|string)[], seconds?: number, closed?: () => void}} what `seconds`: it closes by itself
 */
export function open({ title, kind, children, seconds, closed }) {
  close();
  before = document.activeElement;
  closing = closed ?? null;
  const sheet = byId("sheet");
  const left = make("p", { class: "left", hidden: seconds === undefined });
  sheet.dataset.kind = kind;
  sheet.replaceChildren(make("h2", { id: "sheet-title", tabindex: "-1" }, title), ...children, left);
  setHidden(sheet, false);
  // Not on a button: a key that is still down would press it.
  byId("sheet-title").focus();
  if (seconds === undefined) return;
  const end = performance.now() + seconds * 1000;
  const tick = () => {
    const rest = Math.ceil((end - performance.now()) / 1000);
    setText(left, `Closes in ${rest} s; nothing is ordered`);
    if (rest <= 0) close();
  };
  tick();
  timer = setInterval(tick, 200);
}

export function close() {
  const sheet = byId("sheet");
  if (sheet.hidden) return;
  clearInterval(timer);
  const hadFocus = sheet.contains(document.activeElement);
  setHidden(sheet, true);
  sheet.replaceChildren();
  byId("set-up").setAttribute("aria-expanded", "false");
  const then = closing;
  closing = null;
  then?.();
  if (hadFocus && before instanceof HTMLElement && before.isConnected) before.focus();
}

/** Buttons in a row. @param {Node[]} buttons */
export function row(...buttons) {
  return make("div", { class: "row" }, ...buttons);
}

/** @param {string} text @param {() => void} press @param {Record<string, any>} [more] */
export function button(text, press, more = {}) {
  return make("button", { type: "button", onclick: press, ...more }, text);
}

/** A field with its name. @param {string} name @param {Record<string, any>} attributes */
export function field(name, attributes) {
  const input = make("input", { type: "text", autocomplete: "off", spellcheck: "false", ...attributes });
  return { input, label: make("label", {}, make("span", {}, name), input) };
}

/**
 * A button that acts after it was held down for a while: by finger, mouse, space or Enter.
 * @param {string} text @param {number} ms @param {() => void} act
 */
export function holdButton(text, ms, act) {
  /** @type {any} */ let held = 0;
  const node = make("button", { type: "button", class: "confirm held" }, text);
  const down = () => {
    if (held || node.disabled) return;
    node.dataset.down = "";
    held = setTimeout(() => {
      up();
      // A dialog that was closed meanwhile orders nothing.
      if (node.isConnected) act();
    }, ms);
  };
  const up = () => {
    clearTimeout(held);
    held = 0;
    delete node.dataset.down;
  };
  node.addEventListener("pointerdown", (event) => event.button === 0 && down());
  for (const end of ["pointerup", "pointerleave", "pointercancel", "blur"]) node.addEventListener(end, up);
  node.addEventListener("contextmenu", (event) => event.preventDefault());
  node.addEventListener("keydown", (event) => {
    if (event.key !== " " && event.key !== "Enter") return;
    event.preventDefault();
    if (!event.repeat) down();
  });
  node.addEventListener("keyup", up);
  return node;
}
