//! [`Selection`]: which fields of a sample were asked for.

use ipc_types::Schema;
use ipc_types::schema::{Kind, Message};
use runtime::config::nearest;
use runtime::exit::Failure;

/// How the name of an angle ends.
const RADIANS: &str = "_rad";
const DEGREES: &str = "_deg";

/// Which fields to show.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// Names of fields, plain or nested; none stands for all.
    pub(super) names: Vec<String>,
    /// Those of them that are angles in radians and are shown in degrees.
    pub(super) in_degrees: Vec<String>,
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
    /// The fields `names` of what `schema` describes; all of them when there is no name. A field that no other one ends like may be named
    /// by its last part, and an angle in radians in degrees: `latitude_deg` is `geodetic.latitude_rad`.
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
    pub(super) fn name_in_degrees(&self, path: &str) -> Option<String> {
        let is_meant = self.in_degrees.iter().any(|angle| angle == path);
        let angle = path.strip_suffix(RADIANS).filter(|_| is_meant)?;
        let last = angle.rsplit('.').next()?;
        Some(format!("{last}{DEGREES}"))
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

    /// Whether one number of `schema` was chosen, and nothing else.
    pub fn is_number(&self, schema: &Schema) -> bool {
        matches!(&self.names[..], [only] if schema.number(only).is_some())
    }

    /// Whether all fields were chosen.
    pub fn is_everything(&self) -> bool {
        self.names.is_empty()
    }

    /// Whether the field `path` was chosen, by itself or with what it lies in.
    pub(super) fn contains(&self, path: &str) -> bool {
        self.is_everything() || self.names.iter().any(|name| is_at_or_under(path, name))
    }

    /// Whether a part of the field `path` was chosen, or all of it.
    pub(super) fn touches(&self, path: &str) -> bool {
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

/// Names with the same last part, or else those that are nearest by their letters, as a whole or as a quantity without its unit.
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
pub(super) fn without_indices(path: &str) -> String {
    let parts = path.split('[').enumerate();
    let kept = parts.map(|(index, part)| match index {
        0 => part,
        _ => part.split_once(']').map_or("", |(_, rest)| rest),
    });
    kept.collect()
}

/// Whether the field `path` is `name`, or lies in it.
pub(super) fn is_at_or_under(path: &str, name: &str) -> bool {
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

/// One element of the array `path`.
pub(super) fn element(path: &str, index: usize) -> String {
    format!("{path}[{index}]")
}

/// The field `inner` of the struct `outer`, which is the sample itself when it has no name.
pub(super) fn join(outer: &str, inner: &str) -> String {
    match outer {
        "" => inner.to_owned(),
        _ => format!("{outer}.{inner}"),
    }
}
