//! What commands of MAVLink mean for a helicopter that takes off, flies paths, hovers and lands, as items of a mission
//! and by themselves. What becomes of each parameter stands in [`parameters`](crate::mavlink::parameters).

use std::ops::Deref;

use crate::mavlink::parameters::{Account, Parameter, account, parameter};
use crate::mavlink::{
    self, FRAME_MISSION, FRAMES_HOME, FRAMES_SEA, FRAMES_TERRAIN, MissionItem, Purpose, command,
};
use crate::model::{Action, Altitude, Ignored, OtherKind, Position};

/// What a command asks for, and what it asks for beside that.
#[derive(Debug, PartialEq)]
pub struct Meaning {
    /// The action.
    pub action: Action,
    /// What the helicopter does not do.
    pub ignored: Vec<Ignored>,
}

impl Meaning {
    /// What an item of a mission asks for, or a guided item.
    ///
    /// # Errors
    ///
    /// Why it cannot be read, as a clause: a coordinate that is none.
    pub fn of(item: &MissionItem) -> Result<Meaning, String> {
        ItemReader(item).meaning(false)
    }

    /// What a command asks for that is given by itself. One that is for no flight is [`Action::Other`].
    ///
    /// # Errors
    ///
    /// Why it cannot be read, as a clause: a coordinate that is none.
    pub fn of_command(item: &MissionItem) -> Result<Meaning, String> {
        ItemReader(item).meaning(true)
    }

    /// The place and the altitude of a command.
    ///
    /// # Errors
    ///
    /// Why it cannot be read, as a clause: a coordinate that is none.
    pub fn place(item: &MissionItem) -> Result<(Option<Position>, Option<Altitude>), String> {
        let reader = ItemReader(item);
        match reader.has_foreign_place() {
            true => Err(format!(
                "in frame {} there is no place on the globe",
                item.frame
            )),
            false => Ok((reader.position()?, reader.altitude())),
        }
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
    fn meaning(&self, is_alone: bool) -> Result<Meaning, String> {
        let Account { named, refused } = account(self);
        let action = match (self.command, refused) {
            (_, Some((_, what))) => Ok(self.other(&format!(" with {what}"))),
            _ if self.has_foreign_place() => Ok(self.other(WITHOUT_PLACE)),
            (command::TAKE_OFF, _) => self.take_off(),
            (command::WAYPOINT, _) => self.waypoint(),
            (command::LOITER_UNLIMITED, _) => self.hold(None),
            (command::LOITER_TIME, _) => self.hold(Some(self.params[0])),
            (command::RETURN_TO_LAUNCH, _) => Ok(Action::ReturnToLaunch),
            (command::LAND, _) => Ok(Action::Land {
                position: self.position()?,
            }),
            (command::DELAY, _) => Ok(self.delay()),
            (command::CHANGE_SPEED, _) => Ok(self.speed()),
            (command::REPOSITION, _) if is_alone => self.reposition(),
            _ => Ok(self.other("")),
        }?;
        let named = named.into_iter().map(|(text, is_heading)| Ignored {
            text,
            kind: match is_heading {
                true => OtherKind::Payload,
                false => OtherKind::Flight,
            },
        });
        let is_hover = matches!(self.command, command::WAYPOINT | command::LOITER_TIME);
        let hover_s = self.params[0];
        let of_flight = |text: String| Ignored {
            text,
            kind: OtherKind::Flight,
        };
        let no_hover = (is_hover && hover_s < 0.0).then(|| format!("a hover of {hover_s} s"));
        let stop =
            (!self.auto_continue).then(|| "a stop after the item (autocontinue is off)".to_owned());
        let ignored = match action {
            Action::Other { .. } => Vec::from_iter(stop.map(of_flight)),
            _ => named
                .chain([no_hover, stop].into_iter().flatten().map(of_flight))
                .collect(),
        };
        Ok(Meaning { action, ignored })
    }

    fn take_off(&self) -> Result<Action, String> {
        let position = self.position()?;
        Ok(match self.altitude() {
            Some(altitude) => Action::TakeOff { position, altitude },
            None => self.other(WITHOUT_ALTITUDE),
        })
    }

    fn waypoint(&self) -> Result<Action, String> {
        let hold_s = number_or_zero(self.params[0]).max(0.0);
        Ok(match (self.position()?, self.altitude()) {
            (Some(position), Some(altitude)) => Action::Waypoint {
                position,
                altitude,
                hold_s,
            },
            (None, Some(_)) => self.other(" without a position"),
            (_, None) => self.other(WITHOUT_ALTITUDE),
        })
    }

    fn hold(&self, duration_s: Option<f64>) -> Result<Action, String> {
        let position = self.position()?;
        // Where it is, and as high as it is, unless the item says how high.
        let is_as_high = position.is_none() && number_or_zero(self.params[6]) == 0.0;
        let altitude = self.altitude().filter(|_| !is_as_high);
        if altitude.is_none() && !is_as_high {
            return Ok(self.other(WITHOUT_ALTITUDE));
        }
        Ok(Action::Hold {
            position,
            altitude,
            duration_s: duration_s.map(|seconds| number_or_zero(seconds).max(0.0)),
        })
    }

    /// Fly there and hover. Latitude and longitude 0 are no place here: they lie in the sea, and are most often values
    /// that were forgotten.
    fn reposition(&self) -> Result<Action, String> {
        if (self.params[4], self.params[5]) == (0.0, 0.0) {
            return Err("latitude and longitude are 0".to_owned());
        }
        let altitude = match self.params[6].is_nan() {
            true => None,
            false => match self.altitude() {
                None => return Ok(self.other(WITHOUT_ALTITUDE)),
                altitude => altitude,
            },
        };
        Ok(Action::Hold {
            position: self.position()?,
            altitude,
            duration_s: None,
        })
    }

    fn delay(&self) -> Action {
        let [seconds, time_of_day @ ..] = self.params;
        let is_unset = |part: &f64| part.is_nan() || *part == 0.0 || *part == -1.0;
        match time_of_day[..3].iter().all(is_unset) && seconds > 0.0 {
            true => Action::Hold {
                position: None,
                altitude: None,
                duration_s: Some(seconds),
            },
            false => self.other(" until a time of day"),
        }
    }

    /// Speed types 0 (air), 1 (ground) and 3 (descent), 2 (climb): a hovering helicopter takes the first two for the
    /// same.
    fn speed(&self) -> Action {
        let kind = number_or_zero(self.params[0]);
        match (kind, self.params[1]) {
            (0.0 | 1.0, speed_mps) if speed_mps > 0.0 => Action::Speed { speed_mps },
            (0.0 | 1.0, _) => self.other(" to the vehicle's own"),
            (2.0 | 3.0, _) => self.other(" of climb or descent"),
            _ => self.other(&format!(" of type {kind}")),
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

    /// Whether it names a place in a frame that has none on the globe.
    fn has_foreign_place(&self) -> bool {
        let frames = FRAMES_SEA.iter().chain(&FRAMES_HOME).chain(&FRAMES_TERRAIN);
        let is_global = frames.into_iter().any(|frame| *frame == self.frame);
        let is_read =
            parameter(self.command, 5).is_some_and(|(what, _)| matches!(what, Parameter::Done(_)));
        let is_number = |value: &f64| number_or_zero(*value) != 0.0;
        is_read && !is_global && self.params[4..6].iter().any(is_number)
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
}

const WITHOUT_ALTITUDE: &str = " in a frame without altitude";
const WITHOUT_PLACE: &str = " in a frame without altitude and place";

fn number_or_zero(value: f64) -> f64 {
    if value.is_nan() { 0.0 } else { value }
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
        let ignored: Vec<_> = meaning
            .ignored
            .iter()
            .map(|one| (&*one.text, one.kind))
            .collect();
        assert_eq!(
            ignored,
            [
                ("an acceptance radius of 2 m", OtherKind::Flight),
                ("the heading 90 degrees", OtherKind::Payload),
            ]
        );
        let never = Meaning::of(&item(16, 3, [-5.0, 0.0, 0.0, NAN, 37.0, -6.0, 9.0])).unwrap();
        assert_eq!(never.ignored[0].text, "a hover of -5 s");
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
        // An endless hover and a relative speed are none, and a place needs a frame that has one.
        #[rustfmt::skip]
        let not_possible = [
            (16, 3, [f64::INFINITY, 0.0, 0.0, NAN, 37.0, -6.0, 9.0], "NAV_WAYPOINT (16) with inf as hover, s"),
            (19, 3, [f64::INFINITY, 0.0, 0.0, NAN, 37.0, -6.0, 9.0], "NAV_LOITER_TIME (19) with inf as hover, s"),
            (178, 2, [1.0, 4.0, -1.0, 1.0, 0.0, 0.0, 0.0], "DO_CHANGE_SPEED (178) with a speed relative to the present one"),
            (178, 2, [2.0, 1.5, -1.0, 0.0, 0.0, 0.0, 0.0], "DO_CHANGE_SPEED (178) of climb or descent"),
            (178, 2, [0.5, 1.5, -1.0, 0.0, 0.0, 0.0, 0.0], "DO_CHANGE_SPEED (178) of type 0.5"),
            (93, 2, [5.0, 12.0, 0.0, 0.0, 0.0, 0.0, 0.0], "NAV_DELAY (93) until a time of day"),
            (21, 1, [0.0, 0.0, 0.0, NAN, 5.0, 7.0, 0.0], "NAV_LAND (21) in a frame without altitude and place"),
            (19, 2, [5.0, 0.0, 0.0, NAN, NAN, NAN, 20.0], "NAV_LOITER_TIME (19) in a frame without altitude"),
            (192, 3, [-1.0, 1.0, 0.0, NAN, 37.0, -6.0, 9.0], "DO_REPOSITION (192)"),
        ];
        for (command, frame, params, name) in not_possible {
            assert_eq!(action(command, frame, params).name(), name);
        }
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
