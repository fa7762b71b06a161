//! [`Leaf`]: the numbers of a payload, and how they are found.

use super::message::{Field, Kind, Message};
use super::value::Value;
use crate::payload::Number;

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

/// All numbers of `message`, which lies at `offset` and is called `path`.
pub(super) fn collect<'a>(
    message: &'a Message,
    path: &str,
    offset: usize,
    leaves: &mut Vec<Leaf<'a>>,
) {
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

/// The numbers of `root` at `path` and below it; nothing when there is no such field.
pub(super) fn find<'a>(root: &'a Message, path: &str) -> Option<Vec<Leaf<'a>>> {
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
