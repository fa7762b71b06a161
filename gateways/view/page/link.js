// The connection: one WebSocket, made anew after a growing pause. It decides when to connect, and does not know what messages mean.

import { PROTOCOL } from "./protocol.js";

/** Pauses before the next attempt, ms; the last one repeats. */
const PAUSES = [500, 1000, 2000, 3500, 5000];
/** An attempt that has not connected, and a connection that says nothing, end after so long. */
const SILENCE_MS = 10000;
const ATTEMPT_MS = 5000;
/** More than this waiting in the browser means that nothing leaves it. */
const MOST_WAITING = 16384;

/** The pause before an attempt, ms; `chance` from 0 to 1 keeps many pages from coming at once. @param {number} attempt @param {number} chance */
export function pause(attempt, chance) {
  const most = PAUSES[Math.min(attempt, PAUSES.length - 1)];
  return attempt === 0 ? most : most * (0.8 + 0.2 * chance);
}

export class Link {
  /** @type {WebSocket|null} */ #socket = null;
  #attempt = 0;
  #timer = 0;
  #wanted = false;
  #since = 0;

  /**
   * @param {string} address
   * @param {{opened: () => void, message: (text: unknown) => void, closed: () => void}} to
   * @param {{now: () => number, connect: (address: string, protocol: string) => WebSocket,
   *    after: (ms: number, then: () => void) => number, cancel: (timer: number) => void, chance: () => number}} with_
   */
  constructor(address, to, with_) {
    this.address = address;
    this.to = to;
    this.with = with_;
  }

  get isOpen() {
    return this.#socket?.readyState === 1;
  }

  start() {
    this.#wanted = true;
    if (this.#socket === null) this.#connect();
  }

  /** Ends the connection until `start`. */
  stop() {
    this.#wanted = false;
    this.#drop();
  }

  /** The server has greeted: after an end the next attempt comes soon. What refuses is asked less and less often. */
  settled() {
    this.#attempt = 0;
  }

  /** Sends now or never. @param {object} message @returns {boolean} whether the browser took it */
  send(message) {
    if (!this.isOpen || /** @type {WebSocket} */ (this.#socket).bufferedAmount > MOST_WAITING) return false;
    /** @type {WebSocket} */ (this.#socket).send(JSON.stringify(message));
    return true;
  }

  /** Called now and then: ends what has been silent too long. */
  look() {
    if (this.#socket === null) return;
    const most = this.isOpen ? SILENCE_MS : ATTEMPT_MS;
    if (this.with.now() - this.#since > most) {
      this.#drop();
      this.#again();
    }
  }

  #connect() {
    this.with.cancel(this.#timer);
    this.#since = this.with.now();
    const socket = this.with.connect(this.address, PROTOCOL);
    this.#socket = socket;
    // Events of a socket that was given up say nothing about the present one.
    const mine = (then) => (event) => {
      if (this.#socket === socket) then(event);
    };
    socket.onopen = mine(() => {
      this.#since = this.with.now();
      this.to.opened();
    });
    socket.onmessage = mine((event) => {
      this.#since = this.with.now();
      this.to.message(event.data);
    });
    socket.onclose = mine(() => {
      this.#socket = null;
      this.to.closed();
      this.#again();
    });
  }

  #again() {
    if (!this.#wanted) return;
    this.with.cancel(this.#timer);
    this.#timer = this.with.after(pause(this.#attempt++, this.with.chance()), () => {
      if (this.#wanted && this.#socket === null) this.#connect();
    });
  }

  #drop() {
    const socket = this.#socket;
    this.#socket = null;
    this.with.cancel(this.#timer);
    if (socket === null) return;
    socket.close();
    this.to.closed();
  }
}
