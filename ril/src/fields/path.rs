//! Names of fields: parts, elements of arrays, and what lies in what.

use ipc_types::schema::{Kind, Message};

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
