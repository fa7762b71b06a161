//! Commands of MAVLink, as items of missions and by themselves: their numbers; [`names`]; what becomes of each of
//! their [`parameters`].
//!
//! <https://mavlink.io/en/messages/common.html#mav_commands> has the commands and their seven parameters.

pub mod names;
pub mod parameters;

pub use names::{Purpose, command_name, purpose};

/// A command with its parameters: an item of a mission, or by itself. A parameter that is not used, and one that says
/// "as it is", is not a number.
#[derive(Clone, Copy, Debug)]
pub struct MissionItem {
    /// MAV_FRAME: what the coordinates mean.
    pub frame: u16,
    /// MAV_CMD.
    pub command: u16,
    /// Parameters 1 to 7; of most commands 5 to 7 are latitude, longitude, altitude.
    pub params: [f64; 7],
    /// Whether the mission goes on by itself after the item.
    pub auto_continue: bool,
}

/// Two parameters that are not a number are the same.
impl PartialEq for MissionItem {
    fn eq(&self, other: &Self) -> bool {
        let same = |(a, b): (&f64, &f64)| a == b || (a.is_nan() && b.is_nan());
        (self.frame, self.command, self.auto_continue)
            == (other.frame, other.command, other.auto_continue)
            && self.params.iter().zip(&other.params).all(same)
    }
}

/// Coordinates above sea, as integers or not.
pub const FRAMES_SEA: [u16; 2] = [0, 5];
/// No coordinates.
pub const FRAME_MISSION: u16 = 2;
/// Coordinates above home, as integers or not.
pub const FRAMES_HOME: [u16; 2] = [3, 6];
/// Coordinates above terrain, as integers or not.
pub const FRAMES_TERRAIN: [u16; 2] = [10, 11];

/// MAV_CMD: the commands that something is done for, in a plan or by a vehicle.
pub mod command {
    /// Fly to a place; parameter 1: hold there, s.
    pub const WAYPOINT: u16 = 16;
    /// Hover for ever.
    pub const LOITER_UNLIMITED: u16 = 17;
    /// Hover for the seconds of parameter 1.
    pub const LOITER_TIME: u16 = 19;
    /// Return to where the take-off was, and land.
    pub const RETURN_TO_LAUNCH: u16 = 20;
    /// Land.
    pub const LAND: u16 = 21;
    /// Take off.
    pub const TAKE_OFF: u16 = 22;
    /// Wait for the seconds of parameter 1, or until a time of day.
    pub const DELAY: u16 = 93;
    /// Set the mode by base mode, main mode and sub mode.
    pub const SET_MODE: u16 = 176;
    /// Fly at the speed of parameter 2.
    pub const CHANGE_SPEED: u16 = 178;
    /// Set home.
    pub const SET_HOME: u16 = 179;
    /// End the flight at once.
    pub const FLIGHT_TERMINATION: u16 = 185;
    /// Fly there and hover.
    pub const REPOSITION: u16 = 192;
    /// Pause or continue.
    pub const PAUSE_CONTINUE: u16 = 193;
    /// Switch the geofence.
    pub const FENCE_ENABLE: u16 = 207;
    /// Go on with this item of the mission.
    pub const SET_MISSION_CURRENT: u16 = 224;
    /// Reboot.
    pub const REBOOT: u16 = 246;
    /// Set the mode by one of the standard.
    pub const SET_STANDARD_MODE: u16 = 262;
    /// Begin a mission.
    pub const MISSION_START: u16 = 300;
    /// Arm or disarm.
    pub const ARM_DISARM: u16 = 400;
    /// Send HOME_POSITION once.
    pub const GET_HOME_POSITION: u16 = 410;
    /// How often is a message sent?
    pub const GET_MESSAGE_INTERVAL: u16 = 510;
    /// Send a message so often.
    pub const SET_MESSAGE_INTERVAL: u16 = 511;
    /// Send a message once.
    pub const REQUEST_MESSAGE: u16 = 512;
    /// Send AUTOPILOT_VERSION.
    pub const REQUEST_CAPABILITIES: u16 = 520;
    /// A corner of an area of a geofence to stay inside.
    pub const FENCE_INSIDE_POLYGON: u16 = 5001;
    /// A corner of an area of a geofence to stay outside.
    pub const FENCE_OUTSIDE_POLYGON: u16 = 5002;
    /// A circle of a geofence to stay inside.
    pub const FENCE_INSIDE_CIRCLE: u16 = 5003;
    /// A circle of a geofence to stay outside.
    pub const FENCE_OUTSIDE_CIRCLE: u16 = 5004;
}
