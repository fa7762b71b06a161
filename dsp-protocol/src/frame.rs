//! Frames: 7-bit packing, header, checksum and CRC (`docs/protocol.md` sections 2, 3 and 11).
//!
//! [`Writer`] and [`Reader`] know how a value becomes bytes, never which values a message has. They are public only by
//! name, for the sealed half of `Direction`: no code outside this crate can reach them.

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
/// A scaled value is rounded to the nearest step, halves away from zero, and saturates at the ends of its type. The wire
/// has no word for "not a number": NaN is written as 0, so that an encoder never fails; senders withhold such groups.
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

    // `f64::round` takes halves away from zero and `as` saturates and turns NaN into 0: the rules of section 3.

    /// Appends `value` as a `u16` of 1/`steps` each.
    pub(crate) fn scaled_u16(&mut self, value: f32, steps: f32) {
        self.u16((f64::from(value) * f64::from(steps)).round() as u16);
    }

    /// Appends `value` as an `i16` of 1/`steps` each.
    pub(crate) fn scaled_i16(&mut self, value: f32, steps: f32) {
        self.i16((f64::from(value) * f64::from(steps)).round() as i16);
    }

    /// Appends `value` as an `i32` of 1/`steps` each.
    pub(crate) fn scaled_i32(&mut self, value: f64, steps: f64) {
        self.i32((value * steps).round() as i32);
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

/// Unpacks the values of a frame. It never fails in the middle: [`Reader::finish`] reports what was wrong, so that a parser
/// reads straight on.
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
    /// [`DecodeError::Truncated`] when the payload's length is not that of the values taken, [`DecodeError::Padding`] when
    /// an unused bit was set.
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
