//! The fields of samples by name, and how they are shown.
//!
//! Names use dots, as in `geographic.latitude_deg`. A value that means nothing, because its group was not transmitted
//! or the thing has not happened yet, is shown as nothing: it never looks like data. What depends on what is said in
//! [`tables`] alone.

pub mod tables;

use std::fmt;

use ipc_types::payload::{FieldKind, FieldLayout, Number};
use runtime::config::nearest;
use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::Value;

pub use tables::Shown;

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
    topic: &'static str,
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
    /// The fields `names` of `T`; all of them when there is no name.
    ///
    /// # Errors
    ///
    /// The first name that `T` does not have, with what may have been meant.
    pub fn of<T: Shown>(names: &[String]) -> Result<Selection, UnknownField> {
        let known = field_names(T::FIELDS);
        match names.iter().find(|name| !known.contains(name)) {
            None => Ok(Selection {
                names: names.to_vec(),
            }),
            Some(unknown) => Err(UnknownField {
                topic: T::NAME,
                name: unknown.clone(),
                suggestions: suggestions(unknown, &known),
                known,
            }),
        }
    }

    /// Whether all fields were chosen.
    pub fn is_everything(&self) -> bool {
        self.names.is_empty()
    }

    /// Whether the plain field `path` was chosen, by itself or with what it lies in.
    fn contains(&self, path: &str) -> bool {
        self.is_everything() || self.names.iter().any(|name| is_at_or_under(path, name))
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

fn is_at_or_under(path: &str, name: &str) -> bool {
    path.strip_prefix(name)
        .is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

/// The names of all fields, each nested struct before what lies in it.
fn field_names(fields: &[FieldLayout]) -> Vec<String> {
    let mut names = Vec::new();
    for field in fields {
        names.push(field.name.to_owned());
        if let FieldKind::Struct(nested) = field.kind {
            let nested = field_names(nested.fields);
            names.extend(nested.iter().map(|name| join(field.name, name)));
        }
    }
    names
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
    Nested(Vec<(&'static str, Tree)>),
}

impl Tree {
    /// The chosen fields of `sample`.
    pub fn of<T: Shown>(sample: &T, selection: &Selection) -> Tree {
        // Plain numbers always have a JSON form; floats that are not finite become null.
        let values = serde_json::to_value(sample).unwrap_or_default();
        nested(sample, T::FIELDS, &values, "", selection)
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
        }
    }
}

fn nested<T: Shown>(
    sample: &T,
    fields: &[FieldLayout],
    values: &Value,
    path: &str,
    selection: &Selection,
) -> Tree {
    let mut inner = Vec::new();
    for field in fields {
        let path = join(path, field.name);
        let tree = match field.kind {
            FieldKind::Struct(inner) => {
                nested(sample, inner.fields, &values[field.name], &path, selection)
            }
            _ if selection.contains(&path) => {
                Tree::Plain(plain(sample, field, &values[field.name], &path))
            }
            _ => continue,
        };
        if tree != Tree::Nested(Vec::new()) {
            inner.push((field.name, tree));
        }
    }
    Tree::Nested(inner)
}

/// The value of one field, or null.
fn plain<T: Shown>(sample: &T, field: &FieldLayout, value: &Value, path: &str) -> Value {
    let mut conditions = T::CONDITIONS
        .iter()
        .filter(|(name, _)| is_at_or_under(path, name));
    if !conditions.all(|(_, means_something)| means_something(sample)) {
        return Value::Null;
    }
    let code = T::CODES.iter().find(|(name, _)| *name == path);
    if let Some((_, name_of)) = code {
        let number = value.as_u64().and_then(|number| u32::try_from(number).ok());
        return number
            .and_then(name_of)
            .map_or_else(|| value.clone(), Value::from);
    }
    match field.kind {
        FieldKind::Number(Number::F32) => short(value),
        _ => value.clone(),
    }
}

/// A 32-bit float with its own digits: 0.1 and not 0.10000000149011612.
fn short(value: &Value) -> Value {
    let text = value.as_f64().map(|number| (number as f32).to_string());
    let number = text.and_then(|text| text.parse::<f64>().ok());
    number.map_or(Value::Null, Value::from)
}

impl Serialize for Tree {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Tree::Plain(value) => value.serialize(serializer),
            Tree::Nested(inner) => {
                serializer.collect_map(inner.iter().map(|(name, tree)| (name, tree)))
            }
        }
    }
}

/// A sample as one JSON object that begins with its schema.
#[derive(Debug)]
pub struct JsonLine<'a> {
    /// Name of the layout, such as `hero.DspTelemetry.v2`.
    pub schema: &'static str,
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
    use ipc_types::payload::{DspTelemetry, ModuleState, SharedStruct};

    use super::*;

    fn everything<T: Shown>(sample: &T) -> Tree {
        Tree::of(sample, &Selection::default())
    }

    fn json<T: Shown>(sample: &T, names: &[&str]) -> String {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        let tree = Tree::of(sample, &Selection::of::<T>(&names).unwrap());
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
        let expected: Vec<String> = field_names(ModuleState::FIELDS)
            .into_iter()
            .filter(|name| !is_struct(name))
            .collect();
        assert_eq!(shown, expected);
    }

    #[test]
    fn an_unknown_field_is_refused_with_what_may_have_been_meant() {
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
            let error = Selection::of::<DspTelemetry>(&["xy".to_owned(), name.to_owned()]);
            let error = error.unwrap_err().to_string();
            assert!(error.contains(expected), "{name}: {error}");
        }
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
