//! What the checks go by: plain values, which the command gathers. Nothing here looks at anything by itself.

use std::path::PathBuf;

use bridge::BridgeConfig;
use ipc_types::MonotonicNs;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};

use crate::commands::doctor::facts as doctor;

/// Everything that the checks go by.
#[derive(Clone, Debug, PartialEq)]
pub struct Facts {
    /// The robot.
    pub robot: u32,
    /// When the samples were looked at.
    pub now: MonotonicNs,
    /// What `ril doctor` knows of the machine.
    pub machine: doctor::Facts,
    /// The newest samples.
    pub live: Live,
    /// The bridge's configuration as it stands in the file here; nothing when there is none, or it is wrong.
    pub bridge: Option<BridgeConfig>,
    /// Where status writes its logs.
    pub logs: Logs,
    /// The wall clock.
    pub clock: Clock,
}

/// The newest sample of each topic; nothing of one that did not come in time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Live {
    /// State of bridge, link, DSP and safety rules.
    pub state: Option<ModuleState>,
    /// Raw telemetry.
    pub dsp: Option<DspTelemetry>,
    /// Telemetry in SI units.
    pub hero: Option<HeroTelemetry>,
    /// Whether the bridge answered a request that moves nothing, or why not; `None` if there is no bridge to ask.
    pub answer: Option<Result<(), String>>,
    /// Whether the samples come from another machine.
    pub is_relayed: bool,
}

/// Where status writes its logs.
#[derive(Clone, Debug, PartialEq)]
pub enum Logs {
    /// The configuration of status is wrong, which the check of the configuration reports.
    Unknown,
    /// No configuration file of status is here, so nothing is known of its logs.
    NoFile,
    /// The logs of the configuration, which may be none.
    Configured(Vec<LogPlace>),
}

/// A log's folder.
#[derive(Clone, Debug, PartialEq)]
pub struct LogPlace {
    /// The folder.
    pub directory: PathBuf,
    /// Room that the log leaves to other programs, bytes.
    pub min_free_bytes: u64,
    /// What is free where the folder is, or will be, bytes; or why that is not known.
    pub free_bytes: Result<u64, String>,
    /// Whether this user may write there.
    pub is_writable: bool,
}

/// The wall clock, s since 1970.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Clock {
    /// What it shows.
    pub unix_s: u64,
    /// The newest moment that must have been: when the file of this program was written.
    pub not_before_unix_s: u64,
    /// Whether the system's time service says that the clock is synchronized.
    pub is_synchronized: bool,
}
