//! From an altitude of a plan to a telemetry altitude.

use crate::finding::Finding;
use crate::model::Altitude;
use crate::site::Site;

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
            None => Finding::forbids(
                "sea-level",
                "has an altitude above sea, and how high telemetry's zero lies above sea is not known",
            )
            .remedy(
                "set `[plan] zero_above_sea_m` in ril.toml; or give the plan heights above take-off (a GPX file cannot have them: \
                 leave out its `ele` and state `--altitude 30m`)",
            ),
        },
        Altitude::AboveTerrain(_) => Finding::forbids(
            "above-terrain",
            "has an altitude above terrain, which the helicopter does not know",
        )
        .remedy("give heights above take-off, or altitudes above sea"),
        Altitude::Unstated(Some(_)) => Finding::forbids(
            "altitude-reference",
            "has an altitude, and the file does not say above what",
        )
        .remedy("state it: `--altitude-is take-off` or `--altitude-is sea`"),
        Altitude::Unstated(None) => Finding::forbids("altitude-missing", "has no altitude")
            .remedy("state one: `--altitude 30m` for all items without one, above take-off"),
    })
}
