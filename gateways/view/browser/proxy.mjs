// A proxy between browser and server, of which a test stalls the bytes: Chromium's own "offline" does not stop a WebSocket.

import { connect, createServer } from "node:net";

export class Proxy {
  /** @param {number} port where the server is */
  constructor(port) {
    this.pairs = new Set();
    this.stalled = false;
    this.listener = createServer((socket) => {
      const other = connect(port, "127.0.0.1");
      const pair = [socket, other];
      this.pairs.add(pair);
      const end = () => {
        this.pairs.delete(pair);
        for (const one of pair) one.destroy();
      };
      for (const one of pair) one.on("error", end).on("close", end);
      socket.pipe(other);
      other.pipe(socket);
      if (this.stalled) this.#hold(pair, true);
    });
  }

  async start() {
    await new Promise((done) => this.listener.listen(0, "127.0.0.1", done));
    return this.listener.address().port;
  }

  #hold([socket, other], stalled) {
    if (stalled) {
      socket.unpipe(other).pause();
      other.unpipe(socket).pause();
    } else {
      socket.pipe(other);
      other.pipe(socket);
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
