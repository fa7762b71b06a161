//! [`Clocks`]: what host monotonic time means as time of day, and [`WallClock`], which says it from one look to the next.

use std::time::{Duration, SystemTime};

use ipc_types::MonotonicNs;

use crate::render::words::time_of_day;

/// A wall clock that differs by more from what it was, beside the monotonic one, was set.
const SET: Duration = Duration::from_millis(500);

/// The clocks at one moment.
#[derive(Clone, Copy, Debug)]
pub struct Clocks {
    /// Host monotonic time.
    pub now: MonotonicNs,
    /// The wall clock when host monotonic time was 0, ns since 1970-01-01 UTC.
    pub zero_unix_ns: u64,
}

impl Clocks {
    /// A moment by the wall clock, ns since 1970-01-01 UTC.
    pub fn unix_ns(self, at: MonotonicNs) -> u64 {
        self.zero_unix_ns.saturating_add(at.0)
    }

    /// The same in ms.
    pub fn unix_ms(self, at: MonotonicNs) -> u64 {
        self.unix_ns(at) / 1_000_000
    }

    /// The same in seconds.
    pub fn unix_s(self, at: MonotonicNs) -> u64 {
        self.unix_ns(at) / 1_000_000_000
    }

    /// The time of day of a moment, UTC.
    pub fn time_of_day(self, at: MonotonicNs) -> String {
        time_of_day(self.unix_s(at))
    }
}

/// The wall clock beside the monotonic one. A moment has the same time of day at every look: a wall clock that was set gives all moments
/// another one, and one that is only adjusted does not.
#[derive(Debug, Default)]
pub struct WallClock {
    /// `None` before the first look.
    zero_unix_ns: Option<u64>,
}

impl WallClock {
    /// The clocks at `now`, the present moment, and whether the wall clock was set since the last look.
    pub fn look(&mut self, now: MonotonicNs) -> (Clocks, bool) {
        let since_1970 = SystemTime::UNIX_EPOCH.elapsed().unwrap_or_default();
        let unix_ns = u64::try_from(since_1970.as_nanos()).unwrap_or(u64::MAX);
        self.at(now, unix_ns)
    }

    fn at(&mut self, now: MonotonicNs, unix_ns: u64) -> (Clocks, bool) {
        let measured = unix_ns.saturating_sub(now.0);
        let was_set = self
            .zero_unix_ns
            .is_some_and(|zero| Duration::from_nanos(measured.abs_diff(zero)) > SET);
        if was_set {
            self.zero_unix_ns = Some(measured);
        }
        let zero_unix_ns = *self.zero_unix_ns.get_or_insert(measured);
        (Clocks { now, zero_unix_ns }, was_set)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_moment_keeps_its_time_of_day_until_the_clock_is_set() {
        const MS: u64 = 1_000_000;
        let mut wall = WallClock::default();
        for (now_ms, unix_ms, zero_ms, was_set) in [
            (1_000, 51_000, 50_000, false),
            // Adjusted, forth and back.
            (2_000, 52_500, 50_000, false),
            (3_000, 52_500, 50_000, false),
            (4_000, 54_501, 50_501, true),
            (5_000, 55_501, 50_501, false),
            (6_000, 6_000, 0, true),
            // Before the machine was started: as if at its start.
            (7_000, 3_000, 0, false),
        ] {
            let (clock, is_set) = wall.at(MonotonicNs(now_ms * MS), unix_ms * MS);
            assert_eq!((clock.zero_unix_ns, is_set), (zero_ms * MS, was_set));
            assert_eq!(
                clock.unix_ns(MonotonicNs(MS)),
                (zero_ms + 1) * MS,
                "{now_ms}"
            );
        }
    }
}
