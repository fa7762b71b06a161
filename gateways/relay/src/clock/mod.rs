//! What the other machine's monotonic clock shows, and how surely.
//!
//! Two machines have two `CLOCK_MONOTONIC`s. Each counts from its own boot, and each runs a little too fast or too
//! slow. The station side asks the robot for the time and gets four time stamps per *exchange*, two of each clock:
//!
//! ```text
//!  robot's clock    ───────── remote_received ──── remote_sent ────────────►
//!                            ╱                                ╲
//!                   request ╱                                  ╲ reply
//!                          ╱                                    ╲
//!  station's clock  ──── sent ─────────────────────────────── received ────►
//! ```
//!
//! The *offset* is what the robot's clock shows more than the station's. How long a message was under way is unknown,
//! but no message arrives before it was sent. So each exchange yields two bounds that hold with certainty, for any
//! delays:
//!
//! * when the request was sent, the offset was at most `remote_received − sent` (the *ceiling*);
//! * when the reply was received, the offset was at least `remote_sent − received` (the *floor*).
//!
//! The quicker a message was, the tighter its bound is. [`Clock`] keeps the tightest bounds of the last minutes, moves
//! them to the present, and intersects them. A ceiling and a later floor also bound how fast the offset changes (the
//! *drift*), and a known drift lets old bounds be moved without widening them much. The estimate is the middle of the
//! remaining interval; the uncertainty is half its width. Without exchanges the uncertainty grows by what the drift can
//! be.
//!
//! # What is assumed
//!
//! The true offset lies within the shown uncertainty as long as [`MAX_DRIFT_PPB`], [`MAX_DRIFT_CHANGE_PPB_PER_S`] and
//! [`DRIFT_JITTER_PPB`] bound the drift. Free-running quartz clocks, and clocks which NTP keeps in step, obey them. An
//! NTP daemon that slews a clock after a step of the wall clock does not: it changes the rate of `CLOCK_MONOTONIC` by
//! up to some percent.
//!
//! # When an offset jumps
//!
//! A reboot or a suspend of either machine makes the offset jump. `CLOCK_MONOTONIC` stands still during a suspend.
//! Until the next exchange the station cannot know of a jump at the robot; a relay that was restarted there exchanges
//! nothing until the station takes it for the robot's, and for no other robot's with the same number. That exchange
//! contradicts the bounds so far, or shows another [`Suspended`] time; the estimate then begins anew, from that
//! exchange alone, and [`Clock::resets`] counts it. A jump that is smaller than the uncertainty contradicts nothing,
//! and the offset may then lie outside of the shown interval, by no more than the jump. Six exchanges in a row show
//! it, when it is more than 5 ms and twice what their round trips are longer than the shortest one: see `step`.
//! Another one stays unnoticed until bounds contradict those from before it.
//!
//! Suspended time is only compared, never added: many kernels measure it with a real-time clock of whole seconds.

mod exchange;
mod feasible;
mod step;
#[cfg(test)]
mod tests;

use ipc_types::MonotonicNs;

pub use exchange::{
    DRIFT_JITTER_PPB, Exchange, MAX_DRIFT_CHANGE_PPB_PER_S, MAX_DRIFT_PPB, MAX_ROUND_TRIP_NS,
    MAX_STAMP_NS, Rejected, RemoteNs, SUSPENDED_TOLERANCE_NS, Suspended,
};
use feasible::{Feasible, Window};
pub use feasible::{SLOT_NS, SLOTS};
use step::ClockSteps;

/// How often [`Clock::to_local`] corrects its first guess. Each correction divides the error by 1 / [`MAX_DRIFT_PPB`] =
/// 5000, and 5000⁶ is more than 2⁶⁴ ns.
const CORRECTIONS: usize = 6;

/// The offset at one moment of the local clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Estimate {
    /// Remote clock minus local clock, in ns.
    pub offset_ns: i64,
    /// The true offset differs from `offset_ns` by at most this many ns. It also bounds the error of
    /// [`Clock::to_remote`] at that moment, and of [`Clock::to_local`] when it yields that moment.
    pub uncertainty_ns: u64,
    /// By how many ns per second the remote clock gains on the local one; negative if it loses.
    pub drift_ppb: i64,
    /// The true drift differs from `drift_ppb` by at most this many ns per second, short-term jitter included.
    pub drift_uncertainty_ppb: u64,
    /// The shortest round trip of the last minute with exchanges, in ns.
    pub round_trip_ns: u64,
}

/// Estimates the offset of one remote machine's clock from exchanges of time stamps.
#[derive(Clone, Debug, Default)]
pub struct Clock {
    known: Option<Observations>,
    /// Exchanges that were sent earlier may belong to the time before a jump.
    not_before: MonotonicNs,
    resets: u64,
}

/// What the exchanges since the last jump have shown.
#[derive(Clone, Debug)]
struct Observations {
    feasible: Feasible,
    window: Window,
    steps: ClockSteps,
    /// The suspended times of the first exchange. Later ones are compared with it, so that reading errors do not add
    /// up.
    suspended: Suspended,
}

impl Clock {
    /// A clock that knows nothing yet.
    pub fn new() -> Clock {
        Clock::default()
    }

    /// Learns from an exchange. One that shows that the offset has jumped is all that is known then, and counts as a
    /// [reset](Clock::resets).
    ///
    /// The exchanges may come in any order, and one may come twice. Any time stamps of the remote machine are safe to
    /// pass.
    ///
    /// # Errors
    ///
    /// [`Rejected`] says why nothing can be learned from this exchange. A suspend of the local machine between its two
    /// local stamps has made the offset jump: it discards the estimate as well. So does a reply to a request from
    /// before the last jump that shows another suspend of the remote machine.
    pub fn take(&mut self, exchange: &Exchange) -> Result<(), Rejected> {
        if exchange.sent < self.not_before {
            // Its stamps say nothing, and its reply is newer than what is known.
            if self.was_remote_suspended(exchange) {
                self.reset(exchange.received);
            }
            return Err(Rejected::Superseded);
        }
        let plausible = exchange.check();
        if plausible == Err(Rejected::SuspendedMeanwhile) && self.has_suspended(exchange) {
            self.reset(exchange.received);
        }
        plausible?;
        if !self.learn(exchange) {
            self.reset(exchange.received);
        }
        if self.known.is_none() {
            self.known = Some(Observations {
                feasible: Feasible::from_exchange(exchange),
                window: Window::new(exchange),
                steps: ClockSteps::default(),
                suspended: exchange.suspended,
            });
        }
        Ok(())
    }

    /// Adds `exchange` to what is known; false if it contradicts that.
    fn learn(&mut self, exchange: &Exchange) -> bool {
        if self.has_suspended(exchange) {
            return false;
        }
        let Some(known) = &mut self.known else {
            return true;
        };
        known.steps.add(exchange, &known.feasible);
        if known.steps.show_one(known.window.shortest_of_all_ns()) {
            return false;
        }
        let Some(feasible) = known.feasible.with(exchange, &known.window) else {
            return false;
        };
        known.feasible = feasible;
        known.window.insert(exchange, feasible.drift_ppb());
        true
    }

    /// Either machine has been suspended since the first exchange of what is known.
    fn has_suspended(&self, exchange: &Exchange) -> bool {
        self.known
            .as_ref()
            .is_some_and(|known| exchange.suspended.differs_from(&known.suspended))
    }

    /// The remote machine has been suspended for longer than at the first exchange of what is known.
    fn was_remote_suspended(&self, exchange: &Exchange) -> bool {
        let known = self.known.as_ref().map(|known| known.suspended.remote_ns);
        let longest = known.map(|known| known.saturating_add(SUSPENDED_TOLERANCE_NS));
        longest.is_some_and(|longest| exchange.suspended.remote_ns > longest)
    }

    /// The offset at the local moment `at`, usually the present; `None` before the first exchange and after a reset.
    ///
    /// Moments before the last exchange are allowed too; their uncertainty grows with their distance.
    pub fn estimate(&self, at: MonotonicNs) -> Option<Estimate> {
        let known = self.known.as_ref()?;
        let feasible = known.feasible.moved_to(at);
        Some(Estimate {
            offset_ns: saturated_i64(feasible.offset_ns()),
            uncertainty_ns: saturated_u64(feasible.uncertainty_ns()),
            drift_ppb: saturated_i64(feasible.drift_ppb()),
            drift_uncertainty_ppb: saturated_u64(feasible.drift_uncertainty_ppb()),
            round_trip_ns: known.window.shortest_round_trip_ns(),
        })
    }

    /// What the remote clock shows at the moment `local`, past or future; `None` when there is no estimate.
    ///
    /// Moments before the remote clock's zero become 0, those beyond its range the greatest. Its error is at most the
    /// uncertainty of [`estimate`](Self::estimate) at `local`.
    pub fn to_remote(&self, local: MonotonicNs) -> Option<RemoteNs> {
        let offset_ns = self.known.as_ref()?.feasible.moved_to(local).offset_ns();
        Some(RemoteNs(saturated_u64(i128::from(local.0) + offset_ns)))
    }

    /// When the remote clock shows `remote`, past or future, by the local clock; `None` when there is no estimate.
    ///
    /// Moments before the local clock's zero become 0, those beyond its range the greatest. Its error is at most the
    /// uncertainty of [`estimate`](Self::estimate) at the moment that it yields. So the result may lie a little in the
    /// future for a remote moment that is past.
    pub fn to_local(&self, remote: RemoteNs) -> Option<MonotonicNs> {
        let feasible = &self.known.as_ref()?.feasible;
        let remote_ns = i128::from(remote.0);
        let mut local = MonotonicNs(saturated_u64(remote_ns - feasible.offset_ns()));
        for _ in 0..CORRECTIONS {
            local = MonotonicNs(saturated_u64(
                remote_ns - feasible.moved_to(local).offset_ns(),
            ));
        }
        Some(local)
    }

    /// Discards the estimate, because the offset is known to have jumped at or before the local moment `now`.
    ///
    /// Exchanges that were sent before `now` are rejected from here on.
    pub fn reset(&mut self, now: MonotonicNs) {
        self.not_before = self.not_before.max(now);
        if self.known.take().is_some() {
            self.resets += 1;
        }
    }

    /// How often an estimate was discarded, because the offset had jumped.
    pub fn resets(&self) -> u64 {
        self.resets
    }
}

fn saturated_u64(value: i128) -> u64 {
    value.clamp(0, i128::from(u64::MAX)) as u64
}

fn saturated_i64(value: i128) -> i64 {
    value.clamp(i128::from(i64::MIN), i128::from(i64::MAX)) as i64
}
