//! The fields of samples by name, and how they are shown.
//!
//! Names use dots, as in `geographic.latitude_deg`, and brackets for elements of arrays, as in `cells[2].voltage_v`.
//! What a sample holds is said by its schema, so samples of any module can be shown. Of the robot's own, [`tables`]
//! says more: a value that means nothing, because its group was not transmitted or the thing has not happened yet, is
//! shown as nothing and never looks like data; and numbers that stand for something have their names.

pub mod tables;

#[cfg(test)]
mod tests;

use std::fmt;

use ipc_types::Schema;
use ipc_types::payload::{Number as NumberType, ascii_text};
use ipc_types::schema::{Field, Kind, Leaf, Message, Value as Number};
use runtime::config::nearest;
use runtime::exit::Failure;
use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::Value;
pub use tables::{Meaning, Shown};

/// How the name of an angle ends.
const RADIANS: &str = "_rad";
const DEGREES: &str = "_deg";

/// Which fields to show.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// Names of fields, plain or nested; none stands for all.
    names: Vec<String>,
    /// Names of the chosen angles in radians, which are shown in degrees.
    in_degrees: Vec<String>,
}

/// A field that the sample does not have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{topic} has no field `{name}`; {}", instead(.suggestions, .known))]
pub struct UnknownField {
    topic: String,
    name: String,
    suggestions: Vec<String>,
    known: Vec<String>,
}

/// What may have been meant, or else what there is.
fn instead(suggestions: &[String], known: &[String]) -> String {
    match suggestions {
        [] => format!("the fields are {}", known.join(", ")),
        names => format!("did you mean `{}`?", names.join("` or `")),
    }
}

impl Selection {
    /// The fields `names` of what `schema` describes; all of them when there is no name. A field that no other one ends
    /// like may be named by its last part, and an angle in radians in degrees: `latitude_deg` is
    /// `geodetic.latitude_rad`.
    ///
    /// # Errors
    ///
    /// The first name that it does not have, with what may have been meant.
    pub fn of(schema: &Schema, names: &[String]) -> Result<Selection, UnknownField> {
        let mut selection = Selection::default();
        for name in names {
            let (path, is_in_degrees) = resolve(schema, name)?;
            if is_in_degrees {
                selection.in_degrees.push(path.clone());
            }
            selection.names.push(path);
        }
        Ok(selection)
    }

    /// What the field `path` is called as it is shown, when that is another name: in degrees.
    fn name_in_degrees(&self, path: &str) -> Option<String> {
        let is_meant = self.in_degrees.iter().any(|angle| angle == path);
        let angle = path.strip_suffix(RADIANS).filter(|_| is_meant)?;
        let last = angle.rsplit('.').next()?;
        Some(format!("{last}{DEGREES}"))
    }

    /// Selects the fields `names` of the topic `key`, or gives the failure of a command that was asked for a field
    /// which the topic does not have.
    ///
    /// # Errors
    ///
    /// Code 2, with what may have been meant and where all fields are listed.
    pub fn of_topic(schema: &Schema, names: &[String], key: &str) -> Result<Selection, Failure> {
        Selection::of(schema, names).map_err(|error| {
            Failure::usage(error).with_next_step(format!("`ril topic info {key}` lists all fields"))
        })
    }

    /// Whether the field `path` of a description was chosen, where the first element of an array stands for all.
    pub fn is_about(&self, path: &str) -> bool {
        let path = without_indices(path);
        let is_under = |name: &String| {
            let name = without_indices(name);
            is_at_or_under(&path, &name) || is_at_or_under(&name, &path)
        };
        self.is_everything() || self.names.iter().any(is_under)
    }

    /// Whether one number of `schema` was chosen, and nothing else.
    pub fn is_number(&self, schema: &Schema) -> bool {
        matches!(&self.names[..], [only] if schema.number(only).is_some())
    }

    /// Whether all fields were chosen.
    pub fn is_everything(&self) -> bool {
        self.names.is_empty()
    }

    /// Whether the field `path` was chosen, by itself or with what it lies in.
    fn contains(&self, path: &str) -> bool {
        self.is_everything() || self.names.iter().any(|name| is_at_or_under(path, name))
    }

    /// Whether a part of the field `path` was chosen, or all of it.
    fn touches(&self, path: &str) -> bool {
        self.contains(path) || self.names.iter().any(|name| is_at_or_under(name, path))
    }
}

/// The field that `name` stands for, and whether in degrees.
fn resolve(schema: &Schema, name: &str) -> Result<(String, bool), UnknownField> {
    if !schema.find(name).is_empty() {
        return Ok((name.to_owned(), false));
    }
    let known = field_names(schema.root());
    let radians = name
        .strip_suffix(DEGREES)
        .map(|angle| format!("{angle}{RADIANS}"));
    for (wanted, is_in_degrees) in [(Some(name), false), (radians.as_deref(), true)] {
        let Some(wanted) = wanted else { continue };
        let is_meant = |one: &&String| *one == wanted || last(one) == wanted;
        let mut meant = known.iter().filter(is_meant);
        if let (Some(only), None) = (meant.next(), meant.next())
            && schema.number(only).is_some()
            && !only.contains('[')
        {
            return Ok((only.clone(), is_in_degrees));
        }
    }
    Err(UnknownField {
        topic: schema.root().name.clone(),
        name: name.to_owned(),
        suggestions: suggestions(name, &known),
        known,
    })
}

fn last(name: &str) -> &str {
    name.rsplit('.').next().unwrap_or_default()
}

/// The last part of a name without its unit: `altitude` of `geodetic.altitude_m`.
fn quantity(name: &str) -> &str {
    let last = last(name);
    last.rsplit_once('_').map_or(last, |(quantity, _)| quantity)
}

/// Names with the same last part, or else those that are nearest by their letters, as a whole or as a quantity without
/// its unit.
fn suggestions(unknown: &str, known: &[String]) -> Vec<String> {
    let those = |is_meant: &dyn Fn(&str) -> bool| -> Vec<String> {
        known
            .iter()
            .filter(|name| is_meant(name))
            .cloned()
            .collect()
    };
    let same_end = those(&|name| last(name) == last(unknown));
    if !same_end.is_empty() {
        return same_end;
    }
    // A word of some letters is near to every other one, `x` of `x_m` for example.
    let quantities = known.iter().map(|name| quantity(name));
    let quantities = quantities.filter(|quantity| quantity.len() > 3);
    let words = known.iter().map(String::as_str).chain(quantities);
    let near = nearest(unknown, words);
    near.map_or_else(Vec::new, |near| {
        those(&|name| name == near || quantity(name) == near)
    })
}

/// A path of fields without the `[3]` of arrays.
fn without_indices(path: &str) -> String {
    let parts = path.split('[').enumerate();
    let kept = parts.map(|(index, part)| match index {
        0 => part,
        _ => part.split_once(']').map_or("", |(_, rest)| rest),
    });
    kept.collect()
}

/// Whether the field `path` is `name`, or lies in it.
fn is_at_or_under(path: &str, name: &str) -> bool {
    path.strip_prefix(name)
        .is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
}

/// The names of all fields, each nested struct before what lies in it; of an array of structs the first stands for all.
pub fn field_names(message: &Message) -> Vec<String> {
    let mut names = Vec::new();
    for field in &message.fields {
        names.push(field.name.clone());
        if let Kind::Struct(nested) = &field.kind {
            let outer = match field.len {
                None => field.name.clone(),
                Some(_) => element(&field.name, 0),
            };
            let nested = field_names(nested);
            names.extend(nested.iter().map(|name| join(&outer, name)));
        }
    }
    names
}

/// One element of the array `path`.
fn element(path: &str, index: usize) -> String {
    format!("{path}[{index}]")
}

/// The field `inner` of the struct `outer`, which is the sample itself when it has no name.
fn join(outer: &str, inner: &str) -> String {
    match outer {
        "" => inner.to_owned(),
        _ => format!("{outer}.{inner}"),
    }
}

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

    /// Sets the field `name` to this value; the field is added if there is none.
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

    /// Removes the field `name`.
    #[must_use]
    pub fn without(mut self, name: &str) -> Tree {
        if let Tree::Nested(inner) = &mut self {
            inner.retain(|(field, _)| field != name);
        }
        self
    }

    /// Replaces times by ages: `age_ms` of `last_message_ns` is `last_message_age_ms`, that of `since_ns` is
    /// `since_ms`.
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
    /// Name of the layout, such as `hero.DspTelemetry.v3`.
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
