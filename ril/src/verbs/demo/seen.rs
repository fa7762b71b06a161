//! What a consumer saw of the flight, in shared memory and nowhere else. A pure value, which the checks judge.

use dsp_protocol::Waypoint;
use ipc_types::code::{Functionality, ModuleStatus};
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use ipc_types::{Losses, MonotonicNs, TelemetryGroup};
use plans::flight::ground_m;

/// Ages of samples that are kept for the figures: of the whole demonstration at 50 Hz, five minutes.
const MAX_AGES: usize = 15_000;

/// Distinct states that are kept; a mission has about a dozen, more are a failure anyway.
const MAX_STATES: usize = 64;

/// The samples of a flight, and what they say.
#[derive(Debug, Default)]
pub(super) struct Seen {
    /// Where the helicopter stood before the flight.
    pub home: Option<Waypoint>,
    /// The waypoints to look for, in this order.
    pub waypoints: Vec<Waypoint>,
    /// Of each waypoint whose turn has come, the distance of the nearest sample since the one before was left, m.
    pub approaches_m: Vec<f64>,
    /// The states that the module went through, each once in a row.
    pub states: Vec<(ModuleStatus, Functionality)>,
    /// The last sample of the robot's telemetry.
    pub hero: Option<HeroTelemetry>,
    /// The last state of the module.
    pub state: Option<ModuleState>,
    /// Greatest height over the place of take-off, m.
    pub highest_m: f64,
    /// Whether the helicopter was ever in the air.
    pub ever_flew: bool,
    /// What the subscribers counted.
    pub counts: LossCounts,
    /// Ages of the robot's telemetry at this consumer, from the serial byte to here, µs.
    pub ages_us: Vec<u32>,
}

/// A flight by the script: what is known of it but for what lies in its folder.
#[derive(Debug, Default)]
pub(super) struct Flown {
    /// How many commands ended with 0.
    pub orders_done: usize,
    /// The command that did not, and what it said.
    pub order_failed: Option<String>,
    /// What the last command said at its end.
    pub said: String,
    /// What a consumer saw.
    pub seen: Seen,
    /// The processes that were ended, with their exit codes; `None` for one that a signal ended.
    pub exits: Vec<(&'static str, Option<i32>)>,
}

impl Flown {
    /// A command has ended with this exit code; `end` is what it said last.
    pub fn order_ended(&mut self, command: &str, code: Option<i32>, end: &str) {
        match code {
            Some(0) => self.orders_done += 1,
            _ => self.order_failed = Some(format!("`{command}`: {end}")),
        }
        self.said = end.to_owned();
    }
}

/// What the subscribers counted.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LossCounts {
    /// Raw telemetry.
    pub dsp: Losses,
    /// The robot's telemetry.
    pub hero: Losses,
    /// States.
    pub state: Losses,
}

impl Seen {
    /// Takes a raw sample: it gives the place of take-off.
    pub fn dsp(&mut self, sample: &DspTelemetry) {
        if self.home.is_none() && sample.valid(TelemetryGroup::Geographic) && !sample.is_flying() {
            let place = &sample.geographic;
            self.home = Some(Waypoint {
                latitude_deg: place.latitude_deg,
                longitude_deg: place.longitude_deg,
                altitude_m: place.altitude_m,
            });
        }
    }

    /// Takes a sample of the robot's telemetry, received at `now`.
    pub fn hero(&mut self, sample: &HeroTelemetry, now: MonotonicNs) {
        if self.ages_us.len() < MAX_AGES {
            let age = now.since(MonotonicNs(sample.received_ns));
            self.ages_us
                .push(u32::try_from(age.as_micros()).unwrap_or(u32::MAX));
        }
        self.ever_flew |= sample.is_flying();
        self.hero = Some(*sample);
        if sample.valid(TelemetryGroup::Geographic) {
            self.position(&Waypoint {
                latitude_deg: sample.geodetic.latitude_rad.to_degrees(),
                longitude_deg: sample.geodetic.longitude_rad.to_degrees(),
                altitude_m: sample.geodetic.altitude_m,
            });
        }
    }

    /// A waypoint is approached until the helicopter, once within `NEAR_M`, moves away again by more than the noise of
    /// its position; then the next one's turn comes. That makes the order count.
    fn position(&mut self, here: &Waypoint) {
        const NEAR_M: f64 = 3.0;
        const NOISE_M: f64 = 0.5;
        if let Some(home) = &self.home {
            self.highest_m = self.highest_m.max(here.altitude_m - home.altitude_m);
        }
        while let Some(waypoint) = self
            .waypoints
            .get(self.approaches_m.len().saturating_sub(1))
        {
            let distance_m = ground_m(waypoint, here).hypot(waypoint.altitude_m - here.altitude_m);
            let Some(nearest_m) = self.approaches_m.last_mut() else {
                self.approaches_m.push(distance_m);
                return;
            };
            if distance_m <= *nearest_m {
                *nearest_m = distance_m;
                return;
            }
            let is_left = *nearest_m <= NEAR_M && distance_m > *nearest_m + NOISE_M;
            if !is_left || self.approaches_m.len() == self.waypoints.len() {
                return;
            }
            self.approaches_m.push(f64::INFINITY);
        }
    }

    /// Takes a state of the module.
    pub fn state(&mut self, state: &ModuleState) {
        if let (Some(status), Some(functionality)) = (state.status(), state.functionality())
            && self.states.last() != Some(&(status, functionality))
            && self.states.len() < MAX_STATES
        {
            self.states.push((status, functionality));
        }
        self.state = Some(*state);
    }

    /// The given percentile of the age of the robot's telemetry at this consumer, ms: from the serial byte to here.
    pub fn age_ms(&self, percentile: usize) -> Option<f64> {
        let mut ages = self.ages_us.clone();
        let index = (ages.len() * percentile / 100).min(ages.len().checked_sub(1)?);
        Some(f64::from(*ages.select_nth_unstable(index).1) / 1e3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(north_m: f64) -> Waypoint {
        Waypoint {
            latitude_deg: 37.0 + north_m / 111_194.93,
            longitude_deg: -6.0,
            altitude_m: 10.0,
        }
    }

    /// Flies straight through the given places, a sample each metre; returns the approaches.
    fn fly(waypoints: &[f64], places: &[f64]) -> Vec<f64> {
        let mut seen = Seen {
            waypoints: waypoints.iter().map(|north_m| point(*north_m)).collect(),
            ..Seen::default()
        };
        for leg in places.windows(2) {
            let steps = (leg[1] - leg[0]).abs() as u32;
            for step in 0..=steps {
                let place = point(leg[0] + (leg[1] - leg[0]) * f64::from(step) / f64::from(steps));
                let mut sample = HeroTelemetry {
                    valid_groups: u32::from(TelemetryGroup::Geographic.bit()),
                    ..HeroTelemetry::default()
                };
                sample.geodetic.latitude_rad = place.latitude_deg.to_radians();
                sample.geodetic.longitude_rad = place.longitude_deg.to_radians();
                sample.geodetic.altitude_m = place.altitude_m;
                seen.hero(&sample, MonotonicNs(1000));
            }
        }
        seen.approaches_m
            .iter()
            .map(|metres| metres.round())
            .collect()
    }

    #[test]
    fn waypoints_are_approached_in_their_order() {
        for (waypoints, places, expected) in [
            (
                &[10.0, 30.0, 0.0][..],
                &[0.0, 10.0, 30.0, 0.0][..],
                &[0.0, 0.0, 0.0][..],
            ),
            // A path that ends where it begins is not done at the start: the second one's turn has not come.
            (&[20.0, 0.0], &[0.0, 10.0], &[10.0]),
            (&[20.0, 0.0], &[0.0, 20.0, 0.0], &[0.0, 0.0]),
            // A waypoint that was passed by stops the count.
            (&[10.0, 30.0], &[0.0, 5.0, 0.0], &[5.0]),
        ] {
            assert_eq!(fly(waypoints, places), expected, "{waypoints:?} {places:?}");
        }
    }

    #[test]
    fn ages_have_percentiles() {
        let mut seen = Seen::default();
        assert_eq!(seen.age_ms(50), None);
        for age in 1..=100_u64 {
            let sample = HeroTelemetry {
                received_ns: 1_000_000,
                ..HeroTelemetry::default()
            };
            seen.hero(&sample, MonotonicNs(1_000_000 + age * 1000));
        }
        assert_eq!(
            [50, 99, 100].map(|percentile| seen.age_ms(percentile)),
            [Some(0.051), Some(0.1), Some(0.1)]
        );
    }
}
