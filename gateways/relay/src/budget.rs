//! [`Budget`]: how often something may be done, with some in advance. A pure value.

use std::time::Duration;

use ipc_types::MonotonicNs;

/// Grants a steady rate, and a burst after a pause.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// Time that one piece costs, ns.
    piece_ns: u64,
    /// How far ahead of the steady rate the grants may be, ns.
    burst_ns: u64,
    /// When all that was granted has been earned.
    earned: MonotonicNs,
}

impl Budget {
    /// So many pieces a second, and so many at once after a pause. At least one of each.
    pub const fn new(per_second: u64, burst: u64) -> Budget {
        let per_second = if per_second == 0 { 1 } else { per_second };
        let piece_ns = 1_000_000_000 / per_second;
        Budget {
            piece_ns,
            burst_ns: piece_ns.saturating_mul(burst.saturating_sub(1)),
            earned: MonotonicNs(0),
        }
    }

    /// Whether so many pieces may be done now; they then count as done. More pieces than a burst has are granted only
    /// after a pause, and paid for afterwards.
    pub fn grant(&mut self, pieces: u64, now: MonotonicNs) -> bool {
        let earned = self.earned.max(now);
        if earned.since(now) > Duration::from_nanos(self.burst_ns) {
            return false;
        }
        let cost_ns = self.piece_ns.saturating_mul(pieces);
        self.earned = MonotonicNs(earned.0.saturating_add(cost_ns));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    #[test]
    fn a_burst_then_the_steady_rate_and_after_a_pause_a_burst_again() {
        let mut budget = Budget::new(10, 5);
        let granted = |budget: &mut Budget, now| (0..100).filter(|_| budget.grant(1, now)).count();
        assert_eq!(granted(&mut budget, at(1000)), 5);
        assert_eq!(granted(&mut budget, at(1099)), 0);
        assert_eq!(granted(&mut budget, at(1100)), 1);
        assert_eq!(
            granted(&mut budget, at(60_000)),
            5,
            "no more after a long pause"
        );
    }

    #[test]
    fn what_is_larger_than_a_burst_is_granted_and_paid_for_afterwards() {
        let mut budget = Budget::new(1000, 100);
        assert!(budget.grant(2000, at(0)));
        assert!(!budget.grant(1, at(1900)));
        assert!(budget.grant(1, at(1901)));
        assert!(budget.grant(u64::MAX, at(10_000)));
        assert!(!budget.grant(1, at(1_000_000_000)));
    }
}
