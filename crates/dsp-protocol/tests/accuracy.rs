//! A waypoint on the line lies within 1 cm of the one that was meant, anywhere on Earth.

use dsp_protocol::{Decoded, Decoder, Uplink, Waypoint};
use proptest::prelude::*;

use crate::common;

/// The Earth's greatest radius: on any other sphere the same angles are closer together.
const RADIUS_M: f64 = 6_378_137.0;
/// What `docs/protocol.md` section 5.2 promises, tighter than the centimetre: 8 mm horizontally and 0.5 mm in height.
const BOUND_M: f64 = 0.00802;

/// The place in Cartesian coordinates around the Earth's centre.
fn cartesian(place: Waypoint) -> [f64; 3] {
    let (latitude, longitude) = (
        place.latitude_deg.to_radians(),
        place.longitude_deg.to_radians(),
    );
    let radius = RADIUS_M + place.altitude_m;
    [
        radius * latitude.cos() * longitude.cos(),
        radius * latitude.cos() * longitude.sin(),
        radius * latitude.sin(),
    ]
}

/// How far the waypoint has moved once it has been on the line.
fn error_m(meant: Waypoint) -> f64 {
    let frame = Uplink::Waypoint(meant).encode();
    let (_, Decoded::Message(Uplink::Waypoint(got))) = Decoder::new().decode(frame.as_bytes())
    else {
        panic!("{meant:?} did not arrive");
    };
    cartesian(meant)
        .into_iter()
        .zip(cartesian(got))
        .map(|(meant, got)| (meant - got).powi(2))
        .sum::<f64>()
        .sqrt()
}

proptest! {
    #![proptest_config(common::config(20_000))]

    #[test]
    fn a_waypoint_moves_less_than_a_centimetre(
        latitude_deg in -90.0..=90.0f64,
        longitude_deg in -180.0..=180.0f64,
        altitude_m in -1000.0..=20_000.0f64,
    ) {
        let meant = Waypoint { latitude_deg, longitude_deg, altitude_m };
        let error_m = error_m(meant);
        prop_assert!(error_m < BOUND_M, "{meant:?} moved by {error_m} m");
    }
}

#[test]
fn halfway_between_two_steps_is_the_worst_and_still_within_the_bound() {
    let half_deg = 0.5e-7;
    for latitude_deg in [-90.0, -45.0, 0.0, 45.0, 90.0] {
        for longitude_deg in [-180.0, -90.0, 0.0, 90.0, 180.0] {
            let meant = Waypoint {
                latitude_deg: latitude_deg - f64::copysign(half_deg, latitude_deg),
                longitude_deg: longitude_deg - f64::copysign(half_deg, longitude_deg),
                altitude_m: 19_999.999_5,
            };
            let error_m = error_m(meant);
            assert!(error_m < BOUND_M, "{meant:?} moved by {error_m} m");
        }
    }
}
