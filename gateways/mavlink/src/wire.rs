//! Frames of MAVLink 2, and of MAVLink 1, of which a heartbeat is read and all else refused:
//! <https://mavlink.io/en/guide/serialization.html>.
//!
//! A datagram holds whole frames. What is not a frame ends the datagram: there is nothing behind it that could be
//! trusted. A signature is read and not checked: [`Signing`](crate::Signing) does.

use arrayvec::ArrayVec;
use crc::{CRC_16_MCRF4XX, Crc};

use crate::message::{MessageKind, kind};

/// First byte of a frame of MAVLink 2.
const MAGIC: u8 = 0xfd;

/// First byte of a frame of MAVLink 1.
const MAGIC_1: u8 = 0xfe;

/// Bytes before the payload, and those of the checksum.
const HEADER: usize = 10;
const HEADER_1: usize = 6;
const CHECKSUM: usize = 2;

/// The one flag that changes a frame's length: it is followed by a signature.
const SIGNED: u8 = 1;
const SIGNATURE: usize = 13;

/// Longest payload.
pub const MAX_PAYLOAD: usize = 255;

/// Longest frame.
pub const MAX_FRAME: usize = HEADER + MAX_PAYLOAD + CHECKSUM + SIGNATURE;

const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_MCRF4XX);

/// A frame whose checksum is right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MavFrame<'a> {
    /// Counts the frames of the sender.
    pub sequence: u8,
    /// The sender's system.
    pub system: u8,
    /// The sender's component.
    pub component: u8,
    /// Which message.
    pub kind: MessageKind,
    /// The message, without the zeros at its end.
    pub payload: Payload<'a>,
    /// Its signature, which is not checked; `None` if it has none.
    pub signature: Option<Signature<'a>>,
    /// Whether it is one of MAVLink 1.
    pub is_version_1: bool,
}

/// What follows a frame that is signed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signature<'a> {
    /// Which of the sender's links it goes over.
    pub link: u8,
    /// When it was signed, in 10 µs from the beginning of 2015.
    pub timestamp: u64,
    /// 48 bits of a hash over the key and `covered`.
    pub bytes: [u8; 6],
    /// All of the frame before `bytes`.
    pub covered: &'a [u8],
}

/// Why a frame was rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rejected {
    /// Not the first byte of a frame.
    Stray,
    /// The datagram ends inside the frame.
    CutShort,
    /// Flags that change the frame in a way that is not known.
    Flags,
    /// A message that is not read here, so that its checksum cannot be computed. The frames behind it are read.
    UnknownMessage,
    /// The checksum is wrong.
    Checksum,
}

/// The frames of a datagram, in order.
pub fn frames(datagram: &[u8]) -> impl Iterator<Item = Result<MavFrame<'_>, Rejected>> {
    let mut rest = datagram;
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let (frame, length) = read(rest);
        rest = rest.get(length..).unwrap_or_default();
        Some(frame)
    })
}

/// The first frame, and its length: all there is when nothing behind it can be read.
fn read(bytes: &[u8]) -> (Result<MavFrame<'_>, Rejected>, usize) {
    let all = bytes.len();
    let (header, is_version_1) = match bytes[0] {
        MAGIC => (HEADER, false),
        MAGIC_1 => (HEADER_1, true),
        _ => return (Err(Rejected::Stray), all),
    };
    if all < header {
        return (Err(Rejected::CutShort), all);
    }
    let end = header + usize::from(bytes[1]);
    let (flags, from) = match is_version_1 {
        true => (0, 2),
        false => (bytes[2], 4),
    };
    if flags & !SIGNED != 0 {
        return (Err(Rejected::Flags), all);
    }
    let is_signed = flags & SIGNED != 0;
    let length = end + CHECKSUM + if is_signed { SIGNATURE } else { 0 };
    if all < length {
        return (Err(Rejected::CutShort), all);
    }
    let id = match is_version_1 {
        true => u32::from(bytes[5]),
        false => u32::from_le_bytes([bytes[7], bytes[8], bytes[9], 0]),
    };
    let Some(kind) = kind(id) else {
        return (Err(Rejected::UnknownMessage), length);
    };
    let told = u16::from_le_bytes([bytes[end], bytes[end + 1]]);
    if told != checksum(&bytes[1..end], kind) {
        return (Err(Rejected::Checksum), all);
    }
    let frame = MavFrame {
        sequence: bytes[from],
        system: bytes[from + 1],
        component: bytes[from + 2],
        kind,
        payload: Payload(&bytes[header..end]),
        signature: is_signed.then(|| signature(&bytes[..length])),
        is_version_1,
    };
    (Ok(frame), length)
}

/// The signature at the end of a whole frame.
fn signature(frame: &[u8]) -> Signature<'_> {
    let (covered, bytes) = frame.split_at(frame.len() - 6);
    let (_, stamp) = covered.split_at(covered.len() - 7);
    let stamp: [u8; 7] = std::array::from_fn(|index| stamp[index]);
    let [link, a, b, c, d, e, f] = stamp;
    Signature {
        link,
        timestamp: u64::from_le_bytes([a, b, c, d, e, f, 0, 0]),
        bytes: std::array::from_fn(|index| bytes[index]),
        covered,
    }
}

/// Of all but the first byte, and of what tells two versions of a message apart.
fn checksum(covered: &[u8], kind: MessageKind) -> u16 {
    let mut digest = CRC.digest();
    digest.update(covered);
    digest.update(&[kind.extra]);
    digest.finalize()
}

/// Fields of a message by their place; what was cut off as zeros is zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Payload<'a>(pub &'a [u8]);

impl Payload<'_> {
    fn bytes<const N: usize>(&self, at: usize) -> [u8; N] {
        std::array::from_fn(|index| self.0.get(at + index).copied().unwrap_or(0))
    }

    /// One byte.
    pub fn u8(&self, at: usize) -> u8 {
        self.bytes::<1>(at)[0]
    }

    /// Two bytes.
    pub fn u16(&self, at: usize) -> u16 {
        u16::from_le_bytes(self.bytes(at))
    }

    /// Four bytes.
    pub fn u32(&self, at: usize) -> u32 {
        u32::from_le_bytes(self.bytes(at))
    }

    /// Four bytes with a sign.
    pub fn i32(&self, at: usize) -> i32 {
        i32::from_le_bytes(self.bytes(at))
    }

    /// Eight bytes with a sign.
    pub fn i64(&self, at: usize) -> i64 {
        i64::from_le_bytes(self.bytes(at))
    }

    /// Eight bytes.
    pub fn u64(&self, at: usize) -> u64 {
        u64::from_le_bytes(self.bytes(at))
    }

    /// Four bytes, as a number with a fraction.
    pub fn f32(&self, at: usize) -> f32 {
        f32::from_le_bytes(self.bytes(at))
    }
}

/// A message that is written, field by field in the order of the wire: the longest fields first, extensions last.
#[derive(Clone, Debug, PartialEq)]
pub struct MessageWriter {
    /// Which one.
    pub kind: MessageKind,
    payload: ArrayVec<u8, MAX_PAYLOAD>,
}

macro_rules! fields {
    ($($name:ident)*) => {
        $(
            /// Adds a field.
            #[must_use]
            pub fn $name(mut self, value: $name) -> MessageWriter {
                self.add(&value.to_le_bytes());
                self
            }
        )*
    };
}

impl MessageWriter {
    /// A message without a field.
    pub fn new(kind: MessageKind) -> MessageWriter {
        MessageWriter {
            kind,
            payload: ArrayVec::new(),
        }
    }

    fields!(u8 i8 u16 i16 u32 i32 u64 i64 f32);

    /// Adds an array of characters, cut or filled up with zeros.
    #[must_use]
    pub fn text(mut self, text: &str, length: usize) -> MessageWriter {
        let mut bytes = text.bytes().chain(std::iter::repeat(0));
        for _ in 0..length {
            self.add(&[bytes.next().unwrap_or(0)]);
        }
        self
    }

    /// Adds the same value several times.
    #[must_use]
    pub fn u16s(self, value: u16, count: usize) -> MessageWriter {
        (0..count).fold(self, |message, _| message.u16(value))
    }

    /// Adds one value several times.
    #[must_use]
    pub fn f32s(self, value: f32, count: usize) -> MessageWriter {
        (0..count).fold(self, |message, _| message.f32(value))
    }

    fn add(&mut self, bytes: &[u8]) {
        // No kind is longer: `message` has a test for it.
        let _ = self.payload.try_extend_from_slice(bytes);
    }

    /// The fields so far.
    pub fn payload(&self) -> Payload<'_> {
        Payload(&self.payload)
    }

    /// The frame, from `system` and `component`.
    pub fn frame(&self, sequence: u8, system: u8, component: u8) -> Vec<u8> {
        self.encode(0, sequence, system, component)
    }

    /// The frame, which says that a signature follows, from `system` and `component`.
    pub fn frame_to_sign(&self, sequence: u8, system: u8, component: u8) -> Vec<u8> {
        self.encode(SIGNED, sequence, system, component)
    }

    /// The frame in MAVLink 1, from `system` and `component`: for the one who does not read MAVLink 2. It has no zeros
    /// cut off, and the message must have no field that is an extension.
    pub fn frame_of_version_1(&self, sequence: u8, system: u8, component: u8) -> Vec<u8> {
        let mut frame = Vec::with_capacity(MAX_FRAME);
        let (length, id) = (self.payload.len() as u8, self.kind.id as u8);
        frame.extend([MAGIC_1, length, sequence, system, component, id]);
        frame.extend(&self.payload);
        let checksum = checksum(&frame[1..], self.kind);
        frame.extend(checksum.to_le_bytes());
        frame
    }

    fn encode(&self, flags: u8, sequence: u8, system: u8, component: u8) -> Vec<u8> {
        let kept = self.payload.iter().rposition(|byte| *byte != 0);
        let payload = &self.payload[..kept.map_or(1, |last| last + 1).min(self.payload.len())];
        let id = self.kind.id.to_le_bytes();
        let mut frame = Vec::with_capacity(MAX_FRAME);
        frame.extend([
            MAGIC,
            payload.len() as u8,
            flags,
            0,
            sequence,
            system,
            component,
        ]);
        frame.extend(&id[..3]);
        frame.extend(payload);
        let checksum = checksum(&frame[1..], self.kind);
        frame.extend(checksum.to_le_bytes());
        frame
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::{ATTITUDE, HEARTBEAT, STATUSTEXT};

    fn heartbeat() -> MessageWriter {
        MessageWriter::new(HEARTBEAT)
            .u32(0x0304_0000)
            .u8(4)
            .u8(12)
            .u8(0x81)
            .u8(4)
            .u8(3)
    }

    #[test]
    fn what_is_written_is_read_again_and_zeros_at_the_end_are_not_sent() {
        let frame = heartbeat().frame(7, 1, 1);
        // As pymavlink 2.4.50 packs it.
        assert_eq!(frame.len(), 21);
        let read: Vec<_> = frames(&frame).collect();
        let [Ok(read)] = read[..] else {
            panic!("{read:?}")
        };
        assert_eq!((read.sequence, read.system, read.component), (7, 1, 1));
        assert_eq!(read.payload.u32(0), 0x0304_0000);
        assert_eq!((read.payload.u8(8), read.payload.u8(40)), (3, 0));

        let short = MessageWriter::new(ATTITUDE)
            .u32(5)
            .f32s(0.0, 6)
            .frame(0, 1, 1);
        assert_eq!(short.len(), HEADER + 1 + CHECKSUM);
        let empty = MessageWriter::new(ATTITUDE).u32(0).frame(0, 1, 1);
        assert_eq!(empty.len(), HEADER + 1 + CHECKSUM, "one byte always goes");
    }

    #[test]
    fn a_frame_that_is_none_is_rejected_with_its_reason() {
        let good = heartbeat().frame(0, 1, 1);
        let changed = |at: usize, to: u8| {
            let mut frame = good.clone();
            frame[at] = to;
            frame
        };
        let cases = [
            (vec![0x55; 30], Rejected::Stray),
            (good[..20].to_vec(), Rejected::CutShort),
            (good[..3].to_vec(), Rejected::CutShort),
            (changed(2, 2), Rejected::Flags),
            (changed(7, 200), Rejected::UnknownMessage),
            (changed(12, 9), Rejected::Checksum),
            (changed(19, 9), Rejected::Checksum),
            // A signature is missing.
            (changed(2, SIGNED), Rejected::CutShort),
        ];
        for (bytes, why) in cases {
            let read: Vec<_> = frames(&bytes).collect();
            assert_eq!(read, [Err(why)]);
        }
    }

    #[test]
    fn several_frames_are_read_and_a_signature_is_kept() {
        let text = MessageWriter::new(STATUSTEXT).u8(6).text("hello", 50);
        let mut signed = text.frame_to_sign(1, 255, 190);
        signed.extend([9, 1, 0, 0, 0, 0, 0, 1, 2, 3, 4, 5, 6]);
        let covered = signed[..signed.len() - 6].to_vec();
        let unknown = {
            let mut frame = heartbeat().frame(0, 1, 1);
            frame[8] = 99;
            frame
        };
        let datagram = [signed, unknown, heartbeat().frame(2, 1, 1)].concat();
        let read: Vec<_> = frames(&datagram).collect();
        let [Ok(first), Err(Rejected::UnknownMessage), Ok(last)] = read[..] else {
            panic!("{read:?}")
        };
        let expected = Signature {
            link: 9,
            timestamp: 1,
            bytes: [1, 2, 3, 4, 5, 6],
            covered: &covered,
        };
        assert_eq!((first.signature, last.signature), (Some(expected), None));
        assert_eq!((first.system, last.sequence), (255, 2));
    }

    #[test]
    fn a_heartbeat_of_version_1_is_read_and_written() {
        let mut frame = vec![MAGIC_1, 9, 3, 255, 190, 0];
        frame.extend([0, 0, 0, 0, 6, 8, 0, 4, 3]);
        let checksum = checksum(&frame[1..], HEARTBEAT);
        frame.extend(checksum.to_le_bytes());
        let message = MessageWriter::new(HEARTBEAT).u32(0).u8(6).u8(8);
        let message = message.u8(0).u8(4).u8(3);
        assert_eq!(message.frame_of_version_1(3, 255, 190), frame);
        let read: Vec<_> = frames(&frame).collect();
        let [Ok(read)] = read[..] else {
            panic!("{read:?}")
        };
        assert!(read.is_version_1);
        assert_eq!((read.system, read.payload.u8(4)), (255, 6));
    }
}
