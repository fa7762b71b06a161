//! Bytes that wait for the serial port: bounded, and a message goes in whole or not at all.

use dsp_protocol::Frame;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Bytes that may wait. One command attempt has at most 11 bytes and a waypoint 17; a port that takes nothing for the
/// whole life of a command (three attempts) and of as many grants as the DSP can give meanwhile needs less than half of
/// this. A message that does not fit is refused: a command will be repeated, a waypoint stays where it is.
pub const CAPACITY: usize = 512;

/// The bytes.
#[derive(Clone, Debug)]
pub struct OutgoingBytes {
    bytes: [u8; CAPACITY],
    start: usize,
    end: usize,
}

impl Default for OutgoingBytes {
    fn default() -> Self {
        OutgoingBytes {
            bytes: [0; CAPACITY],
            start: 0,
            end: 0,
        }
    }
}

impl Serialize for OutgoingBytes {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_bytes(self.as_bytes())
    }
}

impl<'de> Deserialize<'de> for OutgoingBytes {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let bytes = Vec::<u8>::deserialize(from)?;
        let mut outgoing = OutgoingBytes::default();
        let place = outgoing.bytes.get_mut(..bytes.len());
        let place = place.ok_or_else(|| D::Error::custom("too many bytes wait"))?;
        place.copy_from_slice(&bytes);
        outgoing.end = bytes.len();
        Ok(outgoing)
    }
}

impl OutgoingBytes {
    /// Whether a message of `len` bytes fits.
    pub fn has_room(&self, len: usize) -> bool {
        self.as_bytes().len() + len <= CAPACITY
    }

    /// Appends a message; false if it does not fit.
    pub fn push(&mut self, frame: &Frame) -> bool {
        let frame = frame.as_bytes();
        if !self.has_room(frame.len()) {
            return false;
        }
        if self.end + frame.len() > CAPACITY {
            self.bytes.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
        }
        self.bytes[self.end..self.end + frame.len()].copy_from_slice(frame);
        self.end += frame.len();
        true
    }

    /// The bytes to send next.
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes[self.start..self.end]
    }

    /// The first `count` bytes have been sent.
    pub fn consume(&mut self, count: usize) {
        self.start = (self.start + count).min(self.end);
        if self.start == self.end {
            self.clear();
        }
    }

    /// Discards everything.
    pub fn clear(&mut self) {
        (self.start, self.end) = (0, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dsp_protocol::{Command, Uplink};

    #[test]
    fn messages_come_out_whole_and_in_order_however_they_are_taken() {
        let frames: Vec<Frame> = (0..200)
            .map(|port| Uplink::Command(Command::Write16 { port, value: port }).encode())
            .collect();
        let (mut outgoing, mut sent, mut next) = (OutgoingBytes::default(), vec![], 0);
        let mut take = 1;
        while sent.len() < frames.iter().map(|frame| frame.as_bytes().len()).sum() {
            while next < frames.len() && outgoing.push(&frames[next]) {
                next += 1;
            }
            take = take % 23 + 1;
            let bytes = outgoing.as_bytes();
            let count = take.min(bytes.len());
            sent.extend_from_slice(&bytes[..count]);
            outgoing.consume(count);
        }
        let expected: Vec<u8> = frames
            .iter()
            .flat_map(|frame| frame.as_bytes())
            .copied()
            .collect();
        assert_eq!(sent, expected);
    }

    #[test]
    fn a_message_that_does_not_fit_changes_nothing() {
        let frame = Uplink::Command(Command::ClearErrors).encode();
        let mut outgoing = OutgoingBytes::default();
        assert!(outgoing.has_room(CAPACITY) && !outgoing.has_room(CAPACITY + 1));
        while outgoing.push(&frame) {}
        let before = outgoing.as_bytes().to_vec();
        assert!(before.len() > CAPACITY - frame.as_bytes().len());
        assert!(!outgoing.push(&frame));
        assert_eq!(outgoing.as_bytes(), before);
        outgoing.consume(usize::MAX);
        assert!(outgoing.as_bytes().is_empty());
    }
}
