//! A Kalman filter of `N` states that takes one measured number at a time. No allocation, no matrix inversion.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A square matrix, row by row.
pub type Matrix<const N: usize> = [[f64; N]; N];

/// What is known about `N` states: a normal distribution.
#[derive(Clone, Debug, PartialEq)]
pub struct Gaussian<const N: usize> {
    /// The expected states.
    pub mean: [f64; N],
    /// Variances on the diagonal, covariances beside it; always symmetric.
    pub covariance: Matrix<N>,
}

/// A measured number and what it says about the states: `measured = observation · states + noise`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurement<const N: usize> {
    /// The number.
    pub measured: f64,
    /// Variance of its noise, greater than 0.
    pub variance: f64,
    /// The weight of each state in the number.
    pub observation: [f64; N],
}

/// How a measured number differs from the expected one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovation {
    /// Measured minus expected.
    pub residual: f64,
    /// The variance that the residual should have.
    pub variance: f64,
}

impl Innovation {
    /// Whether the residual lies within `sigmas` standard deviations; a residual that is not a number does not.
    pub fn is_within(&self, sigmas: f64) -> bool {
        self.residual * self.residual <= sigmas * sigmas * self.variance
    }
}

/// The means, and the covariances row by row.
impl<const N: usize> Serialize for Gaussian<N> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let numbers: Vec<f64> = self.numbers().collect();
        numbers.serialize(to)
    }
}

impl<'de, const N: usize> Deserialize<'de> for Gaussian<N> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let numbers = Vec::<f64>::deserialize(from)?;
        if numbers.len() != N + N * N {
            let wanted = "means and covariances";
            return Err(D::Error::invalid_length(numbers.len(), &wanted));
        }
        let mut gaussian = Gaussian {
            mean: [0.0; N],
            covariance: [[0.0; N]; N],
        };
        let (mean, covariance) = numbers.split_at(N);
        gaussian.mean.copy_from_slice(mean);
        for (row, numbers) in gaussian.covariance.iter_mut().zip(covariance.chunks(N)) {
            row.copy_from_slice(numbers);
        }
        Ok(gaussian)
    }
}

impl<const N: usize> Gaussian<N> {
    fn numbers(&self) -> impl Iterator<Item = f64> {
        let covariance = self.covariance.iter().flatten();
        self.mean.iter().chain(covariance).copied()
    }

    /// Independent states with these means and variances.
    pub fn independent(mean: [f64; N], variances: [f64; N]) -> Gaussian<N> {
        let mut covariance = [[0.0; N]; N];
        for (index, variance) in variances.into_iter().enumerate() {
            covariance[index][index] = variance;
        }
        Gaussian { mean, covariance }
    }

    /// Moves the states on by `transition` and adds the covariance of the `noise` that acts meanwhile.
    pub fn predict(&mut self, transition: &Matrix<N>, noise: &Matrix<N>) {
        self.mean = transition.map(|row| dot(&row, &self.mean));
        self.covariance = sandwich(transition, &self.covariance);
        for (row, noise) in self.covariance.iter_mut().zip(noise) {
            for (value, noise) in row.iter_mut().zip(noise) {
                *value += noise;
            }
        }
    }

    /// How `measurement` differs from what the states let expect.
    pub fn innovation(&self, measurement: &Measurement<N>) -> Innovation {
        let gain = self
            .covariance
            .map(|row| dot(&row, &measurement.observation));
        Innovation {
            residual: measurement.measured - dot(&measurement.observation, &self.mean),
            variance: dot(&measurement.observation, &gain) + measurement.variance,
        }
    }

    /// Corrects the states by `measurement`.
    ///
    /// The covariance is computed in Joseph's form, which rounding cannot make negative.
    pub fn correct(&mut self, measurement: &Measurement<N>) {
        let Innovation { residual, variance } = self.innovation(measurement);
        let observation = &measurement.observation;
        let gain = self.covariance.map(|row| dot(&row, observation) / variance);
        let mut keep = [[0.0; N]; N];
        for row in 0..N {
            self.mean[row] += gain[row] * residual;
            for column in 0..N {
                let identity = if row == column { 1.0 } else { 0.0 };
                keep[row][column] = identity - gain[row] * observation[column];
            }
        }
        self.covariance = sandwich(&keep, &self.covariance);
        for row in 0..N {
            for column in 0..N {
                self.covariance[row][column] += gain[row] * gain[column] * measurement.variance;
            }
        }
    }

    /// Forgets what is known about the state `index` in favour of this mean and variance.
    pub fn replace(&mut self, index: usize, mean: f64, variance: f64) {
        self.mean[index] = mean;
        for other in 0..N {
            self.covariance[index][other] = 0.0;
            self.covariance[other][index] = 0.0;
        }
        self.covariance[index][index] = variance;
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.numbers().all(f64::is_finite)
    }
}

fn dot<const N: usize>(left: &[f64; N], right: &[f64; N]) -> f64 {
    left.iter()
        .zip(right)
        .map(|(left, right)| left * right)
        .sum()
}

/// `outer · inner · outerᵀ` for a symmetric `inner`; exactly symmetric, whatever the rounding.
fn sandwich<const N: usize>(outer: &Matrix<N>, inner: &Matrix<N>) -> Matrix<N> {
    let half = outer.map(|row| inner.map(|column| dot(&row, &column)));
    let mut result = [[0.0; N]; N];
    for row in 0..N {
        for column in 0..=row {
            let value = dot(&half[row], &outer[column]);
            result[row][column] = value;
            result[column][row] = value;
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_equal_measurements_are_averaged_and_halve_the_variance() {
        let mut state = Gaussian::independent([0.0], [1e12]);
        for measured in [3.0, 5.0] {
            state.correct(&Measurement {
                measured,
                variance: 2.0,
                observation: [1.0],
            });
        }
        assert!((state.mean[0] - 4.0).abs() < 1e-9, "{state:?}");
        assert!((state.covariance[0][0] - 1.0).abs() < 1e-9, "{state:?}");
    }

    #[test]
    fn a_speed_that_is_never_measured_shows_in_the_positions() {
        let mut state = Gaussian::independent([0.0, 0.0], [1e6, 1e6]);
        let transition = [[1.0, 0.1], [0.0, 1.0]];
        for step in 0..200 {
            state.correct(&Measurement {
                measured: f64::from(step) * 0.3,
                variance: 0.01,
                observation: [1.0, 0.0],
            });
            state.predict(&transition, &[[0.0; 2]; 2]);
        }
        assert!((state.mean[1] - 3.0).abs() < 1e-3, "{state:?}");
    }

    #[test]
    fn a_replaced_state_depends_on_no_other() {
        let mut state = Gaussian {
            mean: [1.0, 2.0],
            covariance: [[4.0, 1.5], [1.5, 3.0]],
        };
        state.replace(1, 7.0, 9.0);
        assert_eq!(state.mean, [1.0, 7.0]);
        assert_eq!(state.covariance, [[4.0, 0.0], [0.0, 9.0]]);
    }
}
