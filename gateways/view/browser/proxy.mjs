// A proxy between browser and server. A test stalls its bytes, or makes it slow: Chromium's own "offline" does not stop a WebSocket.

import { connect, createServer } from "node:net";
import { Transform } from "node:stream";

/** Bytes that a slow line passes at once. */
const PIECE = 256;

export class Proxy {
  /** @param {number} port where the server is */
  constructor(port) {
    this.pairs = new Set();
    this.stalled = false;
    /** Bytes a second from the server to the browser. */
    this.rate = Infinity;
    this.listener = createServer((socket) => {
      const other = connect(port, "127.0.0.1");
      const slow = this.#slow();
      const pair = [socket, other, slow];
      this.pairs.add(pair);
      const end = () => {
        this.pairs.delete(pair);
        for (const one of pair) one.destroy();
      };
      for (const one of pair) one.on("error", end).on("close", end);
      socket.pipe(other);
      other.pipe(slow).pipe(socket);
      if (this.stalled) this.#hold(pair, true);
    });
  }

  async start() {
    await new Promise((done) => this.listener.listen(0, "127.0.0.1", done));
    return this.listener.address().port;
  }

  /** Passes bytes on, piece by piece, at the rate of the moment. */
  #slow() {
    const proxy = this;
    return new Transform({
      async transform(chunk, _, done) {
        for (let at = 0; at < chunk.length; at += PIECE) {
          const piece = chunk.subarray(at, at + PIECE);
          if (Number.isFinite(proxy.rate)) await new Promise((then) => setTimeout(then, (piece.length / proxy.rate) * 1000));
          this.push(piece);
        }
        done();
      },
    });
  }

  #hold([socket, other, slow], stalled) {
    if (stalled) {
      socket.unpipe(other).pause();
      slow.unpipe(socket).pause();
    } else {
      socket.pipe(other);
      slow.pipe(socket);
    }
  }

  /** Bytes stay here, and connections stay open. @param {boolean} stalled */
  stall(stalled) {
    this.stalled = stalled;
    for (const pair of this.pairs) this.#hold(pair, stalled);
  }

  async stop() {
    for (const pair of this.pairs) for (const one of pair) one.destroy();
    await new Promise((done) => this.listener.close(done));
  }
}
