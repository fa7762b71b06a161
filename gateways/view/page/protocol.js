// Where a text from the server becomes a message of `hero.view.v1`; their types are in protocol.d.ts.

/** The WebSocket subprotocol. */
export const PROTOCOL = "hero.view.v1";

/**
 * The message of a text; null if it is none, so that one odd text does not end the page.
 * @param {unknown} text
 * @returns {any} one of the types of protocol.d.ts, named by its `type`
 */
export function parse(text) {
  if (typeof text !== "string") return null;
  try {
    const message = JSON.parse(text);
    return message !== null && typeof message === "object" && typeof message.type === "string" ? message : null;
  } catch {
    return null;
  }
}

/** A number for an order: 64 random bits, so that two pages do not choose the same one. */
export function orderNumber() {
  const bytes = crypto.getRandomValues(new Uint8Array(8));
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}
