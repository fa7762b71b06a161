//! `[estimator]` in `status.toml`.

use serde::{Deserialize, Serialize};

use super::Estimator;
use super::altitude::{AltitudeConfig, AltitudeEstimator};

/// Which estimator runs, and its figures.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct EstimatorConfig {
    /// Which one.
    pub kind: EstimatorKind,
    /// Figures of [`EstimatorKind::Altitude`].
    pub altitude: AltitudeConfig,
}

/// The estimators that can be chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum EstimatorKind {
    /// None: the estimate is never valid.
    #[default]
    None,
    /// Altitude from GPS, barometer and sonar.
    Altitude,
}

impl EstimatorConfig {
    /// The estimator that was chosen, in its first state.
    pub fn build(&self) -> Option<Box<dyn Estimator + Send>> {
        match self.kind {
            EstimatorKind::None => None,
            EstimatorKind::Altitude => Some(Box::new(AltitudeEstimator::new(&self.altitude))),
        }
    }
}
