//! Between the waypoint path and the DSP: where a trajectory generator goes (requirements D12, G4).
//!
//! A generator is one implementation of [`Trajectory`] and one line in [`generator`]; `[trajectory]` of `bridge.toml`
//! chooses it. Flow control, arrival and reports work on what it gives.

mod divide_legs;
mod interface;

use dsp_protocol::{Waypoint, downlink::Geographic};

use crate::config::{TrajectoryConfig, TrajectoryKind};
use crate::flight::assembly::MAX_WAYPOINTS;
pub use divide_legs::DivideLegs;
pub use interface::{Trajectory, TrajectoryPoint};

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
