//! Between the waypoint path and the DSP: where a trajectory generator goes (requirements D12, G4).
//!
//! A generator is one implementation of [`Trajectory`] and one line in [`generator`]; `[trajectory]` of `bridge.toml`
//! chooses it. Flow control, arrival and reports work on what it gives.

use dsp_protocol::{Waypoint, downlink::Geographic};

use crate::config::{TrajectoryConfig, TrajectoryKind};
use crate::flight::assembly::MAX_WAYPOINTS;
use crate::geodesy::{distance_m, here, longitude_difference_deg};

/// One point for the DSP.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrajectoryPoint {
    /// Where to fly.
    pub waypoint: Waypoint,
    /// The waypoint of the path, counted from 0, that this point is; `None` for a point in between.
    pub path_index: Option<usize>,
}

/// Turns a path into the points that go to the DSP, one for each grant of flow control.
pub trait Trajectory: std::fmt::Debug {
    /// Begins a path of at most [`MAX_WAYPOINTS`] waypoints that the helicopter flies from `start`. Forgets what is
    /// left of the one before.
    fn begin(&mut self, start: Geographic, path: &[Waypoint]);

    /// The point to send next; `None` if all have been given. The last point must be the path's last waypoint, and all
    /// points must lie on the legs of the path, which are what the geofence was checked for.
    fn peek(&self) -> Option<TrajectoryPoint>;

    /// The point of [`Trajectory::peek`] was sent.
    fn advance(&mut self);

    /// Forgets what is left.
    fn clear(&mut self);
}

/// The generator that the configuration chooses.
pub fn generator(config: &TrajectoryConfig) -> Box<dyn Trajectory> {
    match config.kind {
        TrajectoryKind::PassThrough => Box::new(PassThrough::new()),
        TrajectoryKind::DivideLegs => Box::new(DivideLegs::new(config.spacing_m)),
    }
}

/// The bridge as it is: the waypoints themselves.
#[derive(Clone, Debug)]
pub struct PassThrough {
    path: Vec<Waypoint>,
    next: usize,
}

impl PassThrough {
    /// No path.
    pub fn new() -> Self {
        PassThrough {
            path: Vec::with_capacity(MAX_WAYPOINTS),
            next: 0,
        }
    }
}

impl Default for PassThrough {
    fn default() -> Self {
        PassThrough::new()
    }
}

impl Trajectory for PassThrough {
    fn begin(&mut self, _start: Geographic, path: &[Waypoint]) {
        self.clear();
        self.path.extend_from_slice(path);
    }

    fn peek(&self) -> Option<TrajectoryPoint> {
        self.path.get(self.next).map(|waypoint| TrajectoryPoint {
            waypoint: *waypoint,
            path_index: Some(self.next),
        })
    }

    fn advance(&mut self) {
        self.next += 1;
    }

    fn clear(&mut self) {
        self.path.clear();
        self.next = 0;
    }
}

/// Points between the waypoints: divides each leg into equal parts, so that none is longer than a given distance. The
/// points are made one by one, so that a path of any length needs no more memory.
#[derive(Clone, Debug)]
pub struct DivideLegs {
    spacing_m: f64,
    path: Vec<Waypoint>,
    /// Where the present leg begins.
    from: Waypoint,
    /// The leg's end, as an index of the path.
    leg: usize,
    /// The part of the leg whose end comes next, counted from 1, of so many.
    part: u32,
    parts: u32,
}

impl DivideLegs {
    /// No path; parts of legs will be no longer than `spacing_m`, which is greater than 0.
    pub fn new(spacing_m: f64) -> Self {
        DivideLegs {
            spacing_m,
            path: Vec::with_capacity(MAX_WAYPOINTS),
            from: Waypoint::default(),
            leg: 0,
            part: 1,
            parts: 1,
        }
    }

    fn begin_leg(&mut self, from: Waypoint, leg: usize) {
        self.from = from;
        self.leg = leg;
        self.part = 1;
        let length_m = self.path.get(leg).map_or(0.0, |to| distance_m(&from, to));
        // A leg of zero length has one part, its end. The cast stops at the greatest number of parts.
        self.parts = ((length_m / self.spacing_m).ceil() as u32).max(1);
    }
}

impl Trajectory for DivideLegs {
    fn begin(&mut self, start: Geographic, path: &[Waypoint]) {
        self.clear();
        self.path.extend_from_slice(path);
        self.begin_leg(here(&start), 0);
    }

    fn peek(&self) -> Option<TrajectoryPoint> {
        let to = *self.path.get(self.leg)?;
        if self.part >= self.parts {
            return Some(TrajectoryPoint {
                waypoint: to,
                path_index: Some(self.leg),
            });
        }
        let share = f64::from(self.part) / f64::from(self.parts);
        let from = self.from;
        let east_deg = longitude_difference_deg(to.longitude_deg, from.longitude_deg);
        let longitude_deg = from.longitude_deg + share * east_deg;
        Some(TrajectoryPoint {
            waypoint: Waypoint {
                latitude_deg: from.latitude_deg + share * (to.latitude_deg - from.latitude_deg),
                longitude_deg: longitude_difference_deg(longitude_deg, 0.0),
                altitude_m: from.altitude_m + share * (to.altitude_m - from.altitude_m),
            },
            path_index: None,
        })
    }

    fn advance(&mut self) {
        if self.part < self.parts {
            self.part += 1;
        } else if let Some(reached) = self.path.get(self.leg).copied() {
            self.begin_leg(reached, self.leg + 1);
        }
    }

    fn clear(&mut self) {
        self.path.clear();
        self.leg = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geodesy::there;

    fn waypoint(latitude_deg: f64, longitude_deg: f64, altitude_m: f64) -> Waypoint {
        Waypoint {
            latitude_deg,
            longitude_deg,
            altitude_m,
        }
    }

    fn points(spacing_m: f64, start: Waypoint, path: &[Waypoint]) -> Vec<TrajectoryPoint> {
        let mut trajectory = DivideLegs::new(spacing_m);
        trajectory.begin(there(&start), path);
        let mut points = vec![];
        while let Some(point) = trajectory.peek() {
            points.push(point);
            trajectory.advance();
        }
        points
    }

    #[test]
    fn legs_are_divided_evenly_and_every_waypoint_is_a_point() {
        let start = waypoint(37.0, -6.0, 10.0);
        // 111.2 m to the north, then 30 m up.
        let path = [waypoint(37.001, -6.0, 10.0), waypoint(37.001, -6.0, 40.0)];
        let points = points(25.0, start, &path);
        assert_eq!(points.len(), 5 + 2);
        let own: Vec<_> = points.iter().filter_map(|point| point.path_index).collect();
        assert_eq!(own, [0, 1]);
        assert_eq!(points[4].waypoint, path[0]);
        assert_eq!(points[6].waypoint, path[1]);
        let mut from = start;
        for point in &points {
            assert!(distance_m(&from, &point.waypoint) <= 25.0 + 1e-6);
            from = point.waypoint;
        }
        assert!((points[5].waypoint.altitude_m - 25.0).abs() < 1e-9);
    }

    #[test]
    fn short_legs_and_legs_of_no_length_stay_as_they_are() {
        let start = waypoint(37.0, -6.0, 10.0);
        let path = [start, start, waypoint(37.000_01, -6.0, 10.0)];
        let points = points(25.0, start, &path);
        let given: Vec<_> = points.iter().map(|point| point.waypoint).collect();
        assert_eq!(given, path);
    }

    #[test]
    fn the_antimeridian_is_crossed_the_short_way() {
        let points = points(
            5000.0,
            waypoint(0.0, 179.95, 0.0),
            &[waypoint(0.0, -179.95, 0.0)],
        );
        assert!(points.len() < 5);
        for point in points {
            assert!(point.waypoint.longitude_deg.abs() >= 179.9);
            assert!(point.waypoint.longitude_deg.abs() <= 180.0);
        }
    }
}
