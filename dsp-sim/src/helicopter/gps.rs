//! What goes wrong with the GPS receiver: no fix, and an altitude that drifts.
//!
//! The helicopter flies by its true position, so neither changes the flight. They change what a status reports.

use std::time::Duration;

/// The receiver's errors, apart from its noise.
#[derive(Clone, Copy, Debug)]
pub(super) struct GpsErrors {
    /// There is no fix before this time.
    fix_at: Duration,
    drift: Drift,
}

/// An altitude error that grows for a time and then stays.
#[derive(Clone, Copy, Debug, Default)]
struct Drift {
    error_m: f64,
    rate_mps: f64,
    from: Duration,
    until: Duration,
}

impl GpsErrors {
    /// A receiver that has its first fix at `first_fix`, and measures without drift.
    pub(super) fn new(first_fix: Duration) -> GpsErrors {
        GpsErrors {
            fix_at: first_fix,
            drift: Drift::default(),
        }
    }

    /// Loses the fix until `end`.
    pub(super) fn lose_fix(&mut self, end: Duration) {
        self.fix_at = self.fix_at.max(end);
    }

    /// Lets the altitude drift at `rate_mps` for `length`, in place of a drift that is under way. The error that was
    /// there stays.
    pub(super) fn drift(&mut self, now: Duration, rate_mps: f64, length: Duration) {
        self.drift = Drift {
            error_m: self.altitude_error_m(now),
            rate_mps,
            from: now,
            until: now.saturating_add(length),
        };
    }

    pub(super) fn has_fix(&self, now: Duration) -> bool {
        now >= self.fix_at
    }

    /// By how much the altitude reads too high, m.
    pub(super) fn altitude_error_m(&self, now: Duration) -> f64 {
        let Drift {
            error_m,
            rate_mps,
            from,
            until,
        } = self.drift;
        error_m + rate_mps * now.min(until).saturating_sub(from).as_secs_f64()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fix_comes_and_goes() {
        let second = Duration::from_secs;
        let mut gps = GpsErrors::new(second(2));
        assert!(!gps.has_fix(second(1)) && gps.has_fix(second(2)));
        gps.lose_fix(second(9));
        gps.lose_fix(second(5));
        assert!(!gps.has_fix(second(8)) && gps.has_fix(second(9)));
    }

    #[test]
    fn the_altitude_error_grows_stays_and_can_be_taken_back() {
        let second = Duration::from_secs;
        let mut gps = GpsErrors::new(second(0));
        assert_eq!(gps.altitude_error_m(second(100)), 0.0);
        gps.drift(second(10), 0.5, second(4));
        assert_eq!(gps.altitude_error_m(second(12)), 1.0);
        assert_eq!(gps.altitude_error_m(second(100)), 2.0);
        gps.drift(second(100), -1.0, second(10));
        assert_eq!(gps.altitude_error_m(second(101)), 1.0);
        gps.drift(second(102), 0.0, second(1));
        assert_eq!(gps.altitude_error_m(second(200)), 0.0);
    }
}
