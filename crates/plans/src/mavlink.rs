//! Mission items of MAVLink: their numbers, and the names of commands.
//!
//! <https://mavlink.io/en/messages/common.html#mav_commands> has the commands and their seven parameters.

/// One item as MAVLink has it. A parameter that is not used, and one that says "as it is", is not a number.
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
}

/// Which part of a vehicle a command is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// The flight, or that is not known.
    Flight,
    /// A camera, a gimbal or another load, or the heading: the path is the same without it.
    Payload,
}

/// Commands by name, those of cameras and gimbals included, so that a finding can be understood.
const NAMES: [(u16, &str, Purpose); 56] = {
    use Purpose::{Flight, Payload};
    [
        (command::WAYPOINT, "NAV_WAYPOINT", Flight),
        (command::LOITER_UNLIMITED, "NAV_LOITER_UNLIM", Flight),
        (18, "NAV_LOITER_TURNS", Flight),
        (command::LOITER_TIME, "NAV_LOITER_TIME", Flight),
        (command::RETURN_TO_LAUNCH, "NAV_RETURN_TO_LAUNCH", Flight),
        (command::LAND, "NAV_LAND", Flight),
        (command::TAKE_OFF, "NAV_TAKEOFF", Flight),
        (23, "NAV_LAND_LOCAL", Flight),
        (24, "NAV_TAKEOFF_LOCAL", Flight),
        (25, "NAV_FOLLOW", Flight),
        (30, "NAV_CONTINUE_AND_CHANGE_ALT", Flight),
        (31, "NAV_LOITER_TO_ALT", Flight),
        (80, "NAV_ROI", Payload),
        (82, "NAV_SPLINE_WAYPOINT", Flight),
        (84, "NAV_VTOL_TAKEOFF", Flight),
        (85, "NAV_VTOL_LAND", Flight),
        (92, "NAV_GUIDED_ENABLE", Flight),
        (command::DELAY, "NAV_DELAY", Flight),
        (94, "NAV_PAYLOAD_PLACE", Flight),
        (112, "CONDITION_DELAY", Flight),
        (113, "CONDITION_CHANGE_ALT", Flight),
        (114, "CONDITION_DISTANCE", Flight),
        (115, "CONDITION_YAW", Payload),
        (command::SET_MODE, "DO_SET_MODE", Flight),
        (177, "DO_JUMP", Flight),
        (command::CHANGE_SPEED, "DO_CHANGE_SPEED", Flight),
        (command::SET_HOME, "DO_SET_HOME", Flight),
        (181, "DO_SET_RELAY", Payload),
        (182, "DO_REPEAT_RELAY", Payload),
        (183, "DO_SET_SERVO", Payload),
        (184, "DO_REPEAT_SERVO", Payload),
        (189, "DO_LAND_START", Flight),
        (195, "DO_SET_ROI_LOCATION", Payload),
        (196, "DO_SET_ROI_WPNEXT_OFFSET", Payload),
        (197, "DO_SET_ROI_NONE", Payload),
        (200, "DO_CONTROL_VIDEO", Payload),
        (201, "DO_SET_ROI", Payload),
        (202, "DO_DIGICAM_CONFIGURE", Payload),
        (203, "DO_DIGICAM_CONTROL", Payload),
        (204, "DO_MOUNT_CONFIGURE", Payload),
        (205, "DO_MOUNT_CONTROL", Payload),
        (206, "DO_SET_CAM_TRIGG_DIST", Payload),
        (command::FENCE_ENABLE, "DO_FENCE_ENABLE", Flight),
        (208, "DO_PARACHUTE", Flight),
        (211, "DO_GRIPPER", Payload),
        (214, "DO_SET_CAM_TRIGG_INTERVAL", Payload),
        (530, "SET_CAMERA_MODE", Payload),
        (531, "SET_CAMERA_ZOOM", Payload),
        (532, "SET_CAMERA_FOCUS", Payload),
        (1000, "DO_GIMBAL_MANAGER_PITCHYAW", Payload),
        (2000, "IMAGE_START_CAPTURE", Payload),
        (2001, "IMAGE_STOP_CAPTURE", Payload),
        (2003, "DO_TRIGGER_CONTROL", Payload),
        (2500, "VIDEO_START_CAPTURE", Payload),
        (2501, "VIDEO_STOP_CAPTURE", Payload),
        (3000, "DO_VTOL_TRANSITION", Flight),
    ]
};

/// What MAVLink calls a command, with its number.
pub fn command_name(command: u16) -> String {
    match known(command) {
        Some((name, _)) => format!("{name} ({command})"),
        None => format!("MAV_CMD {command}"),
    }
}

/// What a command is for.
pub fn purpose(command: u16) -> Purpose {
    known(command).map_or(Purpose::Flight, |(_, purpose)| purpose)
}

fn known(command: u16) -> Option<(&'static str, Purpose)> {
    NAMES
        .iter()
        .find(|(number, ..)| *number == command)
        .map(|(_, name, purpose)| (*name, *purpose))
}
