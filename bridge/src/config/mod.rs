//! Configuration of the bridge, `bridge.toml` (the source's `bridge.conf`).
//!
//! Every value has a default; the annotated example `bridge/bridge.toml` shows them all and is tested to parse to them.

use std::time::Duration;

use dsp_protocol::{Downlink, FlowControl, Profile, Sequence, port};
use runtime::config::Fault;
use runtime::realtime::RealtimeConfig;
use serde::{Deserialize, Serialize};

use crate::errors::ErrorTable;
use crate::safety::SafetyConfig;
use crate::safety::fence::Fence;

/// Implements `Deserialize` and `Serialize` for types that derive them as `#[serde(remote = "Self")]`: fields that are
/// right each by itself are then checked together.
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

mod control;
mod link;
mod movement;
pub(crate) mod parameters;

pub use control::ControlConfig;
pub use link::{ATTEMPTS, CoherenceRule, LinkConfig, SerialConfig, StatusConfig};
pub use movement::{
    ArrivalConfig, MovementLimits, STOP_WITHIN, Tolerance, TrajectoryConfig, TrajectoryKind,
};
pub use parameters::ParametersConfig;

runtime::ranged! {
    fn state_period_ms(u64) in 10..=1000;
}

/// All of `bridge.toml`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct BridgeConfig {
    /// The port, which is none of the core's: its journal does not have it.
    #[serde(skip_serializing)]
    pub serial: SerialConfig,
    /// What the loop asks of the system, which is none of the core's either.
    #[serde(skip_serializing)]
    pub realtime: RealtimeConfig,
    /// Times of the line.
    pub link: LinkConfig,
    /// What the DSP reports, and which samples are published.
    pub status: StatusConfig,
    /// When a path has been flown.
    pub arrival: ArrivalConfig,
    /// What goes to the DSP for a path.
    pub trajectory: TrajectoryConfig,
    /// Limits of movements.
    pub movement: MovementLimits,
    /// Whose movements are taken.
    pub control: ControlConfig,
    /// Rules of flight safety.
    pub safety: SafetyConfig,
    /// Where the helicopter may fly.
    pub fence: Fence,
    /// Which DSP errors end the functionality.
    pub errors: ErrorTable,
    /// The published state.
    pub state: StateConfig,
    /// Controller parameters.
    pub parameters: ParametersConfig,
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

impl BridgeConfig {
    /// All of it as `bridge.toml` has it, what is none of the core's included.
    pub fn to_toml(&self) -> String {
        let left_out = [
            ("serial", toml::Value::try_from(&self.serial)),
            ("realtime", toml::Value::try_from(&self.realtime)),
        ];
        runtime::config::to_toml(self, left_out)
    }

    /// Whether the line carries what the DSP is asked to send (`docs/protocol.md` section 1): status with all groups of
    /// the mask, and flow control, at their periods: those of `[parameters]`, or of the DSP's boot.
    ///
    /// # Errors
    /// By how much they do not, and what to do about it.
    pub fn check_line(&self) -> Result<(), Fault> {
        let flow = Downlink::FlowControl(FlowControl::Send);
        let frame_len = |profile| {
            flow.encode_in(profile, Sequence::FIRST, Sequence::FIRST)
                .as_bytes()
                .len()
        };
        let flow_len = frame_len(self.link.profile);
        let longer = flow_len - frame_len(Profile::Classic);
        let status_len = self.status.mask().status_frame_len() + longer;
        let [status_ms, flow_ms] = [port::STATUS_PERIOD_MS, port::FLOW_CONTROL_PERIOD_MS]
            .map(|port| u32::from(self.parameters.value_16(port)));
        let a_second = |len: usize, period_ms: u32| (len as u32 * 1000).div_ceil(period_ms);
        let (status, flow) = (a_second(status_len, status_ms), a_second(flow_len, flow_ms));
        let carried = self.serial.baud_rate / link::BITS_PER_BYTE;
        if status + flow <= carried {
            return Ok(());
        }
        let slower = match carried.checked_sub(flow).filter(|left| *left > 0) {
            Some(left) => format!(
                ", take `status_period_ms` = {} or more in `[parameters]`",
                a_second(status_len, left)
            ),
            None => String::new(),
        };
        Err(Fault::at(
            &["serial", "baud_rate"],
            format!(
                "{} baud carry {carried} bytes a second, and the DSP is asked for {}: a status of {status_len} bytes each {status_ms} ms and \
                 flow control of {flow_len} bytes each {flow_ms} ms; name fewer groups in `status.groups`{slower}, or make the line faster",
                self.serial.baud_rate,
                status + flow,
            ),
        ))
    }
}
