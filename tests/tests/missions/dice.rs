//! Dice: what a mission of chance is made of. The same seed draws the same mission.

use std::time::Duration;

use bridge::config::TrajectoryKind;
use bridge::link::coherence::Rule;
use dsp_protocol::{DspErrorCode, StatusMask, port};
use dsp_sim::faults::{
    Act, AfterStall, Damage, Directions, DspEvent, Fault, HelicopterEvent, MessageKind, Script,
    Times, Window,
};
use dsp_sim::helicopter::vector::Vector;
use dsp_sim::random::Random;
use ipc_types::payload::{MovementData, WaypointPosition};

use crate::missions::config::WorldConfig;
use crate::missions::operator::{Step, point};
use crate::missions::world::{Trouble, World};

/// The stream of a seed that makes missions; the simulator has others.
pub const STREAM: u64 = 7;

/// When every fault of a script is over: the last window ends at 55 s, the last hang-up at 60 s.
pub const FAULTS_END: Duration = Duration::from_secs(62);

/// Draws what a mission is made of.
pub struct Dice(Random);

impl Dice {
    pub fn new(seed: u64) -> Dice {
        Dice(Random::new(seed, STREAM))
    }

    pub fn once_in(&mut self, count: u64) -> bool {
        self.count(1, count) == 1
    }

    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.uniform()
    }

    pub fn count(&mut self, low: u64, high: u64) -> u64 {
        low + self.0.next_u64() % (high - low + 1)
    }

    pub fn point(&mut self) -> Vector {
        point(
            self.within(-12.0, 12.0),
            self.within(-12.0, 12.0),
            self.within(4.0, 12.0),
        )
    }

    pub fn path(&mut self) -> Vec<Vector> {
        (0..self.count(1, 4)).map(|_| self.point()).collect()
    }

    /// Take-off, one to three movements, landing.
    pub fn mission(&mut self) -> Vec<Step> {
        let mut steps = vec![Step::Start, Step::TakeOff(self.within(3.0, 10.0))];
        for _ in 0..self.count(1, 3) {
            let path = self.path();
            let end = path[path.len() - 1];
            steps.push(Step::Path(path));
            match self.count(0, 7) {
                // Where the helicopter hovers already.
                0 => steps.push(Step::Path(vec![end])),
                // A path that begins where the last one ended.
                1 => steps.push(Step::Path(vec![end, self.point()])),
                2 => steps.push(Step::Hold),
                3 => steps.push(self.parameter()),
                _ => {}
            }
        }
        steps.extend([Step::Land, Step::Stop]);
        steps
    }

    /// A parameter that is written and read back.
    pub fn parameter(&mut self) -> Step {
        let (number, value) = match self.count(0, 2) {
            0 => (port::ACCEPTANCE_RADIUS_M, self.within(0.4, 0.8)),
            1 => (port::CRUISE_SPEED_MPS, self.within(2.0, 6.0)),
            _ => (port::FLOW_CONTROL_PERIOD_MS, self.count(50, 150) as f64),
        };
        Step::Write(number, value as f32)
    }

    /// A path or a part of one, with more or less sense.
    pub fn send_waypoints(&mut self, world: &mut World) {
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

    pub fn duration(&mut self, low_s: f64, high_s: f64) -> Duration {
        Duration::from_secs_f64(self.within(low_s, high_s))
    }

    /// A span of a mission.
    pub fn window(&mut self) -> Window {
        let begin = self.duration(0.0, 40.0);
        Window::between(begin, begin + self.duration(0.0, 15.0))
    }

    pub fn damage(&mut self) -> Damage {
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

    pub fn message_fault(&mut self) -> Fault {
        let message = [
            MessageKind::Ack,
            MessageKind::FlowControl,
            MessageKind::Status,
            MessageKind::Error,
            MessageKind::Command,
            MessageKind::Waypoint,
        ][self.count(0, 5) as usize];
        // What the PC sends keeps its order, as on every serial link: sections 8.4 and 10 of the protocol rely on it.
        let is_sent_by_pc = matches!(message, MessageKind::Command | MessageKind::Waypoint);
        let act = match self.count(0, if is_sent_by_pc { 1 } else { 3 }) {
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

    pub fn dsp_event(&mut self) -> DspEvent {
        match self.count(0, 5) {
            0 => DspEvent::Reboot,
            4 => DspEvent::ChangeMask(StatusMask(self.0.next_u64() as u16)),
            1 => DspEvent::StopStatus,
            2 => DspEvent::Hang(self.duration(0.0, 8.0)),
            3 => DspEvent::ClockJump(self.within(-20_000.0, 20_000.0) as i64),
            _ => {
                let codes = [1, 8, 18, 30, 45, 102, 300, 999];
                DspEvent::RaiseError(DspErrorCode(codes[self.count(0, 7) as usize]))
            }
        }
    }

    pub fn helicopter_event(&mut self) -> HelicopterEvent {
        match self.count(0, 3) {
            0 => HelicopterEvent::PilotTakesOver(self.duration(0.5, 8.0)),
            1 => HelicopterEvent::BatteryLow {
                volts: self.within(16.0, 24.0),
            },
            2 => HelicopterEvent::GpsAltitudeDrift {
                rate_mps: self.within(-0.5, 0.5),
                length: self.duration(0.0, 5.0),
            },
            _ => HelicopterEvent::LoseFix(self.duration(0.0, 8.0)),
        }
    }

    /// One to six faults of every kind that a script can have.
    pub fn script(&mut self, seed: u64) -> Script {
        let faults = (0..self.count(1, 6)).map(|_| match self.count(0, 4) {
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
            3 => Fault::Helicopter {
                times: Times::once(self.duration(0.0, 50.0)),
                event: self.helicopter_event(),
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
    pub fn config(&mut self, seed: u64) -> WorldConfig {
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
        if self.once_in(4) {
            config = config.extended();
        }
        if self.once_in(4) {
            config.bridge.trajectory.kind = TrajectoryKind::DivideLegs;
            config.bridge.trajectory.spacing_m = self.within(1.0, 8.0);
        }
        self.firmware(&mut config);
        config
    }

    /// The DSP of the protocol, or an older or odd one.
    fn firmware(&mut self, config: &mut WorldConfig) {
        let firmware = &mut config.simulator.firmware;
        match self.count(0, 7) {
            0 => {
                // A classic DSP.
                firmware.has_pc_timeout = false;
                firmware.has_waypoint_count = false;
                firmware.refuses_take_off_before_start_up = false;
            }
            1 => firmware.has_pc_timeout = false,
            2 => firmware.has_waypoint_count = false,
            3 => firmware.has_time = false,
            // Its clock wraps within the mission.
            4 => firmware.clock_start_ms = u32::MAX - self.count(0, 40_000) as u32,
            _ => {}
        }
    }

    /// One in many bits is damaged in both directions, for all of the mission or a part of it.
    pub fn corruption(&mut self) -> Fault {
        let window = if self.once_in(2) {
            Window::between(Duration::ZERO, FAULTS_END)
        } else {
            self.window()
        };
        Fault::Bytes {
            direction: Directions::Both,
            window,
            damage: Damage::FlipBits {
                bit_error_rate: 10_f64.powf(self.within(-6.0, -3.0)),
            },
        }
    }

    /// Nothing comes through for some seconds, so the link falls silent.
    pub fn silence(&mut self) -> Fault {
        let begin = self.duration(3.0, 40.0);
        Fault::Bytes {
            direction: [Directions::ToPc, Directions::ToDsp, Directions::Both]
                [self.count(0, 2) as usize],
            window: Window::between(begin, begin + self.duration(0.5, 8.0)),
            damage: Damage::Outage,
        }
    }

    /// A bridge that is killed, or ends in order.
    pub fn restart(&mut self) -> (Duration, Trouble) {
        let away = self.duration(0.01, 5.0);
        let trouble = if self.once_in(2) {
            Trouble::BridgeDies(away)
        } else {
            Trouble::BridgeEnds(away)
        };
        (self.duration(3.0, 50.0), trouble)
    }

    /// Limits of the battery that some batteries of [`Dice::helicopter_event`] are below.
    pub fn limit_battery(&mut self, config: &mut WorldConfig) {
        let limits = &mut config.bridge.safety.battery_v;
        limits.hold = Some(20.0);
        limits.land = Some(18.0);
    }
}
