//! [`ClockSteps`]: notices a step of a clock that contradicts no bound, because it is less than a round trip.
//!
//! After such a step requests seem to take longer by it and replies to take as much less, or the other way round, and
//! the round trip stays. No way does that by itself: one that becomes longer makes the round trip longer.

use std::collections::VecDeque;

use super::exchange::Exchange;
use super::feasible::Feasible;

/// Exchanges in a row that must show the step: three seconds of them. On a link whose round trips waver, so many are
/// not all as quick as the quickest by chance.
const IN_A_ROW: usize = 6;

/// Least step that is noticed, ns: more than the kernels of two machines take to hand a message on when they are busy.
const LEAST_NS: i128 = 5_000_000;

/// What the last exchanges show, oldest first, at most [`IN_A_ROW`].
#[derive(Clone, Debug, Default)]
pub(super) struct ClockSteps(VecDeque<Seen>);

/// How far the bounds of an exchange lie outside of what was possible before it, ns.
#[derive(Clone, Copy, Debug)]
struct Seen {
    above_ns: i128,
    below_ns: i128,
    round_trip_ns: u64,
}

impl ClockSteps {
    /// Adds `exchange`, before which `feasible` was possible.
    pub fn add(&mut self, exchange: &Exchange, feasible: &Feasible) {
        let (ceiling, floor) = (exchange.ceiling(), exchange.floor());
        self.0.truncate(IN_A_ROW - 1);
        self.0.push_front(Seen {
            above_ns: ceiling.offset_ns - feasible.moved_to(exchange.sent).offset_range_ns().high,
            below_ns: feasible.moved_to(exchange.received).offset_range_ns().low - floor.offset_ns,
            round_trip_ns: exchange.round_trip_ns(),
        });
    }

    /// Whether the offset has made a step. `shortest_ns` is the shortest round trip of the last minutes: an exchange
    /// that took so much longer can lie outside by that much.
    pub fn show_one(&self, shortest_ns: u64) -> bool {
        let longest_ns = self.0.iter().map(|seen| seen.round_trip_ns).max();
        let wavers_ns = longest_ns.unwrap_or_default().saturating_sub(shortest_ns);
        let least_ns = LEAST_NS + 2 * i128::from(wavers_ns);
        self.0.len() == IN_A_ROW
            && (self.0.iter().all(|seen| seen.above_ns > least_ns)
                || self.0.iter().all(|seen| seen.below_ns > least_ns))
    }
}
