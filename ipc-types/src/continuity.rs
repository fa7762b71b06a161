//! Counts what a subscriber missed, by the sequence numbers and epochs of its samples. A pure value.

use crate::time::MonotonicNs;

/// What a subscriber got and what it missed since it began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    /// Samples handed on.
    pub received: u64,
    /// Samples that were published and never came: gaps in the sequence.
    pub lost: u64,
    /// Samples of an earlier publisher that came after the first of a later one; dropped, time does not go back.
    pub stale: u64,
    /// Samples that came twice; dropped. Happens when a port is made again and gets the latest as history.
    pub repeated: u64,
    /// How often another publisher took over.
    pub publisher_changes: u64,
    /// Samples whose publisher claims to begin in the future; dropped. Only a program that does not keep to the contract
    /// publishes such; without this, no later publisher would ever be believed again.
    pub impossible: u64,
}

/// Remembers the last sample and judges the next.
#[derive(Debug, Default)]
pub(crate) struct Continuity {
    losses: Losses,
    last: Option<Last>,
}

#[derive(Clone, Copy, Debug)]
struct Last {
    epoch_ns: u64,
    sequence: u64,
}

impl Continuity {
    pub(crate) fn losses(&self) -> Losses {
        self.losses
    }

    /// Counts a sample and says whether to hand it on.
    ///
    /// The first sample of all begins the count wherever it stands. A later epoch is a new publisher, whose samples
    /// from 1 on were meant for this subscriber too.
    /// `now` is only asked for when the publisher is another than before.
    pub(crate) fn accept(
        &mut self,
        now: impl FnOnce() -> MonotonicNs,
        epoch_ns: u64,
        sequence: u64,
    ) -> bool {
        let is_same = self.last.is_some_and(|last| last.epoch_ns == epoch_ns);
        if !is_same && epoch_ns > now().0 {
            self.losses.impossible += 1;
            return false;
        }
        let lost = match self.last {
            None => 0,
            Some(last) if epoch_ns < last.epoch_ns => {
                self.losses.stale += 1;
                return false;
            }
            Some(last) if epoch_ns > last.epoch_ns => {
                self.losses.publisher_changes += 1;
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

    const NOW: MonotonicNs = MonotonicNs(1_000);

    /// Feeds (epoch, sequence) pairs; returns which were handed on, and the counts.
    fn check(samples: &[(u64, u64)], handed_on: &[(u64, u64)], losses: Losses) {
        let mut continuity = Continuity::default();
        let accepted: Vec<_> = samples
            .iter()
            .copied()
            .filter(|(epoch, sequence)| continuity.accept(|| NOW, *epoch, *sequence))
            .collect();
        assert_eq!(accepted, handed_on);
        assert_eq!(continuity.losses(), losses);
    }

    #[test]
    fn a_late_joiner_begins_anywhere_and_loses_nothing() {
        check(
            &[(5, 900), (5, 901)],
            &[(5, 900), (5, 901)],
            Losses {
                received: 2,
                ..Losses::default()
            },
        );
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
    fn a_new_publisher_counts_from_one_and_the_old_one_s_rest_is_stale() {
        check(
            &[(5, 8), (9, 2), (5, 9), (9, 3)],
            &[(5, 8), (9, 2), (9, 3)],
            Losses {
                received: 3,
                lost: 1,
                stale: 1,
                publisher_changes: 1,
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
                ..Losses::default()
            },
        );
    }

    #[test]
    fn absurd_numbers_do_not_overflow() {
        check(
            &[(0, 0), (0, u64::MAX), (NOW.0, u64::MAX)],
            &[(0, 0), (0, u64::MAX), (NOW.0, u64::MAX)],
            Losses {
                received: 3,
                lost: u64::MAX,
                publisher_changes: 1,
                ..Losses::default()
            },
        );
    }

    #[test]
    fn nobody_who_begins_in_the_future_keeps_others_from_being_heard() {
        check(
            &[(u64::MAX, 7), (5, 1), (NOW.0 + 1, 2), (5, 2)],
            &[(5, 1), (5, 2)],
            Losses {
                received: 2,
                impossible: 2,
                ..Losses::default()
            },
        );
    }
}
