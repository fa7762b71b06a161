//! [`Leaf`]: the numbers of a payload, and how they are found; [`Value`]: such a number, whatever its type.

use std::fmt;

use super::message::{Field, Kind, Message};
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
    /// Length of the array; `None` if it is one number.
    pub len: Option<usize>,
    /// The field.
    pub field: &'a Field,
}

impl Leaf<'_> {
    /// The number in `payload`, of an array the first; `None` if the payload is too short.
    pub fn value(&self, payload: &[u8]) -> Option<Value> {
        self.element(payload, 0)
    }

    /// The number at `index` of the array; `None` if there is none or the payload is too short.
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

/// The numbers of `root` at `path` and below it; `None` if there is no such field.
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

/// A number of a payload.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// `u8` to `u64`
    Unsigned(u64),
    /// `i8` to `i64`
    Signed(i64),
    /// `f32`
    Single(f32),
    /// `f64`
    Double(f64),
}

impl Value {
    /// Reads the number at `offset`; `None` if the bytes end before it does.
    pub fn read(number: Number, bytes: &[u8], offset: usize) -> Option<Value> {
        let end = offset.checked_add(number.size())?;
        let bytes = bytes.get(offset..end)?;
        macro_rules! of {
            ($type:ty) => {
                <$type>::from_le_bytes(bytes.try_into().ok()?)
            };
        }
        Some(match number {
            Number::U8 => Value::Unsigned(of!(u8).into()),
            Number::U16 => Value::Unsigned(of!(u16).into()),
            Number::U32 => Value::Unsigned(of!(u32).into()),
            Number::U64 => Value::Unsigned(of!(u64)),
            Number::I8 => Value::Signed(of!(i8).into()),
            Number::I16 => Value::Signed(of!(i16).into()),
            Number::I32 => Value::Signed(of!(i32).into()),
            Number::I64 => Value::Signed(of!(i64)),
            Number::F32 => Value::Single(of!(f32)),
            Number::F64 => Value::Double(of!(f64)),
        })
    }

    /// The number as a float: exact for all but integers beyond 2⁵³.
    pub fn as_f64(self) -> f64 {
        match self {
            Value::Unsigned(value) => value as f64,
            Value::Signed(value) => value as f64,
            Value::Single(value) => value.into(),
            Value::Double(value) => value,
        }
    }

    /// The integer; `None` if it is negative or a float.
    pub fn as_u64(self) -> Option<u64> {
        match self {
            Value::Unsigned(value) => Some(value),
            Value::Signed(value) => value.try_into().ok(),
            Value::Single(_) | Value::Double(_) => None,
        }
    }
}

/// A number has as few digits as give it back.
impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Unsigned(value) => value.fmt(f),
            Value::Signed(value) => value.fmt(f),
            Value::Single(value) => value.fmt(f),
            Value::Double(value) => value.fmt(f),
        }
    }
}
