//! The wind: a steady one, and seeded gusts on top of it.
//!
//! Each component of the gusts is an Ornstein-Uhlenbeck process: noise that remembers itself for a few seconds and
//! keeps its standard deviation whatever the step.

use crate::random::Random;

use super::vector::Vector;

/// How long a gust lasts, s.
const GUST_TIME_S: f64 = 3.0;
/// Gusts are weaker up and down than along the ground.
const VERTICAL_SHARE: f64 = 0.3;
/// Longest steady wind plus gust that blows, m/s: the most that the helicopter can hold against.
const MAX_WIND_MPS: f64 = 16.0;

/// What kind of wind blows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WindModel {
    /// Steady wind, m/s, not negative.
    pub speed_mps: f64,
    /// Where the steady wind comes from, degrees clockwise from true north.
    pub from_deg: f64,
    /// Standard deviation of the gusts along each horizontal axis, m/s, not negative.
    pub gust_mps: f64,
}

/// The wind at this moment.
#[derive(Clone, Debug)]
pub struct Wind {
    steady_mps: Vector,
    gust_mps: Vector,
    model: WindModel,
    random: Random,
}

impl Wind {
    /// A wind whose gusts `random` decides.
    pub fn new(model: WindModel, random: Random) -> Wind {
        let (sin, cos) = model.from_deg.to_radians().sin_cos();
        Wind {
            steady_mps: Vector::new(-sin, -cos, 0.0) * model.speed_mps,
            gust_mps: Vector::ZERO,
            model,
            random,
        }
    }

    /// Lets `step_s` seconds pass.
    pub fn step(&mut self, step_s: f64) {
        if self.model.gust_mps == 0.0 {
            return;
        }
        let memory = 1.0 - step_s / GUST_TIME_S;
        let strength = self.model.gust_mps * (1.0 - memory * memory).sqrt();
        let push = Vector::new(
            self.random.gaussian(),
            self.random.gaussian(),
            self.random.gaussian() * VERTICAL_SHARE,
        );
        self.gust_mps = self.gust_mps * memory + push * strength;
    }

    /// Velocity of the air over the ground, m/s.
    pub fn velocity_mps(&self) -> Vector {
        (self.steady_mps + self.gust_mps).limited(MAX_WIND_MPS, MAX_WIND_MPS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wind_comes_from_where_it_is_named_after() {
        let model = WindModel {
            speed_mps: 5.0,
            from_deg: 270.0,
            gust_mps: 0.0,
        };
        let wind = Wind::new(model, Random::new(0, 0));
        assert!((wind.velocity_mps() - Vector::new(5.0, 0.0, 0.0)).norm() < 1e-9);
    }

    #[test]
    fn gusts_keep_their_spread_whatever_the_step() {
        for step_s in [0.005, 0.05] {
            let model = WindModel {
                speed_mps: 0.0,
                from_deg: 0.0,
                gust_mps: 2.0,
            };
            let mut wind = Wind::new(model, Random::new(3, 0));
            let steps = (4_000.0 / step_s) as u32;
            let mut squares = 0.0;
            for _ in 0..steps {
                wind.step(step_s);
                squares += wind.velocity_mps().x.powi(2);
            }
            let spread = (squares / f64::from(steps)).sqrt();
            assert!((spread - 2.0).abs() < 0.2, "step {step_s}: {spread}");
        }
    }
}
