//! [`Route`]: the path under way. Its points go to the DSP one for each grant, verified where the DSP counts them; its
//! waypoints are seen to be reached.
//!
//! **Verified delivery** (requirement D14; `docs/protocol.md` sections 6 and 8.4). Waypoints are never acknowledged.
//! But the DSP counts those that it takes, and bytes keep their order on the line: when the count is read after a
//! waypoint was sent, it shows for certain whether that one arrived. So each waypoint is sent, counted, and sent again
//! if it was lost, before the next one goes. A copy does no harm: the DSP discards a waypoint that equals the one
//! before.
//!
//! | phase | grant | count read |
//! |---|---|---|
//! | asking for the count | nothing | may send; or, without such a port, unverified |
//! | may send | send, then ask → checking | – |
//! | checking | nothing | as before: send again · one more: next · else: failed |
//! | unverified, the error of the question may come | nothing | – |
//! | unverified | send → unverified | – |
//!
//! A DSP without the port reports error 30 for the question, right after a status. The first waypoint waits for it, so
//! that every error 15 or 30 after that is about a waypoint. Without counts no waypoint is sent twice: the first such
//! error ends the path.
//!
//! In the classic profile a late or repeated answer to a read of another port can be taken for the count. A port that
//! does not exist reads 0, so any other value without the bit is none: it is asked for again, three times in a row at
//! most.

use dsp_protocol::downlink::Geographic;
use dsp_protocol::{DspErrorCode, Uplink, Waypoint};
use ipc_types::MonotonicNs;
use ipc_types::code::Reason;
use module_kit::journal::NotASnapshot;
use serde::{Deserialize, Serialize};

use super::arrival::Tracker;
use super::motion::PathStep;
use super::report::{Detail, Verdict};
use super::trajectory::{PassThrough, Trajectory};
use crate::config::ArrivalConfig;
use crate::geodesy::{distance_m, here};
use crate::link::Link;

/// Error 30 so often since a waypoint was first sent means that a DSP that counts refuses it. One may be the answer to
/// a waypoint that was damaged on its way.
const REFUSALS: u32 = 2;

/// So many points are never sent for one path: fifty a second for a day. A snapshot with more is none.
const MAX_ADVANCED: u64 = 50 * 86_400;

/// The trajectory of a route until [`Route::configure`].
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

    /// Sends the next point, if it may go now. Returns whether its arrival is verified, and then the DSP's count is to
    /// be read; `None` if nothing was sent.
    pub(super) fn send(&mut self, now: MonotonicNs, link: &mut Link) -> Option<bool> {
        let point = self.trajectory.peek()?;
        let on_grant = self.verification.on_grant();
        let again = self.verification.is_repetition();
        if on_grant == OnGrant::Wait || !link.waypoint(now, &point.waypoint, again) {
            return None;
        }
        Some(on_grant == OnGrant::SendAndCount)
    }

    /// The point is with the DSP. Those that follow and are the same on the wire are with it too: it would take them
    /// for copies. Returns how many waypoints it has, if these are more than `sent`.
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

    /// An error of the DSP that may be about a waypoint, after `sent` of them. Returns the end of the path if the DSP
    /// does not have a waypoint, or may not have it: what follows would be flown without it.
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

/// The bit that the port of a DSP that counts always has; an unknown port reads 0.
const COUNTS: u16 = 0x8000;

/// Times that one waypoint is sent. With three in ten messages lost in either direction, one waypoint in 10⁶ needs
/// more than this; then the path is reported as failed, which is true as well.
pub const MAX_SENDINGS: u32 = 16;

/// So many values in a row that are neither a count nor 0 mean that the DSP does not count.
const NO_COUNTS: u32 = 3;

/// Statuses after which a DSP that does not count has reported the error of the question, or will not.
const STATUSES: u32 = 2;

/// What to do with the waypoint that flow control asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OnGrant {
    /// Nothing: the DSP's count is awaited.
    Wait,
    /// Send it and read the count.
    SendAndCount,
    /// Send it; whether it arrives cannot be known.
    Send,
}

/// What a count says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Counted {
    /// The first waypoint may be sent.
    Ready,
    /// The value is no count, and may be that of another port: it is to be read again.
    AskAgain,
    /// The DSP does not count: delivery is unverified.
    Unverified,
    /// The waypoint arrived; the next one's turn.
    Arrived,
    /// The waypoint was lost; it is to be sent again.
    Lost,
    /// The count is not what it can be, or the waypoint was lost too often.
    Failed(Reason),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum VerificationPhase {
    Asking,
    MaySend {
        count: u16,
        sendings: u32,
    },
    Checking {
        count: u16,
        sendings: u32,
    },
    Unverified {
        /// Statuses to come before the first waypoint goes.
        awaited: u32,
    },
}

/// Delivery of one path.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Verification {
    phase: VerificationPhase,
    /// Values in a row that were no count.
    no_counts: u32,
}

impl Verification {
    /// A path begins: its count is to be read first.
    pub const fn begin() -> Self {
        Verification {
            phase: VerificationPhase::Asking,
            no_counts: 0,
        }
    }

    /// Flow control grants a waypoint.
    pub fn on_grant(&self) -> OnGrant {
        match self.phase {
            VerificationPhase::Asking
            | VerificationPhase::Checking { .. }
            | VerificationPhase::Unverified { awaited: 1.. } => OnGrant::Wait,
            VerificationPhase::MaySend { .. } => OnGrant::SendAndCount,
            VerificationPhase::Unverified { awaited: 0 } => OnGrant::Send,
        }
    }

    /// Whether it can not be known if waypoints arrive.
    pub fn is_unverified(&self) -> bool {
        matches!(self.phase, VerificationPhase::Unverified { .. })
    }

    /// A status arrived.
    pub fn status_arrived(&mut self) {
        if let VerificationPhase::Unverified { awaited } = &mut self.phase {
            *awaited = awaited.saturating_sub(1);
        }
    }

    /// Error 30 arrived: the answer to the question for a count that the DSP does not have comes before the first
    /// waypoint.
    pub fn question_refused(&mut self) {
        if let VerificationPhase::Unverified { awaited } = &mut self.phase {
            *awaited = 0;
        }
    }

    /// Whether the waypoint to send has been sent before.
    pub fn is_repetition(&self) -> bool {
        matches!(self.phase, VerificationPhase::MaySend { sendings, .. } if sendings > 0)
    }

    /// The waypoint was sent and the count is being read.
    pub fn sent(&mut self) {
        if let VerificationPhase::MaySend { count, sendings } = self.phase {
            self.phase = VerificationPhase::Checking {
                count,
                sendings: sendings + 1,
            };
        }
    }

    /// The DSP's count was read.
    pub fn counted(&mut self, value: u16) -> Counted {
        let counts = value & COUNTS != 0;
        let now = value & !COUNTS;
        let is_of_another_port = !counts && value != 0;
        self.no_counts = if is_of_another_port {
            self.no_counts + 1
        } else {
            0
        };
        let is_awaited = matches!(
            self.phase,
            VerificationPhase::Asking | VerificationPhase::Checking { .. }
        );
        if is_awaited && (1..NO_COUNTS).contains(&self.no_counts) {
            return Counted::AskAgain;
        }
        match self.phase {
            VerificationPhase::Asking if counts => {
                self.phase = VerificationPhase::MaySend {
                    count: now,
                    sendings: 0,
                };
                Counted::Ready
            }
            VerificationPhase::Asking => {
                self.phase = VerificationPhase::Unverified { awaited: STATUSES };
                Counted::Unverified
            }
            VerificationPhase::Checking { count, .. } if counts && now == (count + 1) & !COUNTS => {
                self.phase = VerificationPhase::MaySend {
                    count: now,
                    sendings: 0,
                };
                Counted::Arrived
            }
            VerificationPhase::Checking { count, sendings } if counts && now == count => {
                if sendings == MAX_SENDINGS {
                    return Counted::Failed(Reason::DeliveryFailed);
                }
                self.phase = VerificationPhase::MaySend { count, sendings };
                Counted::Lost
            }
            VerificationPhase::Checking { .. }
            | VerificationPhase::MaySend { .. }
            | VerificationPhase::Unverified { .. } => Counted::Failed(Reason::DeliveryFailed),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FAILED: Counted = Counted::Failed(Reason::DeliveryFailed);

    #[test]
    fn every_phase_and_event() {
        let may_send = |count| VerificationPhase::MaySend { count, sendings: 0 };
        let checking = |count| VerificationPhase::Checking { count, sendings: 1 };
        // Phase, what a grant does, value read, what it says, phase afterwards.
        #[rustfmt::skip]
        let table = [
            (VerificationPhase::Asking, OnGrant::Wait, 0x8005, Counted::Ready, may_send(5)),
            (VerificationPhase::Asking, OnGrant::Wait, 0, Counted::Unverified, VerificationPhase::Unverified { awaited: STATUSES }),
            (
                VerificationPhase::Unverified { awaited: 1 },
                OnGrant::Wait,
                0x8005,
                FAILED,
                VerificationPhase::Unverified { awaited: 1 },
            ),
            (checking(5), OnGrant::Wait, 0x8006, Counted::Arrived, may_send(6)),
            (checking(0x7FFF), OnGrant::Wait, 0x8000, Counted::Arrived, may_send(0)),
            (checking(5), OnGrant::Wait, 0x8005, Counted::Lost, VerificationPhase::MaySend { count: 5, sendings: 1 }),
            (checking(5), OnGrant::Wait, 0x8007, FAILED, checking(5)),
            (checking(5), OnGrant::Wait, 0x8000, FAILED, checking(5)),
            (checking(5), OnGrant::Wait, 6, FAILED, checking(5)),
            (may_send(5), OnGrant::SendAndCount, 0x8005, FAILED, may_send(5)),
            (
                VerificationPhase::Unverified { awaited: 0 },
                OnGrant::Send,
                0x8005,
                FAILED,
                VerificationPhase::Unverified { awaited: 0 },
            ),
        ];
        for (phase, grant, value, counted, after) in table {
            // A value that is no count has come twice before.
            let mut verification = Verification {
                phase,
                no_counts: NO_COUNTS - 1,
            };
            assert_eq!(verification.on_grant(), grant, "{phase:?}");
            assert_eq!(verification.counted(value), counted, "{phase:?} {value:#x}");
            assert_eq!(verification.phase, after, "{phase:?} {value:#x}");
            verification.question_refused();
            let waits = matches!(after, VerificationPhase::Unverified { .. });
            assert_eq!(verification.on_grant() == OnGrant::Send, waits, "{phase:?}");
        }
    }

    #[test]
    fn without_counts_so_many_statuses_come_before_a_waypoint() {
        let phase = VerificationPhase::Unverified { awaited: STATUSES };
        let mut verification = Verification {
            phase,
            no_counts: 0,
        };
        for _ in 0..STATUSES {
            assert_eq!(verification.on_grant(), OnGrant::Wait);
            verification.status_arrived();
        }
        assert_eq!(verification.on_grant(), OnGrant::Send);
    }

    #[test]
    fn the_value_of_another_port_is_not_taken_for_a_dsp_that_does_not_count() {
        let mut verification = Verification::begin();
        assert_eq!(verification.counted(2000), Counted::AskAgain);
        assert_eq!(verification.counted(2000), Counted::AskAgain);
        assert_eq!(verification.counted(0x8005), Counted::Ready);
        verification.sent();
        assert_eq!(verification.counted(1), Counted::AskAgain);
        assert_eq!(verification.counted(0x8006), Counted::Arrived);
    }

    #[test]
    fn a_waypoint_that_is_lost_again_and_again_fails_in_the_end() {
        let mut verification = Verification::begin();
        verification.counted(0x8000);
        for sending in 1..=MAX_SENDINGS {
            assert_eq!(verification.on_grant(), OnGrant::SendAndCount);
            verification.sent();
            let expected = if sending == MAX_SENDINGS {
                FAILED
            } else {
                Counted::Lost
            };
            assert_eq!(verification.counted(0x8000), expected);
        }
    }
}
