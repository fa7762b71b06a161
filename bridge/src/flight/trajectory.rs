//! Between the waypoint path and the DSP: where a trajectory generator goes (requirements D12, G4).
//!
//! A generator is one implementation of [`Trajectory`] and one line in [`generator`]; `[trajectory]` of `bridge.toml`
//! chooses it. Flow control, arrival and reports work on what it gives.

mod divide_legs;

use dsp_protocol::{Waypoint, downlink::Geographic};

use crate::config::{TrajectoryConfig, TrajectoryKind};
use crate::flight::assembly::MAX_WAYPOINTS;
pub use divide_legs::DivideLegs;

/// One point for the DSP.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrajectoryPoint {
    /// Where to fly.
    pub waypoint: Waypoint,
    /// The waypoint of the path, counted from 0, that this point is; nothing for a point in between.
    pub path_index: Option<usize>,
}

/// Turns a path into the points that go to the DSP, one for each grant of flow control.
pub trait Trajectory: std::fmt::Debug {
    /// Begins a path of at most [`MAX_WAYPOINTS`] waypoints that the helicopter flies from `start`. Forgets what is left
    /// of the one before.
    fn begin(&mut self, start: Geographic, path: &[Waypoint]);

    /// The point to send next; nothing when all have been given. The last point must be the path's last waypoint, and all
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
