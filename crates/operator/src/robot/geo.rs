//! Places on the Earth and the metres between them, on the bridge's sphere with the mean radius; and where a robot was.
//!
//! Where metres become a place or a place metres ([`moved`], [`origin`], [`plane_m`]), the Earth is the ellipsoid of
//! WGS 84.
//!
//! Distances are those on a flat map around the first place, good to 0.6 % over some kilometres. What the bridge judges
//! with are its own: `bridge::geodesy` and the geofence.

use std::fmt;

use bridge::geodesy::{EARTH_RADIUS_M, longitude_difference_deg};

/// Metres of one degree of latitude, and of longitude at the equator.
pub const METRES_PER_DEGREE: f64 = EARTH_RADIUS_M * std::f64::consts::PI / 180.0;

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

    /// Degrees north and east, as pages have places.
    pub fn degrees(self) -> [f64; 2] {
        [self.latitude_deg, self.longitude_deg]
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.7}° {:.7}°", self.latitude_deg, self.longitude_deg)
    }
}

/// How far `to` lies from `from`: metres east, metres north, the shorter way round the Earth.
pub fn offset_m(from: Place, to: Place) -> (f64, f64) {
    let scale = from.latitude_deg.to_radians().cos();
    (
        east_deg(from, to) * METRES_PER_DEGREE * scale,
        (to.latitude_deg - from.latitude_deg) * METRES_PER_DEGREE,
    )
}

/// Semi-major axis of the ellipsoid of WGS 84, m.
const SEMI_MAJOR_AXIS_M: f64 = 6_378_137.0;

/// First eccentricity of the ellipsoid of WGS 84, squared.
const ECCENTRICITY_SQUARED: f64 = 6.694_379_990_14e-3;

/// The place so many metres east and north of `from`; `None` if that is none, beyond a pole.
pub fn moved(from: Place, east_m: f64, north_m: f64) -> Option<Place> {
    moved_at(from.latitude_deg, from, east_m, north_m)
}

/// The place from which `place` is so many metres east and north, in the plane that touches the Earth there.
pub fn origin(place: Place, east_m: f64, north_m: f64) -> Option<Place> {
    let near = moved(place, -east_m, -north_m)?;
    moved_at(near.latitude_deg, place, -east_m, -north_m)
}

/// Where `place` lies in the plane that touches the Earth at `origin`: metres east, metres north, as [`moved`] has
/// them.
pub fn plane_m(origin: Place, place: Place) -> (f64, f64) {
    let (east_radius_m, north_radius_m) = radii_m(origin.latitude_deg);
    let north_deg = place.latitude_deg - origin.latitude_deg;
    (
        east_deg(origin, place).to_radians() * east_radius_m,
        north_deg.to_radians() * north_radius_m,
    )
}

/// The place so many metres east and north of `from`, with the Earth's curvature at `latitude_deg`.
fn moved_at(latitude_deg: f64, from: Place, east_m: f64, north_m: f64) -> Option<Place> {
    let (east_radius_m, north_radius_m) = radii_m(latitude_deg);
    let longitude_deg = from.longitude_deg + (east_m / east_radius_m).to_degrees();
    Place::new(
        from.latitude_deg + (north_m / north_radius_m).to_degrees(),
        (longitude_deg + 540.0).rem_euclid(360.0) - 180.0,
    )
}

/// Metres of one radian of longitude and of latitude at a latitude.
fn radii_m(latitude_deg: f64) -> (f64, f64) {
    let (sin, cos) = latitude_deg.to_radians().sin_cos();
    let flattened = 1.0 - ECCENTRICITY_SQUARED * sin * sin;
    let east_radius_m = SEMI_MAJOR_AXIS_M / flattened.sqrt();
    let north_radius_m = east_radius_m * (1.0 - ECCENTRICITY_SQUARED) / flattened;
    (east_radius_m * cos, north_radius_m)
}

/// From one longitude to the other, the shorter way round the Earth, degrees.
fn east_deg(from: Place, to: Place) -> f64 {
    longitude_difference_deg(to.longitude_deg, from.longitude_deg)
}

/// Distance along the ground, m.
pub fn distance_m(from: Place, to: Place) -> f64 {
    let (east, north) = offset_m(from, to);
    east.hypot(north)
}

/// Most points of a track. At the first spacing that is 256 m of flight, and twice as much after each thinning.
pub const MAX_POINTS: usize = 512;

/// Distance between points at first, m: half of what counts as reached at a waypoint.
const FIRST_SPACING_M: f64 = 0.5;

/// A jump farther than this begins another track, m: it is no flight, but another fix or another robot.
const MAX_JUMP_M: f64 = 10_000.0;

/// A point that has a distance to others.
pub trait Spaced: Copy {
    /// The distance to another point, m.
    fn distance_m(self, to: Self) -> f64;
}

impl Spaced for Place {
    fn distance_m(self, to: Place) -> f64 {
        distance_m(self, to)
    }
}

/// Where the robot was, bounded: when it is full, every other point goes and the points lie twice as far apart. It has
/// pieces: where the robot was between them is not known.
#[derive(Clone, Debug)]
pub struct Track<P = Place> {
    points: Vec<P>,
    /// Beside each point: whether it begins a piece.
    begins: Vec<bool>,
    /// Whether the next point begins a piece.
    is_cut: bool,
    most: usize,
    spacing_m: f64,
}

impl Default for Track {
    fn default() -> Self {
        Track::with_room(MAX_POINTS)
    }
}

impl<P: Spaced> Track<P> {
    /// A track of at most `most` points, for more or less than a terminal shows.
    pub fn with_room(most: usize) -> Track<P> {
        Track {
            points: Vec::new(),
            begins: Vec::new(),
            is_cut: true,
            most: most.max(2),
            spacing_m: FIRST_SPACING_M,
        }
    }

    /// Takes the present place.
    pub fn push(&mut self, place: P) {
        if let Some(last) = self.points.last() {
            let distance_m = last.distance_m(place);
            if distance_m > MAX_JUMP_M {
                *self = Track::with_room(self.most);
            } else if distance_m < self.spacing_m && !self.is_cut {
                return;
            }
        }
        if self.points.len() == self.most {
            self.thin();
        }
        self.points.push(place);
        self.begins.push(std::mem::take(&mut self.is_cut));
    }

    /// The next place begins a piece.
    pub fn cut(&mut self) {
        self.is_cut = true;
    }

    /// Drops every other point. A piece whose first point goes begins at the next one.
    fn thin(&mut self) {
        let pairs = self.points.chunks(2).zip(self.begins.chunks(2));
        let mut was_dropped = false;
        let mut kept = Vec::with_capacity(self.most);
        for (points, begins) in pairs {
            kept.push((points[0], begins[0] || was_dropped));
            was_dropped = begins.get(1) == Some(&true);
        }
        self.is_cut |= was_dropped;
        (self.points, self.begins) = kept.into_iter().unzip();
        self.spacing_m *= 2.0;
    }

    /// The points, oldest first.
    pub fn points(&self) -> &[P] {
        &self.points
    }

    /// The pieces, oldest first. None is empty.
    pub fn pieces(&self) -> impl Iterator<Item = &[P]> {
        let begins = self.begins.iter().enumerate();
        let mut begins = begins.filter_map(|(index, begins)| begins.then_some(index));
        let mut from = begins.next();
        std::iter::from_fn(move || {
            let first = from?;
            from = begins.next();
            Some(&self.points[first..from.unwrap_or(self.points.len())])
        })
    }
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

    #[test]
    fn a_move_is_as_long_as_it_was_asked_for_across_the_date_line_too() {
        let from = Place::new(37.0, 179.9999).unwrap();
        let (east_m, north_m) = offset_m(from, moved(from, 50.0, -20.0).unwrap());
        // The sphere of distances is another Earth.
        assert!((east_m - 50.0).abs() < 0.3 && (north_m + 20.0).abs() < 0.12);
        let far = moved(from, 5_000.0, -7_000.0).unwrap();
        let back = origin(far, 5_000.0, -7_000.0).unwrap();
        assert!(distance_m(from, back) < 0.05, "{back:?}");
        let (east_m, north_m) = plane_m(from, far);
        assert!((east_m - 5_000.0).abs() < 1e-6 && (north_m + 7_000.0).abs() < 1e-6);
        assert_eq!(moved(Place::new(90.0, 0.0).unwrap(), 0.0, 50.0), None);
    }

    fn place(north_m: f64) -> Place {
        Place::new(37.0 + north_m / METRES_PER_DEGREE, -6.0).unwrap()
    }

    #[test]
    fn a_long_flight_stays_whole_and_bounded() {
        let mut track = Track::default();
        for tenth in 0..100_000 {
            track.push(place(f64::from(tenth) * 0.1));
        }
        let points = track.points();
        assert!(points.len() <= MAX_POINTS && points.len() > MAX_POINTS / 4);
        assert_eq!(points[0], place(0.0), "its beginning is kept");
        let last = *points.last().unwrap();
        assert!(distance_m(last, place(9_999.9)) < 50.0);
    }

    #[test]
    fn a_robot_that_hovers_adds_nothing_and_a_jump_begins_anew() {
        let mut track = Track::default();
        for _ in 0..10 {
            track.push(place(0.0));
        }
        assert_eq!(track.points().len(), 1);
        track.push(place(20_000.0));
        assert_eq!(track.points(), [place(20_000.0)]);
    }

    #[test]
    fn pieces_stay_apart_however_often_points_go() {
        let mut track = Track::with_room(8);
        assert_eq!(track.pieces().count(), 0);
        for tenth in 0..4 {
            track.push(place(f64::from(tenth)));
        }
        track.cut();
        // A new piece begins where the last one ended, too.
        for metre in [3.0, 4.0, 5.0] {
            track.push(place(metre));
        }
        let lengths: Vec<usize> = track.pieces().map(<[Place]>::len).collect();
        assert_eq!(lengths, [4, 3]);
        for metre in 6..40 {
            track.push(place(f64::from(metre)));
            let ends: Vec<_> = track.pieces().map(|piece| piece[0]).collect();
            assert_eq!(ends.len(), 2, "{metre}");
            assert_eq!(ends[0], place(0.0));
        }
    }
}
