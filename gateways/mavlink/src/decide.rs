//! [`decide`]: what a command asks for, as the helicopter is now. Nothing is changed here.

use dsp_protocol::Waypoint;
use ipc_types::code::{Functionality, Reason};
use ipc_types::payload::{ModuleState, WaypointPosition};
use plans::flight::ground_m;
use plans::mavlink::{FRAMES_HOME, FRAMES_SEA, command_name};

use crate::event::OrderKind;
use crate::home::Home;
use crate::mode::Mode;
use crate::number::{MavResult, MavSeverity, command};
use crate::parameters::TAKE_OFF_M;
use crate::received::VehicleCommand;
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

/// What is to be done.
#[derive(Clone, Debug, PartialEq)]
pub enum Decision {
    /// Nothing; this is the answer.
    Answer(CommandAck, Option<(MavSeverity, String)>),
    /// Orders to the bridge.
    Orders(OrderPair),
    /// Home is there.
    SetHome(WaypointPosition),
    /// The mission begins, goes on, or goes elsewhere.
    Mission(MissionAsk),
}

/// What is asked of the mission.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MissionAsk {
    /// Begin with this item, or else go on with the next one.
    Start {
        /// From 0.
        first: Option<u16>,
        /// Whether the module is started for it on the ground; otherwise the mission waits for that.
        arms: bool,
    },
    /// Go on with this item, from 0.
    SetCurrent(u16),
}

/// One or two orders, the second of which follows when the first is done.
#[derive(Clone, Debug, PartialEq)]
pub struct OrderPair {
    pub first: OrderKind,
    pub then: Option<OrderKind>,
    /// Whether the path is that of a return, at whose end the helicopter lands.
    pub is_return: bool,
    /// What is done otherwise than asked.
    pub notice: Option<&'static str>,
}

impl OrderPair {
    fn of(first: OrderKind) -> OrderPair {
        OrderPair {
            first,
            then: None,
            is_return: false,
            notice: None,
        }
    }

    pub fn one(kind: OrderKind) -> Decision {
        Decision::Orders(OrderPair::of(kind))
    }
}

impl Decision {
    /// Whether it makes the flight safer.
    pub fn is_stop(&self) -> bool {
        matches!(self, Decision::Orders(orders) if orders.first.is_stop())
    }

    /// Whether it stops the helicopter, or the module on the ground.
    pub fn ends_something(&self) -> bool {
        self.is_stop()
            || matches!(self, Decision::Orders(orders) if orders.first == OrderKind::Stop)
    }

    /// Whether the helicopter goes somewhere.
    pub fn moves(&self) -> bool {
        let is_movement =
            |kind: OrderKind| matches!(kind, OrderKind::GoTo(_) | OrderKind::TakeOff(_));
        match self {
            Decision::Orders(orders) => [Some(orders.first), orders.then]
                .into_iter()
                .flatten()
                .any(is_movement),
            Decision::Mission(asked) => matches!(asked, MissionAsk::Start { .. }),
            _ => false,
        }
    }

    /// What people call it.
    pub fn name(&self) -> &'static str {
        match self {
            Decision::Orders(orders) if orders.is_return => "return",
            Decision::Orders(orders) => orders.then.unwrap_or(orders.first).name(),
            Decision::Mission(_) => "the mission",
            Decision::SetHome(_) => "home",
            Decision::Answer(..) => "the command",
        }
    }
}

/// Nothing is done, for a reason of ours.
fn refuse(result: MavResult, text: impl Into<String>) -> Decision {
    refuse_for(result, Reason::None, text)
}

fn refuse_for(result: MavResult, reason: Reason, text: impl Into<String>) -> Decision {
    Decision::Answer(
        CommandAck { result, reason },
        Some((MavSeverity::Error, text.into())),
    )
}

fn accept() -> Decision {
    Decision::Answer(CommandAck::plain(MavResult::Accepted), None)
}

/// What a command asks for, as the helicopter is now. Commands that only ask for messages are judged elsewhere.
pub fn decide(asked: &VehicleCommand, facts: &VehicleFacts<'_>) -> Decision {
    match asked.command {
        command::ARM_DISARM => match asked.param(1) {
            1.0 => facts.arm(),
            0.0 => facts.disarm(),
            _ => refuse(MavResult::Denied, "arm: param1 is 0 or 1"),
        },
        command::TAKE_OFF => facts.take_off(asked),
        command::LAND => facts.land(asked),
        command::RETURN_TO_LAUNCH => facts.go_home(),
        command::REPOSITION => facts.reposition(asked),
        command::PAUSE_CONTINUE => match asked.param(1) {
            0.0 => OrderPair::one(OrderKind::Hold),
            1.0 => MISSION_GOES_ON,
            _ => refuse(MavResult::Denied, "pause: param1 is 0 or 1"),
        },
        command::MISSION_START => mission_start(asked),
        command::SET_MISSION_CURRENT => match asked.param(1) {
            number if (0.0..65_535.0).contains(&number) => {
                Decision::Mission(MissionAsk::SetCurrent(number as u16))
            }
            _ => refuse(
                MavResult::Denied,
                "the mission was refused: there is no such item",
            ),
        },
        command::SET_MODE => decide_mode(custom_of(asked.param(2), asked.param(3)), facts),
        command::SET_STANDARD_MODE => {
            let mode = Mode::ALL
                .into_iter()
                .find(|mode| mode.standard() != 0 && f32::from(mode.standard()) == asked.param(1));
            decide_mode(mode.map_or(0, Mode::custom), facts)
        }
        command::CHANGE_SPEED => facts.change_speed(asked),
        command::SET_HOME => facts.set_home(asked),
        command::FLIGHT_TERMINATION | command::REBOOT | command::FENCE_ENABLE => refuse(
            MavResult::Denied,
            format!("{} is never done over MAVLink", command_name(asked.command)),
        ),
        other => refuse(
            MavResult::Unsupported,
            format!("{} is not offered", command_name(other)),
        ),
    }
}

/// What a mode asks for.
pub fn decide_mode(custom: u32, facts: &VehicleFacts<'_>) -> Decision {
    match Mode::of_custom(custom) {
        Ok(Mode::Hold) => OrderPair::one(OrderKind::Hold),
        Ok(Mode::Land) => facts.land_here(),
        Ok(Mode::Mission) => MISSION_GOES_ON,
        Ok(Mode::Return) => facts.go_home(),
        Ok(mode) => {
            let text = format!(
                "mode {} cannot be chosen: it shows what is done",
                mode.name()
            );
            refuse(MavResult::Denied, text)
        }
        Err(name) => refuse(MavResult::Denied, format!("{name}: there is no such mode")),
    }
}

/// Main mode and sub mode apart, as MAVSDK sends them, or the whole number, as scripts do.
fn custom_of(main: f32, sub: f32) -> u32 {
    match main {
        main if main >= 65_536.0 => main as u32,
        // A number that is none of these two is no mode.
        main if !(0.0..256.0).contains(&main) || !(0.0..256.0).contains(&sub) => 0,
        main => (sub as u32) << 24 | (main as u32) << 16,
    }
}

const MISSION_GOES_ON: Decision = Decision::Mission(MissionAsk::Start {
    first: None,
    arms: false,
});

/// The first item is 0 where the station means "go on"; a last item is none where it is 0, or not a number.
fn mission_start(asked: &VehicleCommand) -> Decision {
    let (first, last) = (asked.param(1), asked.param(2));
    if last > 0.0 {
        let text = "the mission was refused: it is flown to its end, and not to an item";
        return refuse(MavResult::Denied, text);
    }
    let first = (first >= 1.0).then_some(first as u16);
    Decision::Mission(MissionAsk::Start { first, arms: true })
}

fn not_heard() -> Decision {
    let text = "the helicopter is not heard: only hold and land are passed on";
    refuse_for(MavResult::TemporarilyRejected, Reason::LinkDown, text)
}

impl VehicleFacts<'_> {
    fn arm(&self) -> Decision {
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
    fn disarm(&self) -> Decision {
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

    fn take_off(&self, asked: &VehicleCommand) -> Decision {
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
        let is_nowhere = asked.degrees().is_none() && !asked.is_without_place();
        if is_nowhere || self.is_elsewhere(asked) {
            return refuse(
                MavResult::Denied,
                "take-off was refused: it begins here, not elsewhere",
            );
        }
        let height_m = match asked.param(7) {
            height if height.is_nan() => Ok(self.settings.take_off_m),
            height => self.over_ground_m(asked.frame(), f64::from(height)),
        };
        let height_m = match height_m {
            Ok(height_m) => height_m,
            Err(why) => return refuse(MavResult::Denied, format!("take-off was refused: {why}")),
        };
        if !TAKE_OFF_M.contains(&height_m) {
            let text = format!(
                "take-off was refused: {height_m:.1} m over the ground, and {} to {} m are possible",
                TAKE_OFF_M.start(),
                TAKE_OFF_M.end()
            );
            return refuse_for(MavResult::Denied, Reason::OutOfRange, text);
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

    /// A height over the ground, m, of an altitude in a frame.
    fn over_ground_m(&self, frame: u8, z: f64) -> Result<f64, &'static str> {
        if FRAMES_HOME.contains(&frame.into()) {
            return Ok(z);
        }
        let altitude_m = self.telemetry_altitude_m(frame, z)?;
        let here = self.known.and_then(|known| known.position());
        let here = here.ok_or("the position is not known")?;
        Ok(altitude_m - here.altitude_m)
    }

    /// An altitude with telemetry's zero, m.
    fn telemetry_altitude_m(&self, frame: u8, z: f64) -> Result<f64, &'static str> {
        if FRAMES_SEA.contains(&frame.into()) {
            return Ok(z - self.settings.zero_above_sea_m.unwrap_or(0.0));
        }
        if FRAMES_HOME.contains(&frame.into()) {
            let home = self.home.known().ok_or("home is not known")?;
            return Ok(home.altitude_m + z);
        }
        Err("altitudes are above sea or above home")
    }

    fn is_elsewhere(&self, asked: &VehicleCommand) -> bool {
        let here = self.known.and_then(|known| known.position());
        let at = |latitude_deg, longitude_deg| Waypoint {
            latitude_deg,
            longitude_deg,
            altitude_m: 0.0,
        };
        match (asked.degrees(), here) {
            (Some((latitude_deg, longitude_deg)), Some(here)) => {
                let here = at(here.latitude_deg, here.longitude_deg);
                ground_m(&here, &at(latitude_deg, longitude_deg)) > ELSEWHERE_M
            }
            _ => false,
        }
    }

    fn land(&self, asked: &VehicleCommand) -> Decision {
        match self.is_elsewhere(asked) {
            true => refuse(
                MavResult::Denied,
                "land was refused: it lands on the spot, not elsewhere",
            ),
            false => self.land_here(),
        }
    }

    fn land_here(&self) -> Decision {
        match self.known {
            Some(known) if known.is_landing() => accept(),
            _ => OrderPair::one(OrderKind::Land),
        }
    }

    fn go_home(&self) -> Decision {
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

    fn reposition(&self, asked: &VehicleCommand) -> Decision {
        let z = f64::from(asked.param(7));
        let place = asked.degrees();
        if z.is_infinite() || place.is_none() && !asked.is_without_place() {
            let text = "goto was refused: that is no place, or no altitude";
            return refuse(MavResult::Denied, text);
        }
        if place.is_none() && z.is_nan() {
            return OrderPair::one(OrderKind::Hold);
        }
        if place.is_none() && has_zeros(asked) {
            return refuse(
                MavResult::Denied,
                "goto was refused: latitude and longitude are 0",
            );
        }
        let Some(known) = self.known else {
            return not_heard();
        };
        let Some(here) = known.position() else {
            let text = "goto was refused: the position is not known";
            return refuse_for(MavResult::TemporarilyRejected, Reason::NoPosition, text);
        };
        let altitude_m = match z.is_finite() {
            true => self.telemetry_altitude_m(asked.frame(), z),
            false => Ok(here.altitude_m),
        };
        let altitude_m = match altitude_m {
            Ok(altitude_m) => altitude_m,
            Err(why) => return refuse(MavResult::Denied, format!("goto was refused: {why}")),
        };
        let is_here = (altitude_m - here.altitude_m).abs() < SAME_HEIGHT_M;
        if place.is_none() && is_here && known.is_holding() {
            return accept();
        }
        let (latitude_deg, longitude_deg) =
            place.unwrap_or((here.latitude_deg, here.longitude_deg));
        let path = OrderKind::GoTo(WaypointPosition {
            latitude_deg,
            longitude_deg,
            altitude_m,
        });
        let (first, then) = match known.started_for(path) {
            Ok(orders) => orders,
            Err(why) => {
                let text = format!("goto was refused: {why}");
                return refuse_for(MavResult::TemporarilyRejected, Reason::NotStarted, text);
            }
        };
        Decision::Orders(OrderPair {
            notice: asked
                .param(4)
                .is_finite()
                .then_some("goto: the heading is not set, the helicopter chooses it"),
            then,
            ..OrderPair::of(first)
        })
    }

    fn change_speed(&self, asked: &VehicleCommand) -> Decision {
        let speed_mps = f64::from(asked.param(2));
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
        Decision::Orders(OrderPair {
            notice: self
                .last_state
                .is_some_and(follows)
                .then_some("speed: the helicopter stops for a moment"),
            ..OrderPair::of(OrderKind::Speed(speed_mps))
        })
    }

    fn set_home(&self, asked: &VehicleCommand) -> Decision {
        let here = self.known.and_then(|known| known.position());
        if asked.param(1) == 1.0 {
            return match here {
                Some(here) => Decision::SetHome(here),
                None => not_heard(),
            };
        }
        let z = f64::from(asked.param(7));
        let altitude_m = self.telemetry_altitude_m(asked.frame(), z);
        match (asked.degrees(), altitude_m) {
            (Some((latitude_deg, longitude_deg)), Ok(altitude_m)) if altitude_m.is_finite() => {
                Decision::SetHome(WaypointPosition {
                    latitude_deg,
                    longitude_deg,
                    altitude_m,
                })
            }
            _ => refuse(
                MavResult::Denied,
                "home was refused: it needs a place and an altitude",
            ),
        }
    }
}

/// Whether a command names the place 0, 0, which is in the sea and most often a value that was forgotten.
fn has_zeros(asked: &VehicleCommand) -> bool {
    matches!(
        asked.place,
        crate::received::CommandPlace::Integer { x: 0, y: 0, .. }
            | crate::received::CommandPlace::Float(0.0, 0.0)
    )
}
