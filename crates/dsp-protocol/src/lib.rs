//! The wire protocol between the PC and the flight-control DSP of the HERO helicopter.
//!
//! `docs/protocol.md` is the contract; this crate is its executable form and nothing else: it knows no serial port, no
//! shared memory and no clock, never allocates and never panics on bytes from the line. It needs nothing but `core`, so
//! that a DSP's firmware in Rust uses it as the PC does.
//!
//! * [`downlink`]: messages of the DSP, [`uplink`]: messages of the PC; both encode and parse.
//! * [`decoder`]: an incremental, resynchronising decoder for either direction.
//! * [`profile`]: what stands around a message on the wire, in the *classic* and the *extended* profile; [`header`]:
//!   the first byte of each message.
//! * [`group`]: the sixteen groups of a status message, their fields and limits, and sets of them.
//! * [`port`]: the DSP's virtual ports; [`error_code`]: its errors.
//!
//! `vectors/` holds frames and whole dialogues that were computed by hand from the contract, for implementers of either
//! end.
//!
//! # Example
//!
//! The PC writes the status mask; the answer arrives behind some noise and in two pieces.
//!
//! ```
//! use dsp_protocol::{
//!     Command, DecodeError, Decoded, Decoder, Downlink, Group, StatusMask, Uplink, port,
//! };
//!
//! let mask: StatusMask = [Group::Time, Group::Geographic].into_iter().collect();
//! let command = Command::Write16 { port: port::STATUS_MASK, value: mask.0 };
//! let frame = Uplink::Command(command).encode();
//! assert_eq!(
//!     frame.as_bytes(),
//!     [0xF0, 0x01, 0x00, 0x4E, 0x10, 0x00, 0x00, 0x03, 0x52]
//! );
//!
//! let mut decoder = Decoder::<Downlink>::new();
//! let mut events = Vec::new();
//! for mut piece in [&[0x17, 0x2A, 0xC3][..], &[0x01, 0x44]] {
//!     loop {
//!         let (taken, decoded) = decoder.decode(piece);
//!         piece = &piece[taken..];
//!         match decoded {
//!             Decoded::Incomplete => break,
//!             event => events.push(event),
//!         }
//!     }
//! }
//! let ack = Downlink::Ack { command: command.code() };
//! assert_eq!(events, [Decoded::Rejected(DecodeError::Stray), Decoded::Message(ack)]);
//! ```

#![cfg_attr(not(test), no_std)]

// Only who keeps what a decoder holds allocates.
#[cfg(feature = "serde")]
extern crate alloc;

mod decode_error;
pub mod decoder;
pub mod downlink;
pub mod error_code;
mod frame;
pub mod group;
pub mod port;
pub mod profile;
pub mod uplink;

pub use decode_error::DecodeError;
pub use decoder::{Decoded, Decoder, Direction, Framed};
pub use downlink::{Downlink, FlowControl, Status};
pub use error_code::DspErrorCode;
pub use frame::{Frame, MAX_CLASSIC_FRAME_LEN, MAX_FRAME_LEN, checksum, crc32};
pub use group::{FieldSpec, Group, StatusMask};
pub use profile::{FrameLen, Profile, Received, Sequence, header};
pub use uplink::{Command, Uplink, Waypoint};
