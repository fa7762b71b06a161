//! The DSP's controllers: position to velocity to acceleration to attitude to angular acceleration.
//!
//! A cascade of proportional controllers with the gains of the ports, fed forward with what guidance knows about the
//! future: velocity, acceleration, and the rate at which the wanted attitude changes. Wind is met by an observer that
//! compares what the machine does with what the rotor should do, so that no error is needed to hold against it.
//!
//! The controllers see the true state. The noise of the sensors is only in what the status reports.

use super::body::{
    Angles, Body, Controls, GRAVITY_MPS2, MAX_THRUST_MPS2, MAX_TILT_RATE_RADPS, MAX_YAW_RATE_RADPS,
};
use super::geodesy::wrap_radians;
use super::smoother::Reference;
use super::vector::Vector;

/// Greatest tilt that the controllers ask for, rad: 40°, or 8.2 m/s² along the ground.
pub const MAX_TILT_RAD: f64 = 0.698;
/// Most velocity that a position error adds, m/s.
const MAX_CORRECTION_MPS: f64 = 3.0;
/// Greatest vertical acceleration asked for, m/s².
const MAX_VERTICAL_ACCELERATION_MPS2: f64 = 6.0;
/// Time constant of the observer of wind, s.
const OBSERVER_S: f64 = 0.4;
/// Bandwidth of the rate loop over that of the attitude loop: critical damping.
const RATE_FACTOR: f64 = 4.0;
/// Least bandwidth of the yaw rate loop, 1/s: a small yaw gain turns slowly, but does not drift.
const MIN_YAW_BANDWIDTH_PER_S: f64 = 4.0;
/// Below this speed along the ground the nose stays where it is, m/s.
const COURSE_SPEED_MPS: f64 = 1.0;

/// Gains of the cascade, 1/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// Velocity for each metre of position error (port 20010).
    pub position_per_s: f64,
    /// Acceleration for each m/s of velocity error (port 20011).
    pub velocity_per_s: f64,
    /// Angular rate for each radian of roll and pitch error (port 20012).
    pub attitude_per_s: f64,
    /// Angular rate for each radian of yaw error (port 20013).
    pub yaw_per_s: f64,
}

/// What the controllers aim at: the group of controller references.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Aims {
    /// Velocity, m/s.
    pub velocity_mps: Vector,
    /// Height above the ground, m.
    pub height_m: f64,
    /// Attitude.
    pub angles: Angles,
}

/// The controllers and what they remember.
#[derive(Clone, Debug)]
pub struct Controller {
    aims: Aims,
    /// Acceleration that is not the rotor's, m/s².
    disturbance_mps2: Vector,
}

impl Controller {
    /// Controllers of a machine at rest that looks along `yaw_rad`.
    pub fn new(yaw_rad: f64) -> Controller {
        Controller {
            aims: Aims {
                angles: Angles {
                    yaw: yaw_rad,
                    ..Angles::default()
                },
                ..Aims::default()
            },
            disturbance_mps2: Vector::ZERO,
        }
    }

    /// What the controllers aim at.
    pub fn aims(&self) -> &Aims {
        &self.aims
    }

    /// Stands on the ground: level, no push, and the nose where it is.
    pub fn stand(&mut self, body: &Body, gains: &Gains) -> Controls {
        *self = Controller::new(body.angles.yaw);
        self.controls(body, gains, Angles::default(), 0.0)
    }

    /// Flies along `reference`; with `turn` the nose follows the course. Lets `step_s` seconds pass.
    pub fn fly(
        &mut self,
        body: &Body,
        reference: &Reference,
        gains: &Gains,
        turn: bool,
        step_s: f64,
    ) -> Controls {
        let rotor_mps2 = body.thrust_vector_mps2() + Vector::new(0.0, 0.0, -GRAVITY_MPS2);
        let felt_mps2 = body.acceleration_mps2 - rotor_mps2 - self.disturbance_mps2;
        self.disturbance_mps2 += felt_mps2 * (step_s / OBSERVER_S);

        let correction_mps = ((reference.position_m - body.position_m) * gains.position_per_s)
            .limited(MAX_CORRECTION_MPS, MAX_CORRECTION_MPS);
        let velocity_mps = reference.velocity_mps + correction_mps;
        let acceleration_mps2 = reference.acceleration_mps2
            + (velocity_mps - body.velocity_mps) * gains.velocity_per_s
            - self.disturbance_mps2;
        let before = self.aims.angles;
        let course = velocity_mps.x.atan2(velocity_mps.y);
        let moving = reference.velocity_mps.horizontal_norm() > COURSE_SPEED_MPS;
        let yaw = if turn && moving { course } else { before.yaw };
        let (push, angles) = attitude_for(acceleration_mps2, body.angles.yaw, yaw);
        self.aims = Aims {
            velocity_mps,
            height_m: reference.position_m.z,
            angles,
        };
        let change = |now: f64, before: f64| {
            let rate = (now - before) / step_s;
            rate.clamp(-MAX_TILT_RATE_RADPS, MAX_TILT_RATE_RADPS)
        };
        let ahead = Angles {
            roll: change(angles.roll, before.roll),
            pitch: change(angles.pitch, before.pitch),
            yaw: 0.0,
        };
        // Tilted, the rotor must push more to carry the same weight.
        let upright = body.angles.tilt().cos().max(0.5);
        self.controls(body, gains, ahead, push.z / upright)
    }

    /// Controls that bring the body's attitude to the aims, which change as `ahead` gives.
    fn controls(&self, body: &Body, gains: &Gains, ahead: Angles, thrust_mps2: f64) -> Controls {
        let (aim, is) = (&self.aims.angles, &body.angles);
        let yaw_rate = gains.yaw_per_s * wrap_radians(aim.yaw - is.yaw);
        let change = Angles {
            roll: ahead.roll + gains.attitude_per_s * (aim.roll - is.roll),
            pitch: ahead.pitch + gains.attitude_per_s * (aim.pitch - is.pitch),
            yaw: yaw_rate.clamp(-MAX_YAW_RATE_RADPS, MAX_YAW_RATE_RADPS),
        };
        let mut wanted = is.rates(&change);
        let tilt = |rate: f64| rate.clamp(-MAX_TILT_RATE_RADPS, MAX_TILT_RATE_RADPS);
        let bandwidth = RATE_FACTOR * gains.attitude_per_s;
        let yaw_bandwidth = (RATE_FACTOR * gains.yaw_per_s).max(MIN_YAW_BANDWIDTH_PER_S);
        wanted.forward = bandwidth * (tilt(wanted.forward) - body.rates_radps.forward);
        wanted.right = bandwidth * (tilt(wanted.right) - body.rates_radps.right);
        wanted.down = yaw_bandwidth * (wanted.down - body.rates_radps.down);
        Controls {
            angular_acceleration_radps2: wanted,
            thrust_mps2: thrust_mps2.clamp(0.0, MAX_THRUST_MPS2),
            rotor_rpm: 0.0,
        }
    }
}

/// The push of the rotor and the attitude that give an acceleration, for a machine that looks along `is_yaw` and is to
/// look along `yaw`.
fn attitude_for(acceleration_mps2: Vector, is_yaw: f64, yaw: f64) -> (Vector, Angles) {
    let climb_mps2 = acceleration_mps2.z.clamp(
        -MAX_VERTICAL_ACCELERATION_MPS2,
        MAX_VERTICAL_ACCELERATION_MPS2,
    );
    let up_mps2 = GRAVITY_MPS2 + climb_mps2;
    let push = Vector {
        z: up_mps2,
        ..acceleration_mps2.limited(up_mps2 * MAX_TILT_RAD.tan(), f64::INFINITY)
    };
    let (sin, cos) = is_yaw.sin_cos();
    let forward = push.x * sin + push.y * cos;
    let right = push.x * cos - push.y * sin;
    let angles = Angles {
        roll: (right / push.norm()).asin(),
        pitch: -forward.atan2(up_mps2),
        yaw,
    };
    (push, angles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_attitude_for_an_acceleration_gives_that_acceleration() {
        for yaw in [-3.0, -1.0, 0.0, 0.7, 2.0] {
            for acceleration in [
                Vector::new(3.0, -2.0, 1.0),
                Vector::new(-4.0, 4.0, -2.0),
                Vector::ZERO,
            ] {
                let (push, angles) = attitude_for(acceleration, yaw, yaw);
                let body = Body {
                    angles,
                    thrust_mps2: push.norm(),
                    ..Body::at_home(0.0)
                };
                let given = body.thrust_vector_mps2() - Vector::new(0.0, 0.0, GRAVITY_MPS2);
                assert!((given - acceleration).norm() < 1e-9, "{yaw}: {given:?}");
            }
        }
    }

    #[test]
    fn no_acceleration_is_worth_more_than_the_greatest_tilt() {
        let (_, angles) = attitude_for(Vector::new(300.0, 400.0, -90.0), 0.3, 0.3);
        assert!(angles.tilt() <= MAX_TILT_RAD + 1e-9);
    }
}
