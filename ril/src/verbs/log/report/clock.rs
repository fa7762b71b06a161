//! Times of a recording: [`FlightClock`], seconds since its beginning; [`RelativeDelay`], how late a sample is against the DSP's clock.

/// A step of the clock beyond this is none of a flight, s: a damaged number, or another start of the host.
const MAX_STEP_S: f64 = 86_400.0;

/// A step back beyond this is another start of the host, s. Topics lie less apart.
const MAX_BACK_S: f64 = 10.0;

/// Monotonic nanoseconds as seconds since the beginning. A clock that jumps goes on where it was.
#[derive(Clone, Copy, Debug, Default)]
pub struct FlightClock {
    first_ns: u64,
    /// What was the time at the last moment: ns, and s since the beginning.
    last: Option<(u64, f64)>,
    jumps: u64,
}

impl FlightClock {
    /// The moment `ns`.
    pub fn at(&mut self, ns: u64) -> f64 {
        let Some((last_ns, last_s)) = self.last else {
            (self.first_ns, self.last) = (ns, Some((ns, 0.0)));
            return 0.0;
        };
        let step_s = (i128::from(ns) - i128::from(last_ns)) as f64 / 1e9;
        let is_jump = !(-MAX_BACK_S..=MAX_STEP_S).contains(&step_s);
        if is_jump {
            self.jumps += 1;
        }
        let at_s = if is_jump { last_s } else { last_s + step_s };
        if is_jump || step_s > 0.0 {
            self.last = Some((ns, at_s));
        }
        at_s.max(0.0)
    }

    /// The moment `ns` of a recording whose samples were all taken: between its beginning and its end.
    pub fn within(&self, ns: u64) -> f64 {
        let since_s = (i128::from(ns) - i128::from(self.first_ns)) as f64 / 1e9;
        since_s.clamp(0.0, self.end_s())
    }

    /// The latest moment, s.
    pub fn end_s(&self) -> f64 {
        self.last.map_or(0.0, |(_, at_s)| at_s)
    }

    /// How often the clock jumped.
    pub fn jumps(&self) -> u64 {
        self.jumps
    }
}

/// Length of a window, s: clocks drift apart by less than 1 ms in it.
const WINDOW_S: f64 = 10.0;

/// How much later a sample came than the fastest one of the last 10 to 20 s, by the clocks of both ends.
#[derive(Clone, Copy, Debug, Default)]
pub struct RelativeDelay {
    window: u64,
    /// Least difference of the clocks in this window and the one before, ns.
    least_ns: [Option<i128>; 2],
}

impl RelativeDelay {
    /// A sample of the DSP's time `dsp_ms` was received at `received_ns`; ms.
    pub fn of(&mut self, at_s: f64, dsp_ms: u32, received_ns: u64) -> f64 {
        let window = (at_s / WINDOW_S) as u64;
        if window != self.window {
            let is_next = window == self.window + 1;
            self.least_ns = [None, self.least_ns[0].filter(|_| is_next)];
            self.window = window;
        }
        let difference_ns = i128::from(received_ns) - i128::from(dsp_ms) * 1_000_000;
        let least = self.least_ns[0].map_or(difference_ns, |least| least.min(difference_ns));
        self.least_ns[0] = Some(least);
        let least = self.least_ns[1].map_or(least, |before| least.min(before));
        (difference_ns - least) as f64 / 1e6
    }

    /// The DSP's clock began anew.
    pub fn reset(&mut self) {
        *self = RelativeDelay::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_jumps_goes_on_where_it_was() {
        let mut clock = FlightClock::default();
        let seconds = |seconds: u64| seconds * 1_000_000_000;
        for (ns, expected) in [
            (seconds(1000), 0.0),
            (seconds(1002), 2.0),
            (seconds(1001), 1.0),
            (u64::MAX, 2.0),
            (seconds(1003), 2.0),
            (seconds(1004), 3.0),
            (0, 3.0),
            (seconds(1), 4.0),
        ] {
            assert_eq!(clock.at(ns), expected, "{ns}");
        }
        assert_eq!((clock.end_s(), clock.jumps()), (4.0, 3));
        assert_eq!(clock.within(seconds(1001)), 1.0);
        assert_eq!((clock.within(0), clock.within(u64::MAX)), (0.0, 4.0));
    }

    #[test]
    fn a_late_sample_is_late_against_the_fastest_one() {
        let mut delay = RelativeDelay::default();
        let received_ns = |ms: u64| 5_000_000_000 + ms * 1_000_000;
        assert_eq!(delay.of(0.0, 100, received_ns(3)), 0.0);
        assert_eq!(delay.of(0.02, 120, received_ns(30)), 7.0);
        assert_eq!(delay.of(0.04, 140, received_ns(42)), 0.0);
        assert_eq!(delay.of(11.0, 11_100, received_ns(11_004)), 2.0);
        assert_eq!(delay.of(99.0, 99_100, received_ns(99_040)), 0.0);
    }
}
