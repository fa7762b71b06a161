//! [`StationMessage`]: what is read of a message.

use arrayvec::ArrayString;

use crate::message::{
    COMMAND_INT, COMMAND_LONG, FILE_TRANSFER_PROTOCOL, HEARTBEAT, MISSION_ACK, MISSION_CLEAR_ALL,
    MISSION_COUNT, MISSION_ITEM, MISSION_ITEM_INT, MISSION_REQUEST, MISSION_REQUEST_INT,
    MISSION_REQUEST_LIST, MISSION_SET_CURRENT, PARAM_REQUEST_LIST, PARAM_REQUEST_READ, PARAM_SET,
    PING, SET_MODE, TIMESYNC,
};
use crate::mission::store::Item;
use crate::number::{AUTOPILOT_INVALID, TYPE_PROGRAM, TYPE_STATION, is_no_integer};
use crate::parameters::NAME;
use crate::wire::{MavFrame, Payload};

/// What a station sends, as far as it is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StationMessage {
    /// A system is there.
    Heartbeat {
        /// Whether the system is a station or a program, and no vehicle.
        is_station: bool,
    },
    /// A command in one of its two forms.
    Command(VehicleCommand),
    /// SET_MODE, for a system.
    SetMode {
        /// For which system.
        system: u8,
        /// The mode.
        custom: u32,
    },
    /// PING, if it asks.
    Ping {
        /// To be repeated.
        time_us: u64,
        /// To be repeated.
        sequence: u32,
    },
    /// TIMESYNC, if it asks.
    TimeSync {
        /// To be repeated.
        theirs_ns: i64,
    },
    /// Asks for a mission, brings one or clears it.
    Mission {
        /// For which system.
        system: u8,
        /// For which component; 0 for all.
        component: u8,
        /// What is asked.
        request: MissionRequest,
        /// Mission, fence or rally points; to be repeated.
        mission_type: u8,
    },
    /// Asks for a file.
    File {
        /// For which system.
        system: u8,
        /// Counts the requests of the sender.
        sequence: u16,
        /// To be repeated.
        session: u8,
        /// What is asked.
        opcode: u8,
    },
    /// Asks for parameters, or sets one.
    Parameter {
        /// For which system.
        system: u8,
        /// For which component; 0 for all.
        component: u8,
        /// What is asked.
        asked: ParameterQuery,
    },
}

/// What is asked about parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParameterQuery {
    /// All of them.
    List,
    /// One.
    Read {
        /// Its number; below 0 its name counts.
        index: i16,
        /// Its name.
        name: Name,
    },
    /// One gets a value.
    Set {
        /// Its name.
        name: Name,
        /// The value in four bytes.
        bits: u32,
        /// MAV_PARAM_TYPE.
        kind: u8,
    },
}

/// The name of a parameter.
pub type Name = ArrayString<NAME>;

/// What is asked about missions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MissionRequest {
    /// How many items are there?
    List,
    /// So many items will come.
    Count(u16),
    /// None shall be there.
    Clear,
    /// Which is this item?
    Request(u16),
    /// This is this item.
    Item(u16, Item),
    /// This is an item, in the form whose places are floats.
    FloatItem,
    /// How a transfer ended: MAV_MISSION_RESULT.
    Ack(u8),
    /// Go on with this item.
    SetCurrent(u16),
}

/// COMMAND_LONG or COMMAND_INT.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VehicleCommand {
    /// For which system; 0 for all.
    pub system: u8,
    /// For which component; 0 for all.
    pub component: u8,
    /// MAV_CMD.
    pub command: u16,
    /// Parameters 1 to 4, and 7.
    pub params: [f32; 5],
    /// Parameters 5 and 6 as degrees or as integers: see [`CommandPlace`].
    pub place: CommandPlace,
}

/// Parameters 5 and 6.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CommandPlace {
    /// Of COMMAND_LONG.
    Float(f32, f32),
    /// Of COMMAND_INT, with its frame.
    Integer {
        /// Latitude in 10⁻⁷ degrees.
        x: i32,
        /// Longitude in 10⁻⁷ degrees.
        y: i32,
        /// MAV_FRAME.
        frame: u8,
    },
}

impl VehicleCommand {
    /// Parameter 1, 2, 3, 4 or 7.
    pub fn param(&self, number: usize) -> f32 {
        match number {
            7 => self.params[4],
            number => self.params[number - 1],
        }
    }

    /// Latitude and longitude in degrees; `None` if the command names no place, or what is none.
    pub fn degrees(&self) -> Option<(f64, f64)> {
        let (latitude, longitude) = match self.place {
            CommandPlace::Float(x, y) => (f64::from(x), f64::from(y)),
            CommandPlace::Integer { x, y, .. } => (f64::from(x) / 1e7, f64::from(y) / 1e7),
        };
        let is_place = latitude.abs() <= 90.0 && longitude.abs() <= 180.0;
        (is_place && (latitude != 0.0 || longitude != 0.0)).then_some((latitude, longitude))
    }

    /// Whether the command names no place. Stations write "none" in many ways, and in both parameters: not a number,
    /// the ends of the integers' range. Zero is one of them where no place is expected: it lies in the sea.
    pub fn is_without_place(&self) -> bool {
        match self.place {
            CommandPlace::Float(x, y) => x.is_nan() && y.is_nan() || (x, y) == (0.0, 0.0),
            CommandPlace::Integer { x, y, .. } => {
                is_no_integer(x) && is_no_integer(y) || (x, y) == (0, 0)
            }
        }
    }

    /// MAV_FRAME; that of COMMAND_LONG is above sea.
    pub fn frame(&self) -> u8 {
        match self.place {
            CommandPlace::Float(..) => 0,
            CommandPlace::Integer { frame, .. } => frame,
        }
    }

    /// What tells two commands apart: the bits of all that was sent.
    pub fn bits(&self) -> [u32; 8] {
        let (x, y, frame) = match self.place {
            CommandPlace::Float(x, y) => (x.to_bits(), y.to_bits(), u32::MAX),
            CommandPlace::Integer { x, y, frame } => (x as u32, y as u32, u32::from(frame)),
        };
        let [a, b, c, d, e] = self.params.map(f32::to_bits);
        [a, b, c, d, x, y, e, frame]
    }
}

impl StationMessage {
    /// What a frame says; `None` if it is nothing that is read.
    pub fn of(frame: &MavFrame<'_>) -> Option<StationMessage> {
        let payload = frame.payload;
        if frame.is_version_1 && frame.kind != HEARTBEAT {
            return None;
        }
        Some(match frame.kind {
            HEARTBEAT => StationMessage::Heartbeat {
                is_station: payload.u8(5) == AUTOPILOT_INVALID
                    || matches!(payload.u8(4), TYPE_STATION | TYPE_PROGRAM),
            },
            COMMAND_LONG => StationMessage::Command(long(payload)),
            COMMAND_INT => StationMessage::Command(int(payload)),
            SET_MODE => StationMessage::SetMode {
                system: payload.u8(4),
                custom: payload.u32(0),
            },
            // With a target it is an answer.
            PING if payload.u8(12) == 0 => StationMessage::Ping {
                time_us: payload.u64(0),
                sequence: payload.u32(8),
            },
            TIMESYNC if payload.i64(0) == 0 => StationMessage::TimeSync {
                theirs_ns: payload.i64(8),
            },
            MISSION_REQUEST_LIST => mission(MissionRequest::List, payload, 0),
            MISSION_COUNT => mission(MissionRequest::Count(payload.u16(0)), payload, 2),
            MISSION_REQUEST | MISSION_REQUEST_INT => {
                mission(MissionRequest::Request(payload.u16(0)), payload, 2)
            }
            MISSION_ACK => StationMessage::Mission {
                system: payload.u8(0),
                component: payload.u8(1),
                request: MissionRequest::Ack(payload.u8(2)),
                mission_type: payload.u8(3),
            },
            MISSION_ITEM_INT => StationMessage::Mission {
                system: payload.u8(32),
                component: payload.u8(33),
                request: MissionRequest::Item(payload.u16(28), Item::of(payload)),
                mission_type: payload.u8(37),
            },
            MISSION_ITEM => StationMessage::Mission {
                system: payload.u8(32),
                component: payload.u8(33),
                request: MissionRequest::FloatItem,
                mission_type: payload.u8(37),
            },
            MISSION_SET_CURRENT => StationMessage::Mission {
                system: payload.u8(2),
                component: payload.u8(3),
                request: MissionRequest::SetCurrent(payload.u16(0)),
                mission_type: 0,
            },
            MISSION_CLEAR_ALL => mission(MissionRequest::Clear, payload, 0),
            FILE_TRANSFER_PROTOCOL => StationMessage::File {
                system: payload.u8(1),
                sequence: payload.u16(3),
                session: payload.u8(5),
                opcode: payload.u8(6),
            },
            PARAM_REQUEST_LIST => parameter(payload, 0, ParameterQuery::List),
            PARAM_REQUEST_READ => {
                let index = payload.u16(0).cast_signed();
                let name = name(payload, 4);
                parameter(payload, 2, ParameterQuery::Read { index, name })
            }
            PARAM_SET => {
                let (bits, kind) = (payload.u32(0), payload.u8(22));
                let name = name(payload, 6);
                parameter(payload, 4, ParameterQuery::Set { name, bits, kind })
            }
            _ => return None,
        })
    }
}

/// A message with its target at `at`.
fn mission(request: MissionRequest, payload: Payload<'_>, at: usize) -> StationMessage {
    StationMessage::Mission {
        system: payload.u8(at),
        component: payload.u8(at + 1),
        request,
        mission_type: payload.u8(at + 2),
    }
}

/// A message with its target at `at`.
fn parameter(payload: Payload<'_>, at: usize, asked: ParameterQuery) -> StationMessage {
    StationMessage::Parameter {
        system: payload.u8(at),
        component: payload.u8(at + 1),
        asked,
    }
}

/// A name that ends with a zero, or with its last place. What is not ASCII is in no name.
fn name(payload: Payload<'_>, at: usize) -> Name {
    let mut name = Name::new();
    let bytes = (at..at + NAME).map(|at| payload.u8(at));
    for byte in bytes.take_while(|byte| *byte != 0) {
        name.push(if byte.is_ascii() { byte.into() } else { '?' });
    }
    name
}

fn long(payload: Payload<'_>) -> VehicleCommand {
    let [a, b, c, d, x, y, e] = std::array::from_fn(|index| payload.f32(4 * index));
    VehicleCommand {
        system: payload.u8(30),
        component: payload.u8(31),
        command: payload.u16(28),
        params: [a, b, c, d, e],
        place: CommandPlace::Float(x, y),
    }
}

fn int(payload: Payload<'_>) -> VehicleCommand {
    let [a, b, c, d] = std::array::from_fn(|index| payload.f32(4 * index));
    VehicleCommand {
        system: payload.u8(30),
        component: payload.u8(31),
        command: payload.u16(28),
        params: [a, b, c, d, payload.f32(24)],
        place: CommandPlace::Integer {
            x: payload.i32(16),
            y: payload.i32(20),
            frame: payload.u8(32),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_place_is_written_in_many_ways() {
        let with = |place| VehicleCommand {
            system: 1,
            component: 1,
            command: 192,
            params: [0.0; 5],
            place,
        };
        let frame = 6;
        let none = [
            CommandPlace::Float(f32::NAN, f32::NAN),
            CommandPlace::Float(0.0, 0.0),
            CommandPlace::Integer { x: 0, y: 0, frame },
            CommandPlace::Integer {
                x: i32::MAX,
                y: i32::MAX,
                frame,
            },
            CommandPlace::Integer {
                x: i32::MIN,
                y: i32::MIN,
                frame,
            },
            CommandPlace::Integer {
                x: 0x7ff8_0000,
                y: 0x7ff8_0000,
                frame,
            },
        ];
        for place in none {
            assert_eq!(with(place).degrees(), None, "{place:?}");
            assert!(with(place).is_without_place(), "{place:?}");
        }
        // A half of a place is none, and is not "no place" either.
        for place in [
            CommandPlace::Float(f32::NAN, -6.0),
            CommandPlace::Float(37.0, f32::INFINITY),
            CommandPlace::Float(91.0, 0.0),
            CommandPlace::Integer {
                x: i32::MAX,
                y: 1,
                frame,
            },
            CommandPlace::Integer {
                x: 900_000_001,
                y: 1,
                frame,
            },
        ] {
            assert_eq!(with(place).degrees(), None, "{place:?}");
            assert!(!with(place).is_without_place(), "{place:?}");
        }
        let (x, y) = (374_112_000, -60_010_000);
        let place = with(CommandPlace::Integer { x, y, frame }).degrees();
        assert_eq!(place, Some((37.4112, -6.001)));
    }
}
