//! [`Value`]: a number read from a payload, whatever its type.

use std::fmt;

use crate::payload::Number;

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
    /// Reads the number at `offset`; nothing when the bytes end before it does.
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

    /// The integer; nothing when it is negative or a float.
    pub fn as_u64(self) -> Option<u64> {
        match self {
            Value::Unsigned(value) => Some(value),
            Value::Signed(value) => value.try_into().ok(),
            Value::Single(_) | Value::Double(_) => None,
        }
    }

    /// The integer; nothing when it is greater than `i64::MAX` or a float.
    pub fn as_i64(self) -> Option<i64> {
        match self {
            Value::Unsigned(value) => value.try_into().ok(),
            Value::Signed(value) => Some(value),
            Value::Single(_) | Value::Double(_) => None,
        }
    }
}

/// As few digits as give back the same number.
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
