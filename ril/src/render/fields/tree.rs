//! [`Tree`]: the chosen fields of a sample.

use std::fmt;

use ipc_types::Schema;
use ipc_types::payload::{Number as NumberType, ascii_text};
use ipc_types::schema::{Field, Kind, Leaf, Message, Value as Number};
use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::Value;

use super::selection::{Selection, element, is_at_or_under, join};
use super::tables::{Meaning, Shown};

/// A sample as it is shown: its chosen fields in the order of the layout.
#[derive(Clone, Debug, PartialEq)]
pub enum Tree {
    /// A plain field; `null` when it means nothing.
    Plain(Value),
    /// A nested struct.
    Nested(Vec<(String, Tree)>),
    /// A whole array of structs.
    List(Vec<Tree>),
}

impl<T: Into<Value>> From<T> for Tree {
    fn from(value: T) -> Tree {
        Tree::Plain(value.into())
    }
}

/// Reports that are not only samples are put together of these.
impl Tree {
    /// Stands for what is not known.
    pub const NULL: Tree = Tree::Plain(Value::Null);

    /// An object with these fields.
    pub fn nested<'a>(fields: impl IntoIterator<Item = (&'a str, Tree)>) -> Tree {
        let fields = fields.into_iter();
        Tree::Nested(fields.map(|(name, tree)| (name.to_owned(), tree)).collect())
    }

    /// Takes the field `name` out; null if there is none.
    pub fn take(&mut self, name: &str) -> Tree {
        self.field(name)
            .map_or(Tree::NULL, |tree| std::mem::replace(tree, Tree::NULL))
    }

    /// The same with this value of the field `name`, which is added if there is none.
    #[must_use]
    pub fn with(mut self, name: &str, value: impl Into<Tree>) -> Tree {
        let value = value.into();
        if let Some(field) = self.field(name) {
            *field = value;
        } else if let Tree::Nested(inner) = &mut self {
            inner.push((name.to_owned(), value));
        }
        self
    }

    /// The same without the field `name`.
    #[must_use]
    pub fn without(mut self, name: &str) -> Tree {
        if let Tree::Nested(inner) = &mut self {
            inner.retain(|(field, _)| field != name);
        }
        self
    }

    /// The same with ages for times: `age_ms` of `last_message_ns` is `last_message_age_ms`, that of `since_ns` is `since_ms`.
    #[must_use]
    pub fn with_ages(mut self, age_ms: impl Fn(u64) -> Option<u64>) -> Tree {
        if let Tree::Nested(inner) = &mut self {
            for (name, tree) in inner {
                let (Some(of), Tree::Plain(time)) = (name.strip_suffix("_ns"), &*tree) else {
                    continue;
                };
                let age = time.as_u64().and_then(&age_ms);
                let infix = if of.ends_with("since") { "" } else { "_age" };
                *name = format!("{of}{infix}_ms");
                *tree = age.into();
            }
        }
        self
    }

    fn field(&mut self, name: &str) -> Option<&mut Tree> {
        let Tree::Nested(inner) = self else {
            return None;
        };
        let mut fields = inner.iter_mut();
        fields
            .find(|(field, _)| field == name)
            .map(|(_, tree)| tree)
    }
}

impl Tree {
    /// The chosen fields of `sample`.
    pub fn of<T: Shown>(sample: &T, selection: &Selection) -> Tree {
        Tree::read(T::schema(), Meaning::of::<T>(), sample.bytes(), selection)
    }

    /// The chosen fields of a sample, of which `payload` are the bytes, `schema` says where they lie and `meaning` what
    /// they mean beyond that.
    pub fn read(schema: &Schema, meaning: Meaning, payload: &[u8], selection: &Selection) -> Tree {
        let reader = SampleReader {
            payload,
            selection,
            void: meaning.void(payload),
            meaning,
        };
        reader.message(schema.root(), "", 0)
    }

    /// The plain fields with their full names, in order.
    pub fn plain_fields(&self) -> Vec<(String, &Value)> {
        let mut fields = Vec::new();
        self.collect("", &mut fields);
        fields
    }

    fn collect<'a>(&'a self, path: &str, fields: &mut Vec<(String, &'a Value)>) {
        match self {
            Tree::Plain(value) => fields.push((path.to_owned(), value)),
            Tree::Nested(inner) => {
                for (name, tree) in inner {
                    tree.collect(&join(path, name), fields);
                }
            }
            Tree::List(elements) => {
                for (index, tree) in elements.iter().enumerate() {
                    tree.collect(&element(path, index), fields);
                }
            }
        }
    }
}

/// Reads the chosen fields of one sample.
struct SampleReader<'a> {
    payload: &'a [u8],
    selection: &'a Selection,
    meaning: Meaning,
    /// Names of the fields that mean nothing in this sample.
    void: Vec<&'static str>,
}

impl SampleReader<'_> {
    /// The struct `path`, which lies at `offset`.
    fn message(&self, message: &Message, path: &str, offset: usize) -> Tree {
        let mut inner = Vec::new();
        for field in &message.fields {
            let path = join(path, &field.name);
            if self.selection.touches(&path) {
                self.field(field, &path, offset + field.offset, &mut inner);
            }
        }
        Tree::Nested(inner)
    }

    /// Adds what was chosen of the field `path` to `inner`: the whole of it, or elements of it.
    fn field(&self, field: &Field, path: &str, offset: usize, inner: &mut Vec<(String, Tree)>) {
        let name = field.name.clone();
        let Some(len) = field.len else {
            let one = self.one(field, path, offset);
            inner.push(match self.selection.name_in_degrees(path) {
                Some(name) => (name, in_degrees(one, &field.kind)),
                None => (name, one),
            });
            return;
        };
        let element_at = |index| {
            let offset = offset + index * field.kind.size();
            self.one(field, &element(path, index), offset)
        };
        if !self.selection.contains(path) {
            let chosen = (0..len).filter(|index| self.selection.touches(&element(path, *index)));
            inner.extend(chosen.map(|index| (element(&name, index), element_at(index))));
            return;
        }
        let tree = match &field.kind {
            Kind::Struct(_) => Tree::List((0..len).map(element_at).collect()),
            Kind::Number(number) => {
                let leaf = Leaf {
                    path: path.to_owned(),
                    offset,
                    number: *number,
                    len: field.len,
                    field,
                };
                let values = || leaf.values(self.payload).map(plain).collect();
                let text = || text_in(field, self.payload.get(offset..offset + field.size)?);
                Tree::Plain(if self.is_void(path) {
                    Value::Null
                } else {
                    text().map_or_else(values, Value::from)
                })
            }
        };
        inner.push((name, tree));
    }

    /// A number or a struct that is no array, or one element of an array.
    fn one(&self, field: &Field, path: &str, offset: usize) -> Tree {
        match &field.kind {
            Kind::Struct(nested) => self.message(nested, path, offset),
            Kind::Number(_) if self.is_void(path) => Tree::Plain(Value::Null),
            Kind::Number(number) => {
                let value = Number::read(*number, self.payload, offset);
                let code = value
                    .and_then(Number::as_u64)
                    .and_then(|code| code.try_into().ok());
                let name = code.and_then(|code| self.meaning.name_of(path, code));
                Tree::Plain(name.map_or_else(|| value.map_or(Value::Null, plain), Value::from))
            }
        }
    }

    fn is_void(&self, path: &str) -> bool {
        self.void.iter().any(|name| is_at_or_under(path, name))
    }
}

/// An angle that is given in radians, with the digits that its type has.
fn in_degrees(angle: Tree, kind: &Kind) -> Tree {
    let digits = match kind {
        Kind::Number(NumberType::F32) => 1e5,
        _ => 1e10,
    };
    let degrees = |angle: f64| Value::from((angle.to_degrees() * digits).round() / digits);
    match angle {
        Tree::Plain(value) => Tree::Plain(value.as_f64().map_or(Value::Null, degrees)),
        other => other,
    }
}

/// The text in a field of bytes that is one by its comment; `None` if it is none, or not printable.
fn text_in<'a>(field: &Field, bytes: &'a [u8]) -> Option<&'a str> {
    let is_text = field.kind == Kind::Number(NumberType::U8) && field.comment.contains("ASCII");
    is_text.then(|| ascii_text(bytes))?
}

/// A number with its own digits: 0.1 and not 0.10000000149011612. One that is not finite is nothing.
fn plain(number: Number) -> Value {
    match number {
        Number::Unsigned(value) => Value::from(value),
        Number::Signed(value) => Value::from(value),
        Number::Double(value) => Value::from(value),
        Number::Single(value) => {
            let digits = value.to_string().parse::<f64>();
            digits.map_or(Value::Null, Value::from)
        }
    }
}

impl Serialize for Tree {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Tree::Plain(value) => value.serialize(serializer),
            Tree::Nested(inner) => {
                serializer.collect_map(inner.iter().map(|(name, tree)| (name, tree)))
            }
            Tree::List(elements) => elements.serialize(serializer),
        }
    }
}

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
pub struct Plain<'a>(pub &'a Value);

impl fmt::Display for Plain<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Value::Null => f.write_str("-"),
            Value::String(text) => f.write_str(text),
            other => other.fmt(f),
        }
    }
}
