// Prints all that `@mcap/core` finds in files of recordings, as read.py does: read.mjs PACKAGES indexed|stream [--sums] FILE...
//
// PACKAGES is the folder with node_modules. `indexed` is for finished files, `stream` for all.

import { createHash } from "node:crypto";
import { createReadStream } from "node:fs";
import { open } from "node:fs/promises";
import { createRequire } from "node:module";
import { resolve } from "node:path";

const [packages, way, ...rest] = process.argv.slice(2);
const hasSums = rest[0] === "--sums";
const paths = hasSums ? rest.slice(1) : rest;
const require = createRequire(resolve(packages, "index.js"));
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");
const { FileHandleReadable } = require("@mcap/nodejs");
const { parse } = require("@lichtblick/rosmsg");
const { MessageReader } = require("@lichtblick/rosmsg2-serialization");

const bits = new DataView(new ArrayBuffer(8));

function number(type, value) {
  if (type === "float32" || type === "float64") {
    bits.setFloat64(0, value);
    return Number.isNaN(value) ? "nan" : bits.getBigUint64(0).toString(16).padStart(16, "0");
  }
  return type === "string" ? Buffer.from(value).toString("hex") : `${Number(value) === value ? value : BigInt(value)}`;
}

class Decoder {
  constructor(schema) {
    this.definitions = parse(new TextDecoder().decode(schema.data), { ros2: true });
    this.byName = new Map(this.definitions.map((definition) => [definition.name, definition]));
    this.reader = new MessageReader(this.definitions);
  }

  fields(data) {
    const fields = [];
    const root = this.definitions.find((definition) => !definition.definitions.every((field) => field.isConstant));
    this.message(root, this.reader.readMessage(data), "", fields);
    return fields;
  }

  message(definition, value, prefix, fields) {
    for (const field of definition.definitions.filter((field) => !field.isConstant)) {
      const name = prefix + field.name;
      const found = value[field.name];
      if (!field.isArray) {
        this.one(field, found, name, fields);
      } else if (found.length === 0) {
        fields.push(`${name}=[]`);
      } else {
        Array.from(found).forEach((element, i) => this.one(field, element, `${name}[${i}]`, fields));
      }
    }
  }

  one(field, value, name, fields) {
    if (field.isComplex) {
      this.message(this.byName.get(field.type), value, `${name}.`, fields);
    } else if (field.type === "time" || field.type === "duration") {
      fields.push(`${name}.sec=${value.sec}`, `${name}.nanosec=${value.nsec}`);
    } else {
      fields.push(`${name}=${number(field.type, value)}`);
    }
  }
}

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
      this.decoders.set(channel.id, new Decoder(this.schemas.get(channel.schemaId)));
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
