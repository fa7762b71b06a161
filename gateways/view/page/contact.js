// Whether what is on the screen may be believed. Pure: it is given the time of the page's clock and of the wall clock, in ms.

/** A page whose own clock stood still for so long was frozen, or the machine slept. */
const GAP_MS = 1000;

/** Most pings without an answer that are kept. */
const PINGS = 30;

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
  /** Pings without an answer, the oldest first: what this page says may not reach the server, though messages come. @type {{id: string, at: number}[]} */
  #unanswered = [];
  #ticked = NaN;
  #wall = NaN;

  /** A connection begins. */
  opened() {
    this.refusal = null;
    this.#unanswered = [];
    this.#awaited = null;
  }

  /** A message came. @param {number} now */
  message(now) {
    this.heard = now;
  }

  /** A ping was sent. @param {string} id @param {number} now */
  pinged(id, now) {
    this.#unanswered.push({ id, at: now });
    // Those between say nothing that the oldest and the newest do not.
    if (this.#unanswered.length > PINGS) this.#unanswered.splice(1, 1);
  }

  /** A ping was answered, and so those before it have arrived. @param {string} id */
  ponged(id) {
    this.#unanswered.splice(0, 1 + this.#unanswered.findIndex((ping) => ping.id === id));
    if (this.#awaited === id) this.#awaited = null;
  }

  /** A message is on the screen. */
  drawn() {
    if (this.#awaited === null) this.#waking = false;
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
    if (this.silence(now) > this.staleAfterMs) return "lost";
    return this.#waking ? "waking" : "live";
  }

  /** Whether an order can be sent. @param {number} now */
  isLive(now) {
    return this.state(now) === "live";
  }

  /** For how long nothing was heard, or the server has not heard this page, in ms. @param {number} now */
  silence(now) {
    if (this.heard === null) return 0;
    const [oldest] = this.#unanswered;
    return now - Math.min(this.heard, oldest ? oldest.at : Infinity);
  }
}
