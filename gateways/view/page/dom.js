// Small helpers for the screen. They write only what differs, so that a value drawn twenty times a second costs nothing while it stays.

/** @param {string} id @returns {any} */
export function byId(id) {
  return document.getElementById(id);
}

/** @param {Element} node @param {string} text */
export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

/** @param {Element} node @param {string} name @param {string|null} value null removes it */
export function setAttribute(node, name, value) {
  if (value === null) node.removeAttribute(name);
  else if (node.getAttribute(name) !== value) node.setAttribute(name, value);
}

/** @param {any} node @param {boolean} is */
export function setHidden(node, is) {
  if (node.hidden !== is) node.hidden = is;
}

/**
 * An element. Attributes that begin with "on" are listeners.
 * @param {string} name @param {Record<string, any>} [attributes] @param {(Node|string)[]} children @returns {any}
 */
export function make(name, attributes = {}, ...children) {
  const node = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value === null || value === false) continue;
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else node.setAttribute(key, value === true ? "" : String(value));
  }
  node.append(...children);
  return node;
}

const SVG = "http://www.w3.org/2000/svg";

/** @param {string} name @param {Record<string, string|number>} attributes @param {(Node|string)[]} children @returns {any} */
export function svg(name, attributes = {}, ...children) {
  const node = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, String(value));
  node.append(...children);
  return node;
}

/** The value of a colour or width of the present theme. @param {string} name */
export function themed(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/** What is kept over a reload; null where the browser keeps nothing. @param {"local"|"session"} kind @param {string} key */
export function recall(kind, key) {
  try {
    return (kind === "local" ? localStorage : sessionStorage).getItem(key);
  } catch {
    return null;
  }
}

/** @param {"local"|"session"} kind @param {string} key @param {string} value */
export function remember(kind, key, value) {
  try {
    (kind === "local" ? localStorage : sessionStorage).setItem(key, value);
  } catch {
    // A browser that keeps nothing asks again next time.
  }
}
