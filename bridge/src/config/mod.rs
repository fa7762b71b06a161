//! Configuration of the bridge, `bridge.toml` (the source's `bridge.conf`).
//!
//! Every value has a default; the annotated example `bridge/bridge.toml` shows them all and is tested to parse to them.

use std::time::Duration;

use serde::Deserialize;

use crate::errors::ErrorTable;
use crate::safety::fence::Fence;

/// Implements `Deserialize` for types that derive it as `#[serde(remote = "Self")]`: fields that are right each by itself
/// are then checked together.
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
        )+
    };
}

mod link;
mod movement;
mod parameters;
mod safety;

pub use link::{LinkConfig, SerialConfig, StatusConfig};
pub use movement::{ArrivalConfig, MovementLimits, TrajectoryConfig, TrajectoryKind};
pub use parameters::Parameters;
pub use safety::{BreachAction, SafetyConfig, SupplyLimits};

/// All of `bridge.toml`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BridgeConfig {
    /// The port.
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

runtime::ranged! {
    fn baud_rate(u32) in 50..=4_000_000;
    fn milliseconds(u64) in 1..=600_000;
    fn pc_timeout_ms(u16) in 0..=60_000;
    fn speed_mps(f64) in 0.01..=100.0;
    fn spacing_m(f64) in 0.1..=10_000.0;
    fn state_period_ms(u64) in 10..=1000;
    fn tolerance_deg(f64) in 1e-7..=1.0;
    fn tolerance_m(f64) in 0.01..=1000.0;
    fn seconds(f64) in 0.1..=86_400.0;
    fn distance_m(f64) in 1.0..=1_000_000.0;
    fn altitude_m(f64) in -1000.0..=20_000.0;
}

/// `[state]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StateConfig {
    /// The state is published at every change and at least this often.
    #[serde(deserialize_with = "state_period_ms")]
    pub period_ms: u64,
}

impl Default for StateConfig {
    fn default() -> Self {
        StateConfig { period_ms: 250 }
    }
}

impl StateConfig {
    /// Longest time between two published states.
    pub fn period(&self) -> Duration {
        Duration::from_millis(self.period_ms)
    }
}
