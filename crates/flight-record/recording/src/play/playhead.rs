//! [`Playhead`]: where in a flight a replay is, for viewers that go to and fro in it. It has no clock; it is given the
//! time.

use std::time::Duration;

use ipc_types::MonotonicNs;

/// Slowest and fastest speed of a replay. Slower, and each sample is stale when the next one comes; faster, and
/// consumers cannot read as fast as samples come.
pub const SPEEDS: std::ops::RangeInclusive<f64> = 0.01..=100.0;

/// Where in a flight a replay is, for viewers that go to and fro in it.
#[derive(Clone, Debug)]
pub struct Playhead {
    length: Duration,
    /// The position at `since`, or for as long as it stands still.
    position: Duration,
    /// Since when it goes on; `None` while it stands still.
    since: Option<MonotonicNs>,
    speed: f64,
}

impl Playhead {
    /// Stands still at the beginning of a flight of this length.
    pub fn new(length: Duration) -> Playhead {
        Playhead {
            length,
            position: Duration::ZERO,
            since: None,
            speed: 1.0,
        }
    }

    /// Since the beginning.
    pub fn position(&self, now: MonotonicNs) -> Duration {
        let passed = self.since.map_or(Duration::ZERO, |since| now.since(since));
        let ahead = Duration::try_from_secs_f64(passed.as_secs_f64() * self.speed);
        let position = self.position.saturating_add(ahead.unwrap_or(Duration::MAX));
        position.min(self.length)
    }

    /// Whether it goes on.
    pub fn is_playing(&self, now: MonotonicNs) -> bool {
        self.since.is_some() && !self.is_ended(now)
    }

    /// Whether it is at the end.
    pub fn is_ended(&self, now: MonotonicNs) -> bool {
        self.position(now) == self.length
    }

    /// How many times as fast as it was flown.
    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// Goes on; at the end it begins again.
    pub fn play(&mut self, now: MonotonicNs) {
        self.position = match self.is_ended(now) {
            true => Duration::ZERO,
            false => self.position(now),
        };
        self.since = Some(now);
    }

    /// Stands still.
    pub fn pause(&mut self, now: MonotonicNs) {
        self.position = self.position(now);
        self.since = None;
    }

    /// Goes to a position, and goes on or stands still there as before.
    pub fn seek(&mut self, position: Duration, now: MonotonicNs) {
        // At the end it stands still, and what is led away from there does not begin to move.
        let is_playing = self.is_playing(now);
        self.position = position.min(self.length);
        self.since = is_playing.then_some(now);
    }

    /// Goes on at another speed, within [`SPEEDS`]; what is no number changes nothing.
    pub fn set_speed(&mut self, speed: f64, now: MonotonicNs) {
        if speed.is_nan() {
            return;
        }
        self.position = self.position(now);
        self.since = self.since.map(|_| now);
        self.speed = speed.clamp(*SPEEDS.start(), *SPEEDS.end());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    const fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn it_goes_on_at_its_speed_from_where_it_stood() {
        let mut head = Playhead::new(ms(10_000));
        assert_eq!(
            (head.position(at(5000)), head.is_playing(at(0))),
            (ms(0), false)
        );
        head.play(at(1000));
        assert_eq!(head.position(at(1500)), ms(500));
        head.set_speed(4.0, at(1500));
        assert_eq!((head.position(at(2000)), head.speed()), (ms(2500), 4.0));
        head.pause(at(2000));
        assert_eq!(head.position(at(9000)), ms(2500));
        head.seek(ms(7000), at(9000));
        assert!(!head.is_playing(at(9000)));
        head.play(at(9000));
        assert_eq!(head.position(at(9500)), ms(9000));
        head.seek(ms(1000), at(9500));
        assert_eq!(
            (head.position(at(9500)), head.is_playing(at(9500))),
            (ms(1000), true)
        );
    }

    #[test]
    fn at_the_end_it_stands_still_and_begins_again() {
        let mut head = Playhead::new(ms(1000));
        head.play(at(0));
        assert!(head.is_ended(at(1000)) && !head.is_playing(at(1000)));
        assert_eq!(head.position(at(60_000)), ms(1000));
        head.seek(ms(400), at(60_000));
        assert!(!head.is_playing(at(60_000)));
        head.seek(ms(5000), at(60_000));
        assert!(head.is_ended(at(60_000)));
        head.play(at(60_000));
        assert_eq!(head.position(at(60_100)), ms(100));
    }

    #[test]
    fn a_speed_is_bounded_and_a_number() {
        let mut head = Playhead::new(ms(1000));
        for (speed, expected) in [
            (f64::NAN, 1.0),
            (0.0, 0.01),
            (f64::INFINITY, 100.0),
            (-3.0, 0.01),
            (2.0, 2.0),
        ] {
            head.set_speed(speed, at(0));
            assert_eq!(head.speed(), expected, "{speed}");
        }
    }
}
