//! Arrival: when a path has been flown (requirement D7).
//!
//! The source's test is a box around the last waypoint. Alone it ends a path that returns to its start before it has
//! begun. So the waypoints must be seen in order: one counts as reached when it has been sent, all before it have been
//! reached, and a position lies in its box. When the helicopter was not watched at the moment it passed one (telemetry
//! has gaps), the path still ends: it must have been outside the last box since the path began, and then stay in it for
//! a configured time with everything sent. The report then says fewer waypoints reached than the path has.

use std::time::Duration;

use dsp_protocol::{Waypoint, downlink::Geographic};
use ipc_types::MonotonicNs;
use serde::{Deserialize, Serialize};

use super::assembly::MAX_WAYPOINTS;
use crate::config::Tolerance;

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
    use crate::geodesy::there as at;

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

    const A: fn() -> Waypoint = || waypoint(37.0, -6.0);
    const B: fn() -> Waypoint = || waypoint(37.001, -6.0);
    const C: fn() -> Waypoint = || waypoint(37.001, -6.001);

    /// Flies `positions` one second apart with everything sent; returns after how many of them the path has ended.
    fn fly(path: &[Waypoint], positions: &[Waypoint]) -> Option<usize> {
        let mut tracker = Tracker::new(TOLERANCE, DWELL);
        tracker.begin(&at(&positions[0]), path);
        positions
            .iter()
            .enumerate()
            .position(|(second, point)| {
                let now = MonotonicNs(second as u64 * 1_000_000_000);
                tracker.observe(now, &at(point), path.len())
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
        tracker.begin(&at(&a), &[b, c]);
        for (second, has_ended) in [(5, false), (10, true)] {
            let now = MonotonicNs(second * 1_000_000_000);
            assert_eq!(tracker.observe(now, &at(&c), 2), has_ended, "{second} s");
        }
    }

    #[test]
    fn what_has_not_been_sent_cannot_be_reached() {
        let (b, c) = (B(), C());
        let mut tracker = Tracker::new(TOLERANCE, DWELL);
        tracker.begin(&at(&A()), &[b, c]);
        for second in 0..10 {
            let now = MonotonicNs(second * 1_000_000_000);
            assert!(!tracker.observe(now, &at(&b), 0));
            assert!(!tracker.observe(now, &at(&c), 1));
        }
        assert_eq!(tracker.reached(), 0);
        assert!(!tracker.observe(MonotonicNs(0), &at(&b), 1));
        assert_eq!(tracker.reached(), 1);
        assert!(tracker.observe(MonotonicNs(0), &at(&c), 2));
    }

    #[test]
    fn each_edge_of_the_box_counts() {
        let target = waypoint(37.0, -6.0);
        let mut inside = at(&target);
        inside.latitude_deg += 0.9e-5;
        inside.longitude_deg -= 0.9e-5;
        inside.altitude_m += 0.9;
        assert!(TOLERANCE.holds(&target, &inside));
        for edge in 0..3 {
            let mut outside = at(&target);
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
            &at(&waypoint(0.0, -179.999_998))
        ));
    }
}
