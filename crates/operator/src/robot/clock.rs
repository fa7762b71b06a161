//! [`Clocks`]: what host monotonic time means as time of day, and [`WallClock`], which says it from one look to the
//! next.

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

    /// A moment by the wall clock, ms since 1970-01-01 UTC.
    pub fn unix_ms(self, at: MonotonicNs) -> u64 {
        self.unix_ns(at) / 1_000_000
    }

    /// A moment by the wall clock, seconds since 1970-01-01 UTC.
    pub fn unix_s(self, at: MonotonicNs) -> u64 {
        self.unix_ns(at) / 1_000_000_000
    }

    /// The time of day of a moment, UTC.
    pub fn time_of_day(self, at: MonotonicNs) -> String {
        time_of_day(self.unix_s(at))
    }
}

/// The wall clock beside the monotonic one. A moment has the same time of day at every look: a wall clock that was set
/// gives all moments another one, and one that is only adjusted does not.
#[derive(Debug, Default)]
pub struct WallClock {
    /// `None` before the first look.
    zero_unix_ns: Option<u64>,
}

impl WallClock {
    /// The clocks at `now`, the present moment, and whether the wall clock was set since the last look.
    pub fn look(&mut self, now: MonotonicNs) -> (Clocks, bool) {
        let before = MonotonicNs::now();
        let since_1970 = SystemTime::UNIX_EPOCH.elapsed().unwrap_or_default();
        let unix_ns = u64::try_from(since_1970.as_nanos()).unwrap_or(u64::MAX);
        let (zero_unix_ns, was_set) = self.read(before, unix_ns, MonotonicNs::now());
        (Clocks { now, zero_unix_ns }, was_set)
    }

    /// The wall clock said `unix_ns` at some moment between two of the monotonic one, which are far apart when the
    /// process stood still there. That is no clock that was set.
    fn read(&mut self, before: MonotonicNs, unix_ns: u64, after: MonotonicNs) -> (u64, bool) {
        let earliest = unix_ns.saturating_sub(after.0);
        let latest = unix_ns.saturating_sub(before.0);
        let set_ns = SET.as_nanos() as u64;
        let as_before = earliest.saturating_sub(set_ns)..=latest.saturating_add(set_ns);
        let was_set = self
            .zero_unix_ns
            .is_some_and(|zero| !as_before.contains(&zero));
        if was_set {
            self.zero_unix_ns = None;
        }
        (*self.zero_unix_ns.get_or_insert(earliest), was_set)
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
            let now = MonotonicNs(now_ms * MS);
            let read = wall.read(now, unix_ms * MS, now);
            assert_eq!(read, (zero_ms * MS, was_set), "{now_ms}");
        }
    }

    #[test]
    fn a_process_that_stood_still_between_two_clocks_takes_none_for_set() {
        const S: u64 = 1_000_000_000;
        let mut wall = WallClock::default();
        for (before_s, unix_s, after_s, zero_s, was_set) in [
            (1, 51, 1, 50, false),
            // Before it read the wall clock, and after it.
            (2, 55, 5, 50, false),
            (6, 56, 9, 50, false),
            // A clock that was set by more than the process stood still.
            (10, 65, 13, 52, true),
        ] {
            let read = wall.read(
                MonotonicNs(before_s * S),
                unix_s * S,
                MonotonicNs(after_s * S),
            );
            assert_eq!(read, (zero_s * S, was_set), "{before_s}");
        }
    }
}
