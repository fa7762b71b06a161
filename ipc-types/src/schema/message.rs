//! [`Message`]: a struct by its fields.

use std::fmt;
use std::sync::Arc;

use super::text;
use crate::payload::Number;
use crate::random::fnv;

/// A struct of a [`Schema`](super::Schema): the whole payload, or one that is nested in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// Package in ROS 2, such as `hero_msgs`.
    pub package: String,
    /// Name without package and version, such as `DspTelemetry`.
    pub name: String,
    /// What it is, by its comment; lines are divided by `\n`.
    pub comment: String,
    /// Size, bytes.
    pub size: usize,
    /// Alignment, bytes.
    pub align: usize,
    /// The fields in the order of their offsets.
    pub fields: Vec<Field>,
    /// Numbers with a name of their own, in nested structs too.
    pub(super) numbers: usize,
    /// Bytes of a list of these numbers.
    pub(super) listed_len: usize,
    /// How many structs are nested here, itself included.
    pub(super) height: usize,
}

/// A field of a [`Message`].
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// Name, such as `altitude_m`.
    pub name: String,
    /// Offset from the start of the struct that it lies in, bytes.
    pub offset: usize,
    /// Size, bytes; of an array all of it.
    pub size: usize,
    /// What lies there.
    pub kind: Kind,
    /// Length of the array; `None` if it is none.
    pub len: Option<usize>,
    /// Its comment; lines are divided by `\n`.
    pub comment: String,
}

/// Type of a field, or of the elements of an array.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// A number.
    Number(Number),
    /// A nested struct.
    Struct(Arc<Message>),
}

/// Longest index of an array in a full name, with the dot behind it: `[1048575].`.
const INDEX_LEN: usize = 10;

impl Kind {
    /// Size of one, bytes.
    pub fn size(&self) -> usize {
        match self {
            Kind::Number(number) => number.size(),
            Kind::Struct(message) => message.size,
        }
    }

    pub(super) fn align(&self) -> usize {
        match self {
            Kind::Number(number) => number.size(),
            Kind::Struct(message) => message.align,
        }
    }

    pub(super) fn numbers(&self) -> usize {
        match self {
            Kind::Number(_) => 1,
            Kind::Struct(message) => message.numbers,
        }
    }

    pub(super) fn height(&self) -> usize {
        match self {
            Kind::Number(_) => 0,
            Kind::Struct(message) => message.height,
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Kind::Number(number) => f.write_str(number.ros_name()),
            Kind::Struct(message) => write!(f, "{}/{}", message.package, message.name),
        }
    }
}

impl Message {
    /// One without fields.
    pub(super) fn new(package: String, name: String, comment: String) -> Message {
        Message {
            package,
            name,
            comment,
            size: 0,
            align: 1,
            fields: Vec::new(),
            numbers: 0,
            listed_len: 0,
            height: 1,
        }
    }
}

impl Field {
    /// The unit, such as `m/s`: what stands in brackets in the comment, as ROS 2's tools have it. Nothing when there is
    /// none.
    pub fn unit(&self) -> Option<&str> {
        text::unit_of(&self.comment)
    }

    /// Type as the schema's text has it, such as `float32[12]`.
    pub fn type_text(&self) -> String {
        match self.len {
            Some(len) => format!("{}[{len}]", self.kind),
            None => self.kind.to_string(),
        }
    }

    /// Bytes of a list of its numbers, each with full name, type and comment: see
    /// [`MAX_LISTED_LEN`](super::MAX_LISTED_LEN).
    pub(super) fn listed_len(&self) -> usize {
        let own = self.name.len() + self.comment.len();
        let Kind::Struct(message) = &self.kind else {
            return own;
        };
        let before_each = self.name.len() + if self.len.is_some() { INDEX_LEN } else { 1 };
        let names = message.numbers.saturating_mul(before_each);
        let nested = names.saturating_add(message.listed_len);
        let nested = nested.saturating_mul(self.len.unwrap_or(1));
        nested.saturating_add(own + message.package.len() + message.name.len())
    }

    /// Numbers with a name of their own.
    pub(super) fn numbers(&self) -> usize {
        match (&self.kind, self.len) {
            (Kind::Struct(message), Some(len)) => message.numbers.saturating_mul(len),
            (kind, _) => kind.numbers(),
        }
    }
}

impl Message {
    /// The hash of a layout that begins with `hash` and goes on with these fields: 64-bit FNV-1a over each field's
    /// name, offset, size and kind, nested structs included.
    ///
    /// A type's name says which layout is meant; the hash says which one was compiled, so that two fields that changed
    /// places are found even when the version was not raised.
    pub(super) fn hash_fields(&self, mut hash: u64) -> u64 {
        for field in &self.fields {
            hash = hash_text(hash, &field.name);
            hash = hash_number(hash, field.offset);
            hash = hash_number(hash, field.size);
            hash = match &field.kind {
                Kind::Number(number) => hash_text(hash, number.rust_name()),
                Kind::Struct(nested) => nested.hash_fields(hash_text(hash, &nested.name)),
            };
            if let Some(len) = field.len {
                hash = hash_number(hash, len);
            }
        }
        hash
    }
}

/// The text's bytes and a zero, so that `ab`, `c` differs from `a`, `bc`.
fn hash_text(hash: u64, text: &str) -> u64 {
    fnv(fnv(hash, text.as_bytes()), &[0])
}

/// The number's low 32 bits, least significant byte first; layouts are far smaller than that.
fn hash_number(hash: u64, number: usize) -> u64 {
    fnv(hash, &(number as u32).to_le_bytes())
}
