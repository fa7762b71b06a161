//! Configuration of the bridge, `bridge.toml` (the source's `bridge.conf`).
//!
//! Every value has a default; the annotated example `bridge/bridge.toml` shows them all and is tested to parse to them.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::errors::ErrorTable;
use crate::safety::fence::Fence;

/// Implements `Deserialize` and `Serialize` for types that derive them as `#[serde(remote = "Self")]`: fields that are right each by
/// itself are then checked together.
macro_rules! checked {
    ($($config:ident),+) => {
        $(
            impl<'de> Deserialize<'de> for $config {
                fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                    let config = $config::deserialize(deserializer)?;
                    config.check().map_err(D::Error::custom)?;
                    Ok(config)
                }
            }

            impl serde::Serialize for $config {
                fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
                    $config::serialize(self, to)
                }
            }
        )+
    };
}

mod line;
mod link;
mod movement;
mod parameters;
mod range;
mod safety;

pub use link::{LinkConfig, SerialConfig, StatusConfig};
pub use movement::{
    ArrivalConfig, MovementLimits, STOP_WITHIN, Tolerance, TrajectoryConfig, TrajectoryKind,
};
pub use parameters::Parameters;
use range::state_period_ms;
pub use safety::{BreachAction, SafetyConfig, SupplyLimits};

/// All of `bridge.toml`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct BridgeConfig {
    /// The port, which is none of the core's.
    #[serde(skip_serializing)]
    pub serial: SerialConfig,
    /// Times of the line.
    pub link: LinkConfig,
    /// What the DSP reports, and which samples are believed.
    pub status: StatusConfig,
    /// When a path has been flown.
    pub arrival: ArrivalConfig,
    /// What goes to the DSP for a path.
    pub trajectory: TrajectoryConfig,
    /// Limits of movements.
    pub movement: MovementLimits,
    /// Rules of flight safety.
    pub safety: SafetyConfig,
    /// Where the helicopter may fly.
    pub fence: Fence,
    /// Which DSP errors end the functionality.
    pub errors: ErrorTable,
    /// The published state.
    pub state: StateConfig,
    /// Controller parameters.
    pub parameters: Parameters,
}

/// `[state]`
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct StateConfig {
    /// The state is published at every change and at least this often.
    #[serde(deserialize_with = "state_period_ms")]
    pub period_ms: u64,
}

impl Default for StateConfig {
    fn default() -> Self {
        StateConfig { period_ms: 1000 }
    }
}

impl StateConfig {
    /// Longest time between two published states.
    pub fn period(&self) -> Duration {
        Duration::from_millis(self.period_ms)
    }
}
