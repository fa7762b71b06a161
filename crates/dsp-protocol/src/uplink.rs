//! Messages from the PC to the DSP (`docs/protocol.md` section 5).

use crate::decode_error::DecodeError;
use crate::decoder::Direction;
use crate::frame::{Frame, Layout, Reader, Steps, Writer, record};
use crate::group::{ALTITUDE, LATITUDE, LONGITUDE};
use crate::profile::{FrameLen, Message, Profile, Sequence, header};

/// Lengths of the commands' payloads, by code.
const COMMAND_PAYLOAD_LEN: [usize; 8] = [4, 7, 4, 9, 1, 1, 1, 2];
/// Length of a waypoint's payload.
const WAYPOINT_PAYLOAD_LEN: usize = <Waypoint as Layout>::LEN;

/// One message from the PC.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Uplink {
    /// A command, always acknowledged.
    Command(Command),
    /// A waypoint, never acknowledged.
    Waypoint(Waypoint),
}

impl Uplink {
    /// The message as one frame of the classic profile.
    pub fn encode(&self) -> Frame {
        self.encode_in(Profile::Classic, Sequence::FIRST)
    }

    /// The message as one frame of `profile`, with its number `sequence`, which the classic profile leaves out.
    pub fn encode_in(&self, profile: Profile, sequence: Sequence) -> Frame {
        // The PC acknowledges nothing.
        profile.encode(self, sequence, Sequence::FIRST)
    }
}

impl Direction for Uplink {}

impl Message for Uplink {
    const EXTENDED_HEADER: u8 = header::EXTENDED_UPLINK;

    fn header(&self) -> u8 {
        match self {
            Uplink::Command(_) => header::COMMAND,
            Uplink::Waypoint(_) => header::WAYPOINT,
        }
    }

    fn write(&self, writer: &mut Writer) {
        match self {
            Uplink::Command(command) => command.write(writer),
            Uplink::Waypoint(waypoint) => Waypoint::write(waypoint, writer),
        }
    }

    fn payload_len(header: u8, payload: &[u8]) -> FrameLen {
        match (header, payload) {
            (header::WAYPOINT, _) => FrameLen::Exactly(WAYPOINT_PAYLOAD_LEN),
            (header::COMMAND, []) => FrameLen::AtLeast(1),
            (header::COMMAND, [code, ..]) => match COMMAND_PAYLOAD_LEN.get(usize::from(*code)) {
                Some(len) => FrameLen::Exactly(*len),
                None => FrameLen::Unknown(DecodeError::UnknownCommand),
            },
            _ => FrameLen::Unknown(DecodeError::UnknownHeader),
        }
    }

    fn read(header: u8, mut reader: Reader<'_>) -> Result<Self, DecodeError> {
        match header {
            header::COMMAND => Command::parse(reader).map(Uplink::Command),
            header::WAYPOINT => {
                let waypoint = Waypoint::read(&mut reader);
                reader.finish()?;
                Ok(Uplink::Waypoint(waypoint))
            }
            _ => Err(DecodeError::UnknownHeader),
        }
    }
}

/// A command to the DSP.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Command {
    /// Read a 16-bit port (`COMANDO_LECTURA_16_BITS`).
    Read16 {
        /// Number of the port.
        port: u16,
    },
    /// Write a 16-bit port (`COMANDO_ESCRITURA_16_BITS`).
    Write16 {
        /// Number of the port.
        port: u16,
        /// The new value; a signed port carries two's complement.
        value: u16,
    },
    /// Read a 32-bit port (`COMANDO_LECTURA_32_BITS`).
    Read32 {
        /// Number of the port.
        port: u16,
    },
    /// Write a 32-bit port (`COMANDO_ESCRITURA_32_BITS`).
    Write32 {
        /// Number of the port.
        port: u16,
        /// The new value.
        value: f32,
    },
    /// Empty the DSP's error queue (`COMANDO_LIMPIEZA_ERROR`).
    ClearErrors,
    /// Start the periodic status (`COMANDO_ACTIVAR_TX_ESTADO`).
    ActivateStatus,
    /// Empty the DSP's path buffer and hover (`COMANDO_INVALIDAR_CAMINO`).
    InvalidatePath,
    /// Switch waypoint following (`COMANDO_CAMBIO_SEGUIMIENTO`).
    Following {
        /// On or off.
        on: bool,
    },
}

impl Command {
    /// The command's code, 0 … 7, which its acknowledgement repeats.
    pub const fn code(&self) -> u8 {
        match self {
            Command::Read16 { .. } => 0,
            Command::Write16 { .. } => 1,
            Command::Read32 { .. } => 2,
            Command::Write32 { .. } => 3,
            Command::ClearErrors => 4,
            Command::ActivateStatus => 5,
            Command::InvalidatePath => 6,
            Command::Following { .. } => 7,
        }
    }

    fn write(&self, writer: &mut Writer) {
        writer.u7(self.code());
        match *self {
            Command::Read16 { port } | Command::Read32 { port } => writer.u16(port),
            Command::Write16 { port, value } => {
                writer.u16(port);
                writer.u16(value);
            }
            Command::Write32 { port, value } => {
                writer.u16(port);
                writer.f32(value);
            }
            Command::ClearErrors | Command::ActivateStatus | Command::InvalidatePath => {}
            Command::Following { on } => writer.u7(u8::from(on)),
        }
    }

    fn parse(mut reader: Reader<'_>) -> Result<Self, DecodeError> {
        let mut switch = 0;
        // The fields of a struct expression are evaluated in the order in which they are written: that of the wire.
        let command = match reader.u7() {
            0 => Command::Read16 { port: reader.u16() },
            1 => Command::Write16 {
                port: reader.u16(),
                value: reader.u16(),
            },
            2 => Command::Read32 { port: reader.u16() },
            3 => Command::Write32 {
                port: reader.u16(),
                value: reader.f32(),
            },
            4 => Command::ClearErrors,
            5 => Command::ActivateStatus,
            6 => Command::InvalidatePath,
            7 => {
                switch = reader.u7();
                Command::Following { on: switch == 1 }
            }
            _ => return Err(DecodeError::UnknownCommand),
        };
        reader.finish()?;
        if switch > 1 {
            return Err(DecodeError::Value);
        }
        Ok(command)
    }
}

record! {
    /// A point to fly to. Wire step: 10⁻⁷ ° and 1 mm.
    Waypoint {
        /// Latitude, degrees, north positive.
        latitude_deg: f64 = Steps<i32, 10_000_000>, "°", LATITUDE;
        /// Longitude, degrees, east positive.
        longitude_deg: f64 = Steps<i32, 10_000_000>, "°", LONGITUDE;
        /// Altitude, metres, up positive, same zero as the status' altitude.
        altitude_m: f64 = Steps<i32, 1000>, "m", ALTITUDE;
    }
}

impl Waypoint {
    /// Whether the waypoint lies within the limits of a geographic position (`docs/protocol.md` section 9).
    pub fn is_plausible(&self) -> bool {
        <Waypoint as Layout>::is_plausible(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_waypoint_is_plausible_to_the_limits_of_a_place() {
        for (latitude_deg, longitude_deg, is_plausible) in [
            (90.0, 180.0, true),
            (-90.0, -180.0, true),
            (90.1, 0.0, false),
            (0.0, -180.1, false),
            (f64::NAN, 0.0, false),
        ] {
            let at = Waypoint {
                latitude_deg,
                longitude_deg,
                altitude_m: 0.0,
            };
            assert_eq!(at.is_plausible(), is_plausible, "{at:?}");
        }
    }
}
