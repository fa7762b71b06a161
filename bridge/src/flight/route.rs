//! [`Route`]: the path under way. Its points go to the DSP one for each grant, verified where the DSP counts them; its waypoints are
//! seen to be reached.

use dsp_protocol::downlink::Geographic;
use dsp_protocol::{DspErrorCode, Uplink, Waypoint};
use ipc_types::MonotonicNs;
use ipc_types::code::Reason;
use serde::{Deserialize, Serialize};

use super::arrival::Tracker;
use super::motion::PathStep;
use super::report::{Detail, Verdict};
use super::trajectory::{PassThrough, Trajectory};
use super::verification::{OnGrant, Verification};
use crate::config::ArrivalConfig;
use crate::geodesy::{distance_m, here};
use crate::link::Link;

/// Error 30 so often since a waypoint was first sent means that a DSP that counts refuses it. One may be the answer to a waypoint
/// that was damaged on its way.
const REFUSALS: u32 = 2;

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

    /// Whether all points have gone to the DSP.
    pub(super) fn is_sent(&self) -> bool {
        self.trajectory.peek().is_none()
    }

    /// Sends the next point, if it may go now. Returns whether its arrival is verified, and then the DSP's count is to be read; `None`
    /// if nothing was sent.
    pub(super) fn send(&mut self, now: MonotonicNs, link: &mut Link) -> Option<bool> {
        let point = self.trajectory.peek()?;
        let on_grant = self.verification.on_grant();
        let again = self.verification.is_repetition();
        if on_grant == OnGrant::Wait || !link.waypoint(now, &point.waypoint, again) {
            return None;
        }
        Some(on_grant == OnGrant::SendAndCount)
    }

    /// The point is with the DSP. Those that follow and are the same on the wire are with it too: it would take them for copies.
    /// Returns how many waypoints it has, if these are more than `sent`.
    pub(super) fn advance(&mut self, sent: u32) -> Option<u32> {
        let wire = |waypoint| Uplink::Waypoint(waypoint).encode();
        let arrived = wire(self.trajectory.peek()?.waypoint);
        let mut now_sent = sent;
        while let Some(point) = self.trajectory.peek()
            && wire(point.waypoint) == arrived
        {
            if let Some(index) = point.path_index {
                now_sent = index as u32 + 1;
            }
            self.trajectory.advance();
            self.advanced += 1;
        }
        (now_sent != sent).then_some(now_sent)
    }

    /// An error of the DSP that may be about a waypoint, after `sent` of them. Returns the end of the path if the DSP does not have a
    /// waypoint, or may not have it: what follows would be flown without it.
    pub(super) fn dsp_error(
        &mut self,
        code: DspErrorCode,
        step: PathStep,
        sent: u32,
    ) -> Option<Verdict> {
        let is_refusal = code == DspErrorCode::INVALID_COMMAND;
        if self.verification.is_unverified() {
            if step.has_begun() {
                return Some(missing(sent, code));
            }
            if is_refusal {
                self.verification.question_refused();
            }
            return None;
        }
        // Otherwise the count says what has become of the waypoint.
        if !is_refusal || step != PathStep::Flying || self.is_sent() {
            return None;
        }
        self.refusals += 1;
        (self.refusals == REFUSALS).then(|| missing(sent + 1, code))
    }
}

/// The DSP does not have this waypoint.
fn missing(waypoint: u32, code: DspErrorCode) -> Verdict {
    let reason = match code {
        DspErrorCode::INVALID_COMMAND | DspErrorCode::UART_QUEUE_FULL => Reason::RefusedByDsp,
        _ => Reason::DeliveryFailed,
    };
    Verdict::aborted(reason).about(Detail {
        waypoint,
        dsp_error: Some(code),
        ..Detail::default()
    })
}
