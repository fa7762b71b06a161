//! What the checks go by: plain values, which `gather` looks up and [`diagnosis`](super::diagnosis) and the preflight
//! judge. Nothing here looks at anything by itself.

use std::path::PathBuf;

use bridge::BridgeConfig;
use bridge::shell::serial::Adapter;
use bridge::shell::serial::holders::Holders;
pub use ipc_types::FreeMemory;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState, RelayLink};
use ipc_types::{LowLimit, MonotonicNs, Repair};
use operator::robot::domain::{DomainFacts, Look};
use operator::robot::running::ConfigOrigin;
use runtime::realtime::RealtimeConfig;
use runtime::realtime::lack::Lack;
use runtime::wall_clock::WallClock;

/// What the doctor knows of the machine.
#[derive(Clone, Debug, PartialEq)]
pub struct MachineFacts {
    /// The robot.
    pub robot: u32,
    /// Its shared memory, or why the environment names none.
    pub domain: Result<DomainFacts, String>,
    /// Why the folder of the domain, which is not there, cannot be made; `None` if it can, or is there.
    pub root_fault: Option<String>,
    /// What this process may use that is less than a robot's processes need.
    pub limits: Vec<LowLimit>,
    /// What is free in `/dev/shm`.
    pub free_memory: Look<FreeMemory>,
    /// The wall clock.
    pub clock: ClockFacts,
    /// Configuration files.
    pub files: Vec<FileFacts>,
    /// The bridge's serial port; `None` if the configuration that names it cannot be read.
    pub port: Option<PortFacts>,
    /// What bridge and status ask for in `[realtime]`.
    pub realtime: RealtimeFacts,
    /// The relay's link to the robot; `None` if no process provides one here.
    pub relay: Option<LinkFacts>,
    /// The view's setup; `None` if it has no file, or a wrong one.
    pub view: Option<Look<ViewFacts>>,
    /// The setup of the gateway to MAVLink; `None` if it has no file, or a wrong one.
    pub mavlink: Option<Look<MavlinkFacts>>,
    /// What was repaired; `None` if that was not asked for.
    pub repair: Option<Look<Repair>>,
}

/// The link of the relay that provides the robot's services here.
#[derive(Clone, Debug, PartialEq)]
pub struct LinkFacts {
    /// What the relay says of it; `None` if it says nothing.
    pub link: Look<Option<RelayLink>>,
    /// When that was looked at.
    pub now: MonotonicNs,
}

/// What view.toml says, and what is in its places.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ViewFacts {
    /// The port.
    pub port: u16,
    /// Who listens at it, in words.
    pub holder: Option<String>,
    /// Whether other machines can connect.
    pub is_open: bool,
    /// Whether there are tokens beside that of `ril view`.
    pub has_tokens: bool,
    /// The certificate and when it ends, Unix time in s; `None` without TLS.
    pub certificate: Option<(PathBuf, Result<u64, String>)>,
    /// The files that this user alone may read and that others may, with the reason.
    pub open_secrets: Vec<(PathBuf, String)>,
    /// The time of day, Unix time in s.
    pub unix_s: u64,
}

/// What mavlink.toml says, and whether its key can be used.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MavlinkFacts {
    /// Whether stations on other machines reach it.
    pub is_open: bool,
    /// Whether these need not sign.
    pub is_insecure: bool,
    /// Whether numbers of stations are named that may command.
    pub has_commanders: bool,
    /// The key's file, and why it cannot be used; `None` without one.
    pub key: Option<(PathBuf, Option<String>)>,
}

/// What the loops of bridge and status ask of the system.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RealtimeFacts {
    /// Those that ask for anything.
    pub loops: Vec<LoopFacts>,
    /// How long real-time threads may run, µs of each second, below 0 without a limit; `None` if the kernel does not
    /// say it.
    pub runtime_us: Option<i64>,
    /// Why this user may not keep the processors awake.
    pub latency_fault: Option<String>,
}

/// The loop of a process.
#[derive(Clone, Debug, PartialEq)]
pub struct LoopFacts {
    /// Whose, such as `bridge`.
    pub command: &'static str,
    /// What it asks for.
    pub asked: RealtimeConfig,
    /// The live process.
    pub process: Option<u32>,
    /// What the live process lacks, or would lack when it is started from here.
    pub lacking: Look<Vec<Lack>>,
    /// What its unit allows; `None` if none is installed.
    pub unit: Option<UnitLimits>,
}

/// What a unit of systemd allows its process.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UnitLimits {
    /// Whether real-time threads are forbidden.
    pub restricts_realtime: bool,
    /// The highest priority.
    pub priority: u64,
    /// Whether memory may be locked without a limit.
    pub locks_memory: bool,
    /// Whether the device by which processors are kept from sleeping is there for it.
    pub has_latency_device: bool,
}

/// A configuration file.
#[derive(Clone, Debug, PartialEq)]
pub struct FileFacts {
    /// Whose, such as `bridge`; `None` stands for the operator's commands.
    pub command: Option<&'static str>,
    /// Which.
    pub path: PathBuf,
    /// What is in it.
    pub content: Look<FileContent>,
    /// Whether the live process runs with what is in it; `None` if no process says what it runs with.
    pub is_in_force: Option<bool>,
}

impl FileFacts {
    /// Whether there is no such file.
    pub fn is_absent(&self) -> bool {
        matches!(self.content, Ok(FileContent::Absent))
    }
}

/// What is in a configuration file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FileContent {
    /// There is no such file, and none is needed: the built-in defaults rule.
    Absent,
    /// A configuration.
    Right,
    /// Something that its process refuses, in that process's words.
    Wrong(String),
}

/// The bridge's serial port.
#[derive(Clone, Debug, PartialEq)]
pub struct PortFacts {
    /// Where.
    pub path: PathBuf,
    /// Whether the operator chose it; else it is the built-in default, which may not be meant.
    pub is_chosen: bool,
    /// Whether the bridge asks its driver to hand on each byte at once.
    pub low_latency: bool,
    /// What is there.
    pub device: Look<Device>,
    /// The processes that use it.
    pub holders: Look<PortHolders>,
}

/// What is in the place of a serial port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Device {
    /// Nothing.
    Missing,
    /// A link whose simulator has ended.
    Stale,
    /// A device that can be a serial port.
    Terminal {
        /// `None` if this user may open it, else what helps.
        forbidden: Option<String>,
        /// The USB adapter that it is.
        adapter: Option<Adapter>,
    },
    /// Something else, in words.
    Other(&'static str),
}

/// The processes that have terminals.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PortHolders {
    /// The processes that use the port.
    pub of_port: Holders,
    /// The terminals that the live bridge has open.
    pub by_bridge: Vec<PathBuf>,
}

/// Everything that the preflight knows.
#[derive(Clone, Debug, PartialEq)]
pub struct PreflightFacts {
    /// The robot.
    pub robot: u32,
    /// When the samples were looked at.
    pub now: MonotonicNs,
    /// What `ril doctor` knows of the machine.
    pub machine: MachineFacts,
    /// The newest samples.
    pub live: Live,
    /// The bridge's configuration, that of the live bridge if it says it; `None` if there is no file, or it is wrong.
    pub bridge: Option<BridgeConfig>,
    /// Where it comes from.
    pub bridge_origin: ConfigOrigin,
    /// Where status writes its logs.
    pub logs: Logs,
}

/// The newest sample of each topic; `None` if none came in time.
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

/// What is known of the wall clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ClockFacts {
    /// What it shows.
    pub clock: WallClock,
    /// Whether the system's time service says that it is synchronized.
    pub is_synchronized: bool,
}
