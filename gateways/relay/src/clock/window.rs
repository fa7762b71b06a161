//! The tightest bounds of the last minutes.

use std::collections::VecDeque;

use super::exchange::{Bound, Exchange};

/// The length of a slot, in ns. Of each slot only the tightest bounds are kept: 8 s hold 8 to 16 exchanges of the usual rate,
/// of which some are quick on most links.
pub const SLOT_NS: u64 = 8_000_000_000;

/// How many slots are kept. 64 × 8 s = 512 s. Older bounds would not tighten the drift: it can change by 512 s × 50 ppb/s
/// = 26 ppm in that time. They are dropped; what they have shown so far stays in the estimate.
pub const SLOTS: usize = 64;

/// The tightest bounds of each slot, oldest first; never empty, at most [`SLOTS`].
#[derive(Clone, Debug)]
pub(super) struct Window {
    slots: VecDeque<Slot>,
}

/// The best of one slot. `number` × [`SLOT_NS`] is the slot's beginning.
#[derive(Clone, Copy, Debug)]
struct Slot {
    number: u64,
    ceiling: Bound,
    floor: Bound,
    round_trip_ns: u64,
}

impl Slot {
    fn new(exchange: &Exchange) -> Slot {
        Slot {
            number: exchange.received.0 / SLOT_NS,
            ceiling: exchange.ceiling(),
            floor: exchange.floor(),
            round_trip_ns: exchange.round_trip_ns(),
        }
    }

    /// Keeps the tighter bounds of both. Which ones are tighter is judged with the estimated drift; a wrong choice costs
    /// accuracy, but what is kept stays true.
    fn merge(&mut self, other: &Slot, drift_ppb: i128) {
        let at_zero = |bound: &Bound| bound.offset_ns * 1_000_000_000 - drift_ppb * bound.at_ns;
        if at_zero(&other.ceiling) <= at_zero(&self.ceiling) {
            self.ceiling = other.ceiling;
        }
        if at_zero(&other.floor) >= at_zero(&self.floor) {
            self.floor = other.floor;
        }
        self.round_trip_ns = self.round_trip_ns.min(other.round_trip_ns);
    }
}

impl Window {
    /// The window after the first exchange.
    pub fn new(exchange: &Exchange) -> Window {
        Window {
            slots: VecDeque::from([Slot::new(exchange)]),
        }
    }

    /// Adds the bounds of `exchange`; `drift_ppb` is the estimated drift.
    pub fn insert(&mut self, exchange: &Exchange, drift_ppb: i128) {
        let slot = Slot::new(exchange);
        match self.slots.back_mut() {
            // An exchange that is handed over late counts to the newest slot: its bounds hold all the same.
            Some(newest) if slot.number <= newest.number => newest.merge(&slot, drift_ppb),
            _ => self.slots.push_back(slot),
        }
        let oldest_kept = (slot.number + 1).saturating_sub(SLOTS as u64);
        while self
            .slots
            .front()
            .is_some_and(|oldest| oldest.number < oldest_kept)
        {
            self.slots.pop_front();
        }
    }

    /// The ceiling and the floor of each slot.
    pub fn bounds(&self) -> impl Iterator<Item = (Bound, Bound)> {
        self.slots.iter().map(|slot| (slot.ceiling, slot.floor))
    }

    /// The shortest round trip in the window, in ns.
    pub fn shortest_round_trip_ns(&self) -> u64 {
        let round_trips = self.slots.iter().map(|slot| slot.round_trip_ns);
        round_trips.min().unwrap_or(u64::MAX)
    }
}
