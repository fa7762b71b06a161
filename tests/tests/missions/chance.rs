//! Missions of chance: paths, heights, wind, noise of the sensors and of the line, and faults of every kind, by seed.

use std::time::Duration;

use bridge::link::coherence::Rule;
use dsp_protocol::DspErrorCode;
use dsp_sim::faults::{
    Act, AfterStall, Damage, Directions, DspEvent, Fault, MessageKind, Script, Times, Window,
};
use dsp_sim::helicopter::vector::Vector;
use dsp_sim::random::Random;
use ipc_types::code::ControlCommand;
use ipc_types::payload::{MovementData, WaypointPosition};

use crate::config::WorldConfig;
use crate::operator::{Step, bring_home, fly, fly_through_trouble, point};
use crate::world::{Trouble, World};

/// The stream of a seed that makes missions; the simulator has others.
const STREAM: u64 = 7;

/// When every fault of a script is over: the last window ends at 55 s, the last hang-up at 60 s.
const FAULTS_END: Duration = Duration::from_secs(62);

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

    fn duration(&mut self, low_s: f64, high_s: f64) -> Duration {
        Duration::from_secs_f64(self.within(low_s, high_s))
    }

    /// A span of a mission.
    fn window(&mut self) -> Window {
        let begin = self.duration(0.0, 40.0);
        Window::between(begin, begin + self.duration(0.0, 15.0))
    }

    fn damage(&mut self) -> Damage {
        match self.count(0, 9) {
            0 => Damage::FlipBits {
                bit_error_rate: 10_f64.powf(self.within(-5.0, -1.5)),
            },
            1 => Damage::Drop {
                rate: self.within(0.0, 0.2),
            },
            2 => Damage::Duplicate {
                rate: self.within(0.0, 0.2),
            },
            3 => Damage::Insert {
                rate: self.within(0.0, 0.2),
            },
            4 => Damage::Delay {
                delay: self.duration(0.0, 0.2),
                jitter: self.duration(0.0, 0.2),
            },
            5 => Damage::Split {
                // No slower than a third of what is said, or it would arrive minutes later.
                chunk_bytes: self.count(8, 32) as usize,
                gap: self.duration(0.000_1, 0.005),
            },
            6 => Damage::Burst {
                rate: self.within(0.0, 0.01),
                length_bytes: self.count(1, 200) as u32,
            },
            7 => Damage::Stall {
                then: AfterStall::Pass,
            },
            8 => Damage::Stall {
                then: AfterStall::Drop,
            },
            _ => Damage::Outage,
        }
    }

    fn message_fault(&mut self) -> Fault {
        let message = [
            MessageKind::Ack,
            MessageKind::FlowControl,
            MessageKind::Status,
            MessageKind::Error,
            MessageKind::Command,
            MessageKind::Waypoint,
        ][self.count(0, 5) as usize];
        let act = match self.count(0, 3) {
            0 => Act::Drop,
            1 => Act::Repeat,
            2 => Act::Late(self.duration(0.0, 0.3)),
            _ => Act::Reorder,
        };
        Fault::Messages {
            message,
            window: self.window(),
            rate: self.within(0.0, 0.5),
            act,
        }
    }

    fn dsp_event(&mut self) -> DspEvent {
        match self.count(0, 4) {
            0 => DspEvent::Reboot,
            1 => DspEvent::StopStatus,
            2 => DspEvent::Hang(self.duration(0.0, 8.0)),
            3 => DspEvent::ClockJump(self.within(-20_000.0, 20_000.0) as i64),
            _ => {
                let codes = [1, 8, 18, 30, 45, 102, 300, 999];
                DspEvent::RaiseError(DspErrorCode(codes[self.count(0, 7) as usize]))
            }
        }
    }

    /// One to six faults of every kind that a script can have.
    fn script(&mut self, seed: u64) -> Script {
        let faults = (0..self.count(1, 6)).map(|_| match self.count(0, 3) {
            0 => Fault::Bytes {
                direction: [Directions::ToPc, Directions::ToDsp, Directions::Both]
                    [self.count(0, 2) as usize],
                window: self.window(),
                damage: self.damage(),
            },
            1 => self.message_fault(),
            2 => Fault::Dsp {
                times: Times::once(self.duration(0.0, 50.0)),
                event: self.dsp_event(),
            },
            _ => Fault::HangUp {
                times: Times::once(self.duration(0.0, 50.0)),
                length: self.duration(0.0, 10.0),
                elsewhere: self.count(0, 1) == 1,
            },
        });
        Script {
            seed,
            faults: faults.collect(),
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
pub fn fly_in_wind(seed: u64) -> u64 {
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
    1
}

/// A mission with noise on the line from a moment of chance on.
pub fn fly_in_noise(seed: u64) -> u64 {
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
    1
}

/// An operator who sends anything at any time, while everything goes wrong at once.
pub fn be_reckless(seed: u64) -> u64 {
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
    1
}

/// A mission under a script of faults, as `ril sim --faults` takes it; half of the bridges are killed on the way.
pub fn fly_through_faults(seed: u64) -> u64 {
    let mut dice = Dice(Random::new(seed, STREAM));
    let config = dice.config(seed);
    let config = config.faults(dice.script(seed), FAULTS_END);
    let mission = dice.mission();
    let mut world = World::new(&config);
    if dice.count(0, 1) == 0 {
        let when = dice.duration(0.0, 50.0);
        let away = dice.duration(0.01, 5.0);
        world.schedule(vec![(when, Trouble::BridgeDies(away))]);
    }
    fly_through_trouble(&mut world, &mission);
    if world.simulator.helicopter().is_flying() {
        bring_home(&mut world);
    }
    world.finish();
    1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seeds;

    #[test]
    fn missions_in_wind() {
        seeds::fly_each(0..350, fly_in_wind);
    }

    #[test]
    fn missions_in_noise() {
        seeds::fly_each(1000..1250, fly_in_noise);
    }

    #[test]
    fn reckless_operators() {
        seeds::fly_each(2000..2200, be_reckless);
    }

    #[test]
    fn missions_under_faults_of_every_kind() {
        seeds::fly_each(3000..3200, fly_through_faults);
    }
}
