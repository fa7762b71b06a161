//! Places on the Earth and the metres between them: the one Earth of this tool, a sphere with the mean radius.
//!
//! Distances are those on a flat map around the first place, good to 0.6 % over some kilometres. What the bridge judges with are its
//! own: `bridge::geodesy` and the geofence.

/// Metres of one degree of latitude, and of longitude at the equator: of the mean radius, 6 371 008.8 m.
pub const METRES_PER_DEGREE: f64 = 6_371_008.8 * std::f64::consts::PI / 180.0;

/// A place on the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Degrees, north positive, −90 … 90.
    pub latitude_deg: f64,
    /// Degrees, east positive, −180 … 180.
    pub longitude_deg: f64,
}

impl Place {
    /// The place with these coordinates; `None` if there is none.
    pub fn new(latitude_deg: f64, longitude_deg: f64) -> Option<Place> {
        // A comparison with no number is false.
        (latitude_deg.abs() <= 90.0 && longitude_deg.abs() <= 180.0).then_some(Place {
            latitude_deg,
            longitude_deg,
        })
    }
}

/// How far `to` lies from `from`: metres east, metres north, the shorter way round the Earth.
pub fn offset_m(from: Place, to: Place) -> (f64, f64) {
    let east_deg = (to.longitude_deg - from.longitude_deg + 540.0).rem_euclid(360.0) - 180.0;
    let scale = from.latitude_deg.to_radians().cos();
    (
        east_deg * METRES_PER_DEGREE * scale,
        (to.latitude_deg - from.latitude_deg) * METRES_PER_DEGREE,
    )
}

/// Distance along the ground, m.
pub fn distance_m(from: Place, to: Place) -> f64 {
    let (east, north) = offset_m(from, to);
    east.hypot(north)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_right_across_the_date_line() {
        let east = Place::new(0.0, 179.9999).unwrap();
        let west = Place::new(0.0, -179.9999).unwrap();
        let (east_m, north_m) = offset_m(east, west);
        assert!((east_m - 22.3).abs() < 0.1 && north_m == 0.0, "{east_m}");
    }
}
