//! Whole flights: what holds whatever the wind, the path and the seed.

mod instruments;

use super::body::{MAX_TILT_RATE_RADPS, MAX_YAW_RATE_RADPS};
use super::control::MAX_TILT_RAD;
use super::*;
use crate::device::ports::Ports;
use crate::simulator::Setup;

const STEP: Duration = Duration::from_nanos(STEP_NS);

/// A helicopter that is flown step by step.
struct Flight {
    helicopter: Helicopter,
    /// Called after every step.
    check: fn(&Helicopter),
}

/// Settings of a brisk flight.
fn brisk() -> Settings {
    let mut settings = Ports::default().settings();
    settings.limits.cruise_mps = 8.0;
    settings.limits.climb_mps = 4.0;
    settings
}

fn model(seed: u64) -> Model {
    Model {
        seed,
        ..Setup::default().model
    }
}

/// No wind, no noise.
fn calm() -> Model {
    let mut calm = model(1);
    calm.wind.speed_mps = 0.0;
    calm.wind.gust_mps = 0.0;
    calm.noise_level = 0.0;
    calm
}

impl Flight {
    fn new(model: Model, settings: Settings) -> Flight {
        Flight {
            helicopter: Helicopter::new(model, settings),
            check: |_| {},
        }
    }

    /// A flight that hovers at the take-off altitude.
    fn hovering(model: Model, settings: Settings) -> Flight {
        let mut flight = Flight::new(model, settings);
        flight.helicopter.take_off().unwrap();
        flight.until(Phase::Hovering);
        flight
    }

    fn step(&mut self) {
        let next = self.helicopter.now() + STEP;
        self.helicopter.advance(next);
        (self.check)(&self.helicopter);
    }

    fn seconds(&mut self, seconds: f64) {
        for _ in 0..(seconds / STEP_S) as u32 {
            self.step();
        }
    }

    /// Flies until the phase is reached; gives up after ten minutes of simulated time.
    fn until(&mut self, phase: Phase) {
        for _ in 0..120_000 {
            if self.helicopter.phase() == phase {
                return;
            }
            self.step();
        }
        panic!("never {phase:?}: {:?}", self.helicopter.body());
    }

    fn push(&mut self, point_m: Vector) -> Result<(), Refused> {
        let waypoint = self.helicopter.world().to_geographic(point_m);
        self.helicopter.push_waypoint(waypoint)
    }

    fn land(&mut self) {
        self.helicopter.land().unwrap();
        self.until(Phase::OnGround);
    }
}

/// What no flight does, however it is flown.
fn check_limits(helicopter: &Helicopter) {
    let body = helicopter.body();
    assert!(body.position_m.z >= 0.0, "under the ground: {body:?}");
    assert!(body.angles.tilt() <= MAX_TILT_RAD + 0.1, "{body:?}");
    assert!(body.rates_radps.forward.abs() <= MAX_TILT_RATE_RADPS);
    assert!(body.rates_radps.right.abs() <= MAX_TILT_RATE_RADPS);
    assert!(body.rates_radps.down.abs() <= MAX_YAW_RATE_RADPS);
    let limits = &helicopter.settings.limits;
    // Gusts may push for a moment.
    assert!(
        body.velocity_mps.horizontal_norm() <= limits.cruise_mps + 1.0,
        "{body:?}"
    );
    assert!(
        body.velocity_mps.z.abs() <= limits.climb_mps + 0.7,
        "{body:?}"
    );
    if helicopter.phase() == Phase::FollowingPath {
        assert!(body.position_m.z > 0.3, "a path is no landing: {body:?}");
    }
}

#[test]
fn random_missions_keep_the_limits_and_pass_every_waypoint_in_order_within_its_radius() {
    for seed in 0..12 {
        let mut random = Random::new(seed, 7);
        let mut settings = brisk();
        settings.limits.cruise_mps = 3.0 + 17.0 * random.uniform();
        settings.limits.climb_mps = 1.0 + 4.0 * random.uniform();
        let mut model = model(seed);
        model.wind.speed_mps = 8.0 * random.uniform();
        model.wind.from_deg = 360.0 * random.uniform();
        let mut flight = Flight::hovering(model, settings);
        flight.check = check_limits;
        let count = 2 + (random.next_u64() % 12) as usize;
        let points: Vec<Vector> = (0..count)
            .map(|_| {
                let mut along = |reach: f64| (random.uniform() - 0.5) * reach;
                Vector::new(along(80.0), along(80.0), 20.0 + along(30.0))
            })
            .collect();
        points.iter().for_each(|point| flight.push(*point).unwrap());

        let mut nearest_m = vec![f64::INFINITY; count];
        while flight.helicopter.phase() != Phase::Hovering {
            flight.step();
            let position_m = flight.helicopter.body().position_m;
            for (nearest_m, point) in nearest_m.iter_mut().zip(&points) {
                *nearest_m = nearest_m.min((position_m - *point).norm());
            }
        }
        let radius_m = settings.limits.acceptance_radius_m;
        assert!(
            nearest_m.iter().all(|miss_m| *miss_m < 0.9 * radius_m),
            "seed {seed}: {nearest_m:?}"
        );
        let arrived: Vec<u64> = flight
            .helicopter
            .arrivals()
            .map(|arrival| arrival.number)
            .collect();
        assert_eq!(
            arrived,
            (0..count as u64).collect::<Vec<_>>(),
            "seed {seed}"
        );
        let rest_m = flight.helicopter.body().position_m - points[count - 1];
        assert!(
            rest_m.norm() < 0.3,
            "seed {seed}: stops {rest_m:?} from the last"
        );

        flight.land();
        let body = flight.helicopter.body();
        assert!(body.touch_down_mps < 0.8, "seed {seed}: {body:?}");
        assert_eq!((body.position_m.z, body.rotor_rpm), (0.0, 0.0));
        assert!(!flight.helicopter.is_flying());
        let drift_m = body.position_m - points[count - 1];
        assert!(
            drift_m.horizontal_norm() < 0.5,
            "seed {seed}: landed {drift_m:?} off"
        );
    }
}

#[test]
fn a_wide_acceptance_radius_lets_the_corners_be_flown_fast() {
    let mut settings = brisk();
    settings.limits.acceptance_radius_m = 3.0;
    let time = |settings| {
        let mut flight = Flight::hovering(model(1), settings);
        let start = flight.helicopter.now();
        for (x, y) in [(20.0, 0.0), (20.0, 20.0), (0.0, 20.0), (0.0, 0.0)] {
            flight.push(Vector::new(x, y, 10.0)).unwrap();
        }
        flight.until(Phase::Hovering);
        (flight.helicopter.now() - start).as_secs_f64()
    };
    assert!(time(settings) < time(brisk()) - 1.0);
}

#[test]
fn gains_at_the_ends_of_their_ranges_fly_badly_but_never_underground_or_to_nowhere() {
    for gains in [
        Gains {
            position_per_s: 0.05,
            velocity_per_s: 0.05,
            attitude_per_s: 0.5,
            yaw_per_s: 0.05,
        },
        Gains {
            position_per_s: 5.0,
            velocity_per_s: 10.0,
            attitude_per_s: 20.0,
            yaw_per_s: 10.0,
        },
        Gains {
            position_per_s: 5.0,
            velocity_per_s: 10.0,
            attitude_per_s: 0.5,
            yaw_per_s: 10.0,
        },
    ] {
        let mut flight = Flight::new(model(2), Settings { gains, ..brisk() });
        flight.helicopter.take_off().unwrap();
        for _ in 0..6_000 {
            flight.step();
            let body = flight.helicopter.body();
            assert!(
                body.position_m.z >= 0.0 && body.position_m.norm() < 1e4,
                "{gains:?}: {body:?}"
            );
        }
    }
}

#[test]
fn orders_are_taken_only_in_the_phases_that_allow_them() {
    use Phase::*;
    let refused = Err(Refused::Impossible);
    // Phase, and the answers to take-off, landing and a waypoint.
    for (phase, take_off, land, waypoint) in [
        (OnGround, Ok(()), refused, refused),
        (SpinningUp, Ok(()), refused, refused),
        (TakingOff, Ok(()), refused, refused),
        (Hovering, refused, Ok(()), Ok(())),
        (FollowingPath, refused, Ok(()), Ok(())),
        (Landing, refused, Ok(()), refused),
        (SpinningDown, refused, Ok(()), refused),
    ] {
        let reach = || {
            let mut flight = Flight::new(model(1), brisk());
            if phase != OnGround {
                flight.helicopter.take_off().unwrap();
            }
            if matches!(phase, FollowingPath | Landing | SpinningDown) {
                flight.until(Hovering);
            }
            if phase == FollowingPath {
                flight.push(Vector::new(30.0, 0.0, 10.0)).unwrap();
            }
            if matches!(phase, Landing | SpinningDown) {
                flight.helicopter.land().unwrap();
            }
            flight.until(phase);
            flight
        };
        assert_eq!(
            reach().helicopter.take_off(),
            take_off,
            "take-off while {phase:?}"
        );
        assert_eq!(reach().helicopter.land(), land, "landing while {phase:?}");
        assert_eq!(
            reach().push(Vector::new(5.0, 0.0, 10.0)),
            waypoint,
            "waypoint while {phase:?}"
        );
    }
}

#[test]
fn a_path_that_is_invalidated_ends_in_a_hover_soon_and_without_going_down() {
    let mut settings = brisk();
    settings.limits.climb_mps = 5.0;
    let mut flight = Flight::hovering(model(1), settings);
    // Steeply down towards the least height.
    flight.push(Vector::new(4.0, 0.0, 0.6)).unwrap();
    flight.push(Vector::new(60.0, 0.0, 0.6)).unwrap();
    flight.check = check_limits;
    flight.seconds(1.6);
    flight.helicopter.clear_path();
    flight.until(Phase::Hovering);
    let rest_m = flight.helicopter.body().position_m;
    flight.seconds(5.0);
    assert!((flight.helicopter.body().position_m - rest_m).norm() < 0.4);
    assert_eq!(flight.helicopter.arrived(), 0);
    assert_eq!(flight.helicopter.free_places(), 16);
}

#[test]
fn a_landing_out_of_full_flight_brakes_then_sinks_vertically() {
    let mut flight = Flight::hovering(model(1), brisk());
    flight.push(Vector::new(100.0, 0.0, 20.0)).unwrap();
    flight.check = check_limits;
    flight.seconds(5.0);
    assert!(flight.helicopter.body().velocity_mps.x > 7.0);
    flight.helicopter.land().unwrap();
    let mut column_m: Option<Vector> = None;
    while flight.helicopter.phase() == Phase::Landing {
        flight.step();
        let position_m = flight.helicopter.body().position_m;
        if position_m.z < 8.0 {
            let top_m = *column_m.get_or_insert(position_m);
            assert!((position_m - top_m).horizontal_norm() < 0.4);
        }
    }
    assert!(flight.helicopter.body().touch_down_mps < 0.8);
    assert_eq!(flight.helicopter.free_places(), 16);
}

#[test]
fn the_flying_flag_is_up_exactly_while_the_skids_are_off_the_ground() {
    let mut flight = Flight::new(model(1), brisk());
    flight.check = |helicopter| {
        let airborne = helicopter.body().position_m.z > 0.0;
        assert_eq!(helicopter.is_flying(), airborne, "{:?}", helicopter.body());
    };
    flight.helicopter.take_off().unwrap();
    flight.until(Phase::Hovering);
    flight.land();
}

#[test]
fn a_night_on_the_ground_costs_no_steps_and_some_charge() {
    let mut helicopter = Helicopter::new(model(1), brisk());
    assert_eq!(helicopter.next_deadline(), None);
    helicopter.advance(Duration::from_secs(3_600 * 2));
    assert_eq!(helicopter.now(), Duration::from_secs(3_600 * 2));
    let supply = helicopter.sense().supply.unwrap();
    assert_eq!((supply.battery_mv, supply.fuel_percent), (23_100, 100));
    helicopter.take_off().unwrap();
    assert!(helicopter.next_deadline().is_some());
}
