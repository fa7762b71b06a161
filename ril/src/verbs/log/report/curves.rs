//! [`Curves`]: the values of a flight over time, in bounded memory.
//!
//! [`FlightClock`]: seconds since the beginning of a recording; [`RelativeDelay`]: how late a sample is against the
//! DSP's clock.

use ipc_types::TelemetryGroup;
use ipc_types::payload::{DspTelemetry, HeroTelemetry};
use operator::robot::pilot::PilotView;
use view::report::envelope::{Bins, Envelope};
use view::report::flight::{Curve, Ink, Limit, Plot, Scale};

use crate::verbs::log::summary::GAP_S;

/// An altitude that was asked for beyond this is none, m.
const MAX_ALTITUDE_M: f32 = 100_000.0;

/// The values of a flight over time, in bounded memory.
#[derive(Clone, Debug)]
pub struct Curves {
    altitude: Envelope,
    asked_altitude: Envelope,
    speed: Envelope,
    climb: Envelope,
    battery: Envelope,
    fuel: Envelope,
    rotor: Envelope,
    interval: Envelope,
    delay: Envelope,
    publication: Envelope,
    /// Samples that came, and those that are missing.
    pub received: Bins,
    /// Samples that are missing by their numbers.
    pub lost: Bins,
    /// Pieces and messages that the bridge rejected.
    pub rejected: Bins,
    /// Commands that the bridge sent again.
    pub repeated: Bins,
}

impl Default for Curves {
    fn default() -> Self {
        // A curve is interrupted where nothing came.
        let empty = || Envelope::new(GAP_S);
        Curves {
            altitude: empty(),
            asked_altitude: empty(),
            speed: empty(),
            climb: empty(),
            battery: empty(),
            fuel: empty(),
            rotor: empty(),
            // What an interval is about is that nothing came.
            interval: Envelope::new(f64::INFINITY),
            delay: empty(),
            publication: empty(),
            received: Bins::default(),
            lost: Bins::default(),
            rejected: Bins::default(),
            repeated: Bins::default(),
        }
    }
}

impl Curves {
    /// Takes a sample, and what a pilot sees of it.
    pub fn sample(&mut self, at_s: f64, dsp: &DspTelemetry, view: &PilotView) {
        let push = |curve: &mut Envelope, value: Option<f64>| {
            if let Some(value) = value {
                curve.push(at_s, value);
            }
        };
        push(&mut self.altitude, view.altitude_m);
        push(&mut self.speed, view.ground_speed_mps);
        push(&mut self.climb, view.climb_mps);
        push(&mut self.battery, view.battery_v);
        push(&mut self.fuel, view.fuel_percent);
        let rotor = dsp.valid(TelemetryGroup::RotorSpeed);
        push(&mut self.rotor, rotor.then(|| f64::from(dsp.rotor_rpm)));
        // On the ground nothing is asked for.
        let asked_m = dsp.references.altitude_m;
        let is_asked = dsp.valid(TelemetryGroup::References)
            && dsp.is_flying()
            && asked_m.abs() < MAX_ALTITUDE_M;
        push(&mut self.asked_altitude, is_asked.then(|| asked_m.into()));
        self.received.add(at_s, 1.0);
    }

    /// The sample came so long after the one before, ms.
    pub fn interval(&mut self, at_s: f64, ms: f64) {
        self.interval.push(at_s, ms);
    }

    /// The sample is so late against the DSP's clock, ms.
    pub fn delay(&mut self, at_s: f64, ms: f64) {
        self.delay.push(at_s, ms);
    }

    /// Takes a sample that status published.
    pub fn hero(&mut self, at_s: f64, hero: &HeroTelemetry) {
        let age_ns = hero.published_ns.saturating_sub(hero.received_ns);
        self.publication.push(at_s, age_ns as f64 / 1e6);
    }

    /// The plots, with limits of the altitude.
    pub fn plots(self, altitude_limits: Vec<Limit>) -> Vec<Plot> {
        let mut altitude = Plot::new("altitude", "Altitude", "m", Scale::Auto { least_span: 4.0 });
        altitude.about = "Telemetry altitude (not above take-off).".to_owned();
        altitude.curves = vec![
            Curve::line("GPS", Ink::Blue, self.altitude),
            Curve::dashes("asked for", Ink::Purple, self.asked_altitude),
        ];
        altitude.limits = altitude_limits;
        let mut speed = Plot::new("speed", "Speed", "m/s", Scale::Auto { least_span: 2.0 });
        speed.curves = vec![
            Curve::line("over ground", Ink::Blue, self.speed),
            Curve::line("upwards", Ink::Orange, self.climb),
        ];
        let mut battery = Plot::new("battery", "Battery", "V", Scale::Auto { least_span: 1.0 });
        battery.curves = vec![Curve::line("battery", Ink::Blue, self.battery)];
        let mut fuel = Plot::new("fuel", "Fuel", "%", Scale::FromZero { least_top: 100.0 });
        fuel.curves = vec![Curve::line("fuel", Ink::Blue, self.fuel)];
        let mut rotor = Plot::new(
            "rotor",
            "Main rotor",
            "rpm",
            Scale::FromZero { least_top: 100.0 },
        );
        rotor.curves = vec![Curve::line("rotor", Ink::Blue, self.rotor)];
        let mut link = Plot::new("link", "Link", "1/s", Scale::FromZero { least_top: 10.0 });
        link.about =
            "Samples of telemetry that were recorded, and those that are missing by their numbers."
                .to_owned();
        link.curves = vec![
            Curve::bars("samples", Ink::Grey, self.received),
            Curve::bars("lost samples", Ink::Red, self.lost),
            Curve::bars("rejected pieces and messages", Ink::Orange, self.rejected),
            Curve::bars("repeated commands", Ink::Purple, self.repeated),
        ];
        let mut ages = Plot::new("ages", "Ages", "ms", Scale::Logarithmic { least: 0.1 });
        ages.about = "Between two samples: the age that the newest value had when the next one came. Late: beyond the fastest sample of the \
            last 10 to 20 s, by the clocks of DSP and host."
            .to_owned();
        ages.curves = vec![
            Curve::line(
                "from the last byte to the sample of status",
                Ink::Green,
                self.publication,
            ),
            Curve::line("late", Ink::Orange, self.delay),
            Curve::line("between two samples", Ink::Blue, self.interval),
        ];
        vec![altitude, speed, battery, fuel, rotor, link, ages]
    }
}

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
