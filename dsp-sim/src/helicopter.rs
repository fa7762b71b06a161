//! The helicopter with its guidance and controllers: what the DSP flies.
//!
//! A fixed step of 5 ms, driven by simulated time alone; the same configuration and the same orders at the same times
//! give the same flight, bit for bit. It knows nothing of bytes.
//!
//! ```text
//! waypoints ─▶ path ─▶ guidance ─▶ smoother ─▶ control ─▶ body ◀─ wind
//!                                                          └─▶ sensors ─▶ status
//! ```
//!
//! | phase | begins with | ends with |
//! |---|---|---|
//! | on the ground | the end of a landing | take-off |
//! | spinning up | take-off | the rotor has its speed |
//! | taking off | | the take-off altitude, at rest |
//! | hovering | rest without waypoints left | a waypoint, or landing |
//! | following a path | a waypoint | the last one reached and at rest |
//! | landing | landing: it brakes, then sinks vertically | touch-down |
//! | spinning down | | the rotor stands |
//!
//! The nose follows the course on a path, and stays where it is otherwise.
//!
//! While the pilot's switch stands on manual, the DSP flies no waypoints: the helicopter comes to rest straight ahead
//! and holds its position, as if the pilot did so, and the path buffer stays as it is. A take-off or landing goes on;
//! none begins.

pub mod body;
pub mod control;
pub mod energy;
pub mod geodesy;
pub mod guidance;
pub mod path;
pub mod pilot;
pub mod sensors;
pub mod smoother;
pub mod vector;
pub mod wind;

use std::collections::VecDeque;
use std::time::Duration;

use dsp_protocol::Status;
use dsp_protocol::downlink::Geographic;

use crate::random::Random;

pub use body::STEP_S;
use body::{Body, Controls, GRAVITY_MPS2};
use control::{Controller, Gains};
use energy::{Energy, EnergyModel};
use geodesy::LocalFrame;
use guidance::{Guidance, MIN_PATH_HEIGHT_M};
use path::{Limits, PATH_PLACES, PathBuffer};
use pilot::{Pilot, PilotSwitch};
use sensors::{GpsErrors, Sensors, Trims, Truth};
use smoother::{Reference, Smoother};
use vector::Vector;
use wind::{Wind, WindModel};

/// [`STEP_S`] in nanoseconds.
const STEP_NS: u64 = 5_000_000;
/// Arrivals that are remembered; the oldest is forgotten first. Twice the waypoints of the longest test of this
/// project.
const ARRIVALS: usize = 256;
/// How far from the take-off altitude, m, and how fast, m/s, a take-off still counts as at its end.
const TAKE_OFF_ERROR_M: f64 = 0.2;
const TAKE_OFF_SPEED_MPS: f64 = 0.3;
/// A path is over when the reference is slower than this, m/s.
const REST_SPEED_MPS: f64 = 0.05;
/// The rotor has its speed when it is this near, rpm.
const ROTOR_ERROR_RPM: f64 = 5.0;
/// Longest time that is simulated at one go when no caller asks for the state of a flying helicopter.
const CATCH_UP: Duration = Duration::from_secs(1);

/// What never changes while the helicopter is simulated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// The point of take-off, on the ground.
    pub home: Geographic,
    /// Where the nose points at first, degrees clockwise from true north.
    pub heading_deg: f64,
    /// Wind.
    pub wind: WindModel,
    /// Noise of the sensors: 0 none, 1 usual.
    pub noise_level: f64,
    /// Seed of wind and noise.
    pub seed: u64,
    /// Time from the start until the GPS has its first fix.
    pub gps_fix_after: Duration,
    /// Battery and fuel.
    pub energy: EnergyModel,
}

/// What the ports set (`docs/protocol.md` section 6).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Speeds and acceptance radius.
    pub limits: Limits,
    /// Gains of the controllers.
    pub gains: Gains,
    /// Height of the next take-off above the point of take-off, m.
    pub take_off_height_m: f64,
    /// Rotor speed set point, rpm.
    pub rotor_rpm: f64,
    /// Offsets of the servos.
    pub trims: Trims,
}

/// What the helicopter is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Phase {
    /// It stands, and the rotor too.
    OnGround,
    /// It stands while the rotor speeds up.
    SpinningUp,
    /// It climbs to the take-off altitude.
    TakingOff,
    /// It hovers.
    Hovering,
    /// It flies waypoints.
    FollowingPath,
    /// It sinks to the ground.
    Landing,
    /// It stands while the rotor slows down.
    SpinningDown,
}

/// Why an order or a waypoint was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// The phase does not allow it, or no helicopter could fly it.
    #[error("not possible now")]
    Impossible,
    /// The waypoint equals the newest one in the buffer.
    #[error("a copy of the newest waypoint")]
    Copy,
    /// All places of the path buffer are taken.
    #[error("the path buffer is full")]
    PathFull,
}

/// A waypoint was reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// Running number of the waypoint among all that were taken since the start, from 0.
    pub number: u64,
    /// When, simulated time since the start.
    pub time: Duration,
    /// Where the waypoint is: east, north and up of the home, m.
    pub waypoint_m: Vector,
}

/// The helicopter.
#[derive(Clone, Debug)]
pub struct Helicopter {
    world: LocalFrame,
    settings: Settings,
    steps: u64,
    phase: Phase,
    take_off_target_m: Vector,
    path: PathBuffer,
    guidance: Guidance,
    smoother: Smoother,
    controller: Controller,
    controls: Controls,
    body: Body,
    energy: Energy,
    pilot: Pilot,
    gps: GpsErrors,
    wind: Wind,
    sensors: Sensors,
    arrivals: VecDeque<Arrival>,
    arrived: u64,
}

impl Helicopter {
    /// A helicopter that stands at its home, at time zero.
    pub fn new(model: Model, settings: Settings) -> Helicopter {
        let yaw_rad = geodesy::wrap_radians(model.heading_deg.to_radians());
        Helicopter {
            world: LocalFrame::new(model.home),
            settings,
            steps: 0,
            phase: Phase::OnGround,
            take_off_target_m: Vector::ZERO,
            path: PathBuffer::default(),
            guidance: Guidance::at(Vector::ZERO),
            smoother: Smoother::at(Vector::ZERO),
            controller: Controller::new(yaw_rad),
            controls: Controls::default(),
            body: Body::at_home(yaw_rad),
            energy: Energy::new(model.energy),
            pilot: Pilot::default(),
            gps: GpsErrors::new(model.gps_fix_after),
            wind: Wind::new(model.wind, Random::new(model.seed, 1)),
            sensors: Sensors::new(Random::new(model.seed, 2), model.noise_level),
            arrivals: VecDeque::new(),
            arrived: 0,
        }
    }

    /// Simulates up to `now`, in whole steps. A helicopter that stands lets the time pass without work.
    pub fn advance(&mut self, now: Duration) {
        let steps = u64::try_from(now.as_nanos() / u128::from(STEP_NS)).unwrap_or(u64::MAX);
        while self.steps < steps {
            if self.phase == Phase::OnGround {
                let idle_s = (steps - self.steps) as f64 * STEP_S;
                self.energy.step(0.0, false, idle_s);
                self.steps = steps;
                self.pilot.advance(self.now());
            } else {
                self.step();
            }
        }
    }

    /// When [`advance`](Self::advance) should be called again at the latest, so that it never has much to catch up;
    /// `None` while the helicopter stands.
    pub fn next_deadline(&self) -> Option<Duration> {
        (self.phase != Phase::OnGround).then(|| self.now() + CATCH_UP)
    }

    /// Whether [`take_off`](Self::take_off) would begin a take-off now.
    pub fn may_take_off(&self) -> bool {
        self.phase == Phase::OnGround && self.switch() == PilotSwitch::Auto
    }

    /// Starts the rotor and takes off. Repeating it during a take-off changes nothing.
    ///
    /// # Errors
    /// The helicopter flies or lands, or the pilot's switch stands on manual.
    pub fn take_off(&mut self) -> Result<(), Refused> {
        match self.phase {
            Phase::OnGround if self.may_take_off() => {
                let above = Vector::new(0.0, 0.0, self.settings.take_off_height_m);
                self.take_off_target_m = self.body.position_m + above;
                self.enter(Phase::SpinningUp);
                Ok(())
            }
            Phase::SpinningUp | Phase::TakingOff => Ok(()),
            _ => Err(Refused::Impossible),
        }
    }

    /// Empties the path, sinks to the ground and stops the rotor. Repeating it during a landing changes nothing.
    ///
    /// # Errors
    /// The helicopter stands or takes off, or the pilot's switch stands on manual.
    pub fn land(&mut self) -> Result<(), Refused> {
        match self.phase {
            Phase::Hovering | Phase::FollowingPath if self.switch() == PilotSwitch::Auto => {
                self.path.clear();
                self.guidance.land();
                self.enter(Phase::Landing);
                Ok(())
            }
            Phase::Landing | Phase::SpinningDown => Ok(()),
            _ => Err(Refused::Impossible),
        }
    }

    /// Appends a waypoint to the path.
    ///
    /// # Errors
    /// The buffer is full; the helicopter neither hovers nor follows a path; or the waypoint lies lower than
    /// [`MIN_PATH_HEIGHT_M`] above the home.
    pub fn push_waypoint(&mut self, waypoint: Geographic) -> Result<(), Refused> {
        if !self.takes_waypoints() {
            return Err(Refused::Impossible);
        }
        let position_m = self.world.to_flat(waypoint);
        if position_m.z < MIN_PATH_HEIGHT_M {
            return Err(Refused::Impossible);
        }
        if self.path.newest() == Some(position_m) {
            return Err(Refused::Copy);
        }
        self.path.push(position_m).ok_or(Refused::PathFull)?;
        self.enter(Phase::FollowingPath);
        Ok(())
    }

    /// Forgets the path; in flight the helicopter comes to rest straight ahead and hovers, a take-off or landing goes
    /// on.
    pub fn clear_path(&mut self) {
        self.path.clear();
        if self.phase == Phase::FollowingPath {
            self.guidance.brake();
        }
    }

    /// What happens when the DSP reboots: it forgets path and settings, and the helicopter hovers. A take-off or
    /// landing goes on, because nothing here models a crash.
    pub fn reboot(&mut self, settings: Settings) {
        self.settings = settings;
        self.sensors.reboot();
        self.clear_path();
    }

    /// Position of the pilot's switch.
    pub fn switch(&self) -> PilotSwitch {
        self.pilot.switch()
    }

    /// Replaces the settings.
    pub fn set_settings(&mut self, settings: Settings) {
        self.settings = settings;
    }

    /// All groups of a status but the DSP's time, as the sensors see them now. Each call draws new noise.
    pub fn sense(&mut self) -> Status {
        let truth = Truth {
            body: &self.body,
            controls: &self.controls,
            aims: self.controller.aims(),
            trims: &self.settings.trims,
            energy: &self.energy,
            switch: self.pilot.switch(),
            world: &self.world,
            gps_fix: self.gps.has_fix(self.now()),
            gps_altitude_error_m: self.gps.altitude_error_m(self.now()),
        };
        self.sensors.read(&truth)
    }

    /// Simulated time up to which the state holds, since the start.
    pub fn now(&self) -> Duration {
        Duration::from_nanos(self.steps.saturating_mul(STEP_NS))
    }

    /// What the helicopter is doing.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Whether it is in the air.
    pub fn is_flying(&self) -> bool {
        !self.body.on_ground
    }

    /// Whether it is in a phase that takes waypoints: it flies, and neither takes off nor lands.
    pub fn takes_waypoints(&self) -> bool {
        matches!(self.phase, Phase::Hovering | Phase::FollowingPath)
    }

    /// Waypoints in the path buffer: those that the DSP has taken and not yet reached, the one that it flies to
    /// included. A helicopter that has reached its last waypoint and hovers there holds none.
    pub fn held_waypoints(&self) -> usize {
        PATH_PLACES - self.path.free_places()
    }

    /// Free places of the path buffer.
    pub fn free_places(&self) -> usize {
        self.path.free_places()
    }

    /// The true state of the machine.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// Where the helicopter should be.
    pub fn reference(&self) -> Reference {
        self.smoother.reference()
    }

    /// The true geographic position.
    pub fn position(&self) -> Geographic {
        self.world.to_geographic(self.body.position_m)
    }

    /// The flat world around the home in which the helicopter flies.
    pub fn world(&self) -> &LocalFrame {
        &self.world
    }

    /// The last waypoints that were reached, oldest first; not more than 256 are remembered.
    pub fn arrivals(&self) -> impl Iterator<Item = &Arrival> {
        self.arrivals.iter()
    }

    /// How many waypoints were reached since the start.
    pub fn arrived(&self) -> u64 {
        self.arrived
    }

    /// One step of everything.
    fn step(&mut self) {
        self.steps += 1;
        self.pilot.advance(self.now());
        self.wind.step(STEP_S);
        self.controls = if self.stands() {
            self.controller.stand(&self.body, &self.settings.gains)
        } else {
            // The DSP flies no waypoints while the pilot flies.
            let nothing = PathBuffer::default();
            let path = match self.switch() {
                PilotSwitch::Auto => &self.path,
                PilotSwitch::Manual => &nothing,
            };
            self.guidance.step(path, &self.settings.limits);
            let reference = self.smoother.step(self.guidance.position_m(), STEP_S);
            let turn = self.phase == Phase::FollowingPath;
            self.controller
                .fly(&self.body, &reference, &self.settings.gains, turn, STEP_S)
        };
        self.controls.rotor_rpm = match self.phase {
            Phase::OnGround | Phase::SpinningDown => 0.0,
            _ => self.settings.rotor_rpm,
        };
        self.body
            .step(&self.controls, self.wind.velocity_mps(), STEP_S);
        let load = self.body.thrust_mps2 / GRAVITY_MPS2;
        self.energy.step(load, self.body.rotor_rpm > 0.0, STEP_S);
        self.check_arrival();
        self.check_phase();
    }

    /// Whether the skids carry the helicopter.
    fn stands(&self) -> bool {
        matches!(
            self.phase,
            Phase::OnGround | Phase::SpinningUp | Phase::SpinningDown
        )
    }

    /// Takes the first waypoint out of the buffer when guidance flies to it, or has passed it, and it is near enough.
    fn check_arrival(&mut self) {
        let Some(first) = self.path.front() else {
            return;
        };
        let due = self
            .guidance
            .number()
            .is_some_and(|number| first.number <= number);
        let away_m = (first.position_m - self.body.position_m).norm();
        if due && away_m <= self.settings.limits.acceptance_radius_m {
            self.path.pop_front();
            self.arrived += 1;
            if self.arrivals.len() == ARRIVALS {
                self.arrivals.pop_front();
            }
            self.arrivals.push_back(Arrival {
                number: first.number,
                time: self.now(),
                waypoint_m: first.position_m,
            });
        }
    }

    /// Goes on to the next phase when this one is over.
    fn check_phase(&mut self) {
        let body = &self.body;
        match self.phase {
            Phase::SpinningUp => {
                if (body.rotor_rpm - self.settings.rotor_rpm).abs() <= ROTOR_ERROR_RPM {
                    self.guidance = Guidance::at(body.position_m);
                    self.smoother = Smoother::at(body.position_m);
                    self.guidance.fly_to(self.take_off_target_m);
                    self.enter(Phase::TakingOff);
                }
            }
            Phase::TakingOff => {
                let away_m = (body.position_m - self.take_off_target_m).norm();
                let slow = body.velocity_mps.norm() <= TAKE_OFF_SPEED_MPS;
                if self.guidance.at_rest() && away_m <= TAKE_OFF_ERROR_M && slow {
                    self.enter(Phase::Hovering);
                }
            }
            Phase::FollowingPath => {
                let speed_mps = self.smoother.reference().velocity_mps.norm();
                let at_rest = self.guidance.at_rest() && speed_mps <= REST_SPEED_MPS;
                if self.path.is_empty() && at_rest {
                    self.enter(Phase::Hovering);
                }
            }
            Phase::Landing => {
                if body.on_ground {
                    self.enter(Phase::SpinningDown);
                }
            }
            Phase::SpinningDown => {
                if body.rotor_rpm == 0.0 {
                    self.park();
                }
            }
            Phase::OnGround | Phase::Hovering => {}
        }
    }

    /// Comes to complete rest, so that no step is needed until the next take-off.
    fn park(&mut self) {
        let (position_m, yaw_rad) = (self.body.position_m, self.body.angles.yaw);
        self.body = Body {
            position_m,
            touch_down_mps: self.body.touch_down_mps,
            ..Body::at_home(yaw_rad)
        };
        self.controls = Controls::default();
        self.guidance = Guidance::at(position_m);
        self.smoother = Smoother::at(position_m);
        self.enter(Phase::OnGround);
    }

    fn enter(&mut self, phase: Phase) {
        if self.phase != phase {
            tracing::debug!(from = ?self.phase, to = ?phase, at = ?self.now(), "phase of flight");
            self.phase = phase;
        }
    }
}

// What a test or a script of faults does to the helicopter ([`crate::faults`]). Nothing here happens by itself.
impl Helicopter {
    /// Moves the pilot's switch and leaves it there.
    pub fn set_switch(&mut self, switch: PilotSwitch) {
        self.pilot.set(switch);
        self.stop_for_pilot();
    }

    /// Moves the pilot's switch to manual for `length`.
    pub fn take_over(&mut self, length: Duration) {
        self.pilot.take_over(self.now().saturating_add(length));
        self.stop_for_pilot();
    }

    /// Sets the voltage of the battery at rest; in a hover it reads 0.4 V less.
    pub fn set_battery_v(&mut self, volts: f64) {
        self.energy.set_battery_v(volts);
    }

    /// Sets what is left of the fuel, %.
    pub fn set_fuel_percent(&mut self, percent: f64) {
        self.energy.set_fuel_percent(percent);
    }

    /// Takes the fix from the GPS for `length`.
    pub fn lose_gps_fix(&mut self, length: Duration) {
        self.gps.lose_fix(self.now().saturating_add(length));
    }

    /// Lets the altitude of the GPS drift at `rate_mps` for `length`; the error that it has reached then stays.
    pub fn drift_gps_altitude(&mut self, rate_mps: f64, length: Duration) {
        self.gps.drift(self.now(), rate_mps, length);
    }

    /// Leaves the path when the pilot has taken over. The waypoints stay in the buffer.
    fn stop_for_pilot(&mut self) {
        if self.switch() == PilotSwitch::Manual && self.phase == Phase::FollowingPath {
            self.guidance.brake();
        }
    }
}

#[cfg(test)]
mod tests;
