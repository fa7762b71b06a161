//! `[control]`: whose movements are taken.

use std::time::Duration;

use serde::{Deserialize, Serialize};

runtime::ranged! {
    fn silence_s(f64) in 1.0..=86_400.0;
}

/// `[control]`
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct ControlConfig {
    /// While a sender has control, movements and parameter writes of others are refused.
    pub exclusive: bool,
    /// After so long without a request the holder has control no more.
    #[serde(deserialize_with = "silence_s")]
    pub silence_s: f64,
}

impl Default for ControlConfig {
    fn default() -> Self {
        ControlConfig {
            exclusive: false,
            silence_s: 60.0,
        }
    }
}

impl ControlConfig {
    /// How long a holder may be silent.
    pub fn silence(&self) -> Duration {
        Duration::from_secs_f64(self.silence_s)
    }
}
