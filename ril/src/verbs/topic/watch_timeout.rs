//! How long a command that watches a stream of samples goes on watching. A pure value: it is given samples, the
//! time and whether the publisher lives, and says when to look again or how it ends.

use std::time::Duration;

use ipc_types::MonotonicNs;

/// While nothing comes, the publisher is looked for this many times in each timeout, so that it is missed for at least
/// three quarters of the timeout before the command gives up.
const LOOKS_PER_TIMEOUT: u32 = 4;

/// What the operator asked for.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// End after so many samples.
    pub count: Option<u64>,
    /// End after so long.
    pub duration: Option<Duration>,
    /// How long to wait for the first sample, and for a publisher that is gone.
    pub timeout: Duration,
}

/// What to do next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// Wait for samples, at most until then.
    Wait(MonotonicNs),
    /// Say by [`WatchTimeout::provider`] whether the publisher lives.
    Look,
    /// As many samples as asked for, or as long.
    Enough,
    /// Nothing came in time, or the publisher has been gone too long.
    Nothing,
}

/// See the module's documentation.
#[derive(Debug)]
pub struct WatchTimeout {
    limits: Limits,
    began: MonotonicNs,
    samples: u64,
    /// When there last was a sign of the publisher: a sample, or that it lives.
    sign: MonotonicNs,
    next_look: MonotonicNs,
}

impl WatchTimeout {
    /// Begins to watch.
    pub fn new(limits: Limits, now: MonotonicNs) -> WatchTimeout {
        WatchTimeout {
            limits,
            began: now,
            samples: 0,
            sign: now,
            next_look: now,
        }
    }

    /// How many more samples are wanted.
    pub fn wanted(&self) -> u64 {
        let count = self.limits.count.unwrap_or(u64::MAX);
        count.saturating_sub(self.samples)
    }

    /// So many samples came, of those that were wanted.
    pub fn came(&mut self, samples: u64, now: MonotonicNs) {
        if samples > 0 {
            self.samples += samples;
            self.sign = now;
            self.next_look = now + self.limits.timeout / LOOKS_PER_TIMEOUT;
        }
    }

    /// Whether the publisher lives. Before the first sample that is not enough: a publisher that never publishes anything is not
    /// waited for.
    pub fn provider(&mut self, lives: bool, now: MonotonicNs) {
        self.next_look = now + self.limits.timeout / LOOKS_PER_TIMEOUT;
        if lives && self.samples > 0 {
            self.sign = now;
        }
    }

    /// What to do at `now`.
    pub fn next(&self, now: MonotonicNs) -> Next {
        let end = self.limits.duration.map(|duration| self.began + duration);
        let give_up = self.sign + self.limits.timeout;
        if self.wanted() == 0 || (self.samples > 0 && end.is_some_and(|end| now >= end)) {
            Next::Enough
        } else if now >= give_up {
            Next::Nothing
        } else if now >= self.next_look {
            Next::Look
        } else {
            let end = end.filter(|_| self.samples > 0);
            let until = self.next_look.min(give_up);
            Next::Wait(end.map_or(until, |end| until.min(end)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    const LIMITS: Limits = Limits {
        count: None,
        duration: None,
        timeout: Duration::from_millis(1000),
    };

    /// Watches from 0 ms; samples come at the given times, the publisher lives in the given interval. Returns when and
    /// how it ended; without an end after a minute, nothing.
    fn watch(limits: Limits, samples: &[u64], lives: std::ops::Range<u64>) -> Option<(u64, Next)> {
        let mut timeout = WatchTimeout::new(limits, at(0));
        let mut samples = samples.iter().copied().peekable();
        let mut now = 0;
        while now < 60_000 {
            while samples.next_if(|sample| *sample <= now).is_some() {
                timeout.came(1, at(now));
            }
            match timeout.next(at(now)) {
                Next::Look => timeout.provider(lives.contains(&now), at(now)),
                Next::Wait(until) => {
                    let until = until.0 / 1_000_000;
                    assert!(until > now, "a wait that is no wait");
                    now = samples.peek().map_or(until, |sample| until.min(*sample));
                }
                end => return Some((now, end)),
            }
        }
        None
    }

    #[test]
    fn the_first_sample_is_waited_for_once_the_timeout() {
        assert_eq!(
            watch(LIMITS, &[], 0..0),
            Some((1000, Next::Nothing)),
            "no publisher"
        );
        assert_eq!(
            watch(LIMITS, &[], 0..9999),
            Some((1000, Next::Nothing)),
            "silent from the start"
        );
    }

    #[test]
    fn a_publisher_that_lives_may_be_silent_for_ever() {
        assert_eq!(watch(LIMITS, &[900], 0..u64::MAX), None);
    }

    #[test]
    fn a_publisher_that_is_gone_is_waited_for() {
        assert_eq!(
            watch(LIMITS, &[100, 200], 0..200),
            Some((1200, Next::Nothing))
        );
        let restarted_in_time = [100, 1050, 1100];
        assert_eq!(
            watch(LIMITS, &restarted_in_time, 0..110),
            Some((2100, Next::Nothing))
        );
        // Seen alive at 4850, looked for every 250 ms.
        assert_eq!(watch(LIMITS, &[100], 0..5000), Some((5850, Next::Nothing)));
    }

    #[test]
    fn a_count_is_met_exactly() {
        let limits = Limits {
            count: Some(2),
            ..LIMITS
        };
        assert_eq!(
            watch(limits, &[10, 20, 30], 0..100),
            Some((20, Next::Enough))
        );
        let mut timeout = WatchTimeout::new(limits, at(0));
        assert_eq!(timeout.wanted(), 2);
        timeout.came(1, at(1));
        assert_eq!(timeout.wanted(), 1);
        assert_eq!(WatchTimeout::new(LIMITS, at(0)).wanted(), u64::MAX);
    }

    #[test]
    fn a_duration_ends_well_only_with_a_sample() {
        let limits = Limits {
            duration: Some(Duration::from_millis(300)),
            ..LIMITS
        };
        assert_eq!(
            watch(limits, &[10, 20], 0..u64::MAX),
            Some((300, Next::Enough))
        );
        assert_eq!(watch(limits, &[], 0..u64::MAX), Some((1000, Next::Nothing)));
        assert_eq!(
            watch(limits, &[500], 0..u64::MAX),
            Some((500, Next::Enough))
        );
    }
}
