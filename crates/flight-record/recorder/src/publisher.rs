//! What becomes of the publisher of a topic.
//!
//! * [`LossEvents`]: what of the topic did not come, as events in the places of what is missing;
//! * [`ProcessWatch`]: when the process has ended, by the rule of the live screens: a process that is killed publishes
//!   nothing that says so;
//! * [`Tail`]: what the publisher of a journal had not published when it was killed. Those records are the ones that
//!   explain its end.

use ipc_types::payload::{ModuleState, RelayLink};
use ipc_types::{
    Ipc, JournalPiece, LeftTail, Losses, MonotonicNs, OpenError, SequenceTracker, Topic,
};
use operator::robot::freshness::{Feed, MODULE_OVERDUE_AFTER, OVERDUE_AFTER};
use recording::{Event, EventKind};

/// Follows the samples of one topic.
#[derive(Debug)]
pub struct LossEvents {
    /// The topic's name in the file.
    topic: String,
    tracker: SequenceTracker,
    /// The time of the last sample.
    last: Option<MonotonicNs>,
}

/// What a sample says of those before it: at most that its publisher began again, and that some are missing.
pub type SampleGap = arrayvec::ArrayVec<Event, 2>;

impl LossEvents {
    /// Of `topic`, no sample of which has come, in a recording that has begun at `begun`.
    pub fn new(topic: String, begun: MonotonicNs) -> LossEvents {
        LossEvents {
            topic,
            tracker: SequenceTracker::new(begun),
            last: None,
        }
    }

    /// The topic.
    pub fn topic(&self) -> &str {
        &self.topic
    }

    /// Takes a sample of the publisher that began at `epoch_ns`, which says that it was made at `at`; gives the events
    /// that come before it.
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
        if after.publisher_restarts > before.publisher_restarts {
            let text = format!("the publisher of {} began again", self.topic);
            found.push(event(EventKind::Restart, 1, text));
        }
        let lost = after.lost - before.lost;
        let topic = &self.topic;
        if lost > 0 && is_first {
            let text = format!("{lost} of {topic} were sent before the recorder had joined");
            found.push(event(EventKind::Late, lost, text));
        } else if lost > 0 {
            let text = format!("{lost} of {topic} did not come, by their sequence numbers");
            found.push(event(EventKind::Gap, lost, text));
        }
        found
    }

    /// The counts so far.
    pub fn losses(&self) -> Losses {
        self.tracker.losses()
    }
}

/// Ends the keys of the topics on which modules publish their states, at least once a second.
const STATE_END: &str = "/state";

/// Says when the process behind a topic has ended.
#[derive(Debug)]
pub(crate) struct ProcessWatch {
    feed: Feed,
    /// When its last sample came.
    last: Option<MonotonicNs>,
}

impl ProcessWatch {
    /// The watch of the live process that publishes the topic `key`; `None` if a process may be silent on that topic
    /// for long, so that silence is no reason to look for the process.
    pub fn of_topic(key: &str, now: MonotonicNs) -> Option<ProcessWatch> {
        let overdue_after = match key {
            ModuleState::KEY => OVERDUE_AFTER,
            RelayLink::KEY => MODULE_OVERDUE_AFTER,
            key if key.ends_with(STATE_END) => MODULE_OVERDUE_AFTER,
            _ => return None,
        };
        // How old a sample is does not matter here.
        let mut feed = Feed::new(overdue_after, overdue_after);
        feed.provider(true, now);
        Some(ProcessWatch { feed, last: None })
    }

    /// A sample came.
    pub fn sample(&mut self, now: MonotonicNs) {
        self.feed.sample(now, now);
        self.last = Some(now);
    }

    /// When to look for the process; `None` if it has ended, until a sample of its successor comes.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.feed.next_look()
    }

    /// Takes whether the process lives; returns the moment of its last sample if it has published one and has ended
    /// since.
    pub fn looked(&mut self, lives: bool, now: MonotonicNs) -> Option<MonotonicNs> {
        self.feed.provider(lives, now);
        self.last.filter(|_| !lives)
    }
}

/// Follows the publishers of a journal, and has the rest of the journal of one that is gone.
pub(crate) struct Tail {
    ipc: Ipc,
    open: fn(&Ipc) -> Result<Option<LeftTail>, OpenError>,
    read: fn(&LeftTail, Option<Piece>) -> Option<Vec<u8>>,
    /// The rest of the journal of the publisher that lived when this was opened.
    file: Option<LeftTail>,
    /// The last piece of that publisher.
    last: Option<Piece>,
}

/// Which piece of which publisher.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Piece {
    pub epoch_ns: u64,
    pub sequence: u64,
}

impl Tail {
    /// Of the journal whose pieces are `P`.
    pub fn of<P: JournalPiece>(ipc: &Ipc) -> Tail {
        let mut tail = Tail {
            ipc: ipc.clone(),
            open: Ipc::left_tail::<P>,
            read: read::<P>,
            file: None,
            last: None,
        };
        tail.open_next();
        tail
    }

    /// Notes a piece that was published. Of a new publisher it returns what the one before had not published: a sample
    /// that comes before.
    pub fn follow(&mut self, piece: Piece) -> Option<Vec<u8>> {
        let is_other = self
            .last
            .is_some_and(|last| last.epoch_ns != piece.epoch_ns);
        let rest = is_other.then(|| self.take_rest()).flatten();
        self.last = Some(piece);
        rest
    }

    /// What comes after the last piece, if its publisher is gone and had not published all. From here on it follows the
    /// next one.
    pub fn take_rest(&mut self) -> Option<Vec<u8>> {
        let file = self.file.take_if(|file| file.is_left());
        let rest = file.and_then(|file| (self.read)(&file, self.last));
        if self.file.is_none() {
            self.last = None;
            self.open_next();
        }
        rest
    }

    fn open_next(&mut self) {
        let opened = (self.open)(&self.ipc);
        if let Err(error) = &opened {
            tracing::debug!(%error, "the tail of a journal cannot be opened");
        }
        // What the dead have left was taken, or belongs to a time that is not recorded.
        self.file = opened.ok().flatten().filter(|file| !file.is_left());
    }
}

/// The sample in the file, if it goes on after `last`, or is the first.
fn read<P: JournalPiece>(tail: &LeftTail, last: Option<Piece>) -> Option<Vec<u8>> {
    let piece = tail.read::<P>()?;
    let goes_on = match last {
        Some(last) => {
            let is_next = last.sequence.checked_add(1) == Some(piece.sequence());
            piece.epoch_ns() == last.epoch_ns && is_next
        }
        None => piece.begins(),
    };
    goes_on.then(|| piece.bytes().to_vec())
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
    }
}

#[cfg(test)]
mod process_watch_tests {
    use super::*;

    const fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    #[test]
    fn an_end_is_noted_once_when_the_live_screens_see_it_and_a_successor_is_watched_again() {
        for (key, overdue_ms) in [("module_state", 500), ("status/state", 1500)] {
            let mut watch = ProcessWatch::of_topic(key, at(0)).unwrap();
            for round in 0..3 {
                let last = 10_000 * round;
                watch.sample(at(last - last / 10));
                watch.sample(at(last));
                let due = at(last + overdue_ms);
                assert_eq!(watch.deadline(), Some(due), "{key}");
                assert_eq!(watch.looked(true, due), None, "it is only silent");
                let next = watch.deadline().unwrap();
                assert_eq!(next, at(last + overdue_ms + 500));
                assert_eq!(watch.looked(false, next), Some(at(last)));
                assert_eq!(watch.deadline(), None, "it is gone for good");
            }
        }
    }

    #[test]
    fn a_process_that_has_published_nothing_and_topics_that_may_be_silent_are_not_noted() {
        let mut watch = ProcessWatch::of_topic("relay/link", at(0)).unwrap();
        assert_eq!(watch.looked(false, at(500)), None);
        assert_eq!(watch.deadline(), None);
        for key in ["dsp_telemetry", "hero_telemetry", "bridge/journal", "a/b"] {
            assert!(ProcessWatch::of_topic(key, at(0)).is_none(), "{key}");
        }
    }
}
