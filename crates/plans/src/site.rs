//! Where and under which conditions a plan is flown.

use dsp_protocol::Waypoint;
use runtime::finding::{Finding, Severity};

use crate::model::Altitude;

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

impl Site {
    /// The telemetry altitude of an altitude of the plan, m.
    ///
    /// # Errors
    ///
    /// The finding that forbids the flight: the telemetry altitude of the item is not known.
    pub fn altitude_m(&self, altitude: Altitude) -> Result<f64, Finding> {
        Err(match altitude {
        Altitude::AboveTakeOff(metres) => return Ok(self.home.altitude_m + metres),
        Altitude::AboveSea(metres) => match self.zero_above_sea_m {
            Some(zero_above_sea_m) => return Ok(metres - zero_above_sea_m),
            None => Finding::new(Severity::Error,
                "sea-level",
                "has an altitude above sea, and how high telemetry's zero lies above sea is not known",
            )
            .with_next_step(
                "set `[plan] zero_above_sea_m` in ril.toml; or give the plan heights above take-off (a GPX file cannot have them: \
                 leave out its `ele` and state `--altitude 30m`)",
            ),
        },
        Altitude::AboveTerrain(_) => Finding::new(Severity::Error,
            "above-terrain",
            "has an altitude above terrain, which the helicopter does not know",
        )
        .with_next_step("give heights above take-off, or altitudes above sea"),
        Altitude::Unstated(Some(_)) => Finding::new(Severity::Error,
            "altitude-reference",
            "has an altitude, and the file does not say above what",
        )
        .with_next_step("state it: `--altitude-is take-off` or `--altitude-is sea`"),
        Altitude::Unstated(None) => Finding::new(Severity::Error, "altitude-missing", "has no altitude")
            .with_next_step("state one: `--altitude 30m` for all items without one, above take-off"),
    })
    }
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
