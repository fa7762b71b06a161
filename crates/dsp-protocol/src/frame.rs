//! Frames and the values in them: 7-bit packing, header, checksum, CRC, wire types (`docs/protocol.md` sections 2, 3
//! and 11).
//!
//! [`Writer`] and [`Reader`] know how a value becomes bytes, never which values a message has. They are public only by
//! name, for the sealed half of `Direction`: no code outside this crate can reach them. [`record!`] states how a run of
//! values lies on the wire and which of them are plausible, once: writing, reading, length and limits follow from one
//! list, so they cannot disagree.

use core::ops::RangeInclusive;

use crc::{CRC_32_ISCSI, Crc, Table};

use crate::decode_error::DecodeError;

/// The longest frame of the classic profile: a status with all groups.
pub const MAX_CLASSIC_FRAME_LEN: usize = 128;
/// The longest frame of either profile: the same in the extended one, which needs six bytes more.
pub const MAX_FRAME_LEN: usize = MAX_CLASSIC_FRAME_LEN + 6;

/// The information bits of a byte on the line.
pub(crate) const DIGIT_MASK: u8 = 0x7F;
/// How many they are.
const DIGIT_BITS: u32 = 7;

/// One encoded message, ready for the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    bytes: [u8; MAX_FRAME_LEN],
    len: usize,
}

impl Frame {
    /// The bytes to send.
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes[..self.len]
    }
}

impl AsRef<[u8]> for Frame {
    fn as_ref(&self) -> &[u8] {
        self.as_bytes()
    }
}

/// The checksum of a frame's bytes before the checksum: their sum, cut to 7 bits.
pub fn checksum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte)) & DIGIT_MASK
}

/// The CRC of the extended profile: CRC-32/ISCSI over the bytes as they are on the line.
pub fn crc32(bytes: &[u8]) -> u32 {
    // Sixteen bytes at a time, by 16 KiB of tables.
    static ISCSI: Crc<u32, Table<16>> = Crc::<u32, Table<16>>::new(&CRC_32_ISCSI);
    ISCSI.checksum(bytes)
}

/// Packs values into a frame.
///
/// A scaled value is rounded to the nearest step, halves away from zero, and saturates at the ends of its type. The
/// wire has no word for "not a number": NaN is written as 0, so that an encoder never fails; senders withhold such
/// groups.
pub struct Writer {
    frame: Frame,
}

impl Writer {
    /// Opens a frame with its header.
    pub(crate) fn new(header: u8) -> Self {
        let mut bytes = [0; MAX_FRAME_LEN];
        bytes[0] = header;
        Writer {
            frame: Frame { bytes, len: 1 },
        }
    }

    /// Appends the low 7·N bits of `value`, most significant digit first. No message is longer than `MAX_FRAME_LEN`, so
    /// the place is always there.
    fn digits<const N: usize>(&mut self, value: u32) {
        let place = &mut self.frame.bytes[self.frame.len..self.frame.len + N];
        let mut rest = value;
        for byte in place.iter_mut().rev() {
            *byte = rest as u8 & DIGIT_MASK;
            rest >>= DIGIT_BITS;
        }
        self.frame.len += N;
    }

    /// Appends a `u7`; greater values saturate at 127.
    pub(crate) fn u7(&mut self, value: u8) {
        self.digits::<1>(u32::from(value.min(DIGIT_MASK)));
    }

    /// Appends a `u14`; greater values saturate at 16383.
    pub(crate) fn u14(&mut self, value: u16) {
        self.digits::<2>(u32::from(value.min((1 << 14) - 1)));
    }

    /// Appends a `u16`.
    pub(crate) fn u16(&mut self, value: u16) {
        self.digits::<3>(u32::from(value));
    }

    /// Appends an `i16`.
    pub(crate) fn i16(&mut self, value: i16) {
        self.u16(value.cast_unsigned());
    }

    /// Appends a `u32`.
    pub(crate) fn u32(&mut self, value: u32) {
        self.digits::<5>(value);
    }

    /// Appends an `i32`.
    pub(crate) fn i32(&mut self, value: i32) {
        self.u32(value.cast_unsigned());
    }

    /// Appends the bit pattern of an `f32`, NaN and infinities as they are.
    pub(crate) fn f32(&mut self, value: f32) {
        self.u32(value.to_bits());
    }

    // `rounded` takes halves away from zero and `as` saturates and turns NaN into 0: the rules of section 3.

    /// Appends `value` as a `u16` of 1/`steps` each.
    pub(crate) fn scaled_u16(&mut self, value: f32, steps: f32) {
        self.u16(rounded(f64::from(value) * f64::from(steps)) as u16);
    }

    /// Appends `value` as an `i16` of 1/`steps` each.
    pub(crate) fn scaled_i16(&mut self, value: f32, steps: f32) {
        self.i16(rounded(f64::from(value) * f64::from(steps)) as i16);
    }

    /// Appends `value` as an `i32` of 1/`steps` each.
    pub(crate) fn scaled_i32(&mut self, value: f64, steps: f64) {
        self.i32(rounded(value * steps) as i32);
    }

    /// Closes the frame with its checksum.
    pub(crate) fn finish(mut self) -> Frame {
        let sum = checksum(self.frame.as_bytes());
        self.u7(sum);
        self.frame
    }

    /// Closes the frame with its CRC.
    pub(crate) fn finish_with_crc(mut self) -> Frame {
        let crc = crc32(self.frame.as_bytes());
        self.u32(crc);
        self.frame
    }
}

/// Unpacks the values of a frame. It never fails in the middle: [`Reader::finish`] reports what was wrong, so that a
/// parser reads straight on.
pub struct Reader<'a> {
    rest: &'a [u8],
    short: bool,
    excess: u64,
}

impl<'a> Reader<'a> {
    /// Reads `payload`, which is a frame without what its profile puts around it.
    pub(crate) fn new(payload: &'a [u8]) -> Self {
        Reader {
            rest: payload,
            short: false,
            excess: 0,
        }
    }

    /// Takes N digits that carry a value of `bits` bits.
    fn digits<const N: usize>(&mut self, bits: u32) -> u32 {
        let Some((digits, rest)) = self.rest.split_first_chunk::<N>() else {
            self.short = true;
            return 0;
        };
        self.rest = rest;
        let value = digits.iter().fold(0u64, |value, digit| {
            value << DIGIT_BITS | u64::from(digit & DIGIT_MASK)
        });
        self.excess |= value >> bits;
        (value & ((1 << bits) - 1)) as u32
    }

    pub(crate) fn u7(&mut self) -> u8 {
        self.digits::<1>(7) as u8
    }

    pub(crate) fn u14(&mut self) -> u16 {
        self.digits::<2>(14) as u16
    }

    pub(crate) fn u16(&mut self) -> u16 {
        self.digits::<3>(16) as u16
    }

    pub(crate) fn i16(&mut self) -> i16 {
        self.u16().cast_signed()
    }

    pub(crate) fn u32(&mut self) -> u32 {
        self.digits::<5>(32)
    }

    pub(crate) fn i32(&mut self) -> i32 {
        self.u32().cast_signed()
    }

    pub(crate) fn f32(&mut self) -> f32 {
        f32::from_bits(self.u32())
    }

    // Dividing by the steps, not multiplying by a step, gives the floating-point number nearest to the decimal one.

    /// Takes a `u16` of 1/`steps` each.
    pub(crate) fn scaled_u16(&mut self, steps: f32) -> f32 {
        f32::from(self.u16()) / steps
    }

    /// Takes an `i16` of 1/`steps` each.
    pub(crate) fn scaled_i16(&mut self, steps: f32) -> f32 {
        f32::from(self.i16()) / steps
    }

    /// Takes an `i32` of 1/`steps` each.
    pub(crate) fn scaled_i32(&mut self, steps: f64) -> f64 {
        f64::from(self.i32()) / steps
    }

    /// Checks that all values taken were there and canonical, and that nothing is left over.
    ///
    /// # Errors
    /// [`DecodeError::Truncated`] when the payload's length is not that of the values taken, [`DecodeError::Padding`]
    /// when an unused bit was set.
    pub(crate) fn finish(self) -> Result<(), DecodeError> {
        if self.short || !self.rest.is_empty() {
            Err(DecodeError::Truncated)
        } else if self.excess != 0 {
            Err(DecodeError::Padding)
        } else {
            Ok(())
        }
    }
}

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
pub(crate) struct Steps<I, const PER_UNIT: u32>(core::marker::PhantomData<I>);

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
        $crate::frame::FieldSpec {
            name: stringify!($name),
            unit: $unit,
            wire: <$wire as $crate::frame::WireType<$type>>::NAME,
            steps_per_unit: <$wire as $crate::frame::WireType<$type>>::STEPS_PER_UNIT,
            min: *$limits.start(),
            max: *$limits.end(),
        }
    };
}
pub(crate) use field_spec;

/// Defines a struct whose fields lie on the wire in the order in which they are listed, and its [`Layout`]. Each line
/// is `field: type = wire type, unit, limits;`.
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

        impl $crate::frame::Layout for $record {
            type Value = $record;

            const FIELDS: &'static [$crate::frame::FieldSpec] =
                &[$($crate::frame::field_spec!($field, $type, $wire, $unit, $limits)),+];

            const LEN: usize = 0 $(+ <$wire as $crate::frame::WireType<$type>>::LEN)+;

            fn write(value: &$record, writer: &mut $crate::frame::Writer) {
                $(<$wire as $crate::frame::WireType<$type>>::write(value.$field, writer);)+
            }

            fn read(reader: &mut $crate::frame::Reader<'_>) -> $record {
                // The fields of a struct expression are evaluated in the order in which they are written.
                $record {
                    $($field: <$wire as $crate::frame::WireType<$type>>::read(reader),)+
                }
            }

            fn is_plausible(value: &$record) -> bool {
                true $(&& $crate::frame::is_within(value.$field, &$limits))+
            }
        }
    };
}
pub(crate) use record;

/// The nearest whole number, halves away from zero; NaN becomes 0. `f64::round` does the same, and is not in `core`.
fn rounded(value: f64) -> f64 {
    // Beyond the range of `i64` it saturates, as the caller's narrower number does then.
    let whole = value as i64 as f64;
    match value - whole {
        rest if rest >= 0.5 => whole + 1.0,
        rest if rest <= -0.5 => whole - 1.0,
        _ => whole,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What `write` puts between header and checksum.
    fn payload(write: impl FnOnce(&mut Writer)) -> Vec<u8> {
        let mut writer = Writer::new(0x80);
        write(&mut writer);
        let frame = writer.finish();
        let [_, payload @ .., _] = frame.as_bytes() else {
            panic!("no frame");
        };
        payload.to_vec()
    }

    #[test]
    fn values_are_rounded_as_the_standard_library_does() {
        let below_half = 0.499_999_999_999_999_94;
        for value in [
            0.0,
            below_half,
            0.5,
            1.5,
            2.5,
            32_767.5,
            4_503_599_627_370_495.5,
            1e300,
        ] {
            assert_eq!(rounded(value) as i32, value.round() as i32, "{value}");
            assert_eq!(rounded(-value) as i32, (-value).round() as i32, "-{value}");
        }
        let special = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
        assert_eq!(
            special.map(|value| rounded(value) as i32),
            [0, i32::MAX, i32::MIN]
        );
    }

    #[test]
    fn values_are_packed_as_section_3_says() {
        assert_eq!(payload(|w| w.u16(10_000)), [0x00, 0x4E, 0x10]);
        assert_eq!(payload(|w| w.i16(-1)), [0x03, 0x7F, 0x7F]);
        assert_eq!(payload(|w| w.f32(1.0)), [0x03, 0x7C, 0x00, 0x00, 0x00]);
        assert_eq!(payload(|w| w.u32(u32::MAX)), [0x0F, 0x7F, 0x7F, 0x7F, 0x7F]);
        assert_eq!(payload(|w| w.i32(i32::MIN)), [0x08, 0x00, 0x00, 0x00, 0x00]);
        assert_eq!(payload(|w| w.u14(300)), [0x02, 0x2C]);
        assert_eq!(payload(|w| w.u7(127)), [0x7F]);
    }

    #[test]
    fn scaled_values_are_rounded_away_from_zero_and_saturate() {
        for (value, steps, expected) in [
            (0.5, 1.0, 1),
            (-0.5, 1.0, -1),
            (1.5, 1.0, 2),
            (-2.5, 1.0, -3),
            (0.49, 1.0, 0),
            (1e9, 100.0, i16::MAX),
            (-1e9, 100.0, i16::MIN),
            (f32::INFINITY, 1.0, i16::MAX),
            (f32::NEG_INFINITY, 1.0, i16::MIN),
            (f32::NAN, 1.0, 0),
        ] {
            assert_eq!(
                payload(|w| w.scaled_i16(value, steps)),
                payload(|w| w.i16(expected)),
                "{value}"
            );
        }
    }

    #[test]
    fn a_reader_tells_what_was_wrong() {
        let read = |payload: &[u8]| {
            let mut reader = Reader::new(payload);
            let value = reader.u16();
            reader.finish().map(|()| value)
        };
        assert_eq!(read(&[0x03, 0x7F, 0x7F]), Ok(u16::MAX));
        assert_eq!(read(&[0x04, 0, 0]), Err(DecodeError::Padding));
        assert_eq!(read(&[0, 0]), Err(DecodeError::Truncated));
        assert_eq!(read(&[0, 0, 0, 0]), Err(DecodeError::Truncated));
        assert_eq!(read(&[]), Err(DecodeError::Truncated));
    }

    #[test]
    fn the_crc_is_the_one_with_the_check_value_of_the_catalogues() {
        assert_eq!(crc32(b"123456789"), 0xE306_9283);
        assert_eq!(crc32(&[]), 0);
        assert_eq!(crc32(&[0; 32]), 0x8A91_36AA);
    }

    #[test]
    fn the_checksum_is_the_sum_cut_to_seven_bits() {
        for (bytes, expected) in [
            (&[][..], 0),
            (&[0x80], 0),
            (&[0xAA, 0x01], 0x2B),
            (&[0x7F; 128], 0),
            (&[0x7F; 127], 1),
        ] {
            assert_eq!(checksum(bytes), expected, "{bytes:02X?}");
        }
    }
}
