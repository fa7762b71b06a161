//! [`VehicleFacts`]: what the helicopter, as it is now, does for what a command means.

use dsp_protocol::Waypoint;
use ipc_types::code::{Functionality, Reason};
use ipc_types::payload::{ModuleState, WaypointPosition};
use plans::check::ANOTHER_SITE_M;
use plans::flight::ground_m;
use plans::mavlink::MissionItem;
use plans::meaning::Meaning;
use plans::model::{Action, Altitude, Position};

use super::decision::{Decision, OrderPair, accept, refuse, refuse_for};
use crate::event::OrderKind;
use crate::home::Home;
use crate::number::{MavResult, MavSeverity};
use crate::parameters::TAKE_OFF_M;
use crate::settings::Settings;
use crate::vehicle::Known;
use crate::verdict::CommandAck;

/// Speeds that the DSP takes, m/s.
const SPEED_MPS: std::ops::RangeInclusive<f64> = 0.1..=20.0;

/// From where on a place is another one than that of the helicopter, m: what GPS and the resolution of a float leave
/// open.
const ELSEWHERE_M: f64 = 20.0;

/// A change of height that is none, m: the second half of QGroundControl's pause.
const SAME_HEIGHT_M: f64 = 1.0;

/// Up to here nobody has asked for a change of height, m: the helicopter itself moves so much.
const UNSAID_HEIGHT_M: f64 = 0.2;

/// How much higher or lower than the helicopter home may be, m: more than it climbs in a flight.
const HOME_OFF_M: f64 = 2_000.0;

/// What is known of the helicopter.
#[derive(Clone, Copy, Debug)]
pub struct VehicleFacts<'a> {
    /// While it is heard.
    pub known: Option<Known<'a>>,
    /// The newest state of the bridge, however old.
    pub last_state: Option<&'a ModuleState>,
    pub home: &'a Home,
    pub settings: &'a Settings,
}

fn not_heard() -> Decision {
    let text = "the helicopter is not heard: only hold and land are passed on";
    refuse_for(MavResult::TemporarilyRejected, Reason::LinkDown, text)
}

impl VehicleFacts<'_> {
    pub fn arm(&self) -> Decision {
        let Some(known) = self.known else {
            return not_heard();
        };
        if known.is_started() {
            return accept();
        }
        // In the air the module was aborted: it is started again.
        match known.not_ready() {
            Some(why) => refuse(
                MavResult::TemporarilyRejected,
                format!("arm was refused: {why}"),
            ),
            None => OrderPair::one(OrderKind::Start),
        }
    }

    /// Judges a disarming. "Kill" and "emergency stop" send the bytes of a forced one.
    pub fn disarm(&self) -> Decision {
        let Some(known) = self.known else {
            return not_heard();
        };
        if known.is_flying() {
            let text = "disarming never stops the rotor in flight; use Land";
            return Decision::Answer(
                CommandAck::plain(MavResult::Denied),
                Some((MavSeverity::Critical, text.to_owned())),
            );
        }
        match known.is_started() {
            true => OrderPair::one(OrderKind::Stop),
            false => accept(),
        }
    }

    /// Does what a command means; `name` is what people call it.
    pub fn act(&self, action: &Action, name: &str, notices: &mut Vec<String>) -> Decision {
        match *action {
            Action::TakeOff { position, altitude } => self.take_off(position, altitude, notices),
            Action::Land { position } => self.land(position),
            Action::ReturnToLaunch => self.go_home(),
            Action::Speed { speed_mps } => self.change_speed(speed_mps, notices),
            Action::Hold {
                position, altitude, ..
            } => self.go_to(position, altitude),
            Action::Waypoint {
                position, altitude, ..
            } => self.go_to(Some(position), Some(altitude)),
            Action::Other { name: ref what, .. } => {
                let text = format!("{name} was refused: the helicopter cannot do {what}");
                refuse(MavResult::Denied, text)
            }
        }
    }

    fn take_off(
        &self,
        position: Option<Position>,
        altitude: Altitude,
        notices: &mut Vec<String>,
    ) -> Decision {
        let Some(known) = self.known else {
            return not_heard();
        };
        if !known.is_started() {
            if known.is_flying() {
                let text = "take-off was refused: the helicopter is in the air";
                return refuse_for(MavResult::TemporarilyRejected, Reason::AlreadyFlying, text);
            }
            if let Some(why) = known.not_ready() {
                let text = format!("take-off was refused: {why}");
                return refuse(MavResult::TemporarilyRejected, text);
            }
        }
        if self.is_elsewhere(position) {
            return refuse(
                MavResult::Denied,
                "take-off was refused: it begins here, not elsewhere",
            );
        }
        let height_m = match altitude {
            Altitude::Unstated(_) => Ok(self.settings.take_off_m),
            altitude => self.over_ground_m(altitude),
        };
        let height_m = match height_m {
            Ok(height_m) => height_m,
            Err(why) => return refuse(MavResult::Denied, format!("take-off was refused: {why}")),
        };
        let above_sea = match altitude {
            Altitude::AboveSea(z) => format!("{z} m above sea are "),
            _ => String::new(),
        };
        let text = format!("{above_sea}{height_m:.1} m over the ground");
        if !TAKE_OFF_M.contains(&height_m) {
            let text = format!(
                "take-off was refused: {text}, and {} to {} m are possible",
                TAKE_OFF_M.start(),
                TAKE_OFF_M.end()
            );
            return refuse_for(MavResult::Denied, Reason::OutOfRange, text);
        }
        if !above_sea.is_empty() {
            notices.push(format!("take-off: {text}"));
        }
        let take_off = OrderKind::TakeOff(height_m);
        match known.is_started() {
            true => OrderPair::one(take_off),
            // QGroundControl arms behind the take-off.
            false => Decision::Orders(OrderPair {
                then: Some(take_off),
                ..OrderPair::of(OrderKind::Start)
            }),
        }
    }

    /// A height over the ground, m, of an altitude.
    fn over_ground_m(&self, altitude: Altitude) -> Result<f64, &'static str> {
        let altitude_m = self.telemetry_altitude_m(altitude)?;
        let here = self.known.and_then(|known| known.position());
        let here = here.ok_or("the position is not known")?;
        Ok(altitude_m - here.altitude_m)
    }

    /// An altitude with telemetry's zero, m.
    fn telemetry_altitude_m(&self, altitude: Altitude) -> Result<f64, &'static str> {
        match altitude {
            Altitude::AboveSea(metres) => {
                Ok(metres - self.settings.zero_above_sea_m.unwrap_or(0.0))
            }
            Altitude::AboveTakeOff(metres) => {
                let home = self.home.known().ok_or("home is not known")?;
                Ok(home.altitude_m + metres)
            }
            Altitude::AboveTerrain(_) => Err("altitudes are above sea or above home"),
            Altitude::Unstated(_) => Err("it has no altitude"),
        }
    }

    fn is_elsewhere(&self, position: Option<Position>) -> bool {
        let here = self.known.and_then(|known| known.position());
        let far_m = position
            .zip(here)
            .map(|(position, here)| far_m(position, here));
        far_m.is_some_and(|far_m| far_m > ELSEWHERE_M)
    }

    fn land(&self, position: Option<Position>) -> Decision {
        match self.is_elsewhere(position) {
            true => refuse(
                MavResult::Denied,
                "land was refused: it lands on the spot, not elsewhere",
            ),
            false => self.land_here(),
        }
    }

    pub fn land_here(&self) -> Decision {
        match self.known {
            Some(known) if known.is_landing() => accept(),
            _ => OrderPair::one(OrderKind::Land),
        }
    }

    pub fn go_home(&self) -> Decision {
        let Some(known) = self.known else {
            return not_heard();
        };
        let (Some(home), Some(here)) = (self.home.known(), known.position()) else {
            let text = "return was refused: home is not known; the gateway was started in flight";
            return refuse(MavResult::TemporarilyRejected, text);
        };
        if !known.is_flying() {
            let text = "return was refused: the helicopter is on the ground";
            return refuse_for(MavResult::TemporarilyRejected, Reason::NotFlying, text);
        }
        let path = OrderKind::GoTo(WaypointPosition {
            altitude_m: here.altitude_m,
            ..home
        });
        match known.started_for(path) {
            Ok((first, then)) => Decision::Orders(OrderPair {
                then,
                is_return: true,
                ..OrderPair::of(first)
            }),
            Err(why) => {
                let text = format!("return was refused: {why}");
                refuse_for(MavResult::TemporarilyRejected, Reason::NotStarted, text)
            }
        }
    }

    /// Flies there and hovers; without a place the height changes here, and without both it holds.
    fn go_to(&self, position: Option<Position>, altitude: Option<Altitude>) -> Decision {
        if position.is_none() && altitude.is_none() {
            return OrderPair::one(OrderKind::Hold);
        }
        let Some(known) = self.known else {
            return not_heard();
        };
        let Some(here) = known.position() else {
            let text = "goto was refused: the position is not known";
            return refuse_for(MavResult::TemporarilyRejected, Reason::NoPosition, text);
        };
        let altitude_m = match altitude {
            Some(altitude) => self.telemetry_altitude_m(altitude),
            None => Ok(here.altitude_m),
        };
        let altitude_m = match altitude_m {
            Ok(altitude_m) => altitude_m,
            Err(why) => return refuse(MavResult::Denied, format!("goto was refused: {why}")),
        };
        let change_m = (altitude_m - here.altitude_m).abs();
        let is_here = change_m < SAME_HEIGHT_M;
        if position.is_none() && is_here && known.is_holding() {
            let text = format!("goto: less than {SAME_HEIGHT_M} m, so the height stays");
            let said = (change_m > UNSAID_HEIGHT_M).then_some((MavSeverity::Notice, text));
            return Decision::Answer(CommandAck::plain(MavResult::Accepted), said);
        }
        let path = OrderKind::GoTo(match position {
            Some(position) => WaypointPosition {
                latitude_deg: position.latitude_deg,
                longitude_deg: position.longitude_deg,
                altitude_m,
            },
            None => WaypointPosition { altitude_m, ..here },
        });
        let (first, then) = match known.started_for(path) {
            Ok(orders) => orders,
            Err(why) => {
                let text = format!("goto was refused: {why}");
                return refuse_for(MavResult::TemporarilyRejected, Reason::NotStarted, text);
            }
        };
        Decision::Orders(OrderPair {
            then,
            ..OrderPair::of(first)
        })
    }

    fn change_speed(&self, speed_mps: f64, notices: &mut Vec<String>) -> Decision {
        if self.known.is_none() {
            return not_heard();
        }
        if !SPEED_MPS.contains(&speed_mps) {
            let text = format!(
                "speed was refused: {speed_mps} m/s, and {} to {} m/s are possible",
                SPEED_MPS.start(),
                SPEED_MPS.end()
            );
            return refuse_for(MavResult::Denied, Reason::OutOfRange, text);
        }
        let follows =
            |state: &ModuleState| state.functionality() == Some(Functionality::FollowingPath);
        if self.last_state.is_some_and(follows) {
            notices.push("speed: the helicopter stops for a moment".to_owned());
        }
        OrderPair::one(OrderKind::Speed(speed_mps))
    }

    /// Home is where the helicopter is, or at a place of its site: what is farther away is a mistake.
    pub fn set_home(&self, asked: &MissionItem, notices: &mut Vec<String>) -> Decision {
        let Some(known) = self.known else {
            return not_heard();
        };
        let Some(here) = known.position() else {
            let text = "home was refused: the position is not known";
            return refuse_for(MavResult::TemporarilyRejected, Reason::NoPosition, text);
        };
        let deny = |why: &str| refuse(MavResult::Denied, format!("home was refused: {why}"));
        let place = match (asked.params[0], Meaning::place(asked)) {
            (1.0, place) => {
                let names_place = asked.params[4..].iter().any(|value| value.abs() > 0.0);
                if names_place || place.is_err() {
                    notices
                        .push("home: it is where the helicopter is, and not elsewhere".to_owned());
                }
                return Decision::SetHome(here);
            }
            (flag, _) if flag != 0.0 && !flag.is_nan() => return deny("param1 is 0 or 1"),
            (_, Err(why)) => return deny(&why),
            (_, Ok((Some(position), Some(altitude)))) => (position, altitude),
            _ => return deny("it needs a place and an altitude"),
        };
        let (position, altitude) = place;
        let altitude_m = match self.telemetry_altitude_m(altitude) {
            Ok(altitude_m) => altitude_m,
            Err(why) => return deny(why),
        };
        let (far_m, off_m) = (far_m(position, here), altitude_m - here.altitude_m);
        if far_m > ANOTHER_SITE_M {
            let text = format!(
                "home was refused: that is {:.0} km from here, and {:.0} km are possible",
                far_m / 1e3,
                ANOTHER_SITE_M / 1e3
            );
            return refuse_for(MavResult::Denied, Reason::OutOfRange, text);
        }
        if off_m.abs() > HOME_OFF_M {
            let text = format!(
                "home was refused: that is {off_m:.0} m above the helicopter, and {HOME_OFF_M} m above or below are possible"
            );
            return refuse_for(MavResult::Denied, Reason::OutOfRange, text);
        }
        Decision::SetHome(WaypointPosition {
            latitude_deg: position.latitude_deg,
            longitude_deg: position.longitude_deg,
            altitude_m,
        })
    }
}

/// How far a place is along the ground, m.
fn far_m(position: Position, from: WaypointPosition) -> f64 {
    let at = |latitude_deg, longitude_deg| Waypoint {
        latitude_deg,
        longitude_deg,
        altitude_m: 0.0,
    };
    let from = at(from.latitude_deg, from.longitude_deg);
    ground_m(&from, &at(position.latitude_deg, position.longitude_deg))
}
