//! [`LossEvents`]: what of a topic did not come, as events in the places of what is missing.

use ipc_types::{Losses, MonotonicNs, SequenceTracker};
use recording::{Event, EventKind};

/// Follows the samples of one topic.
#[derive(Debug)]
pub struct LossEvents {
    /// As it is called in the file.
    topic: String,
    tracker: SequenceTracker,
    /// The time of the last sample.
    last: Option<MonotonicNs>,
    /// When the recording began.
    begun: MonotonicNs,
    /// Samples of a publisher that began later, from before the topic was joined.
    late: u64,
}

/// What a sample says of those before it: at most that its publisher began again, and that some are missing.
pub type SampleGap = arrayvec::ArrayVec<Event, 2>;

impl LossEvents {
    /// Of `topic`, no sample of which has come, in a recording that has begun at `begun`.
    pub fn new(topic: String, begun: MonotonicNs) -> LossEvents {
        LossEvents {
            topic,
            tracker: SequenceTracker::default(),
            last: None,
            begun,
            late: 0,
        }
    }

    /// The topic.
    pub fn topic(&self) -> &str {
        &self.topic
    }

    /// Takes a sample of the publisher that began at `epoch_ns`, which says that it was made at `at`; gives the events that
    /// come before it.
    pub fn take(
        &mut self,
        (epoch_ns, sequence): (u64, u64),
        at: MonotonicNs,
        now: MonotonicNs,
    ) -> SampleGap {
        let before = self.tracker.losses();
        self.tracker.accept(epoch_ns, sequence);
        let after = self.tracker.losses();
        let is_first = self.last.is_none();
        let first = self.last.replace(at).unwrap_or(at);
        let mut found = SampleGap::new();
        let event = |kind, count, text| Event {
            at: now,
            kind,
            topic: self.topic.clone(),
            count,
            first,
            last: at,
            text,
        };
        let has_begun_since = (self.begun.0..=now.0).contains(&epoch_ns);
        if is_first && has_begun_since && sequence > 1 {
            self.late = sequence - 1;
            let text = format!(
                "{} of {} were sent before the recorder had joined",
                self.late, self.topic
            );
            found.push(event(EventKind::Late, self.late, text));
        }
        if after.publisher_restarts > before.publisher_restarts {
            let text = format!("the publisher of {} began again", self.topic);
            found.push(event(EventKind::Restart, 1, text));
        }
        let lost = after.lost - before.lost;
        if lost > 0 {
            let text = format!(
                "{lost} of {} did not come, by their sequence numbers",
                self.topic
            );
            found.push(event(EventKind::Gap, lost, text));
        }
        found
    }

    /// The counts so far.
    pub fn losses(&self) -> Losses {
        let losses = self.tracker.losses();
        Losses {
            lost: losses.lost.saturating_add(self.late),
            ..losses
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missing_is_an_event_before_the_sample_that_shows_it() {
        let mut loss_events = LossEvents::new("/robot1/a".to_owned(), MonotonicNs(6));
        let mut take = |epoch_ns, sequence, at| {
            let found =
                loss_events.take((epoch_ns, sequence), MonotonicNs(at), MonotonicNs(at + 1));
            let found = found.into_iter();
            let words = found.map(|event| {
                assert_eq!(
                    (event.at, event.last),
                    (MonotonicNs(at + 1), MonotonicNs(at))
                );
                (event.kind, event.count, event.first.0)
            });
            words.collect::<Vec<_>>()
        };
        // It begins anywhere.
        assert_eq!(take(5, 900, 10), []);
        assert_eq!(take(5, 901, 20), []);
        assert_eq!(take(5, 904, 30), [(EventKind::Gap, 2, 20)]);
        assert_eq!(take(9, 1, 40), [(EventKind::Restart, 1, 30)]);
        assert_eq!(
            take(10, 3, 50),
            [(EventKind::Restart, 1, 40), (EventKind::Gap, 2, 40)]
        );
        assert_eq!(loss_events.losses().lost, 4);
    }

    #[test]
    fn what_came_before_the_recorder_had_joined_is_told_of_publishers_that_began_after_it() {
        let first = |epoch_ns, sequence| {
            let mut loss_events = LossEvents::new("/robot1/a".to_owned(), MonotonicNs(100));
            let now = MonotonicNs(200);
            let found = loss_events.take((epoch_ns, sequence), MonotonicNs(190), now);
            let events = found.into_iter().map(|event| (event.kind, event.count));
            let lost = loss_events.losses().lost;
            (events.collect::<Vec<_>>(), lost)
        };
        assert_eq!(first(99, 900), (vec![], 0), "it began before");
        assert_eq!(first(100, 1), (vec![], 0));
        assert_eq!(first(150, 8), (vec![(EventKind::Late, 7)], 7));
        assert_eq!(first(201, 8), (vec![], 0), "a start that is yet to come");
    }
}
