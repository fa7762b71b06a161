//! CDR, the serialization of ROS 2's messages: little-endian, each number aligned to its own size, counted from behind
//! the header of four bytes.

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
pub struct Writer {
    bytes: Vec<u8>,
}

impl Writer {
    /// An empty message with room for `capacity` bytes.
    pub fn with_capacity(capacity: usize) -> Writer {
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

    /// Appends a number.
    pub fn u8(&mut self, number: u8) {
        self.number(number.to_le_bytes());
    }

    /// Appends a number.
    pub fn i8(&mut self, number: i8) {
        self.number(number.to_le_bytes());
    }

    /// Appends a number.
    pub fn u16(&mut self, number: u16) {
        self.number(number.to_le_bytes());
    }

    /// Appends a number.
    pub fn u32(&mut self, number: u32) {
        self.number(number.to_le_bytes());
    }

    /// Appends a number.
    pub fn i32(&mut self, number: i32) {
        self.number(number.to_le_bytes());
    }

    /// Appends a number.
    pub fn u64(&mut self, number: u64) {
        self.number(number.to_le_bytes());
    }

    /// Appends a number.
    pub fn f32(&mut self, number: f32) {
        self.number(number.to_le_bytes());
    }

    /// Appends a number.
    pub fn f64(&mut self, number: f64) {
        self.number(number.to_le_bytes());
    }

    /// Numbers of an array with fixed length, or of a nested struct.
    pub fn f64s(&mut self, numbers: &[f64]) {
        for number in numbers {
            self.f64(*number);
        }
    }

    /// A text: its length with the zero that ends it, its bytes, the zero. A text of 4 GiB and more is cut.
    pub fn string(&mut self, text: &str) {
        let len = text.len().min(u32::MAX as usize - 1);
        self.u32(len as u32 + 1);
        self.bytes.extend_from_slice(&text.as_bytes()[..len]);
        self.bytes.push(0);
    }

    /// A sequence without elements.
    pub fn empty_sequence(&mut self) {
        self.u32(0);
    }

    /// The message.
    pub fn finish(self) -> Vec<u8> {
        self.bytes
    }
}

/// Reads a message field by field. Nothing comes of bytes that are not there, so any bytes may be read.
#[derive(Clone, Debug)]
pub struct Reader<'a> {
    /// Behind the header.
    bytes: &'a [u8],
    position: usize,
}

impl<'a> Reader<'a> {
    /// At the beginning of `message`; `None` if it has another header than ours.
    pub fn new(message: &'a [u8]) -> Option<Reader<'a>> {
        Some(Reader {
            bytes: message.strip_prefix(&CDR_HEADER)?,
            position: 0,
        })
    }

    /// A byte.
    pub fn u8(&mut self) -> Option<u8> {
        self.number().map(u8::from_le_bytes)
    }

    /// A signed number of 4 bytes.
    pub fn i32(&mut self) -> Option<i32> {
        self.number().map(i32::from_le_bytes)
    }

    /// A number of 4 bytes.
    pub fn u32(&mut self) -> Option<u32> {
        self.number().map(u32::from_le_bytes)
    }

    /// A number of 8 bytes.
    pub fn u64(&mut self) -> Option<u64> {
        self.number().map(u64::from_le_bytes)
    }

    /// A number of 8 bytes.
    pub fn f64(&mut self) -> Option<f64> {
        self.number().map(f64::from_le_bytes)
    }

    /// A text that ends with its zero.
    pub fn string(&mut self) -> Option<&'a str> {
        let len = usize::try_from(self.u32()?).ok()?;
        let bytes = self.take(1, len)?;
        std::str::from_utf8(bytes.strip_suffix(&[0])?).ok()
    }

    /// Whether no field is left.
    pub fn is_at_end(&self) -> bool {
        self.position == self.bytes.len()
    }

    fn number<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.take(N, N)?.try_into().ok()
    }

    fn take(&mut self, align: usize, len: usize) -> Option<&'a [u8]> {
        let begin = self.position.next_multiple_of(align);
        let end = begin.checked_add(len)?;
        let bytes = self.bytes.get(begin..end)?;
        self.position = end;
        Some(bytes)
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

    #[test]
    fn what_was_written_is_read_and_half_of_it_is_nothing() {
        let mut writer = Writer::with_capacity(0);
        writer.u32(7);
        writer.string("ab");
        writer.u64(9);
        writer.f64(1.5);
        let message = writer.finish();
        let read = |bytes| {
            let mut reader = Reader::new(bytes)?;
            Some((
                reader.u32()?,
                reader.string()?,
                reader.u64()?,
                reader.f64()?,
            ))
        };
        assert_eq!(read(&message), Some((7, "ab", 9, 1.5)));
        for len in 0..message.len() {
            assert_eq!(read(&message[..len]), None);
        }
        assert!(Reader::new(&[0, 0, 0, 0, 7]).is_none());
    }
}
