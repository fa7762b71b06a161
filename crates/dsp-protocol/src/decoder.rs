//! An incremental, resynchronising decoder for either profile (`docs/protocol.md` sections 2 and 11).

#[cfg(feature = "serde")]
use alloc::vec::Vec;
use core::marker::PhantomData;

use crate::decode_error::DecodeError;
use crate::frame::MAX_FRAME_LEN;
use crate::profile::header::is_header;
use crate::profile::{FrameLen, Message, Profile, Received};

/// One direction of the line: which messages it carries and how long they are. Implemented by [`crate::Downlink`] and
/// [`crate::Uplink`] and sealed: the decoder's buffer relies on the lengths that they give. Its functions are those of
/// the classic profile; a [`Decoder`] has them for both.
pub trait Direction: Message {
    /// How long the message is that begins with `prefix`, as far as its bytes show. `prefix` begins with a header; it
    /// may be shorter than the message or reach beyond it. Never panics, whatever the bytes.
    fn frame_len(prefix: &[u8]) -> FrameLen {
        Profile::Classic.frame_len::<Self>(prefix)
    }

    /// The message in `frame`, which is one whole frame (as [`Direction::frame_len`] measures it) with a right
    /// checksum. Never panics, whatever the bytes.
    ///
    /// # Errors
    /// [`DecodeError::Padding`] or [`DecodeError::Value`], in this order when both hold; other errors only for a slice
    /// that is not a whole frame of this direction.
    fn parse(frame: &[u8]) -> Result<Self, DecodeError> {
        Ok(Profile::Classic.parse::<Self>(frame)?.message)
    }
}

/// What a call of [`Decoder::decode`] found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Decoded<M> {
    /// All input is used and the message is not complete yet (`INCOMPLETE`).
    Incomplete,
    /// One whole, correct message.
    Message(M),
    /// Bytes that were discarded, and why.
    Rejected(DecodeError),
}

/// What a call of [`Decoder::next_frame`] found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Framed<'a> {
    /// All input is used and the frame is not complete yet.
    Incomplete,
    /// One whole frame with a right checksum or CRC, header and check included.
    Frame(&'a [u8]),
    /// Bytes that were discarded, and why; never [`DecodeError::Padding`] or [`DecodeError::Value`].
    Rejected(DecodeError),
}

/// Finds the messages of one direction in a stream of bytes, however it is cut.
///
/// The sequence of messages and rejections depends on the bytes alone, never on how they are cut into slices. At most
/// one message is held, in a fixed buffer; a frame that lies whole in the input is read where it lies.
#[derive(Clone, Debug)]
pub struct Decoder<M> {
    profile: Profile,
    /// The bytes of the message that has begun.
    buffer: [u8; MAX_FRAME_LEN],
    /// How many they are; 0 when no message is open.
    held: usize,
    /// Bytes up to the next header belong to a rejection that was already reported.
    skipping: bool,
    direction: PhantomData<M>,
}

impl<M: Direction> Decoder<M> {
    /// A decoder of the classic profile that waits for the first header.
    pub fn new() -> Self {
        Decoder::with_profile(Profile::Classic)
    }

    /// A decoder of `profile` that waits for the first header.
    pub fn with_profile(profile: Profile) -> Self {
        Decoder {
            profile,
            buffer: [0; MAX_FRAME_LEN],
            held: 0,
            skipping: false,
            direction: PhantomData,
        }
    }

    /// The profile of the frames that it looks for.
    pub fn profile(&self) -> Profile {
        self.profile
    }

    /// How many bytes of the message that has begun are missing at least; 0 when none has. It is exact once the bytes
    /// that say its length are there.
    pub fn missing(&self) -> usize {
        if self.held == 0 {
            return 0;
        }
        match self.profile.frame_len::<M>(&self.buffer[..self.held]) {
            FrameLen::Exactly(len) | FrameLen::AtLeast(len) => len.saturating_sub(self.held),
            FrameLen::Unknown(_) => 0,
        }
    }

    /// As [`Decoder::receive`], without the numbers of the extended profile.
    pub fn decode(&mut self, input: &[u8]) -> (usize, Decoded<M>) {
        let (taken, decoded) = self.receive(input);
        let decoded = match decoded {
            Decoded::Incomplete => Decoded::Incomplete,
            Decoded::Message(received) => Decoded::Message(received.message),
            Decoded::Rejected(error) => Decoded::Rejected(error),
        };
        (taken, decoded)
    }

    /// Takes bytes from the front of `input` up to the end of the next message or rejection. Returns how many it took
    /// and what they gave; call again with the rest until it answers [`Decoded::Incomplete`], which takes all.
    ///
    /// A header that interrupts a message ends it as [`DecodeError::Truncated`] and is itself not taken: the next call
    /// begins with it. So a rejection may take no byte, but never twice in a row.
    pub fn receive(&mut self, input: &[u8]) -> (usize, Decoded<Received<M>>) {
        let profile = self.profile;
        let (taken, framed) = self.next_frame(input);
        let decoded = match framed {
            Framed::Frame(frame) => match profile.parse(frame) {
                Ok(received) => Decoded::Message(received),
                Err(error) => Decoded::Rejected(error),
            },
            Framed::Incomplete => Decoded::Incomplete,
            Framed::Rejected(error) => Decoded::Rejected(error),
        };
        (taken, decoded)
    }

    /// As [`Decoder::receive`], but leaves the frame's values alone: only its bounds and its checksum are judged. For a
    /// recorder or a relay, which pass on what they need not understand.
    pub fn next_frame<'a>(&'a mut self, input: &'a [u8]) -> (usize, Framed<'a>) {
        if self.held > 0 {
            return self.continue_frame(0, input);
        }
        let strays = run_without_header(input);
        if strays > 0 && !self.skipping {
            self.skipping = true;
            return (strays, Framed::Rejected(DecodeError::Stray));
        }
        let Some(header) = input.get(strays) else {
            return (strays, Framed::Incomplete);
        };
        self.skipping = false;
        if let Some((frame, sum)) = whole_frame::<M>(self.profile, &input[strays..]) {
            return (strays + frame.len(), judge(self.profile, frame, sum));
        }
        // Cut off by the end of the input or by a header, or unknown: going on piece by piece decides which.
        self.buffer[0] = *header;
        self.held = 1;
        self.continue_frame(strays + 1, input)
    }

    /// A frame is open, and `input` from `taken` on goes on with it or breaks it off with a header.
    fn continue_frame<'a>(&'a mut self, mut taken: usize, input: &[u8]) -> (usize, Framed<'a>) {
        loop {
            let wanted = match self.profile.frame_len::<M>(&self.buffer[..self.held]) {
                FrameLen::Unknown(error) => {
                    self.held = 0;
                    self.skipping = true;
                    return (taken, Framed::Rejected(error));
                }
                FrameLen::Exactly(len) if len <= self.held => {
                    self.held = 0;
                    let frame = &self.buffer[..len];
                    return (taken, judge(self.profile, frame, sum_of(frame)));
                }
                FrameLen::Exactly(len) | FrameLen::AtLeast(len) => len - self.held,
            };
            let rest = &input[taken..];
            let offered = &rest[..wanted.min(rest.len())];
            let fresh = &offered[..run_without_header(offered)];
            self.buffer[self.held..self.held + fresh.len()].copy_from_slice(fresh);
            self.held += fresh.len();
            taken += fresh.len();
            if fresh.len() < offered.len() {
                self.held = 0;
                return (taken, Framed::Rejected(DecodeError::Truncated));
            }
            if fresh.len() < wanted {
                return (taken, Framed::Incomplete);
            }
        }
    }
}

/// What a decoder holds, for a program that goes on where another one was.
#[cfg(feature = "serde")]
impl<M> serde::Serialize for Decoder<M> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let held = &self.buffer[..self.held];
        let is_extended = self.profile == Profile::Extended;
        serde::Serialize::serialize(&(is_extended, self.skipping, held), serializer)
    }
}

/// Bytes that are no beginning of a message are rejected as if they had been received.
#[cfg(feature = "serde")]
impl<'de, M: Direction> serde::Deserialize<'de> for Decoder<M> {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (is_extended, skipping, held): (bool, bool, Vec<u8>) =
            serde::Deserialize::deserialize(deserializer)?;
        let profile = match is_extended {
            true => Profile::Extended,
            false => Profile::Classic,
        };
        let mut decoder = Decoder::with_profile(profile);
        decoder.receive(&held);
        decoder.skipping |= skipping;
        Ok(decoder)
    }
}

impl<M: Direction> Default for Decoder<M> {
    fn default() -> Self {
        Decoder::new()
    }
}

/// How many bytes `input` has before its first header.
fn run_without_header(input: &[u8]) -> usize {
    if input.first().is_some_and(|byte| is_header(*byte)) {
        return 0;
    }
    // All at once is much quicker than one by one, and there usually is none.
    let all = input.iter().fold(0, |bits, byte| bits | byte);
    if !is_header(all) {
        return input.len();
    }
    input
        .iter()
        .position(|byte| is_header(*byte))
        .unwrap_or(input.len())
}

/// The frame at the front of `input` and the sum of its bytes, if it lies there whole and no header breaks it off.
fn whole_frame<M: Direction>(profile: Profile, input: &[u8]) -> Option<(&[u8], u8)> {
    // A header among the bytes that encode the length gives a wrong length, but also lies inside that length.
    let FrameLen::Exactly(len) = profile.frame_len::<M>(input) else {
        return None;
    };
    let frame = input.get(..len)?;
    // One pass that the compiler turns into vector instructions; the longest frame has fewer than 256 bytes to count.
    let (headers, sum) = frame.iter().fold((0u8, 0u8), |(headers, sum), byte| {
        (
            headers.wrapping_add(u8::from(is_header(*byte))),
            sum.wrapping_add(*byte),
        )
    });
    (headers == 1).then_some((frame, sum))
}

fn sum_of(frame: &[u8]) -> u8 {
    frame.iter().fold(0, |sum, byte| sum.wrapping_add(*byte))
}

/// A whole frame is one only if its check field is that of the bytes before it. `sum` is that of all its bytes.
fn judge(profile: Profile, frame: &[u8], sum: u8) -> Framed<'_> {
    if profile.is_sound(frame, sum) {
        Framed::Frame(frame)
    } else {
        Framed::Rejected(DecodeError::Checksum)
    }
}
