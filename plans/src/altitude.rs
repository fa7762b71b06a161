//! From an altitude of a plan to a telemetry altitude.

use crate::model::Altitude;
use crate::site::Site;
use runtime::finding::{Finding, Severity};

/// The telemetry altitude, m.
///
/// # Errors
///
/// The finding that forbids the flight: the telemetry altitude of the item is not known.
pub fn in_telemetry(altitude: Altitude, site: &Site) -> Result<f64, Finding> {
    Err(match altitude {
        Altitude::AboveTakeOff(metres) => return Ok(site.home.altitude_m + metres),
        Altitude::AboveSea(metres) => match site.zero_above_sea_m {
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
