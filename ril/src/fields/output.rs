//! A sample as a line for programs, and a field of it for people.

use std::fmt;

use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::Value;

use super::tree::Tree;

/// A sample as one JSON object that begins with its schema.
#[derive(Debug)]
pub struct JsonLine<'a> {
    /// Name of the layout, such as `hero.DspTelemetry.v2`.
    pub schema: &'a str,
    /// The sample.
    pub tree: &'a Tree,
}

impl Serialize for JsonLine<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("schema", self.schema)?;
        if let Tree::Nested(inner) = self.tree {
            for (name, tree) in inner {
                map.serialize_entry(name, tree)?;
            }
        }
        map.end()
    }
}

/// A plain value for people: without quotes, and a dash for nothing.
pub struct Plainly<'a>(pub &'a Value);

impl fmt::Display for Plainly<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Value::Null => f.write_str("-"),
            Value::String(text) => f.write_str(text),
            other => other.fmt(f),
        }
    }
}
