//! Places and moments as people use them: degrees, a local frame in metres, UTC. The Python package has the same in
//! `geo.py`.

use std::f64::consts::{PI, TAU};
use std::time::{SystemTime, UNIX_EPOCH};

use ipc_types::MonotonicNs;
use ipc_types::payload::WaypointPosition;

/// Half axis of the ellipsoid WGS 84 at the equator, m, and the square of its eccentricity.
const EQUATOR_M: f64 = 6_378_137.0;
const E2: f64 = 6.694_379_990_14e-3;

/// `hero_ril_offset`: a place by its distances from another one.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Offset {
    /// Metres to the north.
    pub north_m: f64,
    /// Metres to the east.
    pub east_m: f64,
    /// Metres up.
    pub up_m: f64,
}

/// Nanoseconds since 1970 (UTC) of a moment of the host's monotonic clock, by the host's clock now; 0 of 0, which is
/// "never".
pub fn utc_ns(monotonic_ns: u64) -> u64 {
    let unix = SystemTime::now().duration_since(UNIX_EPOCH);
    let unix_ns = unix.map_or(0, |since| {
        u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
    });
    utc_at(monotonic_ns, MonotonicNs::now().0, unix_ns)
}

/// The moment `monotonic_ns` in Unix time, if the host's clocks show `now_ns` and `unix_ns`; 0 of 0.
fn utc_at(monotonic_ns: u64, now_ns: u64, unix_ns: u64) -> u64 {
    match monotonic_ns {
        0 => 0,
        _ => unix_ns.saturating_add_signed(monotonic_ns.wrapping_sub(now_ns) as i64),
    }
}

/// Where `place` is from `origin`, along the ellipsoid.
pub fn offset(origin: &WaypointPosition, place: &WaypointPosition) -> Offset {
    let east_rad = (place.longitude_deg - origin.longitude_deg).to_radians();
    Offset {
        north_m: (place.latitude_deg - origin.latitude_deg).to_radians() * meridian_m(origin),
        east_m: ((east_rad + PI).rem_euclid(TAU) - PI) * parallel_m(origin, place.latitude_deg),
        up_m: place.altitude_m - origin.altitude_m,
    }
}

/// The place that is so far from `origin`.
pub fn place(origin: &WaypointPosition, offset: &Offset) -> WaypointPosition {
    let north_rad = offset.north_m / meridian_m(origin);
    let latitude_deg = origin.latitude_deg + north_rad.to_degrees();
    let east_rad = offset.east_m / parallel_m(origin, latitude_deg);
    let longitude_deg = origin.longitude_deg + east_rad.to_degrees();
    WaypointPosition {
        latitude_deg,
        longitude_deg: (longitude_deg + 180.0).rem_euclid(360.0) - 180.0,
        altitude_m: origin.altitude_m + offset.up_m,
    }
}

/// One minus the square of the eccentricity that acts at a latitude.
fn curvature(latitude_deg: f64) -> f64 {
    1.0 - E2 * latitude_deg.to_radians().sin().powi(2)
}

/// Radius of the meridian at a place, m.
fn meridian_m(at: &WaypointPosition) -> f64 {
    EQUATOR_M * (1.0 - E2) / curvature(at.latitude_deg).powf(1.5) + at.altitude_m
}

/// Radius of the parallel halfway from a place to a latitude, m.
fn parallel_m(from: &WaypointPosition, latitude_deg: f64) -> f64 {
    let normal_m = EQUATOR_M / curvature(from.latitude_deg).sqrt() + from.altitude_m;
    normal_m
        * ((from.latitude_deg + latitude_deg) / 2.0)
            .to_radians()
            .cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(latitude_deg: f64, longitude_deg: f64) -> WaypointPosition {
        WaypointPosition {
            latitude_deg,
            longitude_deg,
            altitude_m: 20.0,
        }
    }

    #[test]
    fn a_place_goes_to_metres_and_back() {
        for origin in [at(37.4, -6.0), at(-60.0, 179.999), at(0.0, 0.0)] {
            let offset_of = Offset {
                north_m: 300.0,
                east_m: 400.0,
                up_m: -5.0,
            };
            let place = place(&origin, &offset_of);
            let back = offset(&origin, &place);
            for (expected, found) in [
                (offset_of.north_m, back.north_m),
                (offset_of.east_m, back.east_m),
                (offset_of.up_m, back.up_m),
            ] {
                assert!((expected - found).abs() < 1e-6, "{origin:?}: {back:?}");
            }
            assert!((-180.0..180.0).contains(&place.longitude_deg), "{place:?}");
        }
    }

    #[test]
    fn a_minute_of_latitude_is_a_nautical_mile() {
        let north = offset(&at(45.0, 9.0), &at(45.0 + 1.0 / 60.0, 9.0));
        assert!((north.north_m - 1852.0).abs() < 1.0, "{north:?}");
        let east = offset(&at(0.0, 179.9), &at(0.0, -179.9));
        assert!((east.east_m - 22_264.0).abs() < 2.0, "{east:?}");
    }

    #[test]
    fn a_moment_is_as_far_from_now_by_both_clocks() {
        assert_eq!(utc_at(0, 500, 10_000), 0);
        assert_eq!(utc_at(480, 500, 10_000), 9_980);
        assert_eq!(utc_at(510, 500, 10_000), 10_010);
        assert_eq!(utc_at(1, 20_000, 10_000), 0);
    }
}
