// Messages of ROS 2 as fields, `name=value`: floats as their bits, texts as their bytes, both in hexadecimal.

const bits = new DataView(new ArrayBuffer(8));

function number(type, value) {
  if (type === "float32" || type === "float64") {
    bits.setFloat64(0, value);
    return Number.isNaN(value) ? "nan" : bits.getBigUint64(0).toString(16).padStart(16, "0");
  }
  return type === "string" ? Buffer.from(value).toString("hex") : `${Number(value) === value ? value : BigInt(value)}`;
}

// The class, with the packages that `require` finds. It is made with the text of a schema.
export function decoder(require) {
  const { parse } = require("@lichtblick/rosmsg");
  const { MessageReader } = require("@lichtblick/rosmsg2-serialization");
  return class Decoder {
    constructor(schema) {
      this.definitions = parse(schema, { ros2: true });
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
  };
}
