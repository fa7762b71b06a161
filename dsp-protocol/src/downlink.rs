//! Messages from the DSP to the PC (`docs/protocol.md` section 4).

use crate::decode_error::DecodeError;
use crate::decoder::Direction;
use crate::error_code::DspErrorCode;
use crate::frame::{Frame, Reader, Writer};
use crate::header;
use crate::mask::StatusMask;
use crate::message::{FrameLen, Message};
use crate::profile::{Profile, Sequence};

pub use crate::group::{
    Acceleration, AngularRate, Attitude, Geographic, GpsVelocity, PanTilt, References, ServoPulses,
    Supply, Xy,
};
pub use crate::status::Status;

/// Bytes of a status' payload that hold its mask, from which its length follows.
const STATUS_MASK_LEN: usize = 3;
/// The greatest code of a command, hence of an acknowledgement.
const MAX_COMMAND_CODE: u8 = 7;

/// One message from the DSP. Each variant carries only its own fields.
#[expect(
    clippy::large_enum_variant,
    reason = "most messages are a status, and a box would allocate for each"
)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Downlink {
    /// Periodic state of the helicopter (`ESTADOS`).
    Status(Status),
    /// May the next waypoint be sent (`CONTROLFLUJO`).
    FlowControl(FlowControl),
    /// A command arrived (`COMMANDACK`).
    Ack {
        /// Code of the command, 0 … 7.
        command: u8,
    },
    /// A 16-bit port was read (`COMMANDACK16`).
    Ack16 {
        /// Code of the command, 0 … 7.
        command: u8,
        /// Value of the port.
        value: u16,
    },
    /// A 32-bit port was read (`COMMANDACK32`).
    Ack32 {
        /// Code of the command, 0 … 7.
        command: u8,
        /// Value of the port.
        value: f32,
    },
    /// An error that the DSP noticed (`DSPERROR`).
    Error(DspErrorCode),
}

impl Downlink {
    /// The message as one frame of the classic profile.
    pub fn encode(&self) -> Frame {
        self.encode_in(Profile::Classic, Sequence::FIRST, Sequence::FIRST)
    }

    /// The message as one frame of `profile`, with its own number `sequence`. An acknowledgement also carries the number
    /// of the command that it `acknowledges`; other messages leave it out, and the classic profile both.
    pub fn encode_in(&self, profile: Profile, sequence: Sequence, acknowledges: Sequence) -> Frame {
        profile.encode(self, sequence, acknowledges)
    }
}

impl Direction for Downlink {}

impl Message for Downlink {
    const EXTENDED_HEADER: u8 = header::EXTENDED_DOWNLINK;

    fn header(&self) -> u8 {
        match self {
            Downlink::Status(_) => header::STATUS,
            Downlink::FlowControl(_) => header::FLOW_CONTROL,
            Downlink::Ack { .. } => header::ACK,
            Downlink::Ack16 { .. } => header::ACK_16,
            Downlink::Ack32 { .. } => header::ACK_32,
            Downlink::Error(_) => header::ERROR,
        }
    }

    fn write(&self, writer: &mut Writer) {
        match *self {
            Downlink::Status(ref status) => status.write(writer),
            Downlink::FlowControl(FlowControl::Stop) => writer.u7(0),
            Downlink::FlowControl(FlowControl::Send) => writer.u7(1),
            Downlink::Ack { command } => writer.u7(command),
            Downlink::Ack16 { command, value } => {
                writer.u7(command);
                writer.u16(value);
            }
            Downlink::Ack32 { command, value } => {
                writer.u7(command);
                writer.f32(value);
            }
            Downlink::Error(DspErrorCode(code)) => writer.u16(code),
        }
    }

    fn payload_len(header: u8, payload: &[u8]) -> FrameLen {
        match (header, payload) {
            (header::STATUS, [high, middle, low, ..]) => {
                FrameLen::Exactly(mask_of([*high, *middle, *low]).status_payload_len())
            }
            (header::STATUS, _) => FrameLen::AtLeast(STATUS_MASK_LEN),
            (header::FLOW_CONTROL | header::ACK, _) => FrameLen::Exactly(1),
            (header::ERROR, _) => FrameLen::Exactly(3),
            (header::ACK_16, _) => FrameLen::Exactly(4),
            (header::ACK_32, _) => FrameLen::Exactly(6),
            _ => FrameLen::Unknown(DecodeError::UnknownHeader),
        }
    }

    fn read(header: u8, mut reader: Reader<'_>) -> Result<Self, DecodeError> {
        // The fields of a struct expression are evaluated in the order in which they are written: that of the wire.
        let message = match header {
            header::STATUS => return Status::parse(reader).map(Downlink::Status),
            header::FLOW_CONTROL => return FlowControl::parse(reader).map(Downlink::FlowControl),
            header::ACK => Downlink::Ack {
                command: reader.u7(),
            },
            header::ACK_16 => Downlink::Ack16 {
                command: reader.u7(),
                value: reader.u16(),
            },
            header::ACK_32 => Downlink::Ack32 {
                command: reader.u7(),
                value: reader.f32(),
            },
            header::ERROR => Downlink::Error(DspErrorCode(reader.u16())),
            _ => return Err(DecodeError::UnknownHeader),
        };
        reader.finish()?;
        match message {
            Downlink::Ack { command }
            | Downlink::Ack16 { command, .. }
            | Downlink::Ack32 { command, .. }
                if command > MAX_COMMAND_CODE =>
            {
                Err(DecodeError::Value)
            }
            _ => Ok(message),
        }
    }
}

/// The mask in the first bytes of a status' payload. Its unused bits do not count here: the length follows from the 16 bits of the
/// mask, and the frame is rejected for its padding once its checksum is known to be right.
fn mask_of([high, middle, low]: [u8; 3]) -> StatusMask {
    StatusMask(u16::from(high) << 14 | u16::from(middle) << 7 | u16::from(low))
}

/// The DSP's request for waypoints (`peticion_de_tx`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlowControl {
    /// The path buffer is full.
    Stop,
    /// One new waypoint may be sent.
    Send,
}

impl FlowControl {
    fn parse(mut reader: Reader<'_>) -> Result<Self, DecodeError> {
        let request = reader.u7();
        reader.finish()?;
        match request {
            0 => Ok(FlowControl::Stop),
            1 => Ok(FlowControl::Send),
            _ => Err(DecodeError::Value),
        }
    }
}
