// Prints what Lichtblick's own protocol library gets of a view: judge.mjs PACKAGES ADDRESS COUNT TOPIC...
//
// It subscribes to all topics but journals, and ends when COUNT messages of each TOPIC have come. A line for each message: its topic,
// then its fields. PACKAGES is the folder with node_modules.

import { createRequire } from "node:module";
import { resolve } from "node:path";

import { decoder } from "../../../../tests/src/readers/decoder.mjs";

const [packages, address, count, ...topics] = process.argv.slice(2);
const require = createRequire(resolve(packages, "index.js"));
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const WebSocket = require("ws");
const Decoder = decoder(require);

const socket = new WebSocket(address, ["foxglove.sdk.v1", FoxgloveClient.SUPPORTED_SUBPROTOCOL]);
const client = new FoxgloveClient({ ws: socket });
const channels = new Map();
const missing = new Map(topics.map((topic) => [topic, Number(count)]));
let hasTime = false;

const fail = (why) => {
  console.error(why);
  process.exit(1);
};
client.on("error", (error) => fail(`error: ${error}`));
client.on("close", (event) => fail(`closed: ${event.code} ${event.reason}`));
client.on("status", (status) => fail(`status: ${status.message}`));
client.on("time", () => (hasTime = true));
client.on("advertise", (advertised) => {
  for (const channel of advertised.filter((channel) => !channel.topic.endsWith("journal"))) {
    channels.set(client.subscribe(channel.id), { topic: channel.topic, decoder: new Decoder(channel.schema) });
  }
});
client.on("message", ({ subscriptionId, data }) => {
  const { topic, decoder } = channels.get(subscriptionId);
  const bytes = new Uint8Array(data.buffer, data.byteOffset, data.byteLength);
  console.log([topic, ...decoder.fields(bytes)].join("\t"));
  const left = missing.get(topic) - 1;
  left > 0 ? missing.set(topic, left) : missing.delete(topic);
  if (missing.size === 0) {
    process.exitCode = hasTime ? 0 : 1;
    client.off("close");
    socket.terminate();
  }
});
setTimeout(() => fail(`missing: ${[...missing.keys()]}`), 60_000).unref();
