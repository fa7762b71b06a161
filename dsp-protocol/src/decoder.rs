//! An incremental, resynchronising decoder (`docs/protocol.md` section 2).

use std::marker::PhantomData;

/// One direction of the line: which messages it carries and how long they are. Implemented by [`crate::Downlink`] and
/// [`crate::Uplink`].
pub trait Direction: Sized {}

impl Direction for crate::Downlink {}
impl Direction for crate::Uplink {}

/// What a call of [`Decoder::decode`] found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Decoded<M> {
    /// All input is used and the message is not complete yet (`INCOMPLETE`).
    Incomplete,
    /// One whole, correct message.
    Message(M),
    /// Bytes that were discarded, and why.
    Refused(Refusal),
}

/// Why bytes from the line were discarded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Refusal {
    /// Bytes without a header before them; reported once for each run of them.
    Stray,
    /// A header that this direction does not have.
    UnknownHeader,
    /// A header arrived inside a message.
    Truncated,
    /// The checksum is wrong (`CHECKSUMERROR`).
    Checksum,
    /// The checksum is right, but the unused bits of a value are not zero.
    Padding,
    /// The checksum is right, but a field has a value that it cannot have.
    Value,
}

impl Refusal {
    /// All reasons, in the order of their counters.
    pub const ALL: [Refusal; 6] = [
        Refusal::Stray,
        Refusal::UnknownHeader,
        Refusal::Truncated,
        Refusal::Checksum,
        Refusal::Padding,
        Refusal::Value,
    ];
}

/// Finds the messages of one direction in a stream of bytes, however it is cut.
#[derive(Clone, Debug)]
pub struct Decoder<M> {
    direction: PhantomData<M>,
}

impl<M: Direction> Decoder<M> {
    /// A decoder that waits for the first header.
    pub fn new() -> Self {
        Decoder {
            direction: PhantomData,
        }
    }

    /// Takes bytes from the front of `input` up to the end of the next message or refusal. Returns how many it took and
    /// what they gave; call again with the rest until it answers [`Decoded::Incomplete`], which takes all.
    pub fn decode(&mut self, input: &[u8]) -> (usize, Decoded<M>) {
        unimplemented!("{}", input.len())
    }
}

impl<M: Direction> Default for Decoder<M> {
    fn default() -> Self {
        Decoder::new()
    }
}
