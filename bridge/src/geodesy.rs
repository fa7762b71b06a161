//! Distances on the Earth: how far two points are from one another.

use dsp_protocol::{Waypoint, downlink::Geographic};

/// Mean radius of the Earth, m.
pub const EARTH_RADIUS_M: f64 = 6_371_008.8;

/// `a − b` the short way round, −180 … 180 degrees.
pub fn longitude_difference_deg(a: f64, b: f64) -> f64 {
    (a - b + 540.0).rem_euclid(360.0) - 180.0
}

/// Metres along the ground between two points, on a sphere with the Earth's mean radius. Good to 0.6 %, which is enough
/// to refuse what is absurdly far and to show progress.
pub fn ground_distance_m(a: &Geographic, b: &Waypoint) -> f64 {
    let (lat_a, lat_b) = (a.latitude_deg.to_radians(), b.latitude_deg.to_radians());
    let half_lat = (lat_b - lat_a) / 2.0;
    let half_lon = longitude_difference_deg(b.longitude_deg, a.longitude_deg).to_radians() / 2.0;
    let haversine = half_lat.sin().powi(2) + lat_a.cos() * lat_b.cos() * half_lon.sin().powi(2);
    2.0 * EARTH_RADIUS_M * haversine.clamp(0.0, 1.0).sqrt().asin()
}

/// A position as a waypoint.
pub fn here(position: &Geographic) -> Waypoint {
    Waypoint {
        latitude_deg: position.latitude_deg,
        longitude_deg: position.longitude_deg,
        altitude_m: position.altitude_m,
    }
}

/// A waypoint as a position.
pub fn there(waypoint: &Waypoint) -> Geographic {
    Geographic {
        latitude_deg: waypoint.latitude_deg,
        longitude_deg: waypoint.longitude_deg,
        altitude_m: waypoint.altitude_m,
    }
}

/// Metres between two waypoints, along the ground and up or down.
pub fn distance_m(a: &Waypoint, b: &Waypoint) -> f64 {
    ground_distance_m(&there(a), b).hypot(a.altitude_m - b.altitude_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_antimeridian_is_crossed_the_short_way() {
        let at = |longitude_deg| Waypoint {
            longitude_deg,
            ..Waypoint::default()
        };
        assert!((longitude_difference_deg(179.5, -179.5) + 1.0).abs() < 1e-9);
        assert!((longitude_difference_deg(-179.5, 179.5) - 1.0).abs() < 1e-9);
        let metres = ground_distance_m(&there(&at(179.5)), &at(-179.5));
        assert!((metres - 111_195.0).abs() < 1.0, "{metres}");
    }
}
