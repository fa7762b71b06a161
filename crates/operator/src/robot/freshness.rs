//! [`Feed`]: how old the newest sample of a topic is, and whether its process lives. It says when to look again, so
//! that a screen which shows old data says so in time although nothing comes that could wake it.
//!
//! [`SampleAge`]: what reports say of a sample: how old it is, and whether it is too old; and the names of its codes.

use std::fmt;
use std::time::Duration;

use ipc_types::MonotonicNs;

use crate::render::fields::Tree;

/// A topic is overdue when nothing has come for so long; then its process is looked for. Twice the bridge's period.
pub const OVERDUE_AFTER: Duration = Duration::from_millis(500);

/// When the state of status, of the relay and of other modules is overdue, which comes once a second.
pub const MODULE_OVERDUE_AFTER: Duration = Duration::from_millis(1500);

/// A module's state older than this says nothing of the present: every module publishes it at least once a second, and
/// this is three of them.
pub const MODULE_STALE_AFTER: Duration = Duration::from_secs(3);

/// How often a process that lives and says nothing is looked for.
pub const LOOK_PERIOD: Duration = Duration::from_millis(500);

/// By how much a sample may seem to be of the future: a relay translates times with an error of some milliseconds, and
/// a sample can come while the clock is read. A sample of later is of no age that can be known.
const CLOCK_ERROR: Duration = Duration::from_millis(100);

/// How often the age of an old sample is shown anew.
const AGE_PERIOD: Duration = Duration::from_secs(1);

/// How a topic is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Freshness {
    /// No process publishes it, and nothing has come so far.
    Absent,
    /// A process publishes it, and nothing has come so far.
    Waiting,
    /// The newest sample says how things are.
    Fresh,
    /// The process lives, but the newest sample is old; of unknown age when it claims to be of the future.
    Stale(Option<Duration>),
    /// The process is gone; so old is its last sample.
    Gone(Option<Duration>),
}

impl Freshness {
    /// Whether the newest sample says how things are.
    pub fn is_fresh(self) -> bool {
        self == Freshness::Fresh
    }

    /// The age in words, in whole seconds; `None` if it is fresh or there is none.
    pub fn age(self) -> Option<String> {
        match self {
            Freshness::Stale(age) | Freshness::Gone(age) => Some(match age {
                Some(age) => format!("{} s old", age.as_secs()),
                None => "of unknown age".to_owned(),
            }),
            _ => None,
        }
    }
}

/// What came of a topic last.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Heard {
    /// When its content was so, by its own account.
    published: MonotonicNs,
    arrived: MonotonicNs,
}

/// How old the newest sample of a topic is, whether its process lives, and when to look again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feed {
    stale_after: Duration,
    /// `None` for a topic whose process is not looked for.
    overdue_after: Option<Duration>,
    heard: Option<Heard>,
    provided: Option<bool>,
    /// When to look for the process; `None` while a sample or a new generation will say that it is there.
    next_look: Option<MonotonicNs>,
}

impl Feed {
    /// A topic of which nothing is known. Its samples are stale after `stale_after`; when nothing has come for
    /// `overdue_after`, its process is looked for.
    pub fn new(stale_after: Duration, overdue_after: Duration) -> Feed {
        Feed {
            stale_after,
            overdue_after: Some(overdue_after),
            heard: None,
            provided: None,
            next_look: Some(MonotonicNs(0)),
        }
    }

    /// A topic whose process is not looked for, because another topic's is the same.
    pub fn without_looks(stale_after: Duration) -> Feed {
        Feed {
            stale_after,
            overdue_after: None,
            heard: None,
            provided: None,
            next_look: None,
        }
    }

    /// A sample came whose content was so at `published`.
    pub fn sample(&mut self, published: MonotonicNs, now: MonotonicNs) {
        self.heard = Some(Heard {
            published,
            arrived: now,
        });
        self.provided = Some(true);
        self.next_look = self.overdue_after.map(|overdue| now + overdue);
    }

    /// Whether a live process publishes the topic.
    pub fn provider(&mut self, lives: bool, now: MonotonicNs) {
        self.provided = Some(lives);
        // A process that is gone is not looked for: its successor wakes every subscriber.
        self.next_look = lives.then(|| now + LOOK_PERIOD);
    }

    /// When to look for the process; `None` while a sample or a new generation will say that it is there.
    pub fn next_look(&self) -> Option<MonotonicNs> {
        self.next_look
    }

    /// Whether to look for the process now.
    pub fn look_due(&self, now: MonotonicNs) -> bool {
        self.next_look.is_some_and(|due| now >= due)
    }

    /// How the topic is.
    pub fn at(&self, now: MonotonicNs) -> Freshness {
        let Some(heard) = self.heard else {
            return match self.provided {
                Some(true) => Freshness::Waiting,
                _ => Freshness::Absent,
            };
        };
        let age = (heard.published <= now + CLOCK_ERROR).then(|| now.since(heard.published));
        if self.provided == Some(false) {
            Freshness::Gone(age)
        } else if age.is_none_or(|age| age > self.stale_after) {
            Freshness::Stale(age)
        } else {
            Freshness::Fresh
        }
    }

    /// When to look or to show the topic anew although nothing comes; `None` if only a sample changes it.
    pub fn next(&self, now: MonotonicNs) -> Option<MonotonicNs> {
        let shown = match (self.at(now), self.heard) {
            (Freshness::Fresh, Some(heard)) => {
                Some(heard.published + self.stale_after + Duration::from_millis(1))
            }
            (Freshness::Stale(Some(age)) | Freshness::Gone(Some(age)), _) => {
                // With the next whole second of its age.
                let into = Duration::from_nanos(u64::from(age.subsec_nanos()));
                Some(now + (AGE_PERIOD - into))
            }
            _ => None,
        };
        [shown, self.next_look].into_iter().flatten().min()
    }
}

/// A sample older than this is marked stale: the state comes at least once a second, telemetry far more often.
pub const STALE_AFTER: Duration = Duration::from_secs(1);

/// A sample by its age.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleAge {
    sequence: u64,
    /// `None` if it is dated in the future: it counts as stale, because its age is unknown.
    age_ms: Option<u64>,
    stale: bool,
}

impl SampleAge {
    /// The sample `sequence` whose content was so at `time`.
    pub fn new(sequence: u64, time: MonotonicNs, now: MonotonicNs) -> SampleAge {
        SampleAge::with_limit(sequence, time, now, STALE_AFTER)
    }

    /// The age of a sample that is stale when it is older than `limit`.
    pub fn with_limit(
        sequence: u64,
        time: MonotonicNs,
        now: MonotonicNs,
        limit: Duration,
    ) -> SampleAge {
        SampleAge {
            sequence,
            age_ms: age_ms(time, now),
            stale: is_stale(time, now, limit),
        }
    }

    /// Its age, ms; `None` if it is dated in the future.
    pub fn age_ms(self) -> Option<u64> {
        self.age_ms
    }

    /// Whether it is too old to say how things are now.
    pub fn is_stale(self) -> bool {
        self.stale
    }

    /// The age as part of a JSON object.
    pub fn tree(self) -> Tree {
        Tree::nested([
            ("sequence", self.sequence.into()),
            ("age_ms", self.age_ms.into()),
            ("stale", self.stale.into()),
        ])
    }
}

impl fmt::Display for SampleAge {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.age_ms {
            Some(age) => write!(f, "sample {}, {age} ms old", self.sequence)?,
            None => write!(f, "sample {}, of unknown age", self.sequence)?,
        }
        if self.stale {
            f.write_str(", STALE")?;
        }
        Ok(())
    }
}

/// Whether what was so at `time` says nothing of `now` any more. What is dated in the future is of unknown age, so it
/// is stale.
pub fn is_stale(time: MonotonicNs, now: MonotonicNs, limit: Duration) -> bool {
    time > now || now.since(time) > limit
}

/// Whether what was so at `time` still says how things are at `now`.
pub fn is_present(time: MonotonicNs, now: MonotonicNs) -> bool {
    !is_stale(time, now, STALE_AFTER)
}

/// The name of a code, or a number that is not in the contract.
pub fn named(name: Option<impl fmt::Display>, number: u32) -> String {
    name.map_or_else(|| format!("unknown-{number}"), |name| name.to_string())
}

/// How long ago `time` was, in milliseconds, the unit of all ages. A time of the future, which only a faulty publisher
/// gives, must not look like the present.
pub fn age_ms(time: MonotonicNs, now: MonotonicNs) -> Option<u64> {
    let age = (time <= now).then(|| now.since(time))?;
    u64::try_from(age.as_millis()).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    fn feed() -> Feed {
        Feed::new(Duration::from_secs(1), OVERDUE_AFTER)
    }

    #[test]
    fn a_topic_that_goes_silent_is_looked_for_and_is_stale_at_its_limit() {
        let mut feed = feed();
        assert!(feed.look_due(at(0)));
        feed.provider(true, at(0));
        assert_eq!(feed.at(at(0)), Freshness::Waiting);
        feed.sample(at(100), at(110));
        assert_eq!(feed.at(at(110)), Freshness::Fresh);
        assert_eq!(feed.next(at(110)), Some(at(610)));
        assert!(feed.look_due(at(610)));
        feed.provider(true, at(610));
        assert_eq!(feed.next(at(610)), Some(at(1101)));
        assert_eq!(feed.at(at(1100)), Freshness::Fresh);
        let age = Some(Duration::from_millis(1001));
        assert_eq!(feed.at(at(1101)), Freshness::Stale(age));
    }

    #[test]
    fn the_age_of_an_old_sample_is_shown_anew_every_second() {
        let mut feed = feed();
        feed.sample(at(0), at(0));
        feed.provider(false, at(700));
        let mut now = at(1300);
        for second in 2..5 {
            now = feed.next(now).unwrap();
            assert_eq!(now, at(second * 1000));
            assert_eq!(feed.at(now).age(), Some(format!("{second} s old")));
        }
    }

    #[test]
    fn a_process_that_is_gone_is_not_looked_for_until_it_is_back() {
        let mut feed = feed();
        feed.provider(false, at(0));
        assert_eq!(
            (feed.at(at(0)), feed.next(at(0))),
            (Freshness::Absent, None)
        );
        feed.sample(at(5), at(5));
        assert_eq!(feed.at(at(5)), Freshness::Fresh);
        feed.provider(false, at(600));
        assert!(matches!(feed.at(at(600)), Freshness::Gone(Some(_))));
        assert!(!feed.look_due(at(9_000_000)));
    }

    #[test]
    fn a_time_of_the_future_never_looks_fresh() {
        let mut feed = feed();
        feed.sample(MonotonicNs(u64::MAX), at(5));
        assert_eq!(feed.at(at(5)), Freshness::Stale(None));
        assert_eq!(feed.at(at(5)).age().as_deref(), Some("of unknown age"));
        assert_eq!(feed.next(at(5)), Some(at(505)), "only for a look");
        feed.sample(at(30), at(5));
        assert_eq!(feed.at(at(5)), Freshness::Fresh, "an error of the clock");
    }
}
