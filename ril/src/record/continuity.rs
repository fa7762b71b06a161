//! [`Continuity`]: what of a topic did not come, as events in the places of what is missing.

use ipc_types::{Losses, MonotonicNs, SequenceTracker};
use recording::{Event, EventKind};

/// Follows the samples of one topic.
#[derive(Debug)]
pub struct Continuity {
    /// As it is called in the file.
    topic: String,
    tracker: SequenceTracker,
    /// The time of the last sample.
    last: Option<MonotonicNs>,
}

/// What a sample says of those before it: at most that its publisher began again, and that some are missing.
pub type Found = arrayvec::ArrayVec<Event, 2>;

impl Continuity {
    /// Of `topic`, no sample of which has come.
    pub fn new(topic: String) -> Continuity {
        Continuity {
            topic,
            tracker: SequenceTracker::default(),
            last: None,
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
    ) -> Found {
        let before = self.tracker.losses();
        self.tracker.accept(epoch_ns, sequence);
        let after = self.tracker.losses();
        let first = self.last.replace(at).unwrap_or(at);
        let mut found = Found::new();
        let event = |kind, count, text| Event {
            at: now,
            kind,
            topic: self.topic.clone(),
            count,
            first,
            last: at,
            text,
        };
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
        self.tracker.losses()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missing_is_an_event_before_the_sample_that_shows_it() {
        let mut continuity = Continuity::new("/robot1/a".to_owned());
        let mut take = |epoch_ns, sequence, at| {
            let found = continuity.take((epoch_ns, sequence), MonotonicNs(at), MonotonicNs(at + 1));
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
        assert_eq!(continuity.losses().lost, 4);
    }
}
