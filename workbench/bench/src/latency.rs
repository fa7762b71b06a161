//! What a receiver records: the time from sending to receiving of each sample, and how many never came.

use ipc_types::MonotonicNs;
use serde::{Deserialize, Serialize};

use crate::peers::Mark;
use crate::statistics::Times;

/// Samples at the beginning that do not count: connections are made, pages touched, processors awake.
pub const WARM_UP: usize = 50;

/// The times of one round of one case.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Series {
    /// From sending to receiving, ns, in order.
    pub times_ns: Vec<u64>,
    /// Samples that were sent between the first and the last one that came, and did not come.
    pub lost: u64,
}

impl Series {
    /// The times for percentiles.
    pub fn times(&self) -> Times {
        self.times_ns.iter().copied().collect()
    }
}

/// Records samples as they come.
pub struct Recorder {
    series: Series,
    wanted: usize,
    warm_up: usize,
    last_index: u64,
}

impl Recorder {
    /// Wants `wanted` samples.
    pub fn new(wanted: usize) -> Recorder {
        Recorder {
            series: Series {
                times_ns: Vec::with_capacity(wanted),
                lost: 0,
            },
            wanted,
            warm_up: WARM_UP,
            last_index: 0,
        }
    }

    /// The sample with this mark can be read now.
    pub fn take(&mut self, mark: Mark) {
        let now = MonotonicNs::now();
        let missed = mark.index.saturating_sub(self.last_index + 1);
        self.last_index = mark.index;
        if self.warm_up > 0 {
            self.warm_up -= 1;
        } else if !self.is_complete() {
            self.series.lost += missed;
            self.series
                .times_ns
                .push(now.0.saturating_sub(mark.sent_ns));
        }
    }

    /// Whether the first sample that counts has come.
    #[cfg(feature = "relay")]
    pub fn has_begun(&self) -> bool {
        !self.series.times_ns.is_empty()
    }

    /// Whether all that were wanted have come.
    pub fn is_complete(&self) -> bool {
        self.series.times_ns.len() >= self.wanted
    }

    /// What was recorded.
    pub fn finish(self) -> Series {
        self.series
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mark(index: u64) -> Mark {
        let sent_ns = MonotonicNs::now().0;
        Mark { index, sent_ns }
    }

    #[test]
    fn the_first_samples_do_not_count_and_gaps_after_them_are_losses() {
        let mut recorder = Recorder::new(3);
        // The receiver came late, and something was lost while it warmed up.
        let first = 10;
        let begin = first + WARM_UP as u64 + 5;
        for index in (first..first + 20).chain(first + 25..begin) {
            recorder.take(mark(index));
        }
        assert!(!recorder.is_complete());
        for index in [begin, begin + 1, begin + 4] {
            recorder.take(mark(index));
        }
        assert!(recorder.is_complete());
        recorder.take(mark(begin + 100));
        let series = recorder.finish();
        assert_eq!((series.times_ns.len(), series.lost), (3, 2));
        assert_eq!(series.times().count(), 3);
    }
}
