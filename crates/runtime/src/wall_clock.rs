//! The wall clock of this machine, and whether anybody has set it: a computer without a battery for its clock begins in
//! 1970, or where its system was built, until a network or a person sets it.

use std::fs;
use std::time::{SystemTime, UNIX_EPOCH};

/// The wall clock, s since 1970, and the newest moment that must have been.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WallClock {
    /// What it shows; 0 if that is before 1970.
    pub unix_s: u64,
    /// When the file of this program was written, which is before now; 0 if that is not known.
    pub not_before_unix_s: u64,
}

impl WallClock {
    /// What it shows now.
    pub fn look() -> WallClock {
        let unix_s = |time: SystemTime| {
            time.duration_since(UNIX_EPOCH)
                .map_or(0, |time| time.as_secs())
        };
        let written = std::env::current_exe()
            .and_then(fs::metadata)
            .and_then(|metadata| metadata.modified());
        WallClock {
            unix_s: unix_s(SystemTime::now()),
            not_before_unix_s: written.map_or(0, unix_s),
        }
    }

    /// Whether it can be right.
    pub fn was_set(self) -> bool {
        self.unix_s >= self.not_before_unix_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_clock_of_a_machine_that_tests_run_on_was_set() {
        let clock = WallClock::look();
        assert!(clock.was_set(), "{clock:?}");
        assert!(clock.not_before_unix_s > 0);
        let unset = WallClock {
            unix_s: 30,
            ..clock
        };
        assert!(!unset.was_set());
    }
}
