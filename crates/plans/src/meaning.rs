//! What the mission items of MAVLink mean for a helicopter that takes off, flies paths, hovers and lands.

use std::ops::Deref;

use crate::mavlink::{
    self, FRAME_MISSION, FRAMES_HOME, FRAMES_SEA, FRAMES_TERRAIN, MissionItem, Purpose, command,
};
use crate::model::{Action, Altitude, OtherKind, Position};

/// What an item asks for, and what it asks for beside that.
#[derive(Debug, PartialEq)]
pub struct Meaning {
    /// The action.
    pub action: Action,
    /// What the helicopter does not do.
    pub ignored: Vec<String>,
}

impl Meaning {
    /// What an item asks for.
    ///
    /// # Errors
    ///
    /// Why it cannot be read, as a clause: a coordinate that is none.
    pub fn of(item: &MissionItem) -> Result<Meaning, String> {
        ItemReader(item).meaning()
    }
}

struct ItemReader<'a>(&'a MissionItem);

impl Deref for ItemReader<'_> {
    type Target = MissionItem;

    fn deref(&self) -> &MissionItem {
        self.0
    }
}

impl ItemReader<'_> {
    fn meaning(&self) -> Result<Meaning, String> {
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

    /// Speed types 0 (air), 1 (ground) and 3 (descent), 2 (climb): a hovering helicopter takes the first two for the
    /// same.
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
        let kind = match mavlink::purpose(self.command) {
            Purpose::Flight => OtherKind::Flight,
            Purpose::Payload => OtherKind::Payload,
        };
        Action::Other {
            name: mavlink::command_name(self.command) + detail,
            kind,
        }
    }

    /// `None` if the item means the place where the vehicle is: no number, or 0, 0.
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
                (1, "an acceptance radius of {} m"),
                (2, "a pass at {} m"),
                (3, "the heading {} degrees"),
            ],
            Action::TakeOff { .. } => &[(3, "the heading {} degrees")],
            Action::Land { .. } => &[
                (1, "the precision landing mode {}"),
                (3, "the heading {} degrees"),
            ],
            Action::Hold { .. } if self.command != command::DELAY => {
                &[(2, "a radius of {} m"), (3, "the heading {} degrees")]
            }
            Action::Speed { .. } => &[(2, "a throttle of {} %")],
            _ => &[],
        };
        let mut ignored: Vec<String> = parameters
            .iter()
            .map(|(index, text)| (finite_or_zero(self.params[*index]), text))
            .filter(|(value, text)| {
                *value != 0.0 && !(text.starts_with("a throttle") && *value < 0.0)
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
        Meaning::of(&item(command, frame, params)).unwrap().action
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
        #[rustfmt::skip]
        let cases = [
            (17, [0.0, 0.0, 0.0, NAN, 37.0, -6.0, 9.0], hold(Some(HERE), above, None)),
            (19, [5.0, 0.0, 0.0, NAN, 0.0, 0.0, 9.0], hold(None, above, Some(5.0))),
            (19, [5.0, 0.0, 0.0, NAN, NAN, NAN, 0.0], hold(None, None, Some(5.0))),
            (93, [7.0, 0.0, 0.0, NAN, NAN, NAN, 0.0], hold(None, None, Some(7.0))),
        ];
        for (command, params, expected) in cases {
            assert_eq!(action(command, 3, params), expected);
        }
        let until = action(93, 2, [-1.0, 12.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(until.name(), "NAV_DELAY (93) until a time of day");
    }

    #[test]
    fn what_an_item_asks_for_beside_its_action_is_named() {
        let meaning = Meaning::of(&item(16, 3, [0.0, 2.0, 0.0, 90.0, 37.0, -6.0, 9.0])).unwrap();
        assert_eq!(
            meaning.ignored,
            ["an acceptance radius of 2 m", "the heading 90 degrees"]
        );
        let speed = Meaning::of(&item(178, 2, [1.0, 4.0, -1.0, 0.0, 0.0, 0.0, 0.0])).unwrap();
        assert_eq!(speed.action, Action::Speed { speed_mps: 4.0 });
        assert!(speed.ignored.is_empty());
    }

    #[test]
    fn a_coordinate_that_is_none_is_an_error_and_an_unknown_command_is_not() {
        let error = Meaning::of(&item(16, 3, [0.0, 0.0, 0.0, 0.0, 91.0, -6.0, 9.0])).unwrap_err();
        assert!(error.contains("latitude 91"), "{error}");
        assert!(Meaning::of(&item(21, 3, [0.0, 0.0, 0.0, 0.0, 37.0, NAN, 9.0])).is_err());
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
