//! From degrees to metres: the local plane of one area, and how finely and how far is judged on it.
//!
//! The projection is equirectangular: latitude and longitude are multiplied by the metres per degree that WGS 84 has at
//! the reference point. A line that is straight in latitude and longitude is straight in every such plane, so the planes
//! of all areas agree on what a straight leg is, and a position on it is the same fraction of the leg in all of them.

use dsp_protocol::Waypoint;
use geo::{Coord, coord};

use crate::geodesy::longitude_difference_deg;

/// Closer than this counts as touching, metres.
///
/// A waypoint travels to the DSP in steps of 10⁻⁷ ° and 1 mm, so it can arrive 8 mm from where it was judged. The value
/// is far above rounding errors too, which are below 10⁻⁶ m.
pub const TOUCH_M: f64 = 0.01;

/// Largest extent of an area from east to west and from north to south, and longest leg that is judged, metres: beyond
/// it a flat map is no longer honest.
pub const MAX_EXTENT_M: f64 = 100_000.0;

/// No vertex, centre or leg is judged nearer to a pole than this, degrees of latitude: meridians are no longer parallel there.
pub const MAX_LATITUDE_DEG: f64 = 85.0;

/// Equatorial radius of WGS 84.
const EQUATORIAL_RADIUS_M: f64 = 6_378_137.0;
/// Squared eccentricity of WGS 84.
const ECCENTRICITY_SQUARED: f64 = 6.694_379_990_14e-3;

/// The plane that touches the Earth at a reference point, its origin. x is metres east, y is metres north.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Plane {
    latitude_deg: f64,
    longitude_deg: f64,
    north_m_per_deg: f64,
    east_m_per_deg: f64,
}

impl Plane {
    /// The plane at a reference point.
    pub(super) fn at(latitude_deg: f64, longitude_deg: f64) -> Plane {
        let (sin, cos) = latitude_deg.to_radians().sin_cos();
        let flattened = 1.0 - ECCENTRICITY_SQUARED * sin * sin;
        let east_radius_m = EQUATORIAL_RADIUS_M / flattened.sqrt();
        let north_radius_m = east_radius_m * (1.0 - ECCENTRICITY_SQUARED) / flattened;
        Plane {
            latitude_deg,
            longitude_deg,
            north_m_per_deg: north_radius_m.to_radians(),
            east_m_per_deg: (east_radius_m * cos).to_radians(),
        }
    }

    /// A point in metres. Longitudes are taken across the antimeridian, where that is the shorter way.
    pub(super) fn coord(&self, latitude_deg: f64, longitude_deg: f64) -> Coord {
        coord! {
            x: longitude_difference_deg(longitude_deg, self.longitude_deg) * self.east_m_per_deg,
            y: (latitude_deg - self.latitude_deg) * self.north_m_per_deg,
        }
    }

    /// A leg in metres.
    pub(super) fn leg(&self, from: &Waypoint, to: &Waypoint) -> Leg {
        let east_deg = longitude_difference_deg(to.longitude_deg, from.longitude_deg);
        let north_deg = to.latitude_deg - from.latitude_deg;
        let way = coord! { x: east_deg * self.east_m_per_deg, y: north_deg * self.north_m_per_deg };
        Leg {
            start: self.coord(from.latitude_deg, from.longitude_deg),
            way,
            ground_m: way.x.hypot(way.y),
            altitude_m: from.altitude_m,
            climb_m: to.altitude_m - from.altitude_m,
        }
    }
}

/// A straight leg in a plane. A point of it is named by the fraction of the leg that lies before it, 0 … 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Leg {
    /// Where it begins.
    pub(super) start: Coord,
    /// From its begin to its end.
    pub(super) way: Coord,
    /// Length of `way`.
    pub(super) ground_m: f64,
    /// Altitude at its begin.
    pub(super) altitude_m: f64,
    /// Altitude at its end less that at its begin.
    pub(super) climb_m: f64,
}

impl Leg {
    /// The point at a fraction of the leg.
    pub(super) fn at(&self, fraction: f64) -> Coord {
        self.start + self.way * fraction
    }
}

/// The point at a fraction of the leg, in degrees. The longitude can lie beyond ±180.
pub(super) fn point_between(from: &Waypoint, to: &Waypoint, fraction: f64) -> Waypoint {
    let east_deg = longitude_difference_deg(to.longitude_deg, from.longitude_deg);
    Waypoint {
        latitude_deg: from.latitude_deg + (to.latitude_deg - from.latitude_deg) * fraction,
        longitude_deg: from.longitude_deg + east_deg * fraction,
        altitude_m: from.altitude_m + (to.altitude_m - from.altitude_m) * fraction,
    }
}

/// Metres along the ground between two points that are not much farther apart than an area may be wide.
pub(super) fn ground_length_m(from: &Waypoint, to: &Waypoint) -> f64 {
    let middle_deg = (from.latitude_deg + to.latitude_deg) / 2.0;
    Plane::at(middle_deg, from.longitude_deg)
        .leg(from, to)
        .ground_m
}
