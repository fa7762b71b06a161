//! How a value lies on the wire and which values are plausible; [`record!`] states both once for a run of values.
//!
//! Writing, reading, length and limits of a run follow from one list, so they cannot disagree.

use std::ops::RangeInclusive;

use crate::frame::{Reader, Writer};

/// What a field of a [`Group`](crate::Group) means, how it is sent and which values are plausible.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldSpec {
    /// Name of the field in the group's struct, or in [`Status`](crate::Status) when the group has one value only.
    pub name: &'static str,
    /// Unit of the value; empty for a pure number.
    pub unit: &'static str,
    /// Type on the wire (`docs/protocol.md` section 3).
    pub wire: &'static str,
    /// Steps of the wire in one unit.
    pub steps_per_unit: u32,
    /// Least plausible value (section 9).
    pub min: f64,
    /// Greatest plausible value (section 9).
    pub max: f64,
}

impl FieldSpec {
    /// Whether `value` lies within the limits; NaN does not.
    pub fn accepts(&self, value: f64) -> bool {
        (self.min..=self.max).contains(&value)
    }
}

/// The limits of a field.
pub(crate) type Limits = RangeInclusive<f64>;

/// A type of section 3 that carries values of type `T`.
pub(crate) trait WireType<T> {
    /// The type's name.
    const NAME: &'static str;
    /// Bytes on the wire.
    const LEN: usize;
    /// Steps in one unit.
    const STEPS_PER_UNIT: u32;
    /// Appends `value`.
    fn write(value: T, writer: &mut Writer);
    /// Takes a value; [`Reader::finish`] reports whether it was there.
    fn read(reader: &mut Reader<'_>) -> T;
}

/// The wire type `u7`, which Rust does not have.
pub(crate) enum U7 {}
/// The wire type `u14`, which Rust does not have.
pub(crate) enum U14 {}
/// A scaled value: the wire type `I` counts steps of 1/`PER_UNIT`.
pub(crate) struct Steps<I, const PER_UNIT: u32>(std::marker::PhantomData<I>);

macro_rules! integers {
    ($($wire:ty: $type:ty, $method:ident, $len:literal;)*) => {$(
        impl WireType<$type> for $wire {
            const NAME: &'static str = stringify!($method);
            const LEN: usize = $len;
            const STEPS_PER_UNIT: u32 = 1;

            fn write(value: $type, writer: &mut Writer) {
                writer.$method(value);
            }

            fn read(reader: &mut Reader<'_>) -> $type {
                reader.$method()
            }
        }
    )*};
}

macro_rules! scaled {
    ($($integer:ty: $type:ty, $method:ident, $len:literal;)*) => {$(
        impl<const PER_UNIT: u32> WireType<$type> for Steps<$integer, PER_UNIT> {
            const NAME: &'static str = stringify!($integer);
            const LEN: usize = $len;
            const STEPS_PER_UNIT: u32 = PER_UNIT;

            fn write(value: $type, writer: &mut Writer) {
                writer.$method(value, PER_UNIT as $type);
            }

            fn read(reader: &mut Reader<'_>) -> $type {
                reader.$method(PER_UNIT as $type)
            }
        }
    )*};
}

integers! {
    U7: u8, u7, 1;
    U14: u16, u14, 2;
    u16: u16, u16, 3;
    u32: u32, u32, 5;
}

scaled! {
    u16: f32, scaled_u16, 3;
    i16: f32, scaled_i16, 3;
    i32: f64, scaled_i32, 5;
}

/// A run of values with a fixed place for each.
pub(crate) trait Layout {
    /// What holds the values.
    type Value;
    /// What is known of each value, in the order of the wire.
    const FIELDS: &'static [FieldSpec];
    /// Bytes on the wire.
    const LEN: usize;
    /// Appends the values.
    fn write(value: &Self::Value, writer: &mut Writer);
    /// Takes the values; [`Reader::finish`] reports whether they were there.
    fn read(reader: &mut Reader<'_>) -> Self::Value;
    /// Whether each value lies within its limits.
    fn is_plausible(value: &Self::Value) -> bool;
}

/// Whether `value` lies within `limits`; NaN does not, since it compares false.
pub(crate) fn is_within(value: impl Into<f64>, limits: &Limits) -> bool {
    limits.contains(&value.into())
}

/// The [`FieldSpec`] of a field: name, type of the value, wire type, unit, limits.
macro_rules! field_spec {
    ($name:ident, $type:ty, $wire:ty, $unit:literal, $limits:expr) => {
        $crate::field::FieldSpec {
            name: stringify!($name),
            unit: $unit,
            wire: <$wire as $crate::field::WireType<$type>>::NAME,
            steps_per_unit: <$wire as $crate::field::WireType<$type>>::STEPS_PER_UNIT,
            min: *$limits.start(),
            max: *$limits.end(),
        }
    };
}
pub(crate) use field_spec;

/// Defines a struct whose fields lie on the wire in the order in which they are listed, and its [`Layout`]. Each line is
/// `field: type = wire type, unit, limits;`.
macro_rules! record {
    (
        $(#[$meta:meta])*
        $record:ident {
            $($(#[$doc:meta])* $field:ident: $type:ty = $wire:ty, $unit:literal, $limits:expr;)+
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        pub struct $record {
            $($(#[$doc])* pub $field: $type,)+
        }

        impl $crate::field::Layout for $record {
            type Value = $record;

            const FIELDS: &'static [$crate::field::FieldSpec] =
                &[$($crate::field::field_spec!($field, $type, $wire, $unit, $limits)),+];

            const LEN: usize = 0 $(+ <$wire as $crate::field::WireType<$type>>::LEN)+;

            fn write(value: &$record, writer: &mut $crate::frame::Writer) {
                $(<$wire as $crate::field::WireType<$type>>::write(value.$field, writer);)+
            }

            fn read(reader: &mut $crate::frame::Reader<'_>) -> $record {
                // The fields of a struct expression are evaluated in the order in which they are written.
                $record {
                    $($field: <$wire as $crate::field::WireType<$type>>::read(reader),)+
                }
            }

            fn is_plausible(value: &$record) -> bool {
                true $(&& $crate::field::is_within(value.$field, &$limits))+
            }
        }
    };
}
pub(crate) use record;
