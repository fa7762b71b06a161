//! [`Flights`]: where a flight ends, for recordings with a file for each.

use std::time::Duration;

use ipc_types::MonotonicNs;

/// How long the helicopter must have stood on the ground after a flight: a touchdown that bounces ends none, and what the
/// processes say about the landing still belongs to it.
pub const ON_GROUND_FOR: Duration = Duration::from_secs(5);

/// Watches the helicopter.
#[derive(Debug, Default)]
pub struct Flights {
    /// Whether it has been in the air since the last end of a flight.
    has_flown: bool,
    /// Since when it is on the ground again.
    landed: Option<MonotonicNs>,
}

impl Flights {
    /// Takes what telemetry says of the moment `at`.
    pub fn take(&mut self, is_flying: bool, at: MonotonicNs) {
        self.has_flown |= is_flying;
        self.landed = match is_flying {
            true => None,
            false => self.landed.or(self.has_flown.then_some(at)),
        };
    }

    /// When the flight is over unless telemetry says otherwise.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.landed.map(|landed| landed + ON_GROUND_FOR)
    }

    /// Whether a flight is over at `now`; once for each.
    pub fn is_over(&mut self, now: MonotonicNs) -> bool {
        let is_over = self.deadline().is_some_and(|end| end <= now);
        if is_over {
            *self = Flights::default();
        }
        is_over
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Feeds (ms, flying); returns the moments at which a flight was over, ms, looked at every 100 ms.
    fn ends(steps: &[(u64, bool)]) -> Vec<u64> {
        let mut flights = Flights::default();
        let mut steps = steps.iter().peekable();
        let mut ends = Vec::new();
        for ms in (0..60_000).step_by(100) {
            let now = MonotonicNs(ms * 1_000_000);
            while let Some((_, is_flying)) = steps.next_if(|(at, _)| *at <= ms) {
                flights.take(*is_flying, now);
            }
            if flights.is_over(now) {
                ends.push(ms);
            }
        }
        ends
    }

    #[test]
    fn a_flight_is_over_some_seconds_after_the_landing_and_each_once() {
        for (steps, expected) in [
            (&[(0, false), (9000, false)][..], &[][..]),
            (&[(0, false), (1000, true), (20_000, false)], &[25_000]),
            // It bounces.
            (
                &[(0, true), (10_000, false), (11_000, true), (12_000, false)],
                &[17_000],
            ),
            // Telemetry goes on after it.
            (
                &[(0, true), (10_000, false), (15_000, false), (40_000, false)],
                &[15_000],
            ),
            (
                &[(0, true), (10_000, false), (20_000, true), (30_000, false)],
                &[15_000, 35_000],
            ),
            // It begins in the air, and telemetry ends with the landing.
            (&[(0, true), (50_000, false)], &[55_000]),
        ] {
            assert_eq!(ends(steps), expected, "{steps:?}");
        }
    }
}
