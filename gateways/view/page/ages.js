// How old a value is, at most. The page's clock and the server's clock have no common zero, and a message may wait on its way, so the
// age at sending alone is too small. Two bounds help: what the server sent after it had heard from the page was sent later than the
// page spoke; so the latest such pair limits how far the clocks are apart, and with it how long each message was on its way.

/** Round trips that are kept: a minute of one a second. Old ones go, because clocks drift. */
const KEPT = 60;

/** All times are in ms: `page` of performance.now(), `server` of `sent_ms`. */
export class Ages {
  /** Least value of page time less server time, by each round trip. @type {number[]} */
  #bounds = [];
  /** @type {Map<string, number>} */
  #pings = new Map();
  /** When `open` was sent; null once it has served. @type {number|null} */
  #opened = null;
  /** Round trip of the last answered ping; null before. @type {number|null} */
  roundTripMs = null;

  /** A connection begins: the page has sent `open`. @param {number} page */
  opened(page) {
    this.#bounds = [];
    this.#pings.clear();
    this.#opened = page;
    this.roundTripMs = null;
  }

  /** The page's clock may have stood still: what was known of the two clocks holds no more. */
  gap() {
    this.#bounds = [];
    this.#opened = null;
  }

  /** @param {string} id @param {number} page */
  pinged(id, page) {
    if (this.#pings.size >= KEPT) this.#pings.clear();
    this.#pings.set(id, page);
  }

  /** Takes the answer to a ping. @param {string} id @param {number} server @param {number} page */
  ponged(id, server, page) {
    const sent = this.#pings.get(id);
    if (sent === undefined) return;
    this.#pings.delete(id);
    this.roundTripMs = page - sent;
    if (Number.isFinite(server)) this.#add(sent - server);
  }

  /** Takes the moment of any message: the first one answers `open`. @param {number} server */
  arrived(server) {
    if (this.#opened === null || !Number.isFinite(server)) return;
    this.#add(this.#opened - server);
    this.#opened = null;
  }

  /** @param {number} bound */
  #add(bound) {
    this.#bounds.push(bound);
    if (this.#bounds.length > KEPT) this.#bounds.shift();
  }

  /**
   * How long ago a message was sent, at most; infinite without a bound.
   * @param {number} server when it was sent @param {number} page now
   */
  since(server, page) {
    if (this.#bounds.length === 0) return Infinity;
    return Math.max(0, page - server - Math.max(...this.#bounds));
  }

  /**
   * How old a value is at most.
   * @param {number|null} ageMs its age when it was sent; null if there is no value
   * @param {number} server @param {number} page
   */
  of(ageMs, server, page) {
    return ageMs === null ? null : ageMs + this.since(server, page);
  }
}
