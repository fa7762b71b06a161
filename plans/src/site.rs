//! Where and under which conditions a plan is flown.

use dsp_protocol::Waypoint;

/// What a plan is flown from.
#[derive(Clone, Debug, PartialEq)]
pub struct Site {
    /// The point of take-off, with its telemetry altitude: 0 if that is not known.
    pub home: Waypoint,
    /// Whether the telemetry altitude of home is known.
    pub is_home_altitude_known: bool,
    /// How that is known.
    pub home_source: HomeSource,
    /// Where the flight begins.
    pub start: Start,
    /// How high telemetry's zero lies above sea, m, if it is known.
    pub zero_above_sea_m: Option<f64>,
    /// The height of a take-off that the operator asks for in front of the plan, m.
    pub take_off_m: Option<f64>,
    /// The first item that is flown, from 1.
    pub from: u32,
    /// The plan is to be flown now: what would only be missing becomes what forbids it.
    pub is_for_flight: bool,
}

/// How the point of take-off is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HomeSource {
    /// The robot stands there.
    Robot,
    /// The operator says so.
    Operator,
    /// The plan's author expected it there.
    Plan,
    /// It is not known: it is taken to be below the first place of the plan.
    Assumed,
}

/// Where the flight begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// On the ground, here; usually that is home.
    Ground(Waypoint),
    /// In the air, here, with its telemetry altitude.
    Flying(Waypoint),
}

/// How fast the helicopter flies and for how long.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Endurance {
    /// Cruise speed, m/s.
    pub cruise_speed_mps: Option<f64>,
    /// Climb and sink speed, m/s; `None` for that of the DSP at boot.
    pub climb_speed_mps: Option<f64>,
    /// How long battery and fuel last at that speed, s.
    pub endurance_s: Option<f64>,
    /// How much of it shall be left at the end, s.
    pub reserve_s: f64,
}
