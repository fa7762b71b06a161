//! [`Track`]: where the robot was, bounded: when it is full, every other point goes and the points lie twice as far apart.

use crate::geo::{Place, distance_m};

/// Most points of a track. At the first spacing that is 256 m of flight, and twice as much after each thinning.
pub const MAX_POINTS: usize = 512;

/// Distance between points at first, m: half of what counts as reached at a waypoint.
const FIRST_SPACING_M: f64 = 0.5;

/// A jump farther than this begins another track, m: it is no flight, but another fix or another robot.
const MAX_JUMP_M: f64 = 10_000.0;

/// See the module's documentation.
#[derive(Clone, Debug)]
pub struct Track {
    points: Vec<Place>,
    most: usize,
    spacing_m: f64,
}

impl Default for Track {
    fn default() -> Self {
        Track::with_room(MAX_POINTS)
    }
}

impl Track {
    /// A track of at most `most` points, for more than a terminal shows.
    pub fn with_room(most: usize) -> Track {
        Track {
            points: Vec::new(),
            most: most.max(2),
            spacing_m: FIRST_SPACING_M,
        }
    }

    /// Takes the present place.
    pub fn push(&mut self, place: Place) {
        if let Some(last) = self.points.last() {
            let distance_m = distance_m(*last, place);
            if distance_m > MAX_JUMP_M {
                *self = Track::with_room(self.most);
            } else if distance_m < self.spacing_m {
                return;
            }
        }
        if self.points.len() == self.most {
            let mut index = 0;
            self.points.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.spacing_m *= 2.0;
        }
        self.points.push(place);
    }

    /// The points, oldest first.
    pub fn points(&self) -> &[Place] {
        &self.points
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geo::METRES_PER_DEGREE;

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
}
