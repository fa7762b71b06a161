//! The geofence: each rule at its edges, and a comparison with an independent judge.
//!
//! Distances are metres round 37° N, 6° W, unless a test says otherwise.

use bridge::safety::fence::{Breach, Fence, FenceRule, TOUCH_M};
use dsp_protocol::Waypoint;

#[path = "fence/chance.rs"]
mod chance;
#[path = "fence/globe.rs"]
mod globe;
#[path = "fence/heights.rs"]
mod heights;
#[path = "fence/oracle.rs"]
mod oracle;
#[path = "fence/outlines.rs"]
mod outlines;
#[path = "fence/random.rs"]
mod random;

const ORIGIN_DEG: [f64; 2] = [37.0, -6.0];

/// Which answer a case expects.
type Expected = Option<(FenceRule, f64)>;

const ALLOWED: Expected = None;

fn excluded(amount_m: f64) -> Expected {
    Some((FenceRule::Exclusion, amount_m))
}

fn outside(amount_m: f64) -> Expected {
    Some((FenceRule::Inclusion, amount_m))
}

/// Degrees of the point so many metres east and north of the origin.
fn degrees([east_m, north_m]: [f64; 2]) -> [f64; 2] {
    let [north, east] = oracle::metres_per_degree(ORIGIN_DEG[0]);
    [
        ORIGIN_DEG[0] + north_m / north,
        ORIGIN_DEG[1] + east_m / east,
    ]
}

/// East, north, up.
fn at([east_m, north_m, altitude_m]: [f64; 3]) -> Waypoint {
    let [latitude_deg, longitude_deg] = degrees([east_m, north_m]);
    Waypoint {
        latitude_deg,
        longitude_deg,
        altitude_m,
    }
}

fn waypoint(latitude_deg: f64, longitude_deg: f64, altitude_m: f64) -> Waypoint {
    Waypoint {
        latitude_deg,
        longitude_deg,
        altitude_m,
    }
}

fn parse(text: &str) -> Result<Fence, String> {
    runtime::config::parse(text, "fence.toml").map_err(|error| error.to_string())
}

/// The text of a polygon of metres.
fn polygon(name: &str, kind: &str, outline: &[[f64; 2]]) -> String {
    let outline: Vec<_> = outline.iter().copied().map(degrees).collect();
    format!("[[area]]\nname = \"{name}\"\nkind = \"{kind}\"\npolygon = {outline:?}\n")
}

/// The text of a circle round the origin.
fn circle(kind: &str, radius_m: f64) -> String {
    format!(
        "[[area]]\nname = \"circle\"\nkind = \"{kind}\"\ncentre = {ORIGIN_DEG:?}\nradius_m = {radius_m:?}\n"
    )
}

const SQUARE: [[f64; 2]; 4] = [[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0]];

/// A square of 100 m from whose upper side a notch reaches down to 20 m.
const NOTCHED: [[f64; 2]; 8] = [
    [0.0, 0.0],
    [100.0, 0.0],
    [100.0, 100.0],
    [60.0, 100.0],
    [60.0, 20.0],
    [40.0, 20.0],
    [40.0, 100.0],
    [0.0, 100.0],
];

/// Both directions of a leg break the same rule by the same amount.
fn check(fence: &str, from: [f64; 3], to: [f64; 3], expected: Expected) {
    let fence = parse(fence).unwrap();
    for (from, to) in [(from, to), (to, from)] {
        let breach = fence.check_leg(&at(from), &at(to));
        assert_eq!(
            breach.map(|breach| breach.rule),
            expected.map(|(rule, _)| rule),
            "{from:?} to {to:?}: {breach:?}"
        );
        let all = fence.breaches_of_leg(&at(from), &at(to));
        assert_eq!(all.first().copied(), breach, "the first of {all:?}");
        if let (Some(breach), Some((_, amount_m))) = (breach, expected) {
            // Maps of different middles differ by 10⁻⁵.
            let error_m = (breach.amount_m - amount_m).abs();
            assert!(
                error_m < 0.005 + 1e-5 * amount_m,
                "{from:?} to {to:?}: {breach:?}"
            );
        }
    }
}
