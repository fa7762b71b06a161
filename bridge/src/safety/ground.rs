//! The ground of the take-off: no waypoint lies below it, unless `safety.below_take_off` of `bridge.toml` allows it.
//!
//! A telemetry altitude that was meant as a height above take-off, such as 5 m where telemetry shows 10 m on the ground, leads into the
//! ground. A field that falls away from the place of the take-off is the exception, and its operator says so.

use dsp_protocol::Waypoint;

use super::fence::{Breach, FenceRule};

/// How `to` lies below the ground, whose telemetry altitude is `ground_m`: as a floor that may be touched.
pub fn breach(to: &Waypoint, ground_m: f64) -> Option<Breach> {
    let amount_m = ground_m - to.altitude_m;
    (amount_m > 0.0).then_some(Breach {
        rule: FenceRule::Floor,
        amount_m,
        area: None,
    })
}
