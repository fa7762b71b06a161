//! [`Route`]: the path under way.

use dsp_protocol::Waypoint;
use dsp_protocol::downlink::Geographic;
use serde::{Deserialize, Serialize};

use super::arrival::{Tracker, distance_m, here};
use super::trajectory::{PassThrough, Trajectory};
use super::verification::Verification;
use crate::config::ArrivalConfig;

/// The bytes are no snapshot of this version's core.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("these bytes are no snapshot of a bridge of this version")]
pub struct NotASnapshot;

/// So many points are never sent for one path: fifty a second for a day. A snapshot with more is none.
const MAX_ADVANCED: u64 = 50 * 86_400;

/// What stands in a route until [`Route::configure`].
fn no_trajectory() -> Box<dyn Trajectory> {
    Box::new(PassThrough::default())
}

/// The path under way. It keeps its memory from path to path.
#[derive(Debug, Serialize, Deserialize)]
pub struct Route {
    /// A snapshot does not have it, but what it was given: `start`, the path of `tracker`, and `advanced`.
    #[serde(skip, default = "no_trajectory")]
    pub(super) trajectory: Box<dyn Trajectory>,
    /// Where the helicopter was when the generator began; `None` if it has nothing left.
    start: Option<Geographic>,
    /// Points of the generator that were sent.
    pub(super) advanced: u64,
    pub(super) verification: Verification,
    pub(super) tracker: Tracker,
    /// Errors 30 since the present point was first sent.
    pub(super) refusals: u32,
}

impl Route {
    /// No path. All memory that paths will ever need is taken here.
    pub fn new(arrival: &ArrivalConfig, trajectory: Box<dyn Trajectory>) -> Self {
        Route {
            trajectory,
            start: None,
            advanced: 0,
            verification: Verification::begin(),
            tracker: Tracker::new(arrival.tolerance(), arrival.dwell()),
            refusals: 0,
        }
    }

    /// A path that begins at `position`.
    pub fn begin(&mut self, position: Geographic, path: &[Waypoint]) {
        self.trajectory.begin(position, path);
        self.start = Some(position);
        self.advanced = 0;
        self.tracker.begin(&position, path);
        self.verification = Verification::begin();
        self.refusals = 0;
    }

    /// Nothing more goes to the DSP.
    pub fn clear(&mut self) {
        self.trajectory.clear();
        self.start = None;
        self.advanced = 0;
    }

    /// After a snapshot: takes over what the configuration says, and brings `trajectory` to where the one before was.
    ///
    /// # Errors
    /// More points were sent than a flight can have.
    pub(super) fn configure(
        &mut self,
        arrival: &ArrivalConfig,
        mut trajectory: Box<dyn Trajectory>,
    ) -> Result<(), NotASnapshot> {
        if self.advanced > MAX_ADVANCED {
            return Err(NotASnapshot);
        }
        self.tracker.configure(arrival.tolerance(), arrival.dwell());
        if let Some(start) = self.start {
            trajectory.begin(start, self.tracker.path());
            (0..self.advanced).for_each(|_| trajectory.advance());
        }
        self.trajectory = trajectory;
        Ok(())
    }

    /// The last waypoint.
    pub fn target(&self) -> Option<&Waypoint> {
        self.tracker.target()
    }

    /// The waypoints that have not been reached.
    pub fn ahead(&self) -> &[Waypoint] {
        self.tracker.ahead()
    }

    /// How long the path is from `start`, along the ground and up and down, m.
    pub(super) fn length_m(&self, start: &Geographic) -> f64 {
        let mut from = here(start);
        let mut length_m = 0.0;
        for waypoint in self.tracker.path() {
            length_m += distance_m(&from, waypoint);
            from = *waypoint;
        }
        length_m
    }
}
