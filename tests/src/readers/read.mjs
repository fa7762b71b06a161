// Prints all that `@mcap/core` finds in files of recordings, as read.py does: read.mjs PACKAGES indexed|stream [--sums] FILE...
//
// PACKAGES is the folder with node_modules. `indexed` is for finished files, `stream` for all.

import { createHash } from "node:crypto";
import { createReadStream } from "node:fs";
import { open } from "node:fs/promises";
import { createRequire } from "node:module";
import { resolve } from "node:path";

import { decoder } from "./decoder.mjs";

const [packages, way, ...rest] = process.argv.slice(2);
const hasSums = rest[0] === "--sums";
const paths = hasSums ? rest.slice(1) : rest;
const require = createRequire(resolve(packages, "index.js"));
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");
const { FileHandleReadable } = require("@mcap/nodejs");

const bits = new DataView(new ArrayBuffer(8));
const Decoder = decoder(require);
const lines = [];

// Prints a line for each message.
class Printer {
  schemas = new Map();
  channels = new Map();
  decoders = new Map();

  take(record) {
    if (record.type === "Schema") {
      this.schemas.set(record.id, record);
    } else if (record.type === "Channel") {
      this.channels.set(record.id, record);
    } else if (record.type === "Message") {
      this.message(this.channels.get(record.channelId), record);
    }
  }

  message(channel, record) {
    if (!this.decoders.has(channel.id)) {
      this.decoders.set(channel.id, new Decoder(new TextDecoder().decode(this.schemas.get(channel.schemaId).data)));
    }
    const fields = this.decoders.get(channel.id).fields(record.data);
    lines.push(["message", channel.topic, record.logTime, record.publishTime, record.sequence, ...fields].join("\t"));
  }

  end() {}
}

// Prints a line for each topic.
class Sums extends Printer {
  topics = new Map();

  message(channel, record) {
    if (!this.topics.has(channel.topic)) {
      this.topics.set(channel.topic, { messages: 0, digest: createHash("sha256") });
    }
    const sum = this.topics.get(channel.topic);
    bits.setBigUint64(0, record.logTime, true);
    sum.messages += 1;
    sum.digest.update(new Uint8Array(bits.buffer)).update(record.data);
  }

  end() {
    for (const [topic, { messages, digest }] of this.topics) {
      lines.push(["sum", topic, messages, digest.digest("hex")].join("\t"));
    }
  }
}

async function indexed(path, printer) {
  const file = await open(path, "r");
  try {
    const reader = await McapIndexedReader.Initialize({ readable: new FileHandleReadable(file) });
    printer.schemas = reader.schemasById;
    printer.channels = reader.channelsById;
    for await (const record of reader.readMessages()) {
      printer.take(record);
    }
  } finally {
    await file.close();
  }
}

async function stream(path, printer) {
  const reader = new McapStreamReader({ validateCrcs: true });
  for await (const bytes of createReadStream(path)) {
    reader.append(bytes);
    for (let record; (record = reader.nextRecord()); ) {
      printer.take(record);
    }
  }
  if (!reader.done()) {
    throw new Error("the file ends early");
  }
}

for (const path of paths) {
  lines.push(["file", path].join("\t"));
  const printer = hasSums ? new Sums() : new Printer();
  try {
    await { indexed, stream }[way](path, printer);
  } catch (error) {
    lines.push(["error", `${error}`.replaceAll(/\s+/g, " ")].join("\t"));
  } finally {
    printer.end();
  }
}
process.stdout.write(lines.join("\n") + "\n");
