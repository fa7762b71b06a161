//! [`ProcessWatch`]: finds out when the process that publishes a topic has ended, by the rule of the live screens. A process that is
//! killed publishes nothing that says so.

use ipc_types::payload::{ModuleState, RelayLink};
use ipc_types::{MonotonicNs, Topic};

use crate::robot::freshness::{Feed, MODULE_OVERDUE_AFTER, OVERDUE_AFTER};

/// Ends the keys of the topics on which modules publish their states, at least once a second.
const STATE_END: &str = "/state";

/// See the module's documentation.
#[derive(Debug)]
pub(super) struct ProcessWatch {
    feed: Feed,
    /// When its last sample came.
    last: Option<MonotonicNs>,
}

impl ProcessWatch {
    /// The watch of the live process that publishes the topic `key`; `None` if a process may be silent on that topic for long, so that
    /// silence is no reason to look for the process.
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

    /// Takes whether the process lives; returns the moment of its last sample if it has published one and has ended since.
    pub fn looked(&mut self, lives: bool, now: MonotonicNs) -> Option<MonotonicNs> {
        self.feed.provider(lives, now);
        self.last.filter(|_| !lives)
    }
}

#[cfg(test)]
mod tests {
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
