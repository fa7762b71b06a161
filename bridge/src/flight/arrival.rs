//! Arrival: when a path has been flown (requirement D7).
//!
//! The source's test is a box around the last waypoint. Alone it ends a path that returns to its start before it has
//! begun. So the waypoints must be seen in order: one counts as reached when it has been sent, all before it have been
//! reached, and a position lies in its box. When the helicopter was not watched at the moment it passed one (telemetry
//! has gaps), the path still ends: it must have been outside the last box since the path began, and then stay in it for a
//! configured time with everything sent. The report then says fewer waypoints reached than the path has.

use std::time::Duration;

use dsp_protocol::{Waypoint, downlink::Geographic};
use ipc_types::MonotonicNs;
use serde::{Deserialize, Serialize};

use crate::flight::assembly::MAX_WAYPOINTS;

/// Half the edges of the box around a waypoint (`DELTA_DEG`, `DELTA_M`).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tolerance {
    /// Degrees of latitude.
    pub latitude_deg: f64,
    /// Degrees of longitude.
    pub longitude_deg: f64,
    /// Metres of altitude.
    pub altitude_m: f64,
}

impl Tolerance {
    /// Whether `position` lies in the box around `target`. Longitudes are compared across the antimeridian.
    pub fn holds(&self, target: &Waypoint, position: &Geographic) -> bool {
        (target.latitude_deg - position.latitude_deg).abs() <= self.latitude_deg
            && longitude_difference_deg(target.longitude_deg, position.longitude_deg).abs()
                <= self.longitude_deg
            && (target.altitude_m - position.altitude_m).abs() <= self.altitude_m
    }
}

/// `a − b` the short way round, −180 … 180 degrees.
pub fn longitude_difference_deg(a: f64, b: f64) -> f64 {
    (a - b + 540.0).rem_euclid(360.0) - 180.0
}

/// Metres along the ground between two points, on a sphere with the Earth's mean radius. Good to 0.6 %, which is enough
/// to refuse what is absurdly far and to show progress.
pub fn ground_distance_m(a: &Geographic, b: &Waypoint) -> f64 {
    const EARTH_RADIUS_M: f64 = 6_371_008.8;
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

/// Metres between two waypoints, along the ground and up or down.
pub fn distance_m(a: &Waypoint, b: &Waypoint) -> f64 {
    let from = Geographic {
        latitude_deg: a.latitude_deg,
        longitude_deg: a.longitude_deg,
        altitude_m: a.altitude_m,
    };
    ground_distance_m(&from, b).hypot(a.altitude_m - b.altitude_m)
}

/// Watches one path being flown.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Tracker {
    #[serde(skip)]
    tolerance: Tolerance,
    #[serde(skip)]
    dwell: Duration,
    path: Vec<Waypoint>,
    reached: usize,
    left_last_box: bool,
    in_last_box_since: Option<MonotonicNs>,
}

impl Tracker {
    /// Nothing to watch. All memory that watching will ever need is taken here.
    pub fn new(tolerance: Tolerance, dwell: Duration) -> Self {
        Tracker {
            tolerance,
            dwell,
            path: Vec::with_capacity(MAX_WAYPOINTS),
            reached: 0,
            left_last_box: false,
            in_last_box_since: None,
        }
    }

    /// Takes over what the configuration says, after a snapshot.
    pub fn configure(&mut self, tolerance: Tolerance, dwell: Duration) {
        (self.tolerance, self.dwell) = (tolerance, dwell);
    }

    /// Begins a path at the position `start`.
    pub fn begin(&mut self, start: &Geographic, path: &[Waypoint]) {
        self.path.clear();
        self.path.extend_from_slice(path);
        self.reached = 0;
        // With a status every few seconds, the next position may be one in the last box already.
        self.left_last_box = path
            .last()
            .is_some_and(|last| !self.tolerance.holds(last, start));
        self.in_last_box_since = None;
    }

    /// Waypoints seen to be reached, in order.
    pub fn reached(&self) -> usize {
        self.reached
    }

    /// All waypoints.
    pub fn path(&self) -> &[Waypoint] {
        &self.path
    }

    /// The waypoints that have not been reached.
    pub fn ahead(&self) -> &[Waypoint] {
        self.path.get(self.reached..).unwrap_or_default()
    }

    /// The last waypoint, the target of the path.
    pub fn target(&self) -> Option<&Waypoint> {
        self.path.last()
    }

    /// Whether `position` lies in the box of the last waypoint.
    pub fn is_at_end(&self, position: &Geographic) -> bool {
        self.target()
            .is_none_or(|last| self.tolerance.holds(last, position))
    }

    /// Takes a position while `sent` waypoints have gone to the DSP. Returns whether the path has been flown.
    pub fn observe(&mut self, now: MonotonicNs, position: &Geographic, sent: usize) -> bool {
        while self.reached < sent.min(self.path.len())
            && self.tolerance.holds(&self.path[self.reached], position)
        {
            self.reached += 1;
        }
        if self.reached == self.path.len() {
            return true;
        }
        if !self.is_at_end(position) {
            self.left_last_box = true;
            self.in_last_box_since = None;
            return false;
        }
        let since = *self.in_last_box_since.get_or_insert(now);
        sent == self.path.len() && self.left_last_box && now.since(since) >= self.dwell
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOLERANCE: Tolerance = Tolerance {
        latitude_deg: 1e-5,
        longitude_deg: 1e-5,
        altitude_m: 1.0,
    };
    const DWELL: Duration = Duration::from_secs(3);

    fn waypoint(latitude_deg: f64, longitude_deg: f64) -> Waypoint {
        Waypoint {
            latitude_deg,
            longitude_deg,
            altitude_m: 10.0,
        }
    }

    fn at(point: Waypoint) -> Geographic {
        Geographic {
            latitude_deg: point.latitude_deg,
            longitude_deg: point.longitude_deg,
            altitude_m: point.altitude_m,
        }
    }

    const A: fn() -> Waypoint = || waypoint(37.0, -6.0);
    const B: fn() -> Waypoint = || waypoint(37.001, -6.0);
    const C: fn() -> Waypoint = || waypoint(37.001, -6.001);

    /// Flies `positions` one second apart with everything sent; returns after how many of them the path has ended.
    fn fly(path: &[Waypoint], positions: &[Waypoint]) -> Option<usize> {
        let mut tracker = Tracker::new(TOLERANCE, DWELL);
        tracker.begin(&at(positions[0]), path);
        positions
            .iter()
            .enumerate()
            .position(|(second, point)| {
                let now = MonotonicNs(second as u64 * 1_000_000_000);
                tracker.observe(now, &at(*point), path.len())
            })
            .map(|index| index + 1)
    }

    #[test]
    fn a_path_ends_in_the_box_of_its_last_waypoint() {
        let (a, b, c) = (A(), B(), C());
        assert_eq!(fly(&[b], &[a, b]), Some(2));
        assert_eq!(
            fly(&[a], &[a]),
            Some(1),
            "a single waypoint on the spot ends at once"
        );
        assert_eq!(fly(&[b, c], &[a, b, a, c]), Some(4));
    }

    #[test]
    fn a_path_that_ends_where_it_starts_does_not_end_at_once() {
        let (a, b, c) = (A(), B(), C());
        assert_eq!(fly(&[b, c, a], &[a, a, a, a, a, a, b, c, a]), Some(9));
        assert_eq!(fly(&[b, a, c, a], &[a, b, a, a, c, a]), Some(6));
    }

    #[test]
    fn an_unseen_waypoint_does_not_hang_the_path() {
        let (a, b, c) = (A(), B(), C());
        assert_eq!(
            fly(&[b, c], &[a, c, c, c, c]),
            Some(5),
            "three seconds in the last box"
        );
        assert_eq!(fly(&[b, c, a], &[a, a, a, a, a, a]), None, "it never left");
    }

    #[test]
    fn a_path_ends_although_no_position_between_its_start_and_its_end_was_seen() {
        let (a, b, c) = (A(), B(), C());
        let mut tracker = Tracker::new(TOLERANCE, DWELL);
        tracker.begin(&at(a), &[b, c]);
        for (second, has_ended) in [(5, false), (10, true)] {
            let now = MonotonicNs(second * 1_000_000_000);
            assert_eq!(tracker.observe(now, &at(c), 2), has_ended, "{second} s");
        }
    }

    #[test]
    fn what_has_not_been_sent_cannot_be_reached() {
        let (b, c) = (B(), C());
        let mut tracker = Tracker::new(TOLERANCE, DWELL);
        tracker.begin(&at(A()), &[b, c]);
        for second in 0..10 {
            let now = MonotonicNs(second * 1_000_000_000);
            assert!(!tracker.observe(now, &at(b), 0));
            assert!(!tracker.observe(now, &at(c), 1));
        }
        assert_eq!(tracker.reached(), 0);
        assert!(!tracker.observe(MonotonicNs(0), &at(b), 1));
        assert_eq!(tracker.reached(), 1);
        assert!(tracker.observe(MonotonicNs(0), &at(c), 2));
    }

    #[test]
    fn each_edge_of_the_box_counts() {
        let target = waypoint(37.0, -6.0);
        let mut inside = at(target);
        inside.latitude_deg += 0.9e-5;
        inside.longitude_deg -= 0.9e-5;
        inside.altitude_m += 0.9;
        assert!(TOLERANCE.holds(&target, &inside));
        for edge in 0..3 {
            let mut outside = at(target);
            match edge {
                0 => outside.latitude_deg += 1.1e-5,
                1 => outside.longitude_deg += 1.1e-5,
                _ => outside.altitude_m -= 1.1,
            }
            assert!(!TOLERANCE.holds(&target, &outside), "edge {edge}");
        }
    }

    #[test]
    fn the_antimeridian_is_no_edge() {
        assert!(TOLERANCE.holds(
            &waypoint(0.0, 179.999_998),
            &at(waypoint(0.0, -179.999_998))
        ));
        assert!((longitude_difference_deg(179.5, -179.5) + 1.0).abs() < 1e-9);
        assert!((longitude_difference_deg(-179.5, 179.5) - 1.0).abs() < 1e-9);
        let metres = ground_distance_m(&at(waypoint(0.0, 179.5)), &waypoint(0.0, -179.5));
        assert!((metres - 111_195.0).abs() < 1.0, "{metres}");
    }
}
