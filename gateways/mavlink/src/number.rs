//! Numbers of the protocol that are used here: <https://mavlink.io/en/messages/common.html>.

pub use plans::mavlink::command;

/// MAV_RESULT: the numbers from 7 on are never sent, because clients end on them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum MavResult {
    /// It is done, or begun.
    Accepted = 0,
    /// Not now.
    TemporarilyRejected = 1,
    /// Not this.
    Denied = 2,
    /// Not known.
    Unsupported = 3,
    /// Tried without success, or its outcome is not known.
    Failed = 4,
    /// Something else took its place.
    Cancelled = 6,
}

/// MAV_MISSION_RESULT.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum MissionResult {
    /// It is in force.
    Accepted = 0,
    /// Not now.
    Error = 1,
    /// Not with this frame.
    UnsupportedFrame = 2,
    /// Not this command.
    Unsupported = 3,
    /// Too many items.
    NoSpace = 4,
    /// Not so, as a whole.
    Invalid = 5,
    /// Not this first parameter, which says how many corners an area has, or its radius.
    InvalidParam1 = 6,
    /// Not this second parameter, which is the speed.
    InvalidParam2 = 7,
    /// Not this third parameter.
    InvalidParam3 = 8,
    /// Not this fourth parameter.
    InvalidParam4 = 9,
    /// Not this fifth parameter, or not this place.
    InvalidParam5 = 10,
    /// Not this sixth parameter.
    InvalidParam6 = 11,
    /// Not this seventh parameter, which is the altitude.
    InvalidParam7 = 12,
    /// Not this item at this place, or no such item.
    InvalidSequence = 13,
    /// Not by this station, not over MAVLink, or not while the mission is flown.
    Denied = 14,
    /// It has taken too long, or its station has ended it.
    Cancelled = 15,
}

/// A mission or a geofence that is not taken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MissionRefusal {
    /// Which parameter is wrong, so that stations name it.
    pub result: MissionResult,
    /// The reason, as a clause.
    pub text: String,
}

/// MAV_MISSION_TYPE of a geofence.
pub const MISSION_TYPE_FENCE: u8 = 1;

/// MAV_SEVERITY.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum MavSeverity {
    /// A safety rule lands.
    Emergency = 0,
    /// Hold, abort, link lost.
    Critical = 2,
    /// A refusal; stations show no pop-up below it.
    Error = 3,
    /// A safety rule warns.
    Warning = 4,
    /// Something was done otherwise than asked.
    Notice = 5,
    /// Done.
    Info = 6,
}

/// MAV_TYPE of the helicopter.
pub const TYPE_HELICOPTER: u8 = 4;
/// MAV_TYPE of ground stations.
pub const TYPE_STATION: u8 = 6;
/// MAV_TYPE of programs on board.
pub const TYPE_PROGRAM: u8 = 18;
/// MAV_AUTOPILOT of PX4: ground stations offer guided actions to no vehicle of a generic autopilot.
pub const AUTOPILOT_PX4: u8 = 12;
/// MAV_AUTOPILOT of what is no autopilot.
pub const AUTOPILOT_INVALID: u8 = 8;
/// MAV_COMP_ID of the autopilot.
pub const COMPONENT: u8 = 1;
/// MAV_COMP_ID for all that has to do with missions.
pub const MISSION_PLANNER: u8 = 190;

/// Whether stations write this integer for "not a number": the ends of the range, and the bits of a float that is none.
/// As degrees they lie beyond every place.
pub fn is_no_integer(value: i32) -> bool {
    matches!(value, i32::MAX | i32::MIN | 0x7ff8_0000 | 0x7fc0_0000)
}

/// An integer of a place as a number, NaN where a station writes "none": degrees, or as it is where it is no place.
pub fn coordinate(value: i32, is_place: bool) -> f64 {
    match value {
        value if is_no_integer(value) => f64::NAN,
        value if is_place => f64::from(value) / 1e7,
        value => f64::from(value),
    }
}

/// The number that people have typed: 5.3, and not 5.300000190734863. A whole one, such as a mode, is what it is.
pub fn widened(value: f32) -> f64 {
    let has_fraction = value.is_finite() && value.fract() != 0.0;
    let typed = has_fraction.then(|| value.to_string().parse().ok());
    typed.flatten().unwrap_or(value.into())
}
