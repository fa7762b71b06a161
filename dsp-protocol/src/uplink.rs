//! Messages from the PC to the DSP (`docs/protocol.md` section 5).

use crate::frame::Frame;

/// One message from the PC.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Uplink {
    /// A command, always acknowledged.
    Command(Command),
    /// A waypoint, never acknowledged.
    Waypoint(Waypoint),
}

impl Uplink {
    /// The message as one frame.
    pub fn encode(&self) -> Frame {
        unimplemented!("{self:?}")
    }
}

/// A command to the DSP.
#[derive(Clone, Copy, Debug, PartialEq)]
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
}

/// A point to fly to. Wire step: 10⁻⁷ ° and 1 mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Waypoint {
    /// Latitude, degrees, north positive.
    pub latitude_deg: f64,
    /// Longitude, degrees, east positive.
    pub longitude_deg: f64,
    /// Altitude, metres, up positive, same zero as the status' altitude.
    pub altitude_m: f64,
}
