//! Between geographic positions and the flat world: east, north and up of a point, in metres.
//!
//! The map is linear with the ellipsoid's two radii of curvature at the origin. Within 10 km it is right to about one
//! in a thousand, and it is exactly invertible, which matters more here: the world of this simulator *is* flat.

use dsp_protocol::downlink::Geographic;

use super::vector::Vector;

/// Semi-major axis of the WGS 84 ellipsoid, m.
const SEMI_MAJOR_AXIS_M: f64 = 6_378_137.0;
/// First eccentricity of the WGS 84 ellipsoid, squared.
const ECCENTRICITY_SQUARED: f64 = 6.694_379_990_14e-3;

/// The flat world around an origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalFrame {
    origin: Geographic,
    east_m_per_deg: f64,
    north_m_per_deg: f64,
}

impl LocalFrame {
    /// The flat world that touches the ellipsoid at `origin`, which must not be a pole.
    pub fn new(origin: Geographic) -> LocalFrame {
        let (sin, cos) = origin.latitude_deg.to_radians().sin_cos();
        let flattening = 1.0 - ECCENTRICITY_SQUARED * sin * sin;
        let east_radius_m = SEMI_MAJOR_AXIS_M / flattening.sqrt();
        let north_radius_m = east_radius_m * (1.0 - ECCENTRICITY_SQUARED) / flattening;
        LocalFrame {
            origin,
            east_m_per_deg: east_radius_m * cos * 1_f64.to_radians(),
            north_m_per_deg: north_radius_m * 1_f64.to_radians(),
        }
    }

    /// East, north and up of the origin.
    pub fn to_flat(&self, position: Geographic) -> Vector {
        Vector {
            x: wrap_degrees(position.longitude_deg - self.origin.longitude_deg)
                * self.east_m_per_deg,
            y: (position.latitude_deg - self.origin.latitude_deg) * self.north_m_per_deg,
            z: position.altitude_m - self.origin.altitude_m,
        }
    }

    /// The geographic position of a point.
    pub fn to_geographic(&self, point: Vector) -> Geographic {
        Geographic {
            latitude_deg: self.origin.latitude_deg + point.y / self.north_m_per_deg,
            longitude_deg: wrap_degrees(self.origin.longitude_deg + point.x / self.east_m_per_deg),
            altitude_m: self.origin.altitude_m + point.z,
        }
    }
}

/// Maps an angle to the range from −180 up to, but not including, 180°.
pub fn wrap_degrees(angle_deg: f64) -> f64 {
    (angle_deg + 180.0).rem_euclid(360.0) - 180.0
}

/// Maps an angle to the range from −π up to, but not including, π.
pub fn wrap_radians(angle_rad: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    (angle_rad + PI).rem_euclid(TAU) - PI
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(latitude_deg: f64, longitude_deg: f64) -> Geographic {
        Geographic {
            latitude_deg,
            longitude_deg,
            altitude_m: 10.0,
        }
    }

    #[test]
    fn a_degree_has_the_length_of_the_tables() {
        // Lengths of a degree of latitude and longitude, from the usual tables of WGS 84.
        for (latitude_deg, north_m, east_m) in [
            (0.0, 110_574.3, 111_319.5),
            (45.0, 111_131.8, 78_846.8),
            (60.0, 111_412.2, 55_800.0),
        ] {
            let frame = LocalFrame::new(at(latitude_deg, 7.0));
            let corner = frame.to_flat(at(latitude_deg + 1.0, 8.0));
            assert!(
                (corner.y - north_m).abs() < 0.5,
                "{latitude_deg}: {corner:?}"
            );
            assert!(
                (corner.x - east_m).abs() < 0.5,
                "{latitude_deg}: {corner:?}"
            );
        }
    }

    #[test]
    fn there_and_back_is_the_same_place_also_across_the_antimeridian() {
        for origin in [at(37.4, -6.0), at(-60.0, 179.9999), at(10.0, -179.9999)] {
            let frame = LocalFrame::new(origin);
            for point in [
                Vector::new(120.0, -80.0, 5.0),
                Vector::new(-300.0, 2.0, 0.0),
            ] {
                let position = frame.to_geographic(point);
                assert!(position.longitude_deg.abs() <= 180.0);
                assert!((frame.to_flat(position) - point).norm() < 1e-6);
            }
        }
    }
}
