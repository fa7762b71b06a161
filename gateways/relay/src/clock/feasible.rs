//! [`Feasible`]: the offsets and drifts that all exchanges so far leave possible.

use ipc_types::MonotonicNs;

use super::exchange::{Bound, Exchange};
use super::rate::{
    DRIFT_JITTER_PPB, Range, greatest_drift_change_ppb, greatest_rise_ns, least_drift_ppb,
};
use super::window::Window;

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

    /// The middle of the possible offsets.
    pub fn offset_ns(&self) -> i128 {
        self.offset_ns.middle()
    }

    /// How far the offset can be from the middle. The 4096th part more, and 2 ns, make it hold as well for moments that are
    /// translated into local ones: these are divided by a rate of up to 1 − 200 ppm, and rounded.
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

/// The drifts at `at_ns` that `ceiling` and `floor` allow; neither lies after `at_ns`. The offset rises at least from an
/// earlier ceiling to a later floor, and at most from an earlier floor to a later ceiling.
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
