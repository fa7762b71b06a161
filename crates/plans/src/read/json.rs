//! JSON as a tree of nodes: what serde_json reads, with the line of each value. No member may stand twice in an object.

use std::cell::Cell;
use std::fmt;
use std::io::{self, Read};

use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};

use super::items::{clean, clean_reason};
use super::tree::{Node, Value};
use crate::error::{MAX_NODES, ReadError};

/// Parses JSON; a mistake is reported with its line. Values lie in each other at most as deep as serde_json allows,
/// 128.
pub fn parse(text: &str) -> Result<Node, ReadError> {
    let place = Place {
        line: Cell::new(1),
        nodes: Cell::new(0),
    };
    let input = Input {
        bytes: text.as_bytes(),
        place: &place,
    };
    let mut deserializer = serde_json::Deserializer::from_reader(input);
    let root = NodeSeed {
        name: String::new(),
        place: &place,
    }
    .deserialize(&mut deserializer);
    let root = root.and_then(|root| deserializer.end().map(|()| root));
    root.map_err(|error| {
        if error.is_eof() {
            let reason = match text.trim().is_empty() {
                true => "the file is empty",
                false => "the file ends in the middle of a list or object: it is cut off",
            };
            return ReadError::line(error.line().max(1), reason);
        }
        // The message ends with the place, which the error has by itself.
        let message = error.to_string();
        let reason = clean_reason(
            message
                .rsplit_once(" at line ")
                .map_or(&*message, |(reason, _)| reason),
        );
        ReadError::line(error.line().max(1), reason)
    })
}

/// How far the parser has come.
struct Place {
    line: Cell<usize>,
    nodes: Cell<usize>,
}

/// The text byte by byte, as serde_json asks for it: so the line is known whenever a value begins.
struct Input<'a> {
    bytes: &'a [u8],
    place: &'a Place,
}

impl Read for Input<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.bytes.read(buffer)?;
        let lines = buffer[..count]
            .iter()
            .filter(|byte| **byte == b'\n')
            .count();
        self.place.line.set(self.place.line.get() + lines);
        Ok(count)
    }
}

struct NodeSeed<'a> {
    name: String,
    place: &'a Place,
}

impl<'de> DeserializeSeed<'de> for NodeSeed<'_> {
    type Value = Node;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Node, D::Error> {
        let (line, count) = (self.place.line.get(), self.place.nodes.get() + 1);
        self.place.nodes.set(count);
        if count > MAX_NODES {
            return Err(D::Error::custom(format!("more than {MAX_NODES} values")));
        }
        let visitor = ValueVisitor {
            name: &self.name,
            place: self.place,
        };
        let (value, nodes) = deserializer.deserialize_any(visitor)?;
        Ok(Node::new(self.name, line, value, nodes))
    }
}

macro_rules! scalars {
    ($($visit:ident($scalar:ident: $type:ty) => $value:expr;)*) => {
        $(fn $visit<E>(self, $scalar: $type) -> Result<Self::Value, E> {
            Ok(($value, Vec::new()))
        })*
    };
}

/// Reads the value called `name`.
struct ValueVisitor<'a> {
    name: &'a str,
    place: &'a Place,
}

impl<'de> Visitor<'de> for ValueVisitor<'_> {
    type Value = (Value, Vec<Node>);

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value")
    }

    scalars! {
        visit_bool(flag: bool) => Value::Flag(flag);
        visit_i64(number: i64) => Value::Number(number as f64);
        visit_u64(number: u64) => Value::Number(number as f64);
        visit_f64(number: f64) => Value::Number(number);
        visit_str(text: &str) => Value::Text(text.to_owned());
    }

    fn visit_unit<E>(self) -> Result<Self::Value, E> {
        Ok((Value::Null, Vec::new()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
        let mut nodes = Vec::new();
        let seed = || NodeSeed {
            name: format!("{}[]", self.name),
            place: self.place,
        };
        while let Some(node) = list.next_element_seed(seed())? {
            nodes.push(node);
        }
        Ok((Value::List, nodes))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut object: A) -> Result<Self::Value, A::Error> {
        let mut nodes: Vec<Node> = Vec::new();
        let mut names = std::collections::HashSet::new();
        while let Some(name) = object.next_key::<String>()? {
            if !names.insert(name.clone()) {
                return Err(A::Error::custom(format!(
                    "the member `{}` stands twice",
                    clean(&name)
                )));
            }
            nodes.push(object.next_value_seed(NodeSeed {
                name,
                place: self.place,
            })?);
        }
        Ok((Value::Object, nodes))
    }
}
