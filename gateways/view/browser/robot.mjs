// A robot with its view, as processes of this build: simulator, bridge, status, `ril run view`.

import { spawn } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { basename, join } from "node:path";
import { fileURLToPath } from "node:url";

/** The binary: RIL_BINARY, or that of the debug build. */
export const RIL = process.env.RIL_BINARY ?? fileURLToPath(new URL("../../../target/debug/ril", import.meta.url));
export const HAS_RIL = existsSync(RIL);

/** As in the tests of `ril`: no machine that stalls for seconds ends a flight. And a fence around what is flown. */
const BRIDGE = `
[link]
pc_timeout_ms = 60000
ack_timeout_ms = 5000
silent_after_ms = 20000
[movement]
begin_within_ms = 60000
[[fence.area]]
name = "field"
kind = "inclusion"
polygon = [[37.4102, -6.0022], [37.4124, -6.0022], [37.4124, -5.9996], [37.4113, -5.9992], [37.4102, -5.9996]]
`;

const READY_MS = 60000;

/** A port that no process has at this moment. */
export async function freePort() {
  const server = createServer();
  await new Promise((done) => server.listen(0, "127.0.0.1", done));
  const { port } = server.address();
  await new Promise((done) => server.close(done));
  return port;
}

export class Robot {
  folder = mkdtempSync(join(tmpdir(), "hero-view-"));
  /** Shared memory of this robot alone. */
  #root = `/dev/shm/${basename(this.folder)}`;
  #processes = new Map();

  async start() {
    await this.startRobot();
    this.port = await freePort();
    await this.startView();
    return this;
  }

  /** Simulator, bridge and status. @param {string[]} [sim] more options of the simulator @param {string} [bridge] the bridge's configuration */
  async startRobot(sim = [], bridge = BRIDGE) {
    writeFileSync(join(this.folder, "bridge.toml"), bridge);
    await this.run("sim", ["--link", "dsp", "--seed", "1", ...sim]);
    await this.run("bridge", ["--port", "dsp"]);
    await this.run("status");
  }

  async startView() {
    await this.run("view", ["--port", String(this.port)], []);
    this.token = JSON.parse(readFileSync(join(this.folder, "ril", `view-${this.port}.json`), "utf8")).token;
  }

  /** Starts a process, and waits until it is ready. */
  async run(name, options = [], robot = ["--robot", "1"]) {
    await this.begin(name, ["run", name, ...robot, ...options], / ready[ \n]/);
  }

  /** @param {string[]} words @param {["ignore", any, any]} stdio */
  #spawn(words, stdio) {
    const env = { PATH: process.env.PATH, RIL_IPC_ROOT: this.#root, XDG_RUNTIME_DIR: this.folder, XDG_STATE_HOME: this.folder, RIL_ENDS_WITH_PARENT: "1" };
    return spawn(RIL, words, { cwd: this.folder, env, stdio });
  }

  /** A command, until its end. Its exit code must be one of these. @param {string} words @param {number[]} codes */
  async command(words, codes = [0]) {
    const child = this.#spawn(words.split(" "), ["ignore", "ignore", "pipe"]);
    let said = "";
    child.stderr.on("data", (bytes) => { said += bytes; });
    const code = await new Promise((done) => child.once("exit", done));
    if (!codes.includes(code)) throw new Error(`ril ${words} ended with ${code}: ${said}`);
  }

  /** Starts a process that goes on, and waits until it says this. @param {string} name @param {string[]} words @param {RegExp} sign */
  async begin(name, words, sign) {
    const child = this.#spawn(words, ["ignore", "ignore", "pipe"]);
    this.#processes.set(name, child);
    let said = "";
    await new Promise((done, failed) => {
      const why = (text) => () => failed(new Error(`${name} ${text}: ${said}`));
      const timer = setTimeout(why("is not ready"), READY_MS);
      child.on("exit", why("ended"));
      child.on("error", failed);
      child.stderr.on("data", (bytes) => {
        said += bytes;
        if (!sign.test(said)) return;
        clearTimeout(timer);
        done();
      });
    });
  }

  /** @param {string} name @param {NodeJS.Signals} signal */
  signal(name, signal) {
    this.#processes.get(name).kill(signal);
  }

  /** Ends a process by a signal, and waits for its end. */
  async end(name, signal = "SIGTERM") {
    const child = this.#processes.get(name);
    this.#processes.delete(name);
    if (child.exitCode !== null || child.signalCode !== null) return;
    const ended = new Promise((done) => child.once("exit", done));
    child.kill(signal);
    await ended;
  }

  async stop() {
    for (const name of ["view", "record", "status", "bridge", "sim"]) {
      if (this.#processes.has(name)) await this.end(name, name === "view" ? "SIGKILL" : "SIGTERM");
    }
    for (const folder of [this.folder, this.#root]) rmSync(folder, { recursive: true, force: true });
  }
}
