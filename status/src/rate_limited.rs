//! A count of recurring trouble, reported at onset and then as a sum once a period.

use std::time::Duration;

use ipc_types::MonotonicNs;

/// A counter whose reports to the operator are rate-limited.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct RateLimitedCounter {
    total: u64,
    /// The part of `total` that was reported.
    reported: u64,
    /// Nothing is reported before this.
    next_report: MonotonicNs,
    period: Duration,
}

impl RateLimitedCounter {
    /// A counter at zero; there will be `period` between two reports.
    pub fn every(period: Duration) -> RateLimitedCounter {
        RateLimitedCounter {
            total: 0,
            reported: 0,
            next_report: MonotonicNs::default(),
            period,
        }
    }

    /// The count since the beginning.
    pub fn total(&self) -> u64 {
        self.total
    }

    /// Counts `count` more.
    pub fn add(&mut self, count: u64) {
        self.total = self.total.saturating_add(count);
    }

    /// Takes over the total of another counter.
    pub fn set(&mut self, total: u64) {
        self.total = total;
    }

    /// The increment to report at `now`; `None` if there is none, or if the last report was less than a period ago.
    pub fn due(&mut self, now: MonotonicNs) -> Option<u64> {
        if self.deadline()? > now {
            return None;
        }
        let increment = self.unreported();
        self.reported = self.total;
        self.next_report = now + self.period;
        Some(increment)
    }

    /// When [`due`](Self::due) has something.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        (self.unreported() > 0).then_some(self.next_report)
    }

    fn unreported(&self) -> u64 {
        self.total.saturating_sub(self.reported)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_is_reported_at_once_and_the_rest_as_sums() {
        let at = |ms| MonotonicNs::default() + Duration::from_millis(ms);
        let mut counter = RateLimitedCounter::every(Duration::from_secs(5));
        assert_eq!((counter.due(at(0)), counter.deadline()), (None, None));
        counter.add(3);
        assert_eq!(counter.due(at(10)), Some(3));
        counter.add(1);
        counter.set(9);
        assert_eq!(counter.due(at(5009)), None);
        assert_eq!(counter.deadline(), Some(at(5010)));
        assert_eq!(counter.due(at(5010)), Some(6));
        assert_eq!((counter.due(at(60_000)), counter.total()), (None, 9));
        // Long after, the next is reported at once again.
        counter.add(1);
        assert_eq!(counter.due(at(60_000)), Some(1));
    }
}
