//! A count of trouble that goes on, told at once and then as a sum every so often.

use std::time::Duration;

use ipc_types::MonotonicNs;

/// Something that is counted, and told to the operator at a bounded rate.
#[derive(Clone, Debug)]
pub struct Tally {
    total: u64,
    /// Of `total`, how many were told.
    told: u64,
    /// Before this, nothing is told.
    next_telling: MonotonicNs,
    period: Duration,
}

impl Tally {
    /// Nothing counted; there will be `period` between two tellings.
    pub fn every(period: Duration) -> Tally {
        Tally {
            total: 0,
            told: 0,
            next_telling: MonotonicNs::default(),
            period,
        }
    }

    /// How many there were in all.
    pub fn total(&self) -> u64 {
        self.total
    }

    /// Counts `count` more.
    pub fn add(&mut self, count: u64) {
        self.total = self.total.saturating_add(count);
    }

    /// Takes the count from somebody else who counts.
    pub fn set(&mut self, total: u64) {
        self.total = total;
    }

    /// What is to be told at `now`: how many there were since the last telling. Nothing if there were none, or if the
    /// last telling is too near.
    pub fn due(&mut self, now: MonotonicNs) -> Option<u64> {
        if self.deadline()? > now {
            return None;
        }
        let untold = self.untold();
        self.told = self.total;
        self.next_telling = now + self.period;
        Some(untold)
    }

    /// When [`due`](Self::due) has something.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        (self.untold() > 0).then_some(self.next_telling)
    }

    fn untold(&self) -> u64 {
        self.total.saturating_sub(self.told)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_is_told_at_once_and_the_rest_as_sums() {
        let at = |ms| MonotonicNs::default() + Duration::from_millis(ms);
        let mut tally = Tally::every(Duration::from_secs(5));
        assert_eq!((tally.due(at(0)), tally.deadline()), (None, None));
        tally.add(3);
        assert_eq!(tally.due(at(10)), Some(3));
        tally.add(1);
        tally.set(9);
        assert_eq!(tally.due(at(5009)), None);
        assert_eq!(tally.deadline(), Some(at(5010)));
        assert_eq!(tally.due(at(5010)), Some(6));
        assert_eq!((tally.due(at(60_000)), tally.total()), (None, 9));
        // Long after, the next is told at once again.
        tally.add(1);
        assert_eq!(tally.due(at(60_000)), Some(1));
    }
}
