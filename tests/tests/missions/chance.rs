//! Missions of chance: paths, heights, wind, noise of the sensors and of the line, by seed.

use std::time::Duration;

use bridge::line::coherence::Rule;
use dsp_sim::helicopter::vector::Vector;
use dsp_sim::random::Random;
use ipc_types::code::ControlCommand;
use ipc_types::payload::{MovementData, WaypointPosition};

use crate::config::WorldConfig;
use crate::operator::{Step, bring_home, fly, fly_through_trouble, point};
use crate::seeds;
use crate::world::{Trouble, World};

/// The stream of a seed that makes missions; the simulator has others.
const STREAM: u64 = 7;

/// Draws what a mission is made of.
struct Dice(Random);

impl Dice {
    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.uniform()
    }

    fn count(&mut self, low: u64, high: u64) -> u64 {
        low + self.0.next_u64() % (high - low + 1)
    }

    fn point(&mut self) -> Vector {
        point(
            self.within(-12.0, 12.0),
            self.within(-12.0, 12.0),
            self.within(4.0, 12.0),
        )
    }

    fn path(&mut self) -> Vec<Vector> {
        (0..self.count(1, 4)).map(|_| self.point()).collect()
    }

    fn mission(&mut self) -> Vec<Step> {
        let mut steps = vec![Step::Start, Step::TakeOff(self.within(3.0, 10.0))];
        for _ in 0..self.count(1, 2) {
            steps.push(Step::Path(self.path()));
        }
        steps.extend([Step::Land, Step::Stop]);
        steps
    }

    /// A path or a part of one, with more or less sense.
    fn send_waypoints(&mut self, world: &mut World) {
        let path = self.path();
        let path_id = self.count(1, 2);
        for index in 0..path.len() {
            match self.count(0, 19) {
                0 => {}
                1 => {
                    let (first, last) = (self.count(0, 1) == 1, self.count(0, 1) == 1);
                    let place = world.simulator.helicopter().position();
                    let position = WaypointPosition {
                        latitude_deg: place.latitude_deg,
                        longitude_deg: place.longitude_deg,
                        altitude_m: place.altitude_m + self.within(-5.0, 5.0),
                    };
                    world.movement(MovementData::waypoint(0, path_id, position, first, last));
                }
                _ => _ = world.waypoint(path_id, &path, index),
            }
        }
    }

    /// A windy place somewhere on Earth.
    fn config(&mut self, seed: u64) -> WorldConfig {
        let mut config = WorldConfig::new()
            .seed(seed)
            .at(self.within(-65.0, 65.0), self.within(-180.0, 180.0))
            .wind(
                self.within(0.0, 6.0),
                self.within(0.0, 360.0),
                self.within(0.0, 1.0),
            )
            // Fewer samples make more missions.
            .parameters("status_period_ms = 50\ncruise_speed_mps = 6.0\nclimb_speed_mps = 3.0");
        config.simulator.model.noise_level = self.within(0.0, 1.5);
        config.simulator.model.heading_deg = self.within(0.0, 360.0);
        if self.count(0, 3) == 0 {
            config.bridge.status.coherence = Rule::Confirmed;
        }
        if self.count(0, 3) == 0 {
            config = config.extended();
        }
        config
    }
}

/// A mission in wind and with noisy sensors, on a line that is sound.
fn fly_in_wind(seed: u64) {
    let mut dice = Dice(Random::new(seed, STREAM));
    let config = dice.config(seed);
    let mission = dice.mission();
    let mut world = World::new(&config);
    fly(&mut world, &mission);
    world.finish();
    let dsp = world.simulator.dsp().counters();
    let refused: u64 = dsp.refusals.iter().sum();
    assert_eq!((dsp.waypoints_discarded, refused), (0, 0));
    assert_eq!(world.witness.state.refused.implausible_groups, 0);
}

/// A mission with noise on the line from a moment of chance on.
fn fly_in_noise(seed: u64) {
    let mut dice = Dice(Random::new(seed, STREAM));
    let config = dice.config(seed).unsound();
    let mission = dice.mission();
    let mut world = World::new(&config);
    let moments: [fn(&World) -> bool; 4] = [
        |world| world.now() > Duration::from_millis(20),
        |world| world.now() > Duration::from_secs(2),
        |world| world.now() > Duration::from_secs(5),
        |world| world.probe.waypoints > 0,
    ];
    let when = moments[dice.count(0, 3) as usize];
    let time = Duration::from_secs_f64(dice.within(0.3, 4.0));
    world.plan(Trouble::Noise(time), when);
    fly_through_trouble(&mut world, &mission);
    assert!(!world.simulator.helicopter().is_flying());
    world.finish();
}

/// An operator who sends anything at any time, while everything goes wrong at once.
fn be_reckless(seed: u64) {
    let mut dice = Dice(Random::new(seed, STREAM));
    let config = dice.config(seed).unsound();
    let mut world = World::new(&config);
    for _ in 0..dice.count(20, 60) {
        world.run_for(Duration::from_secs_f64(dice.within(0.0, 1.5)));
        match dice.count(0, 19) {
            0 => world.plan(Trouble::Reboot, |_| true),
            1 => world.plan(
                Trouble::PortGone(Duration::from_secs_f64(dice.within(0.01, 3.0))),
                |_| true,
            ),
            2 => world.plan(
                Trouble::Noise(Duration::from_secs_f64(dice.within(0.1, 2.0))),
                |_| true,
            ),
            3..=7 => _ = world.control(ControlCommand::Start),
            8 => _ = world.control(ControlCommand::Stop),
            9..=11 => _ = world.movement(MovementData::take_off(0, dice.within(0.0, 12.0))),
            12 => _ = world.movement(MovementData::land(0)),
            _ => dice.send_waypoints(&mut world),
        }
    }
    bring_home(&mut world);
    assert!(!world.simulator.helicopter().is_flying());
    world.finish();
}

// In parts, so that they run side by side.

#[test]
fn a_hundred_missions_in_wind() {
    seeds::for_each(0..100, fly_in_wind);
}

#[test]
fn another_hundred_missions_in_wind() {
    seeds::for_each(100..200, fly_in_wind);
}

#[test]
fn seventy_missions_in_noise() {
    seeds::for_each(1000..1070, fly_in_noise);
}

#[test]
fn another_seventy_missions_in_noise() {
    seeds::for_each(1070..1140, fly_in_noise);
}

#[test]
fn sixty_reckless_operators() {
    seeds::for_each(2000..2060, be_reckless);
}
