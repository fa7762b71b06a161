//! [`Cadence`]: how often something arrives, and so how long it may stay away before it is missing.
//!
//! This is the bridge's only notion of freshness: whether the link is silent, whether a status is overdue and whether an
//! observation is still known all follow from it.

use std::time::Duration;

use ipc_types::MonotonicNs;
use serde::{Deserialize, Serialize};

/// Gaps that are remembered. Their median is the period: an outage or a burst does not change it.
const GAPS: usize = 5;

/// So many periods may pass without an arrival: two in a row may be destroyed by noise.
const PERIODS: u32 = 3;

/// Longest period that is believed: the longest status period (port 10001).
const MAX_PERIOD: Duration = Duration::from_secs(10);

/// Observes the period of arrivals.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Cadence {
    last: Option<MonotonicNs>,
    gaps: [Duration; GAPS],
    observed: usize,
}

impl Cadence {
    /// Something arrived.
    pub fn arrived(&mut self, now: MonotonicNs) {
        if let Some(last) = self.last.replace(now) {
            self.gaps[self.observed % GAPS] = now.since(last).min(MAX_PERIOD);
            self.observed += 1;
        }
    }

    /// The period; nothing before the second arrival.
    pub fn period(&self) -> Option<Duration> {
        let count = self.observed.min(GAPS);
        let mut gaps = self.gaps;
        let gaps = &mut gaps[..count];
        gaps.sort_unstable();
        gaps.get(count / 2).copied()
    }

    /// How long an arrival counts as recent: three observed periods, `at_least` in any case.
    pub fn fresh_for(&self, at_least: Duration) -> Duration {
        // The median is no longer than the longest gap, and that needs no sorting.
        if self.gaps.iter().all(|gap| PERIODS * *gap <= at_least) {
            return at_least;
        }
        at_least.max(PERIODS * self.period().unwrap_or_default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    fn cadence(times_ms: &[u64]) -> Cadence {
        let mut cadence = Cadence::default();
        for ms in times_ms {
            cadence.arrived(MonotonicNs(ms * 1_000_000));
        }
        cadence
    }

    #[test]
    fn the_period_is_the_median_of_the_last_gaps() {
        assert_eq!(cadence(&[]).period(), None);
        assert_eq!(cadence(&[7]).period(), None);
        assert_eq!(cadence(&[0, 5000]).fresh_for(SECOND), 15 * SECOND);
        assert_eq!(cadence(&[0, 20, 40, 60]).fresh_for(SECOND), SECOND);
        let with_outage = cadence(&[0, 20, 40, 8000, 8020, 8040]);
        assert_eq!(with_outage.period(), Some(Duration::from_millis(20)));
        let with_burst = cadence(&[0, 5000, 10_000, 15_000, 15_000, 20_000, 25_000]);
        assert_eq!(with_burst.period(), Some(5 * SECOND));
    }

    #[test]
    fn nothing_is_believed_to_come_more_slowly_than_the_slowest_status() {
        assert_eq!(cadence(&[0, 600_000]).fresh_for(SECOND), 30 * SECOND);
    }
}
