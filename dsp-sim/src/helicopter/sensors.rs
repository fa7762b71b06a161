//! What the instruments measure: the true state in the units of the wire, with seeded noise.
//!
//! Every reading is fresh: a GPS that answers five times a second, or late, is not modelled.

use std::f64::consts::FRAC_PI_2;
use std::time::Duration;

use dsp_protocol::downlink::{
    Acceleration, AngularRate, Attitude, Geographic, GpsVelocity, PanTilt, References, ServoPulses,
    Status, Supply, Xy,
};

use crate::random::Random;

use super::body::{
    Body, Controls, GRAVITY_MPS2, MAX_TILT_ACCELERATION_RADPS2, MAX_YAW_ACCELERATION_RADPS2,
};
use super::control::Aims;
use super::energy::Energy;
use super::geodesy::LocalFrame;
use super::pilot::PilotSwitch;
use super::vector::Vector;

/// Standard deviations at noise level 1: those of a good receiver with carrier phase, and of a small IMU.
const GPS_HORIZONTAL_M: f64 = 0.02;
const GPS_VERTICAL_M: f64 = 0.03;
const GPS_VELOCITY_MPS: f64 = 0.02;
const ATTITUDE_DEG: f64 = 0.1;
const ACCELERATION_MPS2: f64 = 0.05;
const RATE_RADPS: f64 = 0.005;
const SONAR_M: f64 = 0.01;
const BAROMETER_M: f64 = 0.2;
const ROTOR_RPM: f64 = 3.0;
const PULSE_US: f64 = 1.5;
const PAN_TILT_ADC: f64 = 0.5;

/// NMEA fix quality without a fix, and with the carrier phase resolved.
const NO_FIX: u8 = 0;
const RTK_FIX: u8 = 4;
/// Below this speed along the ground a receiver keeps the course it had, m/s.
const COURSE_SPEED_MPS: f64 = 0.2;
/// Greatest value of a 12-bit converter.
const ADC_MAX: f64 = 4095.0;
/// Sonar: metres for each step.
const SONAR_STEP_M: f64 = 0.0025;
/// Barometer: metres for each step, and the step at altitude 0.
const BAROMETER_STEP_M: f64 = 0.25;
const BAROMETER_ZERO_ADC: f64 = 500.0;
/// Pan and tilt: steps for each radian, and the step straight ahead.
const PAN_TILT_STEPS_PER_RAD: f64 = 2_048.0 / FRAC_PI_2;
const PAN_TILT_CENTRE_ADC: f64 = 2_048.0;
/// The camera looks straight ahead, and a little down: nothing on the wire moves it.
const PAN_RAD: f64 = 0.0;
const TILT_RAD: f64 = -0.2;
/// Servos: the middle, and the way to each side, µs.
const PULSE_CENTRE_US: f64 = 1_500.0;
const PULSE_WAY_US: f64 = 500.0;
/// Pulses that a servo accepts, µs (`docs/protocol.md` section 9).
const PULSES_US: (f64, f64) = (500.0, 2_500.0);
/// Rotor speed at full throttle, rpm: the greatest set point of port 10210.
const FULL_THROTTLE_RPM: f64 = 3_000.0;

/// Offsets of the five servos, µs (ports 10200 … 10204). The closed loop of the model does not feel them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Trims {
    /// Collective pitch.
    pub collective_us: i16,
    /// Lateral cyclic.
    pub roll_us: i16,
    /// Longitudinal cyclic.
    pub pitch_us: i16,
    /// Tail rotor.
    pub tail_us: i16,
    /// Throttle.
    pub throttle_us: i16,
}

/// The true state of everything that is measured.
#[derive(Clone, Copy, Debug)]
pub struct Truth<'a> {
    /// The machine.
    pub body: &'a Body,
    /// What its servos were last asked for.
    pub controls: &'a Controls,
    /// What the controllers aim at.
    pub aims: &'a Aims,
    /// Offsets of the servos.
    pub trims: &'a Trims,
    /// Battery and fuel.
    pub energy: &'a Energy,
    /// Position of the pilot's switch.
    pub switch: PilotSwitch,
    /// Where the flat world lies.
    pub world: &'a LocalFrame,
    /// Whether the GPS has a fix.
    pub gps_fix: bool,
    /// By how much the altitude of the GPS reads too high, m.
    pub gps_altitude_error_m: f64,
}

/// The instruments and what they remember.
#[derive(Clone, Debug)]
pub struct Sensors {
    random: Random,
    level: f64,
    /// The DSP's flat frame around the first valid fix.
    origin: Option<LocalFrame>,
    course_deg: f64,
}

impl Sensors {
    /// Instruments whose noise `random` decides; `level` 0 is without noise, 1 is usual.
    pub fn new(random: Random, level: f64) -> Sensors {
        Sensors {
            random,
            level,
            origin: None,
            course_deg: 0.0,
        }
    }

    /// Forgets what a DSP forgets when it boots: the origin of its flat frame.
    pub fn reboot(&mut self) {
        self.origin = None;
    }

    /// All groups of a status but the DSP's time.
    pub fn read(&mut self, truth: &Truth<'_>) -> Status {
        let (geographic, xy, gps_velocity, gps_quality) = self.gps(truth);
        let body = truth.body;
        let force = body.specific_force_mps2();
        let rates = body.rates_radps;
        Status {
            flying: !body.on_ground,
            time_ms: None,
            geographic: Some(geographic),
            xy: Some(xy),
            gps_velocity: Some(gps_velocity),
            gps_quality: Some(gps_quality),
            attitude: Some(self.attitude(body)),
            acceleration: Some(Acceleration {
                x_mps2: self.noisy(force.forward, ACCELERATION_MPS2) as f32,
                y_mps2: self.noisy(force.right, ACCELERATION_MPS2) as f32,
                z_mps2: self.noisy(force.down, ACCELERATION_MPS2) as f32,
            }),
            angular_rate: Some(AngularRate {
                x_radps: self.noisy(rates.forward, RATE_RADPS) as f32,
                y_radps: self.noisy(rates.right, RATE_RADPS) as f32,
                z_radps: self.noisy(rates.down, RATE_RADPS) as f32,
            }),
            pilot_pwm: Some(self.pilot()),
            sonar_adc: Some(self.adc(body.position_m.z, SONAR_M, 0.0, SONAR_STEP_M)),
            supply: Some(Supply {
                battery_mv: truth.energy.battery_mv(body.thrust_mps2 / GRAVITY_MPS2),
                fuel_percent: truth.energy.fuel_percent(),
                auto_switch: (truth.switch == PilotSwitch::Auto).into(),
            }),
            pan_tilt: Some(PanTilt {
                pan_adc: self.potentiometer(PAN_RAD),
                tilt_adc: self.potentiometer(TILT_RAD),
            }),
            rotor_rpm: Some(self.rotor(body)),
            barometer_adc: Some(self.barometer(truth)),
            actuation: Some(actuation(truth)),
            references: Some(references(truth)),
        }
    }

    /// Position, flat position, velocity and quality. Without a fix they are zero, and the quality shows it.
    fn gps(&mut self, truth: &Truth<'_>) -> (Geographic, Xy, GpsVelocity, u8) {
        if !truth.gps_fix {
            let nothing = (Geographic::default(), Xy::default(), GpsVelocity::default());
            return (nothing.0, nothing.1, nothing.2, NO_FIX);
        }
        let position_m = Vector {
            x: self.noisy(truth.body.position_m.x, GPS_HORIZONTAL_M),
            y: self.noisy(truth.body.position_m.y, GPS_HORIZONTAL_M),
            z: self.noisy(truth.body.position_m.z, GPS_VERTICAL_M),
        };
        let mut fix = truth.world.to_geographic(position_m);
        fix.altitude_m += truth.gps_altitude_error_m;
        let origin = self.origin.get_or_insert_with(|| LocalFrame::new(fix));
        let flat_m = origin.to_flat(fix);
        let velocity_mps = Vector {
            x: self.noisy(truth.body.velocity_mps.x, GPS_VELOCITY_MPS),
            y: self.noisy(truth.body.velocity_mps.y, GPS_VELOCITY_MPS),
            z: self.noisy(truth.body.velocity_mps.z, GPS_VELOCITY_MPS),
        };
        let speed_mps = velocity_mps.horizontal_norm();
        if speed_mps > COURSE_SPEED_MPS {
            let course = velocity_mps.x.atan2(velocity_mps.y);
            self.course_deg = course.to_degrees().rem_euclid(360.0);
        }
        let velocity = GpsVelocity {
            horizontal_speed_mps: speed_mps as f32,
            vertical_speed_mps: velocity_mps.z as f32,
            heading_deg: self.course_deg as f32,
        };
        let xy = Xy {
            x_m: flat_m.x,
            y_m: flat_m.y,
        };
        (fix, xy, velocity, RTK_FIX)
    }

    fn attitude(&mut self, body: &Body) -> Attitude {
        let yaw_deg = self.noisy(body.angles.yaw.to_degrees(), ATTITUDE_DEG);
        Attitude {
            pitch_deg: self.noisy(body.angles.pitch.to_degrees(), ATTITUDE_DEG) as f32,
            roll_deg: self.noisy(body.angles.roll.to_degrees(), ATTITUDE_DEG) as f32,
            yaw_deg: super::geodesy::wrap_degrees(yaw_deg) as f32,
        }
    }

    /// The pilot's hands are off: all sticks stand in the middle.
    fn pilot(&mut self) -> ServoPulses {
        let mut stick = || self.noisy(PULSE_CENTRE_US, PULSE_US).round() as u16;
        ServoPulses {
            collective_us: stick(),
            roll_us: stick(),
            pitch_us: stick(),
            tail_us: stick(),
            throttle_us: stick(),
        }
    }

    fn rotor(&mut self, body: &Body) -> u16 {
        // A rotor that stands gives no pulses to miscount.
        let noise_rpm = if body.rotor_rpm > 0.0 { ROTOR_RPM } else { 0.0 };
        self.noisy(body.rotor_rpm, noise_rpm).round().max(0.0) as u16
    }

    fn barometer(&mut self, truth: &Truth<'_>) -> u16 {
        let altitude_m = truth.world.to_geographic(truth.body.position_m).altitude_m;
        self.adc(
            altitude_m,
            BAROMETER_M,
            BAROMETER_ZERO_ADC,
            BAROMETER_STEP_M,
        )
    }

    fn potentiometer(&mut self, angle_rad: f64) -> u16 {
        let steps = PAN_TILT_CENTRE_ADC + angle_rad * PAN_TILT_STEPS_PER_RAD;
        self.noisy(steps, PAN_TILT_ADC).round().clamp(0.0, ADC_MAX) as u16
    }

    /// A length as a 12-bit converter gives it: cut at both ends.
    fn adc(&mut self, length_m: f64, deviation_m: f64, zero: f64, step_m: f64) -> u16 {
        let steps = zero + self.noisy(length_m, deviation_m) / step_m;
        steps.round().clamp(0.0, ADC_MAX) as u16
    }

    fn noisy(&mut self, value: f64, deviation: f64) -> f64 {
        if self.level == 0.0 {
            return value;
        }
        value + self.random.gaussian() * deviation * self.level
    }
}

/// What is sent to the servos: a part of their way for what is asked of them, and the trim.
fn actuation(truth: &Truth<'_>) -> ServoPulses {
    let pulse = |part: f64, trim_us: i16| {
        let pulse_us = PULSE_CENTRE_US + PULSE_WAY_US * part.clamp(-1.0, 1.0) + f64::from(trim_us);
        pulse_us.round().clamp(PULSES_US.0, PULSES_US.1) as u16
    };
    let Controls {
        angular_acceleration_radps2: turn,
        thrust_mps2,
        rotor_rpm,
    } = truth.controls;
    let trims = truth.trims;
    ServoPulses {
        collective_us: pulse(thrust_mps2 / GRAVITY_MPS2 - 1.0, trims.collective_us),
        roll_us: pulse(turn.forward / MAX_TILT_ACCELERATION_RADPS2, trims.roll_us),
        pitch_us: pulse(turn.right / MAX_TILT_ACCELERATION_RADPS2, trims.pitch_us),
        tail_us: pulse(turn.down / MAX_YAW_ACCELERATION_RADPS2, trims.tail_us),
        throttle_us: pulse(2.0 * rotor_rpm / FULL_THROTTLE_RPM - 1.0, trims.throttle_us),
    }
}

fn references(truth: &Truth<'_>) -> References {
    let aims = truth.aims;
    let above = Vector::new(0.0, 0.0, aims.height_m);
    References {
        x_speed_mps: aims.velocity_mps.x as f32,
        y_speed_mps: aims.velocity_mps.y as f32,
        altitude_m: truth.world.to_geographic(above).altitude_m,
        pitch_deg: aims.angles.pitch.to_degrees() as f32,
        roll_deg: aims.angles.roll.to_degrees() as f32,
        yaw_deg: aims.angles.yaw.to_degrees() as f32,
    }
}

// What goes wrong with the GPS receiver. The helicopter flies by its true position, so none of it changes the flight.

/// The receiver's errors, apart from its noise.
#[derive(Clone, Copy, Debug)]
pub(super) struct GpsErrors {
    /// There is no fix before this time.
    fix_at: Duration,
    drift: Drift,
}

/// An altitude error that grows for a time and then stays.
#[derive(Clone, Copy, Debug, Default)]
struct Drift {
    error_m: f64,
    rate_mps: f64,
    from: Duration,
    until: Duration,
}

impl GpsErrors {
    /// A receiver that has its first fix at `first_fix`, and measures without drift.
    pub(super) fn new(first_fix: Duration) -> GpsErrors {
        GpsErrors {
            fix_at: first_fix,
            drift: Drift::default(),
        }
    }

    /// Loses the fix until `end`.
    pub(super) fn lose_fix(&mut self, end: Duration) {
        self.fix_at = self.fix_at.max(end);
    }

    /// Lets the altitude drift at `rate_mps` for `length`, in place of a drift that is under way. The error that was
    /// there stays.
    pub(super) fn drift(&mut self, now: Duration, rate_mps: f64, length: Duration) {
        self.drift = Drift {
            error_m: self.altitude_error_m(now),
            rate_mps,
            from: now,
            until: now.saturating_add(length),
        };
    }

    pub(super) fn has_fix(&self, now: Duration) -> bool {
        now >= self.fix_at
    }

    /// By how much the altitude reads too high, m.
    pub(super) fn altitude_error_m(&self, now: Duration) -> f64 {
        let Drift {
            error_m,
            rate_mps,
            from,
            until,
        } = self.drift;
        error_m + rate_mps * now.min(until).saturating_sub(from).as_secs_f64()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fix_comes_and_goes() {
        let second = Duration::from_secs;
        let mut gps = GpsErrors::new(second(2));
        assert!(!gps.has_fix(second(1)) && gps.has_fix(second(2)));
        gps.lose_fix(second(9));
        gps.lose_fix(second(5));
        assert!(!gps.has_fix(second(8)) && gps.has_fix(second(9)));
    }

    #[test]
    fn the_altitude_error_grows_stays_and_can_be_taken_back() {
        let second = Duration::from_secs;
        let mut gps = GpsErrors::new(second(0));
        assert_eq!(gps.altitude_error_m(second(100)), 0.0);
        gps.drift(second(10), 0.5, second(4));
        assert_eq!(gps.altitude_error_m(second(12)), 1.0);
        assert_eq!(gps.altitude_error_m(second(100)), 2.0);
        gps.drift(second(100), -1.0, second(10));
        assert_eq!(gps.altitude_error_m(second(101)), 1.0);
        gps.drift(second(102), 0.0, second(1));
        assert_eq!(gps.altitude_error_m(second(200)), 0.0);
    }
}
