//! The fields of samples by name, and how they are shown.
//!
//! Names use dots, as in `geographic.latitude_deg`, and brackets for elements of arrays, as in `cells[2].voltage_v`. What a
//! sample holds is said by its schema, so samples of any module can be shown. Of the robot's own, [`tables`] says more: a
//! value that means nothing, because its group was not transmitted or the thing has not happened yet, is shown as nothing
//! and never looks like data; and numbers that stand for something have their names.

pub mod tables;

use std::fmt;

use ipc_types::Schema;
use ipc_types::schema::{Field, Kind, Leaf, Message, Value as Number};
use runtime::config::nearest;
use runtime::exit::Failure;
use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::Value;

pub use tables::{Meaning, Shown};

/// Which fields to show.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// Names of fields, plain or nested; none stands for all.
    names: Vec<String>,
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

/// A path of fields without the `[3]` of arrays.
fn without_indices(path: &str) -> String {
    let parts = path.split('[').enumerate();
    let kept = parts.map(|(index, part)| match index {
        0 => part,
        _ => part.split_once(']').map_or("", |(_, rest)| rest),
    });
    kept.collect()
}

/// What may have been meant, or else what there is.
fn instead(suggestions: &[String], known: &[String]) -> String {
    match suggestions {
        [] => format!("the fields are {}", known.join(", ")),
        names => format!("did you mean `{}`?", names.join("` or `")),
    }
}

impl Selection {
    /// The fields `names` of what `schema` describes; all of them when there is no name.
    ///
    /// # Errors
    ///
    /// The first name that it does not have, with what may have been meant.
    pub fn of(schema: &Schema, names: &[String]) -> Result<Selection, UnknownField> {
        match names.iter().find(|name| schema.find(name).is_empty()) {
            None => Ok(Selection {
                names: names.to_vec(),
            }),
            Some(unknown) => {
                let known = field_names(schema.root());
                Err(UnknownField {
                    topic: schema.root().name.clone(),
                    name: unknown.clone(),
                    suggestions: suggestions(unknown, &known),
                    known,
                })
            }
        }
    }

    /// The same with the failure of a command that was asked for a field which the topic `key` does not have.
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

/// Names with the same last part, or else the one that is nearest by its letters.
fn suggestions(unknown: &str, known: &[String]) -> Vec<String> {
    let last = |name: &str| name.rsplit('.').next().unwrap_or_default().to_owned();
    let same_end: Vec<String> = known
        .iter()
        .filter(|name| last(name) == last(unknown))
        .cloned()
        .collect();
    if !same_end.is_empty() {
        return same_end;
    }
    let nearest = nearest(unknown, known.iter().map(String::as_str));
    nearest.map(str::to_owned).into_iter().collect()
}

/// Whether the field `path` is `name`, or lies in it.
fn is_at_or_under(path: &str, name: &str) -> bool {
    path.strip_prefix(name)
        .is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
}

/// The names of all fields, each nested struct before what lies in it; of an array of structs the first stands for all.
pub(crate) fn field_names(message: &Message) -> Vec<String> {
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

fn element(path: &str, index: usize) -> String {
    format!("{path}[{index}]")
}

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

impl Tree {
    /// The chosen fields of `sample`.
    pub fn of<T: Shown>(sample: &T, selection: &Selection) -> Tree {
        let schema = Schema::of::<T>();
        Tree::read(&schema, Meaning::of::<T>(), sample.bytes(), selection)
    }

    /// The chosen fields of a sample, of which `payload` are the bytes, `schema` says where they lie and `meaning` what
    /// they mean beyond that.
    pub fn read(schema: &Schema, meaning: Meaning, payload: &[u8], selection: &Selection) -> Tree {
        let reader = Reader {
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
struct Reader<'a> {
    payload: &'a [u8],
    selection: &'a Selection,
    meaning: Meaning,
    /// Names of the fields that mean nothing in this sample.
    void: Vec<&'static str>,
}

impl Reader<'_> {
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
            inner.push((name, self.one(field, path, offset)));
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
                Tree::Plain(if self.is_void(path) {
                    Value::Null
                } else {
                    values()
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

#[cfg(test)]
mod tests {
    use ipc_types::TelemetryGroup;
    use ipc_types::code::{ImiError, ModuleStatus};
    use ipc_types::payload::{DspTelemetry, ModuleState};

    use super::*;

    fn everything<T: Shown>(sample: &T) -> Tree {
        Tree::of(sample, &Selection::default())
    }

    fn json<T: Shown>(sample: &T, names: &[&str]) -> String {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        let tree = Tree::of(sample, &Selection::of(&Schema::of::<T>(), &names).unwrap());
        let schema = T::TYPE_NAME;
        serde_json::to_string(&JsonLine {
            schema,
            tree: &tree,
        })
        .unwrap()
    }

    #[test]
    fn chosen_fields_keep_their_place_and_their_digits() {
        let mut dsp = DspTelemetry {
            sequence: 7,
            valid_groups: TelemetryGroup::Geographic.bit() | TelemetryGroup::Attitude.bit(),
            ..DspTelemetry::default()
        };
        dsp.geographic.latitude_deg = -37.123_456_7;
        dsp.attitude.yaw_deg = 0.1;
        for (names, expected) in [
            (
                &["sequence"][..],
                r#"{"schema":"hero.DspTelemetry.v2","sequence":7}"#,
            ),
            (
                &["attitude.yaw_deg", "geographic.latitude_deg", "xy.x_m"],
                r#"{"schema":"hero.DspTelemetry.v2","geographic":{"latitude_deg":-37.1234567},"xy":{"x_m":null},"attitude":{"yaw_deg":0.1}}"#,
            ),
            (
                &["xy", "xy.x_m"],
                r#"{"schema":"hero.DspTelemetry.v2","xy":{"x_m":null,"y_m":null}}"#,
            ),
        ] {
            assert_eq!(json(&dsp, names), expected);
        }
        dsp.attitude.yaw_deg = f32::NAN;
        let expected = r#"{"schema":"hero.DspTelemetry.v2","attitude":{"yaw_deg":null}}"#;
        assert_eq!(json(&dsp, &["attitude.yaw_deg"]), expected);
    }

    #[test]
    fn codes_are_shown_by_name_and_unknown_ones_as_they_are() {
        let mut state = ModuleState {
            status: ModuleStatus::Running.code(),
            functionality: 99,
            imi_error: ImiError::CommunicationFatalError.code(),
            ..ModuleState::default()
        };
        state.dsp_errors.total = 1;
        state.dsp_errors.last_code = 8;
        assert_eq!(
            json(
                &state,
                &[
                    "status",
                    "functionality",
                    "imi_error",
                    "dsp_errors.last_code"
                ]
            ),
            r#"{"schema":"hero.ModuleState.v2","status":"running","imi_error":"communication-fatal-error","functionality":99,"dsp_errors":{"last_code":"dsp-error-8"}}"#
        );
    }

    #[test]
    fn all_fields_are_shown_when_none_is_chosen() {
        let tree = everything(&ModuleState::default());
        let shown: Vec<String> = tree
            .plain_fields()
            .into_iter()
            .map(|(path, _)| path)
            .collect();
        let is_struct = |name: &str| {
            shown
                .iter()
                .any(|path| path.starts_with(&format!("{name}.")))
        };
        let expected: Vec<String> = field_names(Schema::of::<ModuleState>().root())
            .into_iter()
            .filter(|name| !is_struct(name))
            .collect();
        assert_eq!(shown, expected);
    }

    #[test]
    fn an_unknown_field_is_refused_with_what_may_have_been_meant() {
        let schema = Schema::of::<DspTelemetry>();
        for (name, expected) in [
            ("latitude_deg", "did you mean `geographic.latitude_deg`?"),
            (
                "altitude_m",
                "did you mean `geographic.altitude_m` or `references.altitude_m`?",
            ),
            ("geografic", "did you mean `geographic`?"),
            ("geographic.", "did you mean `geographic`?"),
            (
                "geographic.latitud_deg",
                "did you mean `geographic.latitude_deg`?",
            ),
            (
                "zzz",
                "has no field `zzz`; the fields are sequence, epoch_ns, ",
            ),
            ("", "has no field ``; the fields are"),
        ] {
            let error = Selection::of(&schema, &["xy".to_owned(), name.to_owned()]);
            let error = error.unwrap_err().to_string();
            assert!(error.contains(expected), "{name}: {error}");
        }
    }

    #[test]
    fn a_description_is_about_the_chosen_fields_and_what_they_lie_in() {
        let chosen = |names: &[&str]| Selection {
            names: names.iter().map(|name| (*name).to_owned()).collect(),
        };
        for (names, path, expected) in [
            (&["cells[2]"][..], "cells", true),
            (&["cells[2]"], "cells[0].level", true),
            (&["cells[2].level"], "cells[0].flags", false),
            (&["attitude"], "attitude.yaw_deg", true),
            (&["attitude.yaw_deg"], "attitude", true),
            (&["attitude"], "sequence", false),
            (&[], "sequence", true),
        ] {
            assert_eq!(chosen(names).is_about(path), expected, "{names:?} {path}");
        }
    }

    #[test]
    fn an_unknown_struct_is_shown_by_its_schema() {
        let schema = "# Layout: a.A.v1\n\nuint64 sequence\nuint64 epoch_ns\na_msgs/B[2] cells\nfloat32[2] raw\n\
            ================================================================================\n\
            MSG: a_msgs/B\nint16 level\nuint8[2] flags\n";
        let schema = Schema::parse(schema).unwrap();
        let mut payload = vec![0; schema.size()];
        payload[0] = 5;
        payload[16..18].copy_from_slice(&(-2_i16).to_le_bytes());
        payload[23] = 9;
        payload[24..28].copy_from_slice(&0.1_f32.to_le_bytes());
        payload[28..32].copy_from_slice(&f32::INFINITY.to_le_bytes());
        for (names, expected) in [
            (
                &[][..],
                r#"{"schema":"a.A.v1","sequence":5,"epoch_ns":0,"cells":[{"level":-2,"flags":[0,0]},{"level":0,"flags":[0,9]}],"raw":[0.1,null]}"#,
            ),
            (
                &["raw[0]", "cells[1].flags[1]", "sequence"],
                r#"{"schema":"a.A.v1","sequence":5,"cells[1]":{"flags[1]":9},"raw[0]":0.1}"#,
            ),
            (
                &["cells[0]"],
                r#"{"schema":"a.A.v1","cells[0]":{"level":-2,"flags":[0,0]}}"#,
            ),
        ] {
            let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
            let selection = Selection::of(&schema, &names).unwrap();
            let tree = Tree::read(&schema, Meaning::NONE, &payload, &selection);
            let line = JsonLine {
                schema: schema.type_name(),
                tree: &tree,
            };
            assert_eq!(serde_json::to_string(&line).unwrap(), expected);
        }
        let tree = Tree::read(&schema, Meaning::NONE, &payload, &Selection::default());
        let names: Vec<String> = tree
            .plain_fields()
            .into_iter()
            .map(|(name, _)| name)
            .collect();
        assert_eq!(
            names[2..5],
            ["cells[0].level", "cells[0].flags", "cells[1].level"]
        );
        let error = Selection::of(&schema, &["level".to_owned()]).unwrap_err();
        assert!(error.to_string().contains("`cells[0].level`"), "{error}");
    }

    #[test]
    fn people_see_a_dash_for_nothing_and_text_without_quotes() {
        for (value, expected) in [
            (Value::Null, "-"),
            (Value::from("running"), "running"),
            (Value::from(0.5), "0.5"),
            (Value::from(vec![0, 3]), "[0,3]"),
        ] {
            assert_eq!(Plainly(&value).to_string(), expected);
        }
    }
}
