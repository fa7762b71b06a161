//! The moving average that makes a reference soft enough for a helicopter to follow.
//!
//! Guidance changes its acceleration from one step to the next, which no helicopter can. The mean of its last
//! positions changes acceleration gradually, and is as good otherwise: a mean of velocities is never faster than they
//! were, a mean of accelerations never stronger, and a point at rest stays where it is.

use super::vector::Vector;

/// Samples in the window: 0.4 s at a step of 5 ms, in which the rotor tilts from one side to the other.
const WINDOW: usize = 80;

/// Where the helicopter should be, and how it should move there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reference {
    /// Position, m.
    pub position_m: Vector,
    /// Velocity, m/s.
    pub velocity_mps: Vector,
    /// Acceleration, m/s².
    pub acceleration_mps2: Vector,
}

/// A moving average of positions, with its derivatives.
#[derive(Clone, Debug)]
pub struct Smoother {
    window: [Vector; WINDOW],
    oldest: usize,
    sum: Vector,
    reference: Reference,
}

impl Smoother {
    /// A window full of one position.
    pub fn at(position_m: Vector) -> Smoother {
        Smoother {
            window: [position_m; WINDOW],
            oldest: 0,
            sum: position_m * WINDOW as f64,
            reference: Reference {
                position_m,
                ..Reference::default()
            },
        }
    }

    /// Takes the next position, `step_s` seconds after the last, and gives the smooth reference.
    pub fn step(&mut self, position_m: Vector, step_s: f64) -> Reference {
        let change = position_m - self.window[self.oldest];
        self.window[self.oldest] = position_m;
        self.oldest = (self.oldest + 1) % WINDOW;
        self.sum += change;
        let velocity_mps = change * (1.0 / (WINDOW as f64 * step_s));
        self.reference = Reference {
            position_m: self.sum * (1.0 / WINDOW as f64),
            velocity_mps,
            acceleration_mps2: (velocity_mps - self.reference.velocity_mps) * (1.0 / step_s),
        };
        self.reference
    }

    /// The reference as it stands.
    pub fn reference(&self) -> Reference {
        self.reference
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jump_of_velocity_becomes_a_ramp() {
        const STEP_S: f64 = 0.005;
        let mut smoother = Smoother::at(Vector::ZERO);
        let mut x = 0.0;
        let mut before = 0.0;
        for _ in 0..2 * WINDOW {
            x += 4.0 * STEP_S;
            let reference = smoother.step(Vector::new(x, 0.0, 0.0), STEP_S);
            let velocity = reference.velocity_mps.x;
            assert!(velocity >= before - 1e-9 && velocity <= 4.0 + 1e-9);
            assert!(reference.acceleration_mps2.x <= 4.0 / 0.4 + 1e-6);
            before = velocity;
        }
        let delay_m = x - smoother.reference().position_m.x;
        assert!((delay_m - 4.0 * STEP_S * (WINDOW as f64 - 1.0) / 2.0).abs() < 1e-9);
    }
}
