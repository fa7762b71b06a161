//! A straight leg on the local plane of one area, and where along it something holds.
//!
//! The projection is equirectangular: latitude and longitude are multiplied by the metres per degree that WGS 84 has at
//! the reference point. A line that is straight in latitude and longitude is straight in every such plane, so the
//! planes of all areas agree on what a straight leg is, and a position on it is the same fraction of the leg in all of
//! them.
//!
//! Where something holds is said in [spans](Span) of fractions of the leg. Every shape here is convex, so a straight
//! leg is inside it in one piece.

use dsp_protocol::Waypoint;
use geo::{Coord, Line, coord};

use crate::geodesy::longitude_difference_deg;

/// Closer than this counts as touching, metres.
///
/// A waypoint travels to the DSP in steps of 10⁻⁷ ° and 1 mm, so it can arrive 8 mm from where it was judged. The value
/// is far above rounding errors too, which are below 10⁻⁶ m.
pub const TOUCH_M: f64 = 0.01;

/// Largest extent of an area from east to west and from north to south, and longest leg that is judged, metres: beyond
/// it a flat map is no longer honest.
pub const MAX_EXTENT_M: f64 = 100_000.0;

/// No vertex, centre or leg is judged nearer to a pole than this, degrees of latitude: meridians are no longer parallel
/// there.
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

    /// The point so many metres from the plane's origin `at`.
    pub(super) fn moved(&self, at: &Waypoint, east_m: f64, north_m: f64, up_m: f64) -> Waypoint {
        let longitude_deg = at.longitude_deg + east_m / self.east_m_per_deg;
        Waypoint {
            latitude_deg: at.latitude_deg + north_m / self.north_m_per_deg,
            longitude_deg: longitude_difference_deg(longitude_deg, 0.0),
            altitude_m: at.altitude_m + up_m,
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

/// A leg with less ground length than this stays at one place: a direction of it would be noise. The margin that counts
/// as touching is 100,000 times more.
const STANDSTILL_M: f64 = 1e-7;

/// Part of a leg, both ends included, as fractions of the leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Span {
    pub(super) from: f64,
    pub(super) to: f64,
}

impl Span {
    /// The whole leg.
    pub(super) const WHOLE: Span = Span { from: 0.0, to: 1.0 };
    /// The whole line of which the leg is a part.
    const LINE: Span = Span {
        from: f64::NEG_INFINITY,
        to: f64::INFINITY,
    };

    /// What both spans have in common.
    pub(super) fn and(self, other: Span) -> Option<Span> {
        let from = self.from.max(other.from);
        let to = self.to.min(other.to);
        (from <= to).then_some(Span { from, to })
    }

    /// Fraction of the leg that it covers.
    pub(super) fn length(self) -> f64 {
        self.to - self.from
    }

    /// The point halfway.
    pub(super) fn middle(self) -> f64 {
        self.from + self.length() / 2.0
    }
}

/// Where `start + fraction × change` lies from `low` to `high`. Not clipped to the leg.
pub(super) fn where_between(start: f64, change: f64, low: f64, high: f64) -> Option<Span> {
    if change == 0.0 {
        return (low <= start && start <= high).then_some(Span::LINE);
    }
    let (a, b) = ((low - start) / change, (high - start) / change);
    Span::LINE.and(Span {
        from: a.min(b),
        to: a.max(b),
    })
}

/// Where the leg's line is not farther than `radius_m` from `centre`. Not clipped to the leg.
pub(super) fn where_in_disc(leg: &Leg, centre: Coord, radius_m: f64) -> Option<Span> {
    let to_centre = centre - leg.start;
    let length_m = leg.ground_m;
    if length_m < STANDSTILL_M {
        return (to_centre.x.hypot(to_centre.y) <= radius_m).then_some(Span::LINE);
    }
    let miss_m = cross(leg.way, to_centre) / length_m;
    if radius_m < miss_m.abs() {
        return None;
    }
    let closest = dot(leg.way, to_centre) / (length_m * length_m);
    let half = ((radius_m - miss_m) * (radius_m + miss_m)).sqrt() / length_m;
    Some(Span {
        from: closest - half,
        to: closest + half,
    })
}

/// Where the leg's line is not farther than `radius_m` from `edge`. Not clipped to the leg.
pub(super) fn where_near_edge(leg: &Leg, edge: Line, radius_m: f64) -> Option<Span> {
    // Most edges lie on one side of the leg's line.
    let start = cross(leg.way, edge.start - leg.start);
    let end = cross(leg.way, edge.end - leg.start);
    let near = radius_m * leg.ground_m;
    if start.min(end) > near || start.max(end) < -near {
        return None;
    }
    let (along, length_m) = (edge.delta(), edge.delta().x.hypot(edge.delta().y));
    let along = along / length_m;
    let from_edge = leg.start - edge.start;
    let beside = where_between(
        cross(along, from_edge),
        cross(along, leg.way),
        -radius_m,
        radius_m,
    )?;
    let abreast = where_between(dot(along, from_edge), dot(along, leg.way), 0.0, length_m);
    // The points near an edge are a rectangle beside it and a disc round either end.
    [
        abreast.and_then(|abreast| abreast.and(beside)),
        where_in_disc(leg, edge.start, radius_m),
        where_in_disc(leg, edge.end, radius_m),
    ]
    .into_iter()
    .flatten()
    .reduce(|a, b| Span {
        from: a.from.min(b.from),
        to: a.to.max(b.to),
    })
}

/// Sorts the spans and joins those that overlap or touch.
pub(super) fn join(spans: &mut Vec<Span>) {
    spans.sort_unstable_by(|a, b| a.from.total_cmp(&b.from));
    spans.dedup_by(|next, last| {
        let joined = next.from <= last.to;
        if joined {
            last.to = last.to.max(next.to);
        }
        joined
    });
}

/// What of the whole leg no span covers. The ends of the spans count as not covered, except the leg's own two ends.
pub(super) fn rest(spans: &mut [Span]) -> Vec<Span> {
    spans.sort_unstable_by(|a, b| a.from.total_cmp(&b.from));
    let mut rest = Vec::new();
    let mut covered_to = 0.0;
    for span in spans.iter() {
        if span.from > covered_to || (span.from == covered_to && covered_to > 0.0) {
            rest.push(Span {
                from: covered_to,
                to: span.from,
            });
        }
        covered_to = span.to.max(covered_to);
    }
    if covered_to < 1.0 || spans.is_empty() {
        rest.push(Span {
            from: covered_to,
            to: 1.0,
        });
    }
    rest
}

fn dot(a: Coord, b: Coord) -> f64 {
    a.x * b.x + a.y * b.y
}

fn cross(a: Coord, b: Coord) -> f64 {
    a.x * b.y - a.y * b.x
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spans<const N: usize>(ends: [(f64, f64); N]) -> Vec<Span> {
        ends.map(|(from, to)| Span { from, to }).to_vec()
    }

    #[test]
    fn spans_that_overlap_touch_or_contain_each_other_are_joined() {
        let mut joined = spans([(0.6, 0.7), (0.1, 0.5), (0.2, 0.3), (0.7, 0.8), (0.9, 1.0)]);
        join(&mut joined);
        assert_eq!(joined, spans([(0.1, 0.5), (0.6, 0.8), (0.9, 1.0)]));
    }

    #[test]
    fn the_rest_of_a_leg_is_what_no_span_covers() {
        let check = |covered: &[Span], expected: &[Span]| {
            assert_eq!(rest(&mut covered.to_vec()), expected, "{covered:?}");
        };
        check(&[], &[Span::WHOLE]);
        check(&[Span::WHOLE], &[]);
        check(&spans([(0.2, 0.4)]), &spans([(0.0, 0.2), (0.4, 1.0)]));
        check(&spans([(0.5, 1.0), (0.0, 0.6)]), &[]);
        check(&spans([(0.0, 0.9), (0.2, 0.3)]), &spans([(0.9, 1.0)]));
        // The end of a span is not covered by it, unless it is an end of the leg.
        check(&spans([(0.0, 0.5), (0.5, 1.0)]), &spans([(0.5, 0.5)]));
        check(&spans([(0.0, 0.0)]), &[Span::WHOLE]);
    }

    #[test]
    fn what_does_not_change_is_between_everywhere_or_nowhere() {
        assert_eq!(where_between(5.0, 0.0, 5.0, 6.0), Some(Span::LINE));
        assert_eq!(where_between(4.9, 0.0, 5.0, 6.0), None);
        let rising = where_between(0.0, 10.0, 2.0, f64::INFINITY);
        assert_eq!(
            rising.and_then(|span| span.and(Span::WHOLE)),
            Some(Span { from: 0.2, to: 1.0 })
        );
    }
}
