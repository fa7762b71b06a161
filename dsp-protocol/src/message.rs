//! What a message is to the layers that find and frame it: a header and a payload of a known length.
//!
//! [`Message`] is public only by name: it seals [`Direction`](crate::Direction), and no code outside this crate can reach it.

use crate::decode_error::DecodeError;
use crate::frame::{Reader, Writer};

/// What a direction's messages are between the bytes that a profile puts around them. Messages are distinguished by
/// their classic header, in either profile.
pub trait Message: Sized {
    /// The header of all messages of this direction in the extended profile.
    const EXTENDED_HEADER: u8;

    /// The message's classic header.
    fn header(&self) -> u8;

    /// Appends the payload.
    fn write(&self, writer: &mut Writer);

    /// How long the payload of the message with this `header` is, as far as its first bytes show. `payload` may be
    /// shorter than that, or reach beyond it.
    fn payload_len(header: u8, payload: &[u8]) -> FrameLen;

    /// Takes the message with this `header` out of its payload; the errors are those of [`crate::Direction::parse`].
    fn read(header: u8, reader: Reader<'_>) -> Result<Self, DecodeError>;
}

/// What is known of the length of a frame, or of its payload, from the first bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameLen {
    /// The whole frame has this many bytes, at most [`MAX_FRAME_LEN`](crate::MAX_FRAME_LEN).
    Exactly(usize),
    /// The length is known once this many bytes are there; more than the prefix has.
    AtLeast(usize),
    /// No message begins like this.
    Unknown(DecodeError),
}

impl FrameLen {
    /// The length of a frame whose payload has this length: `front` bytes lie before it, `overhead` bytes around it.
    pub(crate) fn within(self, front: usize, overhead: usize) -> FrameLen {
        match self {
            FrameLen::Exactly(len) => FrameLen::Exactly(len + overhead),
            FrameLen::AtLeast(len) => FrameLen::AtLeast(len + front),
            FrameLen::Unknown(error) => FrameLen::Unknown(error),
        }
    }
}
