// Whether what is on the screen may be believed. Pure: it is given the time of the page's clock and of the wall clock, in ms.

/** A page whose own clock stood still for so long was frozen, or the machine slept. */
const GAP_MS = 1000;

/** @typedef {"connecting"|"live"|"lost"|"waking"|"refused"} ContactState */

export class Contact {
  staleAfterMs = 1500;
  /** When the last message came; null before the first one. @type {number|null} */
  heard = null;
  /** What the server said before it closed. @type {string|null} */
  refusal = null;
  /** The ping whose answer ends a cover after a gap: what was queued meanwhile came before it. @type {string|null} */
  #awaited = null;
  /** Whether a drawn message ends the cover. */
  #waking = false;
  /** Whether this server has answered a ping. */
  #answers = false;
  #ticked = NaN;
  #wall = NaN;

  /** A connection begins. */
  opened() {
    this.refusal = null;
    this.#answers = false;
    this.#awaited = null;
  }

  /** A message came. @param {number} now */
  message(now) {
    this.heard = now;
  }

  /** A ping was answered. @param {string} id */
  ponged(id) {
    this.#answers = true;
    if (this.#awaited === id) this.#awaited = null;
  }

  /** A message is on the screen. */
  drawn() {
    if (this.#awaited === null || !this.#answers) this.#waking = false;
  }

  /**
   * The page's clock goes on. Gives true after a gap, when everything is to be covered; then `awake` is to be called.
   * @param {number} now @param {number} wall
   */
  tick(now, wall) {
    const gap = Math.max(now - this.#ticked, wall - this.#wall);
    [this.#ticked, this.#wall] = [now, wall];
    return gap > GAP_MS;
  }

  /** Covers until something is drawn after the answer to this ping. @param {string|null} ping */
  wake(ping) {
    this.#waking = true;
    this.#awaited = ping;
  }

  /** @param {number} now @returns {ContactState} */
  state(now) {
    if (this.refusal !== null) return "refused";
    if (this.heard === null) return "connecting";
    if (now - this.heard > this.staleAfterMs) return "lost";
    return this.#waking ? "waking" : "live";
  }

  /** Whether an order can be sent. @param {number} now */
  isLive(now) {
    return this.state(now) === "live";
  }

  /** Since when nothing was heard, in ms. @param {number} now */
  silence(now) {
    return this.heard === null ? 0 : now - this.heard;
  }
}
