//! Mission items of MAVLink: what the commands mean for a helicopter that takes off, flies paths, hovers and lands.
//!
//! <https://mavlink.io/en/messages/common.html#mav_commands> has the commands and their seven parameters.

use crate::model::{Action, Altitude, OtherKind, Position};

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

/// Coordinates above sea level, as integers or not.
pub const FRAMES_SEA: [u16; 2] = [0, 5];
/// No coordinates.
pub const FRAME_MISSION: u16 = 2;
/// Coordinates above home, as integers or not.
pub const FRAMES_HOME: [u16; 2] = [3, 6];
/// Coordinates above terrain, as integers or not.
pub const FRAMES_TERRAIN: [u16; 2] = [10, 11];

/// The commands that this model has words for.
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
    /// Fly at the speed of parameter 2.
    pub const CHANGE_SPEED: u16 = 178;
}

/// Commands by name, those of cameras and gimbals included, so that a finding can be understood.
const NAMES: [(u16, &str, OtherKind); 56] = {
    use OtherKind::{Flight, Payload};
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
        (176, "DO_SET_MODE", Flight),
        (177, "DO_JUMP", Flight),
        (command::CHANGE_SPEED, "DO_CHANGE_SPEED", Flight),
        (179, "DO_SET_HOME", Flight),
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
        (207, "DO_FENCE_ENABLE", Flight),
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

fn known(command: u16) -> Option<(&'static str, OtherKind)> {
    NAMES
        .iter()
        .find(|(number, ..)| *number == command)
        .map(|(_, name, kind)| (*name, *kind))
}

/// What an item asks for, and what it asks for beside that.
#[derive(Debug, PartialEq)]
pub struct Meaning {
    /// The action.
    pub action: Action,
    /// What the helicopter does not do.
    pub ignored: Vec<String>,
}

impl MissionItem {
    /// What the item asks for.
    ///
    /// # Errors
    ///
    /// Why it cannot be read, as a clause: a coordinate that is none.
    pub fn meaning(&self) -> Result<Meaning, String> {
        let action = match self.command {
            command::TAKE_OFF => self.take_off(),
            command::WAYPOINT => self.waypoint(),
            command::LOITER_UNLIMITED => self.hold(None),
            command::LOITER_TIME => self.hold(Some(self.params[0])),
            command::RETURN_TO_LAUNCH => Ok(Action::ReturnToLaunch),
            command::LAND => Ok(Action::Land {
                position: self.position()?,
            }),
            command::DELAY => Ok(self.delay()),
            command::CHANGE_SPEED => Ok(self.speed()),
            _ => Ok(self.other("")),
        }?;
        Ok(Meaning {
            ignored: self.ignored(&action),
            action,
        })
    }

    fn take_off(&self) -> Result<Action, String> {
        let position = self.position()?;
        Ok(match self.altitude() {
            Some(altitude) => Action::TakeOff { position, altitude },
            None => self.other(" in a frame without altitude"),
        })
    }

    fn waypoint(&self) -> Result<Action, String> {
        let hold_s = finite_or_zero(self.params[0]).max(0.0);
        Ok(match (self.position()?, self.altitude()) {
            (Some(position), Some(altitude)) => Action::Waypoint {
                position,
                altitude,
                hold_s,
            },
            (None, Some(_)) => self.other(" without a position"),
            (_, None) => self.other(" in a frame without altitude"),
        })
    }

    fn hold(&self, duration_s: Option<f64>) -> Result<Action, String> {
        let position = self.position()?;
        let altitude = match position {
            Some(_) => self.altitude(),
            // Where it is, and as high as it is, unless the item says how high.
            None => self
                .altitude()
                .filter(|_| finite_or_zero(self.params[6]) != 0.0),
        };
        if position.is_some() && altitude.is_none() {
            return Ok(self.other(" in a frame without altitude"));
        }
        Ok(Action::Hold {
            position,
            altitude,
            duration_s: duration_s.map(|seconds| finite_or_zero(seconds).max(0.0)),
        })
    }

    fn delay(&self) -> Action {
        match self.params[0] {
            seconds if seconds > 0.0 && seconds.is_finite() => Action::Hold {
                position: None,
                altitude: None,
                duration_s: Some(seconds),
            },
            _ => self.other(" until a time of day"),
        }
    }

    /// Speed types 0 (air), 1 (ground) and 3 (descent), 2 (climb): a hovering helicopter takes the first two for the same.
    fn speed(&self) -> Action {
        match (self.params[0], self.params[1]) {
            (kind, speed_mps) if kind <= 1.0 && speed_mps > 0.0 && speed_mps.is_finite() => {
                Action::Speed { speed_mps }
            }
            (kind, _) if kind > 1.0 => self.other(" of climb or descent"),
            _ => self.other(" to the vehicle's own"),
        }
    }

    fn other(&self, detail: &str) -> Action {
        let kind = known(self.command).map_or(OtherKind::Flight, |(_, kind)| kind);
        Action::Other {
            name: command_name(self.command) + detail,
            kind,
        }
    }

    /// Nothing when the item means the place where the vehicle is: no number, or 0, 0.
    fn position(&self) -> Result<Option<Position>, String> {
        let (latitude_deg, longitude_deg) = (self.params[4], self.params[5]);
        let is_absent = latitude_deg.is_nan() && longitude_deg.is_nan();
        let is_here = latitude_deg == 0.0 && longitude_deg == 0.0;
        match is_absent || is_here || self.frame == FRAME_MISSION {
            true => Ok(None),
            false => Position::new(latitude_deg, longitude_deg).map(Some),
        }
    }

    /// Nothing in a frame whose third coordinate is no altitude.
    fn altitude(&self) -> Option<Altitude> {
        let metres = self.params[6];
        if !metres.is_finite() {
            return Some(Altitude::Unstated(None));
        }
        let frame = self.frame;
        if FRAMES_SEA.contains(&frame) {
            Some(Altitude::AboveSea(metres))
        } else if FRAMES_HOME.contains(&frame) {
            Some(Altitude::AboveTakeOff(metres))
        } else if FRAMES_TERRAIN.contains(&frame) {
            Some(Altitude::AboveTerrain(metres))
        } else {
            None
        }
    }

    /// What stands in the parameters beside the action. Zero and no number ask for nothing.
    fn ignored(&self, action: &Action) -> Vec<String> {
        let parameters: &[(usize, &str)] = match action {
            Action::Waypoint { .. } => &[
                (1, "acceptance radius of {} m"),
                (2, "pass at {} m"),
                (3, "heading {} degrees"),
            ],
            Action::TakeOff { .. } => &[(3, "heading {} degrees")],
            Action::Land { .. } => &[(1, "precision landing mode {}"), (3, "heading {} degrees")],
            Action::Hold { .. } if self.command != command::DELAY => {
                &[(2, "radius of {} m"), (3, "heading {} degrees")]
            }
            Action::Speed { .. } => &[(2, "throttle {} %")],
            _ => &[],
        };
        let mut ignored: Vec<String> = parameters
            .iter()
            .map(|(index, text)| (finite_or_zero(self.params[*index]), text))
            .filter(|(value, text)| {
                *value != 0.0 && !(text.starts_with("throttle") && *value < 0.0)
            })
            .map(|(value, text)| text.replace("{}", &value.to_string()))
            .collect();
        if !self.auto_continue {
            ignored.push("a stop after the item (autocontinue is off)".to_owned());
        }
        ignored
    }
}

fn finite_or_zero(value: f64) -> f64 {
    if value.is_finite() { value } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAN: f64 = f64::NAN;

    fn item(command: u16, frame: u16, params: [f64; 7]) -> MissionItem {
        MissionItem {
            frame,
            command,
            params,
            auto_continue: true,
        }
    }

    fn action(command: u16, frame: u16, params: [f64; 7]) -> Action {
        item(command, frame, params).meaning().unwrap().action
    }

    const HERE: Position = Position {
        latitude_deg: 37.0,
        longitude_deg: -6.0,
    };

    #[test]
    fn the_frame_says_what_an_altitude_is_above() {
        let params = [0.0, 0.0, 0.0, NAN, 37.0, -6.0, 20.0];
        for (frame, altitude) in [
            (0, Altitude::AboveSea(20.0)),
            (5, Altitude::AboveSea(20.0)),
            (3, Altitude::AboveTakeOff(20.0)),
            (6, Altitude::AboveTakeOff(20.0)),
            (10, Altitude::AboveTerrain(20.0)),
            (11, Altitude::AboveTerrain(20.0)),
        ] {
            let expected = Action::Waypoint {
                position: HERE,
                altitude,
                hold_s: 0.0,
            };
            assert_eq!(action(16, frame, params), expected, "frame {frame}");
        }
        assert!(matches!(
            action(16, 1, params),
            Action::Other {
                kind: OtherKind::Flight,
                ..
            }
        ));
    }

    #[test]
    fn a_hover_has_a_place_and_a_time_or_neither() {
        let hold = |position, altitude, duration_s| Action::Hold {
            position,
            altitude,
            duration_s,
        };
        let above = Some(Altitude::AboveTakeOff(9.0));
        for (command, params, expected) in [
            (
                17,
                [0.0, 0.0, 0.0, NAN, 37.0, -6.0, 9.0],
                hold(Some(HERE), above, None),
            ),
            (
                19,
                [5.0, 0.0, 0.0, NAN, 0.0, 0.0, 9.0],
                hold(None, above, Some(5.0)),
            ),
            (
                19,
                [5.0, 0.0, 0.0, NAN, NAN, NAN, 0.0],
                hold(None, None, Some(5.0)),
            ),
            (
                93,
                [7.0, 0.0, 0.0, NAN, NAN, NAN, 0.0],
                hold(None, None, Some(7.0)),
            ),
        ] {
            assert_eq!(action(command, 3, params), expected);
        }
        let until = action(93, 2, [-1.0, 12.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(until.name(), "NAV_DELAY (93) until a time of day");
    }

    #[test]
    fn what_an_item_asks_for_beside_its_action_is_named() {
        let meaning = item(16, 3, [0.0, 2.0, 0.0, 90.0, 37.0, -6.0, 9.0])
            .meaning()
            .unwrap();
        assert_eq!(
            meaning.ignored,
            ["acceptance radius of 2 m", "heading 90 degrees"]
        );
        let speed = item(178, 2, [1.0, 4.0, -1.0, 0.0, 0.0, 0.0, 0.0])
            .meaning()
            .unwrap();
        assert_eq!(speed.action, Action::Speed { speed_mps: 4.0 });
        assert!(speed.ignored.is_empty());
    }

    #[test]
    fn a_coordinate_that_is_none_is_an_error_and_an_unknown_command_is_not() {
        let error = item(16, 3, [0.0, 0.0, 0.0, 0.0, 91.0, -6.0, 9.0])
            .meaning()
            .unwrap_err();
        assert!(error.contains("latitude 91"), "{error}");
        assert!(
            item(21, 3, [0.0, 0.0, 0.0, 0.0, 37.0, NAN, 9.0])
                .meaning()
                .is_err()
        );
        assert_eq!(action(4242, 3, [NAN; 7]).name(), "MAV_CMD 4242");
        let camera = action(206, 2, [10.0; 7]);
        assert!(matches!(
            camera,
            Action::Other {
                kind: OtherKind::Payload,
                ..
            }
        ));
    }
}
