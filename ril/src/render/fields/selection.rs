//! [`Selection`]: which fields of a sample were asked for.

use ipc_types::Schema;
use ipc_types::schema::{Kind, Message};
use runtime::config::nearest;
use runtime::exit::Failure;

/// Which fields to show.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// Names of fields, plain or nested; none stands for all.
    pub(super) names: Vec<String>,
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
    pub(super) fn contains(&self, path: &str) -> bool {
        self.is_everything() || self.names.iter().any(|name| is_at_or_under(path, name))
    }

    /// Whether a part of the field `path` was chosen, or all of it.
    pub(super) fn touches(&self, path: &str) -> bool {
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
