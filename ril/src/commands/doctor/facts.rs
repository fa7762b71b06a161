//! What the doctor goes by: plain values, gathered by `gather` and judged by
//! [`findings`](super::findings). Nothing here looks at anything by itself.

use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

use bridge::shell::serial::holders::Holders;
use ipc_types::inspect::{Entry, Inspection};
use ipc_types::payload::RelayLink;
use ipc_types::{MonotonicNs, Provider, Repair, RobotId, ServiceId};
use runtime::duration::Shown;

/// What a look found, or why it found nothing.
pub type Look<T> = Result<T, Trouble>;

/// Why a look found nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// It took longer than this and was given up: something stands in the way that keeps the looking process waiting.
    TookTooLong(Duration),
    /// It failed.
    Failed(String),
}

impl fmt::Display for Trouble {
    /// The end of a sentence that begins with what was looked at.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Trouble::TookTooLong(limit) => write!(f, "was given up after {}", Shown(*limit)),
            Trouble::Failed(reason) => write!(f, "failed: {reason}"),
        }
    }
}

/// Everything that the doctor knows.
#[derive(Clone, Debug, PartialEq)]
pub struct Facts {
    /// The robot.
    pub robot: u32,
    /// Its shared memory, or why the environment names none.
    pub domain: Result<DomainFacts, String>,
    /// What is free in `/dev/shm`.
    pub free_memory: Look<FreeMemory>,
    /// Configuration files.
    pub files: Vec<FileFacts>,
    /// The bridge's serial port; nothing when the configuration that names it cannot be read.
    pub port: Option<PortFacts>,
    /// The relay's link to the robot; nothing when no process provides one here.
    pub relay: Option<LinkFacts>,
    /// What was repaired; nothing when that was not asked for.
    pub repair: Option<Look<Repair>>,
}

/// Shared memory.
#[derive(Clone, Debug, PartialEq)]
pub struct DomainFacts {
    /// The folder of the domain.
    pub root: PathBuf,
    /// What is there.
    pub inspection: Look<Inspection>,
    /// The live providers of all robots of the domain.
    pub providers: Look<Vec<Provided>>,
    /// Live processes that do not run because they are stopped.
    pub stopped: Vec<u32>,
    /// The domains of other users in the usual place.
    pub others: Vec<Entry>,
}

/// A service that a live process provides.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Provided {
    /// Of which robot.
    pub robot: RobotId,
    /// Which service.
    pub service: ServiceId,
    /// The process.
    pub by: Provider,
    /// Its PID namespace: elsewhere than in this one its process id means nothing.
    pub pids: Namespace,
    /// Its time namespace: elsewhere than in this one its times mean other moments.
    pub clock: Namespace,
}

/// The namespace of another process, beside the one of this process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Namespace {
    /// The same.
    Ours,
    /// Another one.
    Other,
    /// The other process did not say.
    Unknown,
}

/// The link of the relay that provides the robot's services here.
#[derive(Clone, Debug, PartialEq)]
pub struct LinkFacts {
    /// What the relay says of it; nothing when it says nothing.
    pub link: Look<Option<RelayLink>>,
    /// When that was looked at.
    pub now: MonotonicNs,
}

/// What is free in `/dev/shm`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FreeMemory {
    /// Bytes.
    pub bytes: u64,
    /// Inodes: each file, folder, segment and socket takes one. Nothing when their number is not limited.
    pub inodes: Option<u64>,
}

/// A configuration file.
#[derive(Clone, Debug, PartialEq)]
pub struct FileFacts {
    /// Whose, such as `bridge`; nothing stands for the operator's commands.
    pub command: Option<&'static str>,
    /// Which.
    pub path: PathBuf,
    /// What is in it.
    pub content: Look<FileContent>,
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
    /// A device that can be a serial port.
    Terminal {
        /// Nothing when this user may open it, else what helps.
        forbidden: Option<String>,
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
