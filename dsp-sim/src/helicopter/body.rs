//! The machine that flies: a rigid body under a rotor, in wind, over flat ground.
//!
//! It obeys controls within what it can do, and knows nothing of where it should go. The rotor pushes along the
//! body's vertical axis alone, so that the only way to accelerate forward is to lower the nose: what the instruments
//! report about attitude, acceleration and velocity belongs together because it comes from one state.

use super::vector::Vector;

/// Length of a step of the simulation, s.
pub const STEP_S: f64 = 0.005;
/// Acceleration of gravity, m/s².
pub const GRAVITY_MPS2: f64 = 9.81;
/// Greatest rate of roll and pitch, rad/s.
pub const MAX_TILT_RATE_RADPS: f64 = 2.5;
/// Greatest rate of yaw, rad/s.
pub const MAX_YAW_RATE_RADPS: f64 = 1.5;
/// Greatest angular acceleration of roll and pitch, rad/s².
pub const MAX_TILT_ACCELERATION_RADPS2: f64 = 20.0;
/// Greatest angular acceleration of yaw, rad/s².
pub const MAX_YAW_ACCELERATION_RADPS2: f64 = 6.0;
/// Greatest push of the rotor for each kilogram, m/s²: twice the weight.
pub const MAX_THRUST_MPS2: f64 = 2.0 * GRAVITY_MPS2;
/// Drag for each kilogram and each m/s through the air, 1/s.
const DRAG_PER_S: f64 = 0.1;
/// Time constant of the rotor's push behind the collective, s.
const THRUST_LAG_S: f64 = 0.05;
/// How fast the rotor speeds up and slows down, rpm/s: three quarters of a second to its speed at boot.
const ROTOR_ACCELERATION_RPMPS: f64 = 2_000.0;
/// Beyond this the rotor blades would hit the tail, rad. No controller asks for as much.
const MECHANICAL_TILT_RAD: f64 = 1.0;

/// Roll, pitch and yaw, rad, with the signs of `docs/protocol.md` section 4.1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Angles {
    /// Right side down positive.
    pub roll: f64,
    /// Nose up positive.
    pub pitch: f64,
    /// Clockwise from true north.
    pub yaw: f64,
}

/// Something about each of the body's axes: forward, right, down.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BodyAxes {
    /// About the forward axis: rolling.
    pub forward: f64,
    /// About the right axis: pitching.
    pub right: f64,
    /// About the down axis: yawing.
    pub down: f64,
}

/// What the servos and the engine are asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Controls {
    /// Angular acceleration about the body axes, rad/s².
    pub angular_acceleration_radps2: BodyAxes,
    /// Push of the rotor for each kilogram, m/s².
    pub thrust_mps2: f64,
    /// Rotor speed that the engine's governor holds, rpm.
    pub rotor_rpm: f64,
}

/// State of the machine.
#[derive(Clone, Debug)]
pub struct Body {
    /// Position, m; z is the height above the ground.
    pub position_m: Vector,
    /// Velocity over ground, m/s.
    pub velocity_mps: Vector,
    /// Acceleration over ground, m/s².
    pub acceleration_mps2: Vector,
    /// Attitude.
    pub angles: Angles,
    /// Angular rates about the body axes, rad/s.
    pub rates_radps: BodyAxes,
    /// Push of the rotor for each kilogram, m/s².
    pub thrust_mps2: f64,
    /// Rotor speed, rpm.
    pub rotor_rpm: f64,
    /// The skids touch the ground.
    pub on_ground: bool,
    /// Speed of descent at the last touch-down, m/s; zero before the first.
    pub touch_down_mps: f64,
}

impl Body {
    /// A machine at rest on the ground at the home.
    pub fn at_home(yaw_rad: f64) -> Body {
        Body {
            position_m: Vector::ZERO,
            velocity_mps: Vector::ZERO,
            acceleration_mps2: Vector::ZERO,
            angles: Angles {
                yaw: yaw_rad,
                ..Angles::default()
            },
            rates_radps: BodyAxes::default(),
            thrust_mps2: 0.0,
            rotor_rpm: 0.0,
            on_ground: true,
            touch_down_mps: 0.0,
        }
    }

    /// Lets `step_s` seconds pass in a wind of `wind_mps`.
    pub fn step(&mut self, controls: &Controls, wind_mps: Vector, step_s: f64) {
        self.turn(&controls.angular_acceleration_radps2, step_s);
        let thrust_mps2 = controls.thrust_mps2.clamp(0.0, MAX_THRUST_MPS2);
        self.thrust_mps2 += (thrust_mps2 - self.thrust_mps2) * step_s / THRUST_LAG_S;
        let spin = ROTOR_ACCELERATION_RPMPS * step_s;
        self.rotor_rpm += (controls.rotor_rpm - self.rotor_rpm).clamp(-spin, spin);
        self.translate(wind_mps, step_s);
    }

    /// Integrates rates and attitude.
    fn turn(&mut self, wanted: &BodyAxes, step_s: f64) {
        let rate = |rate: f64, wanted: f64, max_acceleration: f64, max_rate: f64| {
            let acceleration = wanted.clamp(-max_acceleration, max_acceleration);
            (rate + acceleration * step_s).clamp(-max_rate, max_rate)
        };
        let (tilting, tilt_rate) = (MAX_TILT_ACCELERATION_RADPS2, MAX_TILT_RATE_RADPS);
        let rates = &mut self.rates_radps;
        rates.forward = rate(rates.forward, wanted.forward, tilting, tilt_rate);
        rates.right = rate(rates.right, wanted.right, tilting, tilt_rate);
        rates.down = rate(
            rates.down,
            wanted.down,
            MAX_YAW_ACCELERATION_RADPS2,
            MAX_YAW_RATE_RADPS,
        );
        let change = self.angles.change(&self.rates_radps);
        let tilt = |angle: f64| angle.clamp(-MECHANICAL_TILT_RAD, MECHANICAL_TILT_RAD);
        self.angles = Angles {
            roll: tilt(self.angles.roll + change.roll * step_s),
            pitch: tilt(self.angles.pitch + change.pitch * step_s),
            yaw: super::geodesy::wrap_radians(self.angles.yaw + change.yaw * step_s),
        };
    }

    /// Integrates velocity and position, and stops them at the ground.
    fn translate(&mut self, wind_mps: Vector, step_s: f64) {
        let drag_mps2 = (wind_mps - self.velocity_mps) * DRAG_PER_S;
        let free_mps2 =
            self.thrust_vector_mps2() + drag_mps2 + Vector::new(0.0, 0.0, -GRAVITY_MPS2);
        if self.on_ground {
            // The skids hold against the wind until the rotor lifts more than the weight.
            if free_mps2.z <= 0.0 {
                self.acceleration_mps2 = Vector::ZERO;
                return;
            }
            self.on_ground = false;
        }
        self.acceleration_mps2 = free_mps2;
        self.velocity_mps += free_mps2 * step_s;
        self.position_m += self.velocity_mps * step_s;
        if self.position_m.z <= 0.0 && self.velocity_mps.z <= 0.0 {
            self.touch_down_mps = -self.velocity_mps.z;
            self.on_ground = true;
            self.position_m.z = 0.0;
            self.velocity_mps = Vector::ZERO;
            self.acceleration_mps2 = Vector::ZERO;
        }
    }

    /// Push of the rotor for each kilogram as a vector of the flat world, m/s².
    pub fn thrust_vector_mps2(&self) -> Vector {
        let [_, _, down] = self.angles.axes();
        down * -self.thrust_mps2
    }

    /// What an accelerometer in the body feels along forward, right and down, m/s².
    pub fn specific_force_mps2(&self) -> BodyAxes {
        let felt = self.acceleration_mps2 + Vector::new(0.0, 0.0, GRAVITY_MPS2);
        let [forward, right, down] = self.angles.axes();
        BodyAxes {
            forward: felt.dot(forward),
            right: felt.dot(right),
            down: felt.dot(down),
        }
    }
}

impl Angles {
    /// The body's forward, right and down axes in the flat world.
    pub fn axes(&self) -> [Vector; 3] {
        let (roll_sin, roll_cos) = self.roll.sin_cos();
        let (pitch_sin, pitch_cos) = self.pitch.sin_cos();
        let (yaw_sin, yaw_cos) = self.yaw.sin_cos();
        [
            Vector::new(pitch_cos * yaw_sin, pitch_cos * yaw_cos, pitch_sin),
            Vector::new(
                roll_sin * pitch_sin * yaw_sin + roll_cos * yaw_cos,
                roll_sin * pitch_sin * yaw_cos - roll_cos * yaw_sin,
                -roll_sin * pitch_cos,
            ),
            Vector::new(
                roll_cos * pitch_sin * yaw_sin - roll_sin * yaw_cos,
                roll_cos * pitch_sin * yaw_cos + roll_sin * yaw_sin,
                -roll_cos * pitch_cos,
            ),
        ]
    }

    /// How fast the angles change when the body turns with `rates`.
    pub fn change(&self, rates: &BodyAxes) -> Angles {
        let (roll_sin, roll_cos) = self.roll.sin_cos();
        let across = rates.right * roll_sin + rates.down * roll_cos;
        Angles {
            roll: rates.forward + across * self.pitch.tan(),
            pitch: rates.right * roll_cos - rates.down * roll_sin,
            yaw: across / self.pitch.cos(),
        }
    }

    /// The rates about the body axes at which the angles change, as given: the inverse of [`change`](Self::change).
    pub fn rates(&self, change: &Angles) -> BodyAxes {
        let (roll_sin, roll_cos) = self.roll.sin_cos();
        let (pitch_sin, pitch_cos) = self.pitch.sin_cos();
        BodyAxes {
            forward: change.roll - change.yaw * pitch_sin,
            right: change.pitch * roll_cos + change.yaw * roll_sin * pitch_cos,
            down: -change.pitch * roll_sin + change.yaw * roll_cos * pitch_cos,
        }
    }

    /// Angle between the body's vertical axis and the world's, rad.
    pub fn tilt(&self) -> f64 {
        (self.roll.cos() * self.pitch.cos()).clamp(-1.0, 1.0).acos()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn angles(roll: f64, pitch: f64, yaw: f64) -> Angles {
        Angles { roll, pitch, yaw }
    }

    fn in_flight(angles: Angles) -> Body {
        Body {
            position_m: Vector::new(0.0, 0.0, 50.0),
            angles,
            thrust_mps2: GRAVITY_MPS2,
            on_ground: false,
            ..Body::at_home(0.0)
        }
    }

    #[test]
    fn tilt_accelerates_as_the_protocol_signs_it() {
        let east = std::f64::consts::FRAC_PI_2;
        for (name, tilted, x, y) in [
            ("nose down, to the north", angles(0.0, -0.1, 0.0), 0.0, 1.0),
            ("nose down, to the east", angles(0.0, -0.1, east), 1.0, 0.0),
            ("nose up, to the north", angles(0.0, 0.1, 0.0), 0.0, -1.0),
            (
                "right side down, to the north",
                angles(0.1, 0.0, 0.0),
                1.0,
                0.0,
            ),
            (
                "right side down, to the east",
                angles(0.1, 0.0, east),
                0.0,
                -1.0,
            ),
        ] {
            let push = in_flight(tilted).thrust_vector_mps2();
            let expected = GRAVITY_MPS2 * 0.1_f64.sin();
            assert!((push.x - x * expected).abs() < 1e-9, "{name}: {push:?}");
            assert!((push.y - y * expected).abs() < 1e-9, "{name}: {push:?}");
            assert!(push.z > 0.0, "{name}: {push:?}");
        }
    }

    #[test]
    fn the_accelerometer_feels_the_ground_the_rotor_and_nothing_in_free_fall() {
        let resting = Body::at_home(1.0).specific_force_mps2();
        assert!((resting.down + GRAVITY_MPS2).abs() < 1e-9, "{resting:?}");

        // In calm air, from rest, the rotor's push along −down is all there is, whatever the attitude.
        let mut body = in_flight(angles(0.3, -0.2, 2.0));
        let controls = Controls {
            thrust_mps2: GRAVITY_MPS2,
            ..Controls::default()
        };
        body.step(&controls, Vector::ZERO, STEP_S);
        let felt = body.specific_force_mps2();
        assert!(felt.forward.abs() < 1e-9 && felt.right.abs() < 1e-9);
        assert!((felt.down + GRAVITY_MPS2).abs() < 1e-9, "{felt:?}");

        body.thrust_mps2 = 0.0;
        body.velocity_mps = Vector::ZERO;
        body.step(&Controls::default(), Vector::ZERO, STEP_S);
        assert!(body.specific_force_mps2().down.abs() < 1e-9);
    }

    #[test]
    fn rates_and_changes_of_the_angles_are_each_others_inverse() {
        let attitude = angles(0.4, -0.5, 2.5);
        let rates = BodyAxes {
            forward: 0.3,
            right: -0.7,
            down: 0.9,
        };
        let back = attitude.rates(&attitude.change(&rates));
        assert!((back.forward - rates.forward).abs() < 1e-12);
        assert!((back.right - rates.right).abs() < 1e-12);
        assert!((back.down - rates.down).abs() < 1e-12);
    }

    #[test]
    fn the_ground_holds_until_the_rotor_lifts_and_stops_a_fall() {
        let mut body = Body::at_home(0.0);
        let wind = Vector::new(10.0, 0.0, 0.0);
        let mut controls = Controls {
            thrust_mps2: 0.99 * GRAVITY_MPS2,
            ..Controls::default()
        };
        for _ in 0..200 {
            body.step(&controls, wind, STEP_S);
        }
        assert!(body.on_ground);
        assert_eq!(body.position_m, Vector::ZERO);

        controls.thrust_mps2 = 1.2 * GRAVITY_MPS2;
        for _ in 0..200 {
            body.step(&controls, wind, STEP_S);
        }
        assert!(!body.on_ground && body.position_m.z > 0.5);

        for _ in 0..400 {
            body.step(&Controls::default(), wind, STEP_S);
            assert!(body.position_m.z >= 0.0);
        }
        assert!(body.on_ground && body.touch_down_mps > 2.0);
        assert_eq!(body.velocity_mps, Vector::ZERO);
    }
}
