//! CDR, the serialization of ROS 2's messages: little-endian, each number aligned to its own size, counted from behind the header
//! of four bytes.

use ipc_types::schema::CDR_HEADER;

/// The message of a sample of ours: its bytes as they lie in shared memory, behind the header of CDR.
///
/// No struct of the contract has padding, and every number is aligned to its size, which is what CDR wants.
pub fn message(sample: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(CDR_HEADER.len() + sample.len());
    bytes.extend_from_slice(&CDR_HEADER);
    bytes.extend_from_slice(sample);
    bytes
}

/// Writes a message field by field.
#[derive(Debug)]
pub(super) struct Writer {
    bytes: Vec<u8>,
}

impl Writer {
    /// An empty message with room for `capacity` bytes.
    pub(super) fn with_capacity(capacity: usize) -> Writer {
        let mut bytes = Vec::with_capacity(capacity);
        bytes.extend_from_slice(&CDR_HEADER);
        Writer { bytes }
    }

    /// Appends a number of `N` bytes, and zeros before it as its alignment wants.
    fn number<const N: usize>(&mut self, number: [u8; N]) {
        let position = self.bytes.len() - CDR_HEADER.len();
        let aligned = CDR_HEADER.len() + position.next_multiple_of(N);
        self.bytes.resize(aligned, 0);
        self.bytes.extend_from_slice(&number);
    }

    pub(super) fn u8(&mut self, number: u8) {
        self.number(number.to_le_bytes());
    }

    pub(super) fn i8(&mut self, number: i8) {
        self.number(number.to_le_bytes());
    }

    pub(super) fn u16(&mut self, number: u16) {
        self.number(number.to_le_bytes());
    }

    pub(super) fn u32(&mut self, number: u32) {
        self.number(number.to_le_bytes());
    }

    pub(super) fn i32(&mut self, number: i32) {
        self.number(number.to_le_bytes());
    }

    pub(super) fn f32(&mut self, number: f32) {
        self.number(number.to_le_bytes());
    }

    pub(super) fn f64(&mut self, number: f64) {
        self.number(number.to_le_bytes());
    }

    /// Numbers of an array with fixed length, or of a nested struct.
    pub(super) fn f64s(&mut self, numbers: &[f64]) {
        for number in numbers {
            self.f64(*number);
        }
    }

    /// A text: its length with the zero that ends it, its bytes, the zero. Only short texts of this crate are written.
    pub(super) fn string(&mut self, text: &str) {
        self.u32(text.len() as u32 + 1);
        self.bytes.extend_from_slice(text.as_bytes());
        self.bytes.push(0);
    }

    /// A sequence without elements.
    pub(super) fn empty_sequence(&mut self) {
        self.u32(0);
    }

    /// The message.
    pub(super) fn finish(self) -> Vec<u8> {
        self.bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_becomes_a_message_by_the_header_alone() {
        assert_eq!(message(&[7, 8]), [0, 1, 0, 0, 7, 8]);
    }

    #[test]
    fn numbers_are_aligned_from_behind_the_header() {
        let mut writer = Writer::with_capacity(0);
        writer.u8(1);
        writer.u16(2);
        writer.string("ab");
        writer.f64(1.0);
        let expected = [
            0, 1, 0, 0, // header
            1, 0, 2, 0, // u8, a byte of alignment, u16
            3, 0, 0, 0, b'a', b'b', 0, 0, // text, alignment
            0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f,
        ];
        assert_eq!(writer.finish(), expected);
    }
}
