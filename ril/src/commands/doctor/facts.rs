//! What the doctor goes by: plain values, gathered by `gather` and judged by
//! [`findings`](super::findings). Nothing here looks at anything by itself.

use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

use bridge::shell::serial::holders::Holders;
use ipc_types::inspect::Inspection;
use ipc_types::{Provider, Repair, ServiceId};

/// What a look found, or why it found nothing.
pub type Look<T> = Result<T, Trouble>;

/// Why a look found nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// It took longer than this and was given up: something stands in the way that keeps whoever looks waiting.
    TookTooLong(Duration),
    /// It failed.
    Failed(String),
}

impl fmt::Display for Trouble {
    /// The end of a sentence that begins with what was looked at.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Trouble::TookTooLong(limit) => write!(f, "was given up after {limit:?}"),
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
    /// Bytes free in `/dev/shm`.
    pub free_memory: Look<u64>,
    /// Configuration files.
    pub files: Vec<FileFacts>,
    /// The bridge's serial port; nothing when the configuration that names it cannot be read.
    pub port: Option<PortFacts>,
    /// What was repaired; nothing when that was not asked for.
    pub repair: Option<Look<Repair>>,
}

/// Shared memory.
#[derive(Clone, Debug, PartialEq)]
pub struct DomainFacts {
    /// Prefix of the names of segments.
    pub prefix: String,
    /// Folder of everything else.
    pub root: PathBuf,
    /// What is there.
    pub inspection: Look<Inspection>,
    /// Who provides each service of the robot.
    pub providers: Look<Vec<(ServiceId, Option<Provider>)>>,
    /// Live processes that do not run because somebody has stopped them.
    pub stopped: Vec<u32>,
}

/// A configuration file.
#[derive(Clone, Debug, PartialEq)]
pub struct FileFacts {
    /// Whose, as in `ril bridge`; nothing stands for the operator's commands.
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
    /// Whether anybody chose it; else it is the built-in default, which nobody may mean.
    pub is_chosen: bool,
    /// What is there.
    pub device: Look<Device>,
    /// Who uses it.
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

/// Who has terminals.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PortHolders {
    /// Who uses the port.
    pub of_port: Holders,
    /// The terminals that the live bridge has open.
    pub by_bridge: Vec<PathBuf>,
}
