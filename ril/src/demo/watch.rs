//! What a consumer saw of the flight, in shared memory and nowhere else. A pure value; the verdict judges it.

use ipc_types::code::{Functionality, ModuleStatus};
use ipc_types::payload::{DspGeographic, DspTelemetry, HeroTelemetry, ModuleState};
use ipc_types::{Losses, MonotonicNs, TelemetryGroup};

use super::mission::Point;

/// Ages of samples that are kept for the figures: of the whole demonstration at 50 Hz, five minutes.
const MAX_AGES: usize = 15_000;

/// Distinct states that are kept; a mission has about a dozen, more are a failure anyway.
const MAX_STATES: usize = 64;

/// How near the helicopter came to a waypoint, and when.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// The waypoint.
    pub point: Point,
    /// Distance of the nearest sample since the waypoint before was left, m.
    pub distance_m: f64,
}

/// Watches the telemetry.
#[derive(Debug, Default)]
pub struct Watch {
    home: Option<DspGeographic>,
    waypoints: Vec<Point>,
    approaches: Vec<Approach>,
    states: Vec<(ModuleStatus, Functionality)>,
    ages_us: Vec<u32>,
    last_hero: Option<HeroTelemetry>,
    last_state: Option<ModuleState>,
    highest_m: f64,
    ever_flew: bool,
}

impl Watch {
    /// Takes a raw sample: it gives the place of take-off.
    pub fn dsp(&mut self, sample: &DspTelemetry) {
        if self.home.is_none() && sample.valid(TelemetryGroup::Geographic) && !sample.is_flying() {
            self.home = Some(sample.geographic);
        }
    }

    /// Where the helicopter stood before the mission.
    pub fn home(&self) -> Option<&DspGeographic> {
        self.home.as_ref()
    }

    /// From now on looks for these waypoints, in this order.
    pub fn expect(&mut self, waypoints: Vec<Point>) {
        self.waypoints = waypoints;
    }

    /// Takes a sample of the robot's telemetry, received at `now`.
    pub fn hero(&mut self, sample: &HeroTelemetry, now: MonotonicNs) {
        if self.ages_us.len() < MAX_AGES {
            let age = now.since(MonotonicNs(sample.received_ns));
            self.ages_us
                .push(u32::try_from(age.as_micros()).unwrap_or(u32::MAX));
        }
        self.ever_flew |= sample.is_flying();
        self.last_hero = Some(*sample);
        if sample.valid(TelemetryGroup::Geographic) {
            self.position(sample);
        }
    }

    /// A waypoint is approached until the helicopter, once within `NEAR_M`, moves away again by more than the noise of
    /// its position; then the next one's turn comes. That makes the order count.
    fn position(&mut self, sample: &HeroTelemetry) {
        const NEAR_M: f64 = 3.0;
        const NOISE_M: f64 = 0.5;
        if let Some(home) = &self.home {
            self.highest_m = self
                .highest_m
                .max(sample.geodetic.altitude_m - home.altitude_m);
        }
        while let Some(point) = self.waypoints.get(self.approaches.len().saturating_sub(1)) {
            let distance_m = distance_m(point, sample);
            match self.approaches.last_mut() {
                None => {
                    self.approaches.push(Approach {
                        point: *point,
                        distance_m,
                    });
                    return;
                }
                Some(approach) if distance_m <= approach.distance_m => {
                    approach.distance_m = distance_m;
                    return;
                }
                Some(approach)
                    if approach.distance_m > NEAR_M
                        || distance_m <= approach.distance_m + NOISE_M =>
                {
                    return;
                }
                Some(_) => {}
            }
            let Some(next) = self.waypoints.get(self.approaches.len()) else {
                return;
            };
            self.approaches.push(Approach {
                point: *next,
                distance_m: f64::INFINITY,
            });
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
        self.last_state = Some(*state);
    }

    /// The waypoints approached so far, in order.
    pub fn approaches(&self) -> &[Approach] {
        &self.approaches
    }

    /// The states that the module went through, each once in a row.
    pub fn states(&self) -> &[(ModuleStatus, Functionality)] {
        &self.states
    }

    /// The last sample of the robot's telemetry.
    pub fn last_hero(&self) -> Option<&HeroTelemetry> {
        self.last_hero.as_ref()
    }

    /// The last state of the module.
    pub fn last_state(&self) -> Option<&ModuleState> {
        self.last_state.as_ref()
    }

    /// Greatest height over the place of take-off, m.
    pub fn highest_m(&self) -> f64 {
        self.highest_m
    }

    /// Whether the helicopter was ever in the air.
    pub fn ever_flew(&self) -> bool {
        self.ever_flew
    }

    /// The given percentile of the age of the robot's telemetry at this consumer, µs: from the serial byte to here.
    pub fn age_us(&self, percentile: usize) -> Option<u32> {
        let mut ages = self.ages_us.clone();
        let index = (ages.len() * percentile / 100).min(ages.len().checked_sub(1)?);
        Some(*ages.select_nth_unstable(index).1)
    }
}

/// What the subscribers counted.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counts {
    /// Raw telemetry.
    pub dsp: Losses,
    /// The robot's telemetry.
    pub hero: Losses,
    /// States.
    pub state: Losses,
}

/// Straight distance, m. Good for the few metres of the demonstration.
fn distance_m(point: &Point, sample: &HeroTelemetry) -> f64 {
    const EARTH_RADIUS_M: f64 = 6_371_008.8;
    let here = &sample.geodetic;
    let north = (point.latitude_deg.to_radians() - here.latitude_rad) * EARTH_RADIUS_M;
    let east = (point.longitude_deg.to_radians() - here.longitude_rad)
        * EARTH_RADIUS_M
        * here.latitude_rad.cos();
    let up = point.altitude_m - here.altitude_m;
    (north * north + east * east + up * up).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(north_m: f64) -> Point {
        Point {
            latitude_deg: 37.0 + north_m / 111_194.93,
            longitude_deg: -6.0,
            altitude_m: 10.0,
        }
    }

    /// Flies straight through the given places, a sample each metre; returns the approaches.
    fn fly(waypoints: &[f64], places: &[f64]) -> Vec<f64> {
        let mut watch = Watch::default();
        watch.expect(waypoints.iter().map(|north_m| point(*north_m)).collect());
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
                watch.hero(&sample, MonotonicNs(1000));
            }
        }
        watch
            .approaches()
            .iter()
            .map(|approach| approach.distance_m.round())
            .collect()
    }

    #[test]
    fn waypoints_are_approached_in_their_order() {
        assert_eq!(
            fly(&[10.0, 30.0, 0.0], &[0.0, 10.0, 30.0, 0.0]),
            [0.0, 0.0, 0.0]
        );
    }

    #[test]
    fn a_path_that_ends_where_it_begins_is_not_done_at_the_start() {
        assert_eq!(
            fly(&[20.0, 0.0], &[0.0, 10.0]),
            [10.0],
            "the second one's turn has not come"
        );
        assert_eq!(fly(&[20.0, 0.0], &[0.0, 20.0, 0.0]), [0.0, 0.0]);
    }

    #[test]
    fn a_waypoint_that_was_passed_by_stops_the_count() {
        assert_eq!(fly(&[10.0, 30.0], &[0.0, 5.0, 0.0]), [5.0]);
    }

    #[test]
    fn ages_have_percentiles() {
        let mut watch = Watch::default();
        assert_eq!(watch.age_us(50), None);
        for age in 1..=100_u64 {
            let sample = HeroTelemetry {
                received_ns: 1_000_000,
                ..HeroTelemetry::default()
            };
            watch.hero(&sample, MonotonicNs(1_000_000 + age * 1000));
        }
        assert_eq!(
            (watch.age_us(50), watch.age_us(99), watch.age_us(100)),
            (Some(51), Some(100), Some(100))
        );
    }
}
