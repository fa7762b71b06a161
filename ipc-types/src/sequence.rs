//! The two numbers that every sample begins with: its publisher writes its count and its own start, by which a
//! subscriber notices what it missed. Pure values.

use crate::time::MonotonicNs;

/// Where `sequence` lies in every sample of a topic, bytes.
pub const SEQUENCE_OFFSET: usize = 0;

/// Where `epoch_ns` lies in every sample of a topic, bytes.
pub const EPOCH_OFFSET: usize = 8;

/// The number at an offset of a sample or a request; 0 when it is too short, which no schema allows.
pub(crate) fn word(payload: &[u8], offset: usize) -> u64 {
    let bytes = payload.get(offset..offset + 8);
    bytes
        .and_then(|bytes| bytes.try_into().ok())
        .map_or(0, u64::from_ne_bytes)
}

/// Writes a publisher's count and identity into a sample.
pub(crate) fn stamp(sample: &mut [u8], sequence: u64, epoch_ns: u64) {
    sample[SEQUENCE_OFFSET..][..8].copy_from_slice(&sequence.to_ne_bytes());
    sample[EPOCH_OFFSET..][..8].copy_from_slice(&epoch_ns.to_ne_bytes());
}

/// What a subscriber got and what it missed since it began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    /// Samples handed on.
    pub received: u64,
    /// Samples that were published for this subscriber and never came: gaps in the sequence, and of a publisher that
    /// began after the subscriber all before the first that came.
    pub lost: u64,
    /// Samples before the first one that came, of a publisher that had begun before the subscriber: it joined late.
    /// When it first reads after its queue has run over, what did not fit is among them.
    pub joined_late: u64,
    /// Samples that came twice; dropped. Happens when a publisher begins a new generation of shared memory.
    pub repeated: u64,
    /// How often another publisher took over.
    pub publisher_restarts: u64,
}

/// Remembers the last sample of a topic and judges the next, by the numbers that both begin with.
///
/// A service has one publisher, whose samples come in order; the former one's are drained before the first of the next.
/// So another start is a restart, whatever the clocks say.
#[derive(Debug)]
pub struct SequenceTracker {
    losses: Losses,
    /// When the subscriber began.
    joined: MonotonicNs,
    last: Option<Last>,
}

#[derive(Clone, Copy, Debug)]
struct Last {
    epoch_ns: u64,
    sequence: u64,
}

impl SequenceTracker {
    /// Of a subscriber that began at `joined`.
    pub fn new(joined: MonotonicNs) -> SequenceTracker {
        SequenceTracker {
            losses: Losses::default(),
            joined,
            last: None,
        }
    }

    /// The counts so far.
    pub fn losses(&self) -> Losses {
        self.losses
    }

    /// Counts a sample and says whether to hand it on.
    ///
    /// The samples from 1 on of a publisher that begins after the subscriber, or after another publisher, are meant for
    /// the subscriber. Of one that was there before, the first sample that comes begins the count wherever it stands.
    pub fn accept(&mut self, epoch_ns: u64, sequence: u64) -> bool {
        let lost = match self.last {
            None if epoch_ns < self.joined.0 => {
                self.losses.joined_late = sequence.saturating_sub(1);
                0
            }
            None => sequence.saturating_sub(1),
            Some(last) if epoch_ns != last.epoch_ns => {
                self.losses.publisher_restarts += 1;
                sequence.saturating_sub(1)
            }
            Some(last) if sequence <= last.sequence => {
                self.losses.repeated += 1;
                return false;
            }
            Some(last) => sequence - last.sequence - 1,
        };
        self.losses.lost = self.losses.lost.saturating_add(lost);
        self.losses.received += 1;
        self.last = Some(Last { epoch_ns, sequence });
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Feeds (start, sequence) pairs; returns which were handed on, and the counts.
    fn check(samples: &[(u64, u64)], handed_on: &[(u64, u64)], losses: Losses) {
        let mut tracker = SequenceTracker::new(MonotonicNs(100));
        let accepted: Vec<_> = samples
            .iter()
            .copied()
            .filter(|(epoch, sequence)| tracker.accept(*epoch, *sequence))
            .collect();
        assert_eq!(accepted, handed_on);
        assert_eq!(tracker.losses(), losses);
    }

    #[test]
    fn a_late_joiner_begins_anywhere_and_loses_nothing() {
        check(
            &[(5, 900), (5, 901)],
            &[(5, 900), (5, 901)],
            Losses {
                received: 2,
                joined_late: 899,
                ..Losses::default()
            },
        );
    }

    #[test]
    fn of_a_publisher_that_begins_later_all_samples_count() {
        for (epoch, lost, joined_late) in [(99, 0, 351), (100, 351, 0), (101, 351, 0)] {
            check(
                &[(epoch, 352), (epoch, 353)],
                &[(epoch, 352), (epoch, 353)],
                Losses {
                    received: 2,
                    lost,
                    joined_late,
                    ..Losses::default()
                },
            );
        }
    }

    #[test]
    fn gaps_are_losses() {
        check(
            &[(5, 1), (5, 2), (5, 5), (5, 6)],
            &[(5, 1), (5, 2), (5, 5), (5, 6)],
            Losses {
                received: 4,
                lost: 2,
                ..Losses::default()
            },
        );
    }

    #[test]
    fn a_new_publisher_counts_from_one_whatever_its_clock_says() {
        check(
            &[(9, 8), (5, 2), (5, 3), (u64::MAX, 1), (7, 1)],
            &[(9, 8), (5, 2), (5, 3), (u64::MAX, 1), (7, 1)],
            Losses {
                received: 5,
                lost: 1,
                joined_late: 7,
                publisher_restarts: 3,
                ..Losses::default()
            },
        );
    }

    #[test]
    fn what_comes_twice_is_dropped() {
        check(
            &[(5, 3), (5, 3), (5, 2), (5, 4)],
            &[(5, 3), (5, 4)],
            Losses {
                received: 2,
                repeated: 2,
                joined_late: 2,
                ..Losses::default()
            },
        );
    }

    #[test]
    fn absurd_numbers_do_not_overflow() {
        check(
            &[(0, 0), (0, u64::MAX), (7, u64::MAX)],
            &[(0, 0), (0, u64::MAX), (7, u64::MAX)],
            Losses {
                received: 3,
                lost: u64::MAX,
                publisher_restarts: 1,
                ..Losses::default()
            },
        );
    }
}
