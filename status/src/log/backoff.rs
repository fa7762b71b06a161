//! When to try again what has failed: soon at first, then ever less often, never not at all.

use std::time::Duration;

use ipc_types::MonotonicNs;

/// The first pause: most trouble is short, and nothing is lost so soon.
pub const FIRST_PAUSE: Duration = Duration::from_millis(500);

/// The longest pause. An attempt every ten seconds costs nothing, and rows wait longer than that in memory.
pub const LONGEST_PAUSE: Duration = Duration::from_secs(10);

/// The pauses between attempts.
#[derive(Clone, Copy, Debug, Default)]
pub struct Backoff {
    /// The last pause; nothing before the first.
    pause: Option<Duration>,
    /// When trouble ended.
    over_since: Option<MonotonicNs>,
}

impl Backoff {
    /// How long to wait after an attempt that failed at `now`: twice as long as before, unless all went well for
    /// [`LONGEST_PAUSE`]. So trouble that comes and goes is not told, and starts no file, more often than that.
    pub fn failed(&mut self, now: MonotonicNs) -> Duration {
        let forgotten = self
            .over_since
            .take()
            .is_some_and(|over| now.since(over) >= LONGEST_PAUSE);
        let next = match self.pause {
            Some(pause) if !forgotten => (2 * pause).min(LONGEST_PAUSE),
            _ => FIRST_PAUSE,
        };
        self.pause = Some(next);
        next
    }

    /// Takes note that the attempt at `now` went well.
    pub fn over(&mut self, now: MonotonicNs) {
        self.over_since = Some(now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_grow_to_a_bound_and_are_forgotten_after_a_good_time() {
        let start = MonotonicNs(1);
        let mut backoff = Backoff::default();
        let mut pause_ms = |at_s| {
            let at = start + Duration::from_secs(at_s);
            backoff.failed(at).as_millis()
        };
        for expected in [500, 1000, 2000, 4000, 8000, 10_000, 10_000] {
            assert_eq!(pause_ms(0), expected);
        }
        let at = |s| start + Duration::from_secs(s);
        for (over_s, failed_s, expected) in [(100, 109, 10_000), (110, 120, 500), (121, 122, 1000)]
        {
            backoff.over(at(over_s));
            assert_eq!(backoff.failed(at(failed_s)).as_millis(), expected);
        }
    }
}
