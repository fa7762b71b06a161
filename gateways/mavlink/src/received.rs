//! [`StationMessage`]: what is read of a message.

use arrayvec::ArrayString;

use plans::mavlink::{FRAME_MISSION, MissionItem};

use crate::message::{
    COMMAND_INT, COMMAND_LONG, FILE_TRANSFER_PROTOCOL, HEARTBEAT, MISSION_ACK, MISSION_CLEAR_ALL,
    MISSION_COUNT, MISSION_ITEM, MISSION_ITEM_INT, MISSION_REQUEST, MISSION_REQUEST_INT,
    MISSION_REQUEST_LIST, MISSION_REQUEST_PARTIAL_LIST, MISSION_SET_CURRENT,
    MISSION_WRITE_PARTIAL_LIST, MessageKind, PARAM_REQUEST_LIST, PARAM_REQUEST_READ, PARAM_SET,
    PING, SET_MODE, TIMESYNC,
};
use crate::mission::store::Item;
use crate::number::{AUTOPILOT_INVALID, TYPE_PROGRAM, TYPE_STATION, coordinate, widened};
use crate::parameters::NAME;
use crate::unoffered::{self, Unoffered};
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
    /// Asks for something that is not offered.
    Unoffered {
        /// For which system.
        system: u8,
        /// For which component; 0 for all.
        component: u8,
        /// What it is.
        message: &'static Unoffered,
    },
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
    /// Asks for a part of a mission, or brings one.
    Part(MessageKind),
    /// How a transfer ended: MAV_MISSION_RESULT.
    Ack(u8),
    /// Go on with this item.
    SetCurrent(u16),
}

impl MissionRequest {
    /// Whether it changes nothing by itself: it reads, or belongs to a transfer that has begun.
    pub fn is_reading(&self) -> bool {
        match self {
            MissionRequest::List | MissionRequest::Request(_) | MissionRequest::Ack(_) => true,
            MissionRequest::Item(_, item) => !item.is_guided(),
            MissionRequest::Count(_)
            | MissionRequest::Clear
            | MissionRequest::FloatItem
            | MissionRequest::Part(_)
            | MissionRequest::SetCurrent(_) => false,
        }
    }
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
    /// The command as `plans` reads it. The frame of COMMAND_LONG is above sea.
    pub fn item(&self) -> MissionItem {
        let (frame, x, y) = match self.place {
            CommandPlace::Float(x, y) => (0, widened(x), widened(y)),
            CommandPlace::Integer { x, y, frame } => {
                let is_place = u16::from(frame) != FRAME_MISSION;
                (frame, coordinate(x, is_place), coordinate(y, is_place))
            }
        };
        let [a, b, c, d, z] = self.params.map(widened);
        MissionItem {
            frame: frame.into(),
            command: self.command,
            params: [a, b, c, d, x, y, z],
            auto_continue: true,
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
            MISSION_REQUEST_PARTIAL_LIST | MISSION_WRITE_PARTIAL_LIST => {
                mission(MissionRequest::Part(frame.kind), payload, 4)
            }
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
            kind => {
                let message = unoffered::find(kind)?;
                let (system, component) = message.target(payload);
                StationMessage::Unoffered {
                    system,
                    component,
                    message,
                }
            }
        })
    }

    /// For which system and which component it is; `None` if it names none.
    pub fn target(&self) -> Option<(u8, u8)> {
        match *self {
            StationMessage::Command(VehicleCommand {
                system, component, ..
            })
            | StationMessage::Unoffered {
                system, component, ..
            }
            | StationMessage::Mission {
                system, component, ..
            }
            | StationMessage::Parameter {
                system, component, ..
            } => Some((system, component)),
            StationMessage::SetMode { system, .. } | StationMessage::File { system, .. } => {
                Some((system, 0))
            }
            StationMessage::Heartbeat { .. }
            | StationMessage::Ping { .. }
            | StationMessage::TimeSync { .. } => None,
        }
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
