//! [`Timeline`]: moments of a flight as moments of now.

use ipc_types::MonotonicNs;

/// A moment by the clock of the machine that recorded: its monotonic time, ns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct FlightNs(pub u64);

/// Moments of the flight as moments of now: one moment of each that belong together, and the speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timeline {
    flight: FlightNs,
    live: MonotonicNs,
    speed: f64,
}

impl Timeline {
    /// `flight` is at `live`; the flight passes `speed` times as fast as it was flown.
    pub fn new(flight: FlightNs, live: MonotonicNs, speed: f64) -> Timeline {
        Timeline {
            flight,
            live,
            speed,
        }
    }

    /// When a moment of the flight is, or was.
    pub fn live(&self, flight: FlightNs) -> MonotonicNs {
        let ahead_ns = difference(flight.0, self.flight.0) / self.speed;
        MonotonicNs(moved(self.live.0, ahead_ns))
    }

    /// Which moment of the flight is at `live`.
    pub fn flight(&self, live: MonotonicNs) -> FlightNs {
        let ahead_ns = difference(live.0, self.live.0) * self.speed;
        FlightNs(moved(self.flight.0, ahead_ns))
    }

    /// Turns the moments in a sample, which lie at these offsets, into those of now. 0 stands for never and stays 0; no
    /// moment lies after `now`.
    pub fn translate(&self, sample: &mut [u8], moments: &[usize], now: MonotonicNs) {
        for offset in moments {
            let Some(bytes) = sample
                .get_mut(*offset..)
                .and_then(|rest| rest.first_chunk_mut())
            else {
                continue;
            };
            let recorded = u64::from_le_bytes(*bytes);
            if recorded != 0 {
                let live = self.live(FlightNs(recorded)).min(now);
                *bytes = live.0.max(1).to_le_bytes();
            }
        }
    }
}

/// `later - earlier`, ns: exact for a hundred days, which is longer than any flight.
fn difference(later: u64, earlier: u64) -> f64 {
    (i128::from(later) - i128::from(earlier)) as f64
}

/// `start_ns` and `ahead_ns`; at the ends of the range when that lies beyond.
fn moved(start_ns: u64, ahead_ns: f64) -> u64 {
    // A cast of floating point stops at the ends of the range.
    let moved = i128::from(start_ns).saturating_add(ahead_ns.round() as i128);
    u64::try_from(moved.max(0)).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_keep_their_distances_divided_by_the_speed() {
        let at_speed = |speed| Timeline::new(FlightNs(1_000), MonotonicNs(50_000), speed);
        for (speed, flight, live) in [
            (1.0, 1_000, 50_000),
            (1.0, 1_777, 50_777),
            (1.0, 400, 49_400),
            (10.0, 2_000, 50_100),
            (0.5, 2_000, 52_000),
        ] {
            let timeline = at_speed(speed);
            assert_eq!(timeline.live(FlightNs(flight)), MonotonicNs(live));
            assert_eq!(timeline.flight(MonotonicNs(live)), FlightNs(flight));
        }
        // Before the machine of now was switched on.
        assert_eq!(at_speed(0.01).live(FlightNs(0)), MonotonicNs(0));
        assert_eq!(
            at_speed(0.01).live(FlightNs(u64::MAX)),
            MonotonicNs(u64::MAX)
        );
    }

    #[test]
    fn moments_in_samples_are_translated_never_stays_and_nothing_is_of_the_future() {
        let words = |numbers: [u64; 5]| numbers.map(u64::to_le_bytes).concat();
        let mut sample = words([7, 900, 0, 1_500, 10]);
        let timeline = Timeline::new(FlightNs(1_000), MonotonicNs(950), 1.0);
        timeline.translate(&mut sample, &[8, 16, 24, 32, 40, 99], MonotonicNs(1_000));
        // The last moment would be before the clock's zero: it becomes 1, because 0 means never.
        assert_eq!(sample, words([7, 850, 0, 1_000, 1]));
    }
}
