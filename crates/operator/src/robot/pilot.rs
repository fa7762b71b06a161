//! [`PilotView`]: what a pilot asks first, of the newest telemetry. `ril status` prints it, `ril watch` draws it.
//!
//! A pure value. What was not measured, and a number that cannot be, is nothing: any bit pattern may lie in shared
//! memory.

use std::fmt;

use ipc_types::code::{Functionality, MovementKind, PilotSwitch, Reason};
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use ipc_types::{MonotonicNs, TelemetryGroup};
use status::calibration::Calibration;
use status::translate::translate;

use crate::robot::geo::Place;

/// A speed beyond this is no speed of a helicopter, m/s.
const MAX_SPEED_MPS: f64 = 1000.0;

/// An altitude beyond this is none of a helicopter, m: the limit that the geofence judges with.
const MAX_ALTITUDE_M: f64 = 100_000.0;

/// A voltage beyond this is none of a battery, V.
const MAX_BATTERY_V: f64 = 1000.0;

/// Quality of the GPS fix, as NMEA numbers it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GpsFix(pub u32);

impl GpsFix {
    /// Whether there is a position at all.
    pub fn is_there(self) -> bool {
        self.0 != 0
    }

    /// The quality in a word.
    pub fn name(self) -> &'static str {
        match self.0 {
            0 => "no fix",
            1 => "GPS",
            2 => "DGPS",
            3 => "PPS",
            4 => "RTK fixed",
            5 => "RTK float",
            6 => "estimated",
            7 => "manual",
            8 => "simulated",
            _ => "unknown",
        }
    }
}

impl fmt::Display for GpsFix {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", self.name(), self.0)
    }
}

/// What a pilot asks first. `None` is what was not measured, and a number that cannot be.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PilotView {
    /// Whether the helicopter is in the air; `None` without telemetry.
    pub flying: Option<bool>,
    /// Where it is.
    pub place: Option<Place>,
    /// Telemetry altitude, m.
    pub altitude_m: Option<f64>,
    /// Climb speed, m/s, up positive.
    pub climb_mps: Option<f64>,
    /// Horizontal speed over ground, m/s.
    pub ground_speed_mps: Option<f64>,
    /// Course over ground, degrees clockwise from true north, 0 … 360.
    pub course_deg: Option<f64>,
    /// Where the nose points, degrees clockwise from true north, 0 … 360.
    pub heading_deg: Option<f64>,
    /// Right side down positive, degrees, −180 … 180.
    pub roll_deg: Option<f64>,
    /// Nose up positive, degrees, −180 … 180.
    pub pitch_deg: Option<f64>,
    /// Battery, V.
    pub battery_v: Option<f64>,
    /// Fuel, 0 … 100.
    pub fuel_percent: Option<f64>,
    /// The pilot's switch.
    pub switch: Option<PilotSwitch>,
    /// The GPS fix.
    pub gps: Option<GpsFix>,
    /// When the bridge read the message; `None` without telemetry.
    pub received: Option<MonotonicNs>,
}

impl From<&HeroTelemetry> for PilotView {
    fn from(hero: &HeroTelemetry) -> PilotView {
        let group = |group, value: f64| hero.valid(group).then_some(value);
        let geodetic = hero.geodetic;
        let place = Place::new(
            geodetic.latitude_rad.to_degrees(),
            geodetic.longitude_rad.to_degrees(),
        );
        let velocity = |value: f32| group(TelemetryGroup::GpsVelocity, value.into());
        let angle = |value: f32| group(TelemetryGroup::Attitude, value.to_degrees().into());
        let supply = |value: f32| group(TelemetryGroup::Supply, value.into());
        PilotView {
            flying: Some(hero.is_flying()),
            place: place.filter(|_| hero.valid(TelemetryGroup::Geographic)),
            altitude_m: group(TelemetryGroup::Geographic, geodetic.altitude_m),
            climb_mps: velocity(hero.velocity.up_mps),
            ground_speed_mps: velocity(hero.velocity.ground_speed_mps),
            course_deg: velocity(hero.velocity.course_rad.to_degrees()),
            heading_deg: angle(hero.attitude.yaw_rad),
            roll_deg: angle(hero.attitude.roll_rad),
            pitch_deg: angle(hero.attitude.pitch_rad),
            battery_v: supply(hero.supply.battery_v),
            fuel_percent: supply(hero.supply.fuel_fraction * 100.0),
            switch: hero
                .valid(TelemetryGroup::Supply)
                .then(|| switch(hero.supply.auto_switch)),
            gps: hero
                .valid(TelemetryGroup::GpsQuality)
                .then_some(GpsFix(hero.gps_quality)),
            received: Some(hero.received()),
        }
        .plausible()
    }
}

/// By the code of status, with its default calibration: it is about sonar, barometer, camera and servos, which a pilot
/// does not ask for.
impl From<&DspTelemetry> for PilotView {
    fn from(dsp: &DspTelemetry) -> PilotView {
        (&translate(dsp, &Calibration::default(), dsp.received())).into()
    }
}

impl PilotView {
    /// Of two kinds of telemetry the newer one; those in SI units when both are of the same message.
    pub fn of(hero: Option<&HeroTelemetry>, dsp: Option<&DspTelemetry>) -> PilotView {
        match (hero, dsp) {
            (Some(hero), Some(dsp)) if dsp.received() > hero.received() => dsp.into(),
            (Some(hero), _) => hero.into(),
            (None, Some(dsp)) => dsp.into(),
            (None, None) => PilotView::default(),
        }
    }

    /// Battery and fuel in words; `None` if neither is known.
    pub fn supply(&self) -> Option<String> {
        let battery = self.battery_v.map(|volts| format!("battery {volts:.1} V"));
        let fuel = self
            .fuel_percent
            .map(|percent| format!("fuel {percent:.0} %"));
        let parts: Vec<String> = battery.into_iter().chain(fuel).collect();
        (!parts.is_empty()).then(|| parts.join(", "))
    }

    /// Drops numbers that cannot be.
    fn plausible(self) -> PilotView {
        let within = |value: Option<f64>, limit: f64| value.filter(|value| value.abs() <= limit);
        let circle =
            |value: Option<f64>| within(value, 720.0).map(|degrees| degrees.rem_euclid(360.0));
        PilotView {
            altitude_m: within(self.altitude_m, MAX_ALTITUDE_M),
            climb_mps: within(self.climb_mps, MAX_SPEED_MPS),
            ground_speed_mps: within(self.ground_speed_mps, MAX_SPEED_MPS),
            course_deg: circle(self.course_deg),
            heading_deg: circle(self.heading_deg),
            roll_deg: within(self.roll_deg, 180.0),
            pitch_deg: within(self.pitch_deg, 180.0),
            battery_v: within(self.battery_v, MAX_BATTERY_V),
            fuel_percent: within(self.fuel_percent, 100.0).filter(|percent| *percent >= 0.0),
            ..self
        }
    }
}

fn switch(number: u32) -> PilotSwitch {
    match number {
        0 => PilotSwitch::Manual,
        1 => PilotSwitch::Auto,
        _ => PilotSwitch::Unknown,
    }
}

/// What the helicopter does, in words: `flying the path, waypoint 2 of 3`.
pub fn phase(state: &ModuleState, flying: Option<bool>) -> String {
    let Some(functionality) = state.functionality() else {
        return format!("unknown phase {}", state.functionality);
    };
    let activity = activity(functionality, flying);
    match (functionality, next_waypoint(state)) {
        (Functionality::FollowingPath, Some((next, total))) => {
            format!("{activity}, waypoint {next} of {total}")
        }
        (Functionality::ReceivingPath, _) => format!("{activity}, receiving a path"),
        _ => activity.to_owned(),
    }
}

/// What the helicopter does, in a word or two.
pub fn activity(functionality: Functionality, flying: Option<bool>) -> &'static str {
    match functionality {
        Functionality::AtRest | Functionality::ReceivingPath => at_rest(flying),
        Functionality::TakingOff => "taking off",
        Functionality::FollowingPath => "flying the path",
        Functionality::Landing => "landing",
        Functionality::Stopping => "stopping",
        Functionality::Holding => "holding",
    }
}

fn at_rest(flying: Option<bool>) -> &'static str {
    match flying {
        Some(true) => "hovering",
        Some(false) => "on the ground",
        None => "at rest",
    }
}

/// Which movement ended early and why, unless another one took its place, as in `goto ended early: sender-lost`.
pub fn ended_early(state: &ModuleState) -> Option<String> {
    let end = &state.last_end;
    let (kind, reason) = end.kind().zip(end.early())?;
    (reason != Reason::Replaced).then(|| format!("{kind} ended early: {reason}"))
}

/// Whether the last end is that of the movement that the state shows. Movements that safety rules order have no number
/// of their own: one that is under way has not ended.
pub fn is_end_of_shown(state: &ModuleState) -> bool {
    let is_over = matches!(
        state.functionality(),
        Some(Functionality::AtRest | Functionality::ReceivingPath | Functionality::Stopping)
    );
    let id = state.movement.request_id;
    state.last_end.request_id == id && (id != 0 || is_over)
}

/// How far the path is flown, or which order came last, and whether it ended early; `None` if there was none.
pub fn movement(state: &ModuleState) -> Option<String> {
    if is_end_of_shown(state)
        && let Some(end) = ended_early(state)
    {
        return Some(end);
    }
    Some(match (state.movement.kind()?, next_waypoint(state)) {
        (MovementKind::GoToWaypoint, Some((_, total))) => {
            format!("{} of {total} reached", state.movement.waypoints_reached)
        }
        (kind, _) => format!("last order: {kind}"),
    })
}

/// The request whose movement the helicopter carries out, a path or a take-off; `None` if it does not, or by itself.
pub fn request_under_way(state: &ModuleState) -> Option<u64> {
    let moves = matches!(
        state.functionality(),
        Some(Functionality::TakingOff | Functionality::FollowingPath)
    );
    Some(state.movement.request_id).filter(|id| moves && *id != 0)
}

/// The waypoint that the helicopter flies to, counted from 1, and how many the path has; `None` if that cannot be.
pub fn next_waypoint(state: &ModuleState) -> Option<(u32, u32)> {
    let (reached, total) = (
        state.movement.waypoints_reached,
        state.movement.waypoints_total,
    );
    (reached <= total && total > 0).then(|| (reached.saturating_add(1).min(total), total))
}

#[cfg(test)]
mod tests {
    use ipc_types::payload::SharedStruct;

    use super::*;

    #[test]
    fn what_is_not_valid_or_cannot_be_is_nothing() {
        let mut hero = HeroTelemetry::default();
        hero.geodetic.altitude_m = 5.0;
        assert_eq!(PilotView::from(&hero).altitude_m, None);
        hero.valid_groups = u32::MAX;
        assert_eq!(PilotView::from(&hero).altitude_m, Some(5.0));
        hero.geodetic.altitude_m = f64::NAN;
        hero.geodetic.latitude_rad = f64::INFINITY;
        hero.velocity.ground_speed_mps = 1e30;
        hero.supply.fuel_fraction = -0.5;
        hero.supply.auto_switch = 7;
        hero.gps_quality = 99;
        let view = PilotView::from(&hero);
        assert_eq!(
            (
                view.altitude_m,
                view.place,
                view.ground_speed_mps,
                view.fuel_percent
            ),
            (None, None, None, None)
        );
        assert_eq!(view.switch, Some(PilotSwitch::Unknown));
        assert_eq!(view.gps.unwrap().to_string(), "unknown (99)");
    }

    #[test]
    fn any_bits_of_raw_telemetry_become_a_view() {
        let bytes = vec![0xff; size_of::<DspTelemetry>()];
        let dsp = DspTelemetry::from_bytes(&bytes).unwrap();
        let view = PilotView::from(&dsp);
        assert_eq!((view.place, view.altitude_m), (None, None));
    }

    #[test]
    fn the_newer_telemetry_counts() {
        let hero = HeroTelemetry {
            received_ns: 5,
            flying: 1,
            ..HeroTelemetry::default()
        };
        let mut dsp = DspTelemetry {
            received_ns: 5,
            ..DspTelemetry::default()
        };
        assert_eq!(PilotView::of(Some(&hero), Some(&dsp)).flying, Some(true));
        dsp.received_ns = 6;
        assert_eq!(PilotView::of(Some(&hero), Some(&dsp)).flying, Some(false));
        assert_eq!(PilotView::of(None, None), PilotView::default());
    }

    #[test]
    fn a_phase_is_said_in_words_and_counts_waypoints_from_one() {
        let mut state = ModuleState::default();
        assert_eq!(phase(&state, None), "unknown phase 0");
        state.functionality = Functionality::AtRest.code();
        assert_eq!(phase(&state, Some(true)), "hovering");
        assert_eq!(phase(&state, Some(false)), "on the ground");
        state.functionality = Functionality::FollowingPath.code();
        for (reached, total, expected) in [
            (0, 3, "flying the path, waypoint 1 of 3"),
            (3, 3, "flying the path, waypoint 3 of 3"),
            (u32::MAX, 3, "flying the path"),
            (0, 0, "flying the path"),
        ] {
            state.movement.waypoints_reached = reached;
            state.movement.waypoints_total = total;
            assert_eq!(phase(&state, Some(true)), expected);
        }
    }
}
