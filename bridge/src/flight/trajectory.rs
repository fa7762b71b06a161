//! Between the waypoint path and the DSP: where a trajectory generator goes (requirement D12).
//!
//! Whoever wants points between the waypoints implements [`Trajectory`] and hands it to
//! [`Bridge::with_trajectory`](crate::Bridge::with_trajectory). Nothing else changes: flow control, arrival and reports
//! work on what it gives.

use dsp_protocol::{Waypoint, downlink::Geographic};

use crate::flight::path::MAX_WAYPOINTS;

/// One point for the DSP.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrajectoryPoint {
    /// Where to fly.
    pub waypoint: Waypoint,
    /// The waypoint of the path, counted from 0, that this point is; nothing for a point in between.
    pub path_index: Option<usize>,
}

/// Turns a path into the points that go to the DSP, one for each grant of flow control.
pub trait Trajectory {
    /// Begins a path of at most [`MAX_WAYPOINTS`] waypoints that the helicopter flies from `start`. Forgets what is left
    /// of the one before.
    fn begin(&mut self, start: Geographic, path: &[Waypoint]);

    /// The point to send next; nothing when all have been given. The last point must be the path's last waypoint.
    fn peek(&self) -> Option<TrajectoryPoint>;

    /// The point of [`Trajectory::peek`] was sent.
    fn advance(&mut self);

    /// Forgets what is left.
    fn clear(&mut self);
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
