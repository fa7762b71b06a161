//! The wire protocol between the PC and the flight-control DSP of the HERO helicopter.
//!
//! `docs/protocol.md` is the contract; this crate is its executable form and nothing else: it knows no serial port, no
//! shared memory and no clock, never allocates after construction and never panics on bytes from the line.
//!
//! * [`downlink`]: what the DSP says, [`uplink`]: what the PC says; both encode and parse.
//! * [`decoder`]: an incremental, resynchronising decoder for either direction.
//! * [`mask`]: the groups of a status message; [`port`]: the DSP's virtual ports; [`error_code`]: its errors.
//! * [`plausibility`]: which decoded values cannot be.

pub mod decoder;
pub mod downlink;
pub mod error_code;
mod frame;
pub mod header;
mod layout;
pub mod mask;
pub mod plausibility;
pub mod port;
pub mod uplink;

pub use decoder::{Decoded, Decoder, Direction, Extent, Refusal};
pub use downlink::{Downlink, FlowControl, Status};
pub use error_code::DspErrorCode;
pub use frame::{Frame, MAX_FRAME_LEN, checksum};
pub use mask::{Group, StatusMask};
pub use uplink::{Command, Uplink, Waypoint};
