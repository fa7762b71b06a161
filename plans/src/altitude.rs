//! From what a plan says of an altitude to telemetry's.

use crate::finding::Finding;
use crate::model::Altitude;
use crate::site::Site;

/// The altitude with the zero of telemetry, m, and what the operator must know about it; without an altitude, why there is none.
pub fn in_telemetry(altitude: Altitude, site: &Site) -> (Option<f64>, Option<Finding>) {
    let finding = match altitude {
        Altitude::AboveTakeOff(metres) => return (Some(site.home.altitude_m + metres), None),
        Altitude::AboveSea(metres) => {
            let telemetry_m = metres - site.zero_above_sea_m.unwrap_or(0.0);
            return (Some(telemetry_m), sea_level(site));
        }
        Altitude::AboveTerrain(_) => Finding::forbids(
            "above-terrain",
            "has an altitude above terrain, which the helicopter does not know",
        )
        .remedy("give altitudes above take-off or above sea level"),
        Altitude::Unstated(Some(_)) => Finding::forbids(
            "altitude-reference",
            "has an altitude, and the file does not say above what",
        )
        .remedy("state it: `--altitude-is take-off` or `--altitude-is sea`"),
        Altitude::Unstated(None) => Finding::forbids("altitude-missing", "has no altitude")
            .remedy("state one: `--altitude 30m` for all items without one, above take-off"),
    };
    (None, Some(finding))
}

/// Nothing when it is configured how telemetry's zero lies.
fn sea_level(site: &Site) -> Option<Finding> {
    let is_unknown = site.zero_above_sea_m.is_none();
    is_unknown.then(|| {
        Finding::warns(
            "sea-level",
            "has an altitude above sea level, which is taken for telemetry's",
        )
        .remedy(
            "check it against the altitude that telemetry shows at a known place; `[plan] zero_above_sea_m` in ril.toml",
        )
    })
}
