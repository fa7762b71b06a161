//! Schemas: what lies in a topic, as a text that goes along with it, so that programs read structs which they have never
//! seen.
//!
//! The text is a message definition of ROS 2 with all nested types, as an MCAP file with the encoding `ros2msg` has it.
//! [`text`](text()) writes it from a [`Layout`]; [`Schema::parse`] reads it and works out size, alignment
//! and offsets, which are those of the struct in shared memory.
//!
//! ```text
//! # The flight battery.
//! #
//! # Layout: battery_watch.Battery.v1
//!
//! # Counts the samples of this publisher from 1.
//! uint64 sequence
//! # When the publisher began, host monotonic ns. [ns]
//! uint64 epoch_ns
//! # The cells, from the negative pole.
//! battery_watch_msgs/Cell[12] cells
//!
//! ================================================================================
//! MSG: battery_watch_msgs/Cell
//! # One cell of a battery.
//! #
//! # Layout: battery_watch.Cell.v1
//!
//! # Voltage under load. [V]
//! float32 voltage_v
//! ```
//!
//! | in shared memory | in the schema |
//! |---|---|
//! | `battery_watch.Cell.v1` | `battery_watch_msgs/Cell`, and the whole name in the comment `Layout:` |
//! | `u32`, `f64`, `[u8; 32]` | `uint32`, `float64`, `uint8[32]` |
//! | doc comment | comment above the field |
//! | unit, by the suffix of the name | `[V]` at the end of the comment, where ROS 2's tools look for units |
//!
//! The sample's bytes with [`CDR_HEADER`] in front are the message in ROS 2's serialization (CDR): little-endian, each
//! number aligned to its size, and no struct of the contract has padding, so both put every number at the same place.
//!
//! A schema comes from another process, or from a file: parsing is bounded ([`MAX_TEXT_LEN`], [`MAX_DEPTH`],
//! [`MAX_NUMBERS`], [`MAX_PAYLOAD_SIZE`]), reading a value looks at the bytes that are there, and neither panics.

mod load;
mod parse;
mod text;
mod value;

use std::fmt;
use std::sync::Arc;

use crate::payload::layout::{FNV_BASIS, hash_number, hash_text};
use crate::payload::{
    FieldKind, FieldLayout, Layout, MAX_PAYLOAD_SIZE, Number, RequestReport, SharedStruct,
};

pub use load::{LoadError, load, load_with_text};
pub use parse::SchemaError;
pub use text::text;
pub use value::Value;

/// What stands before a sample's bytes to make them a CDR message: plain CDR, little-endian, no options.
pub const CDR_HEADER: [u8; 4] = [0, 1, 0, 0];

/// Name of the text's format in an MCAP file.
pub const ENCODING: &str = "ros2msg";

/// Longest text that is parsed, bytes. The longest of the robot's own has 12 kB.
pub const MAX_TEXT_LEN: usize = 256 << 10;

/// How deep structs may be nested, the outermost included. The robot's own are two deep.
pub const MAX_DEPTH: usize = 16;

/// Most numbers of a payload that have a name of their own; an array of numbers is one.
pub const MAX_NUMBERS: usize = 1 << 14;

/// What lies in a topic. Cheap to clone.
#[derive(Clone, Debug, PartialEq)]
pub struct Schema {
    type_name: String,
    root: Arc<Message>,
}

/// A struct of a [`Schema`]: the whole payload, or one that is nested in it.
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
    numbers: usize,
    /// How many structs are nested here, itself included.
    height: usize,
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
    /// Length of the array; nothing when it is none.
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

impl Kind {
    /// Size of one, bytes.
    pub fn size(&self) -> usize {
        match self {
            Kind::Number(number) => number.size(),
            Kind::Struct(message) => message.size,
        }
    }

    fn align(&self) -> usize {
        match self {
            Kind::Number(number) => number.size(),
            Kind::Struct(message) => message.align,
        }
    }

    fn numbers(&self) -> usize {
        match self {
            Kind::Number(_) => 1,
            Kind::Struct(message) => message.numbers,
        }
    }

    fn height(&self) -> usize {
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

impl Field {
    /// The unit, such as `m/s`: what stands in brackets in the comment, as ROS 2's tools have it. Nothing when there is none.
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

    /// Numbers with a name of their own.
    fn numbers(&self) -> usize {
        match (&self.kind, self.len) {
            (Kind::Struct(message), Some(len)) => message.numbers.saturating_mul(len),
            (kind, _) => kind.numbers(),
        }
    }
}

/// A number of a payload, or an array of numbers: where it lies, and what it is called.
#[derive(Clone, Debug, PartialEq)]
pub struct Leaf<'a> {
    /// Full name, such as `cells[2].voltage_v`.
    pub path: String,
    /// Offset from the start of the payload, bytes.
    pub offset: usize,
    /// Type of the number, or of the elements of the array.
    pub number: Number,
    /// Length of the array; nothing when it is one number.
    pub len: Option<usize>,
    /// The field.
    pub field: &'a Field,
}

impl Leaf<'_> {
    /// The number in `payload`, of an array the first; nothing when the payload is too short.
    pub fn value(&self, payload: &[u8]) -> Option<Value> {
        self.element(payload, 0)
    }

    /// The number at `index` of the array; nothing when there is none or the payload is too short.
    pub fn element(&self, payload: &[u8], index: usize) -> Option<Value> {
        if index >= self.len.unwrap_or(1) {
            return None;
        }
        Value::read(
            self.number,
            payload,
            self.offset
                .checked_add(index.checked_mul(self.number.size())?)?,
        )
    }

    /// All numbers of the array, or the one; fewer when the payload is too short.
    pub fn values(&self, payload: &[u8]) -> impl Iterator<Item = Value> {
        (0..self.len.unwrap_or(1)).map_while(|index| self.element(payload, index))
    }
}

impl Schema {
    /// The schema of `T`.
    pub fn of<T: SharedStruct>() -> Schema {
        Schema::from_layout(T::LAYOUT)
    }

    /// The schema of a struct that this program was built with.
    pub fn from_layout(layout: &Layout) -> Schema {
        Schema {
            type_name: layout.type_name.to_owned(),
            root: Arc::new(Message::from_layout(layout)),
        }
    }

    /// Reads the text of a schema.
    ///
    /// # Errors
    ///
    /// Whatever is not a schema of a struct of the contract: see [`SchemaError`].
    pub fn parse(text: &str) -> Result<Schema, SchemaError> {
        parse::parse(text)
    }

    /// Name of the type in shared memory, with package and version: `hero.DspTelemetry.v2`.
    pub fn type_name(&self) -> &str {
        &self.type_name
    }

    /// Name of the schema in an MCAP file and of the type in `ros2`, such as `hero_msgs/msg/DspTelemetry`.
    pub fn ros_resource_name(&self) -> String {
        format!("{}/msg/{}", self.root.package, self.root.name)
    }

    /// Size of the payload, bytes.
    pub fn size(&self) -> usize {
        self.root.size
    }

    /// Alignment of the payload, bytes.
    pub fn align(&self) -> usize {
        self.root.align
    }

    /// The outermost struct.
    pub fn root(&self) -> &Message {
        &self.root
    }

    /// Hash of the layout as section 8 of `docs/ipc.md` has it: the attribute `layout_hash` of a topic with this schema.
    ///
    /// So a reader can check whether a text that it found belongs to the service that it opened.
    pub fn layout_hash(&self) -> u64 {
        self.root.hash_fields(FNV_BASIS)
    }

    /// The attribute `layout_hash` of a request service whose requests have this schema: the report's fields are hashed after
    /// the request's.
    pub fn request_layout_hash(&self) -> u64 {
        let report = Message::from_layout(RequestReport::LAYOUT);
        report.hash_fields(self.layout_hash())
    }

    /// All numbers, in the order of their offsets. There are at most [`MAX_NUMBERS`].
    pub fn leaves(&self) -> Vec<Leaf<'_>> {
        let mut leaves = Vec::with_capacity(self.root.numbers);
        collect(&self.root, "", 0, &mut leaves);
        leaves
    }

    /// Offsets of all moments of the host's monotonic clock, in ascending order: fields of type `uint64` whose names end in
    /// `_ns`, but not in `epoch_ns`; nested structs and the elements of arrays included.
    ///
    /// These are what has to be translated when a sample goes to another machine, whose clock has another zero. A moment of 0
    /// stands for "never" and stays 0. `epoch_ns` identifies a publisher and is compared for equality only. A duration is no
    /// moment: its name ends in another unit, such as `_s`, or its type is another one.
    pub fn moments(&self) -> Vec<usize> {
        let is_moment = |leaf: &Leaf<'_>| {
            let name = &leaf.field.name;
            leaf.number == Number::U64 && name.ends_with("_ns") && !name.ends_with("epoch_ns")
        };
        let leaves = self.leaves().into_iter().filter(is_moment);
        leaves
            .flat_map(|leaf| {
                let len = leaf.len.unwrap_or(1);
                (0..len).map(move |index| leaf.offset + index * leaf.number.size())
            })
            .collect()
    }

    /// The numbers at `path` and below it, such as `sequence`, `cells`, `cells[2]` or `cells[2].voltage_v`; none when there
    /// is no such field.
    pub fn find(&self, path: &str) -> Vec<Leaf<'_>> {
        find(&self.root, path).unwrap_or_default()
    }

    /// The one number at `path`, an element of an array for example; nothing when it is none, or more than one.
    pub fn number(&self, path: &str) -> Option<Leaf<'_>> {
        let mut leaves = self.find(path);
        match leaves.len() {
            1 if leaves[0].path == path => leaves.pop(),
            _ => None,
        }
    }
}

/// All numbers of `message`, which lies at `offset` and is called `path`.
fn collect<'a>(message: &'a Message, path: &str, offset: usize, leaves: &mut Vec<Leaf<'a>>) {
    for field in &message.fields {
        let path = match path {
            "" => field.name.clone(),
            _ => format!("{path}.{}", field.name),
        };
        collect_field(field, path, offset + field.offset, leaves);
    }
}

fn collect_field<'a>(field: &'a Field, path: String, offset: usize, leaves: &mut Vec<Leaf<'a>>) {
    match (&field.kind, field.len) {
        (Kind::Number(number), len) => leaves.push(Leaf {
            path,
            offset,
            number: *number,
            len,
            field,
        }),
        (Kind::Struct(message), None) => collect(message, &path, offset, leaves),
        (Kind::Struct(message), Some(len)) => {
            for index in 0..len {
                let path = format!("{path}[{index}]");
                collect(message, &path, offset + index * message.size, leaves);
            }
        }
    }
}

fn find<'a>(root: &'a Message, path: &str) -> Option<Vec<Leaf<'a>>> {
    let mut leaves = Vec::new();
    let mut message = root;
    let mut offset = 0;
    let mut parts = path.split('.').peekable();
    while let Some(part) = parts.next() {
        let (name, index) = match part.strip_suffix(']').and_then(|part| part.split_once('[')) {
            Some((name, index)) => (name, Some(index.parse::<usize>().ok()?)),
            None => (part, None),
        };
        let field = message.fields.iter().find(|field| field.name == name)?;
        offset += field.offset;
        if let Some(index) = index {
            if index >= field.len? {
                return None;
            }
            offset += index * field.kind.size();
        }
        // What follows a whole array of structs would be many things.
        let is_one = field.len.is_none() || index.is_some();
        match (&field.kind, parts.peek().is_some()) {
            (Kind::Struct(nested), true) if is_one => message = nested,
            (_, true) => return None,
            (Kind::Struct(nested), false) if is_one => collect(nested, path, offset, &mut leaves),
            (Kind::Number(number), false) if is_one => leaves.push(Leaf {
                path: path.to_owned(),
                offset,
                number: *number,
                len: None,
                field,
            }),
            (_, false) => collect_field(field, path.to_owned(), offset, &mut leaves),
        }
    }
    Some(leaves)
}

impl Message {
    fn from_layout(layout: &Layout) -> Message {
        let fields = layout.fields.iter().map(Field::from_layout).collect();
        let mut message = Message {
            package: format!("{}_msgs", layout.package()),
            name: layout.name.to_owned(),
            comment: text::comment(layout),
            size: layout.size,
            align: layout.align,
            fields,
            numbers: 0,
            height: 1,
        };
        message.numbers = message.fields.iter().map(Field::numbers).sum();
        for field in &message.fields {
            message.height = message.height.max(1 + field.kind.height());
        }
        message
    }

    fn hash_fields(&self, mut hash: u64) -> u64 {
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

impl Field {
    fn from_layout(layout: &FieldLayout) -> Field {
        let kind = match layout.kind {
            FieldKind::Number(number) | FieldKind::Array(number, _) => Kind::Number(number),
            FieldKind::Struct(nested) | FieldKind::StructArray(nested, _) => {
                Kind::Struct(Arc::new(Message::from_layout(nested)))
            }
        };
        Field {
            name: layout.name.to_owned(),
            offset: layout.offset,
            size: layout.size,
            kind,
            len: layout.kind.len(),
            comment: text::field_comment(layout),
        }
    }
}

#[cfg(test)]
mod tests;
