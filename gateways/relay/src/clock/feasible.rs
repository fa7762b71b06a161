//! [`Feasible`]: the offsets and drifts that all exchanges so far leave possible, and [`Window`]: the tightest bounds
//! of the last minutes.

use std::collections::VecDeque;

use ipc_types::MonotonicNs;

use super::exchange::{
    Bound, DRIFT_JITTER_PPB, Exchange, Range, greatest_drift_change_ppb, greatest_rise_ns,
    least_drift_ppb,
};

/// What is possible at one moment of the local clock. The truth lies in both ranges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Feasible {
    at_ns: i128,
    offset_ns: Range,
    /// Without the jitter.
    drift_ppb: Range,
}

impl Feasible {
    /// All that one plausible exchange shows, at the moment at which its reply was received.
    pub fn from_exchange(exchange: &Exchange) -> Feasible {
        let (ceiling, floor) = (exchange.ceiling(), exchange.floor());
        let drift_ppb = Range::ANY_DRIFT;
        let rise_ns = greatest_rise_ns(drift_ppb.high, floor.at_ns - ceiling.at_ns);
        Feasible {
            at_ns: floor.at_ns,
            offset_ns: Range {
                low: floor.offset_ns,
                high: ceiling.offset_ns + rise_ns,
            },
            drift_ppb,
        }
    }

    /// What remains possible after a further exchange; `window` has the bounds of those before. `None` if nothing does:
    /// the offset has jumped.
    pub fn with(&self, exchange: &Exchange, window: &Window) -> Option<Feasible> {
        let received_ns = i128::from(exchange.received.0);
        let at_ns = self.at_ns.max(received_ns);
        let predicted = self.moved_to_ns(at_ns);
        let (ceiling, floor) = (exchange.ceiling(), exchange.floor());

        let mut drift_ppb = predicted.drift_ppb;
        for (earlier_ceiling, earlier_floor) in window.bounds() {
            drift_ppb = drift_ppb.and(drift_between(earlier_ceiling, floor, at_ns))?;
            drift_ppb = drift_ppb.and(drift_between(ceiling, earlier_floor, at_ns))?;
        }

        let mut offset_ns = predicted.offset_ns;
        for (ceiling, floor) in window.bounds().chain([(ceiling, floor)]) {
            let rise_ns = greatest_rise_ns(drift_ppb.high, at_ns - ceiling.at_ns);
            let fall_ns = greatest_rise_ns(-drift_ppb.low, at_ns - floor.at_ns);
            offset_ns = offset_ns.and(Range {
                low: floor.offset_ns - fall_ns,
                high: ceiling.offset_ns + rise_ns,
            })?;
        }
        Some(Feasible {
            at_ns,
            offset_ns,
            drift_ppb,
        })
    }

    /// What is possible at `moment`, earlier or later.
    pub fn moved_to(&self, moment: MonotonicNs) -> Feasible {
        self.moved_to_ns(i128::from(moment.0))
    }

    fn moved_to_ns(&self, at_ns: i128) -> Feasible {
        let duration_ns = (at_ns - self.at_ns).abs();
        let rise_ns = greatest_rise_ns(self.drift_ppb.high, duration_ns);
        let fall_ns = greatest_rise_ns(-self.drift_ppb.low, duration_ns);
        let (down_ns, up_ns) = if at_ns >= self.at_ns {
            (fall_ns, rise_ns)
        } else {
            (rise_ns, fall_ns)
        };
        let change_ppb = greatest_drift_change_ppb(2 * duration_ns);
        let any = Range::ANY_DRIFT;
        Feasible {
            at_ns,
            offset_ns: Range {
                low: self.offset_ns.low - down_ns,
                high: self.offset_ns.high + up_ns,
            },
            drift_ppb: Range {
                low: (self.drift_ppb.low - change_ppb).max(any.low),
                high: (self.drift_ppb.high + change_ppb).min(any.high),
            },
        }
    }

    /// The possible offsets.
    pub fn offset_range_ns(&self) -> Range {
        self.offset_ns
    }

    /// The middle of the possible offsets.
    pub fn offset_ns(&self) -> i128 {
        self.offset_ns.middle()
    }

    /// How far the offset can be from the middle. The 4096th part more, and 2 ns, make it hold as well for moments that
    /// are translated into local ones: these are divided by a rate of up to 1 − 200 ppm, and rounded.
    pub fn uncertainty_ns(&self) -> i128 {
        let half_width_ns = self.offset_ns.half_width();
        half_width_ns + half_width_ns / 4096 + 2
    }

    /// The middle of the possible drifts.
    pub fn drift_ppb(&self) -> i128 {
        self.drift_ppb.middle()
    }

    /// How far the drift can be from the middle, jitter included.
    pub fn drift_uncertainty_ppb(&self) -> i128 {
        self.drift_ppb.half_width() + i128::from(DRIFT_JITTER_PPB)
    }
}

/// The drifts at `at_ns` that `ceiling` and `floor` allow; neither lies after `at_ns`. The offset rises at least from
/// an earlier ceiling to a later floor, and at most from an earlier floor to a later ceiling.
fn drift_between(ceiling: Bound, floor: Bound, at_ns: i128) -> Range {
    let duration_ns = floor.at_ns - ceiling.at_ns;
    let rise_ns = floor.offset_ns - ceiling.offset_ns;
    // A mean is known. The drift had it half way if it changed at a steady pace, which is the extreme case.
    let change_ppb = greatest_drift_change_ppb(2 * at_ns - ceiling.at_ns - floor.at_ns);
    let mut drift_ppb = Range {
        low: i128::MIN,
        high: i128::MAX,
    };
    if duration_ns > 0 {
        drift_ppb.low = least_drift_ppb(rise_ns, duration_ns) - change_ppb;
    } else if duration_ns < 0 {
        drift_ppb.high = -least_drift_ppb(rise_ns, -duration_ns) + change_ppb;
    }
    drift_ppb
}

/// The length of a slot, in ns. Of each slot only the tightest bounds are kept: 8 s hold 8 to 16 exchanges of the usual
/// rate, of which some are quick on most links.
pub const SLOT_NS: u64 = 8_000_000_000;

/// How many slots are kept. 64 × 8 s = 512 s. Older bounds would not tighten the drift: it can change by 512 s × 50
/// ppb/s = 26 ppm in that time. They are dropped; what they have shown so far stays in the estimate.
pub const SLOTS: usize = 64;

/// Of how many slots the shortest round trip counts: 8 × 8 s, the last minute with exchanges. A link that has become
/// another one, a mobile network in the place of Wi-Fi, is no longer measured by what it was.
const ROUND_TRIP_SLOTS: u64 = 8;

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

    /// Keeps the tighter bounds of both. Which ones are tighter is judged with the estimated drift; a wrong choice
    /// costs accuracy, but what is kept stays true.
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
    pub fn shortest_of_all_ns(&self) -> u64 {
        let all = self.slots.iter().map(|slot| slot.round_trip_ns);
        all.min().unwrap_or(u64::MAX)
    }

    /// The shortest round trip of the newest [`ROUND_TRIP_SLOTS`], in ns.
    pub fn shortest_round_trip_ns(&self) -> u64 {
        let newest = self.slots.back().map_or(0, |slot| slot.number);
        let recent = self.slots.iter().rev();
        let recent = recent.take_while(|slot| slot.number + ROUND_TRIP_SLOTS > newest);
        recent
            .map(|slot| slot.round_trip_ns)
            .min()
            .unwrap_or(u64::MAX)
    }
}
