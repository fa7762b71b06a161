//! [`StartUp`]: which command of the start-up sequence comes next (requirement D1; `docs/protocol.md` section 8.1).
//! `DspSession`: what is known of a DSP that was started up, above all what its path buffer may hold ([`DspPath`],
//! requirement H1).
//!
//! Waypoints can only be sent while the path buffer is not `Unknown`, and only the acknowledgement of *invalidate path*
//! makes it `Empty`. Whatever ends a movement, or makes its state uncertain, sets it to `Unknown`; the link then
//! repeats *invalidate path* until the DSP has acknowledged it.
//!
//! | state | forget | waypoint | emptied, for certain | emptied, perhaps |
//! |---|---|---|---|---|
//! | Empty | → Unknown | → Ours | – | – |
//! | Ours | → Unknown | – | – | – |
//! | Unknown | – | not sent | → Empty | – |

use std::time::Duration;

use dsp_protocol::{Command, StatusMask, port};
use ipc_types::MonotonicNs;
use ipc_types::code::DspPathState;
use serde::{Deserialize, Serialize};

use crate::config::{BridgeConfig, ParametersConfig};

/// Sensors that come and go make a few masks; the oldest is asked for anew.
const ACCEPTED_MASKS: usize = 4;

/// What the DSP's path buffer may hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum DspPath {
    /// It may hold anything.
    #[default]
    Unknown,
    /// It holds nothing.
    Empty,
    /// It holds waypoints of the path under way.
    Ours,
}

impl DspPath {
    /// A waypoint is about to be sent; false when that is not allowed.
    pub fn add_waypoint(&mut self) -> bool {
        match self {
            DspPath::Unknown => false,
            DspPath::Empty | DspPath::Ours => {
                *self = DspPath::Ours;
                true
            }
        }
    }

    /// The path buffer as it is published.
    pub fn published(self) -> DspPathState {
        match self {
            DspPath::Unknown => DspPathState::Unknown,
            DspPath::Empty => DspPathState::Empty,
            DspPath::Ours => DspPathState::Ours,
        }
    }
}

/// What is known of a DSP that was started up.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct DspSession {
    /// What its path buffer may hold.
    pub path: DspPath,
    /// It empties its path buffer by itself when the PC is gone.
    pub has_pc_timeout: bool,
    /// When the last message was sent that the DSP is known to have got.
    pub last_delivered: MonotonicNs,
    /// Probes in a row that were answered without any other message.
    pub probe_only_replies: u32,
    /// A mask that is not ours, in the last status and how often in a row, and when that came.
    pub odd_mask: Option<(StatusMask, u32)>,
    pub odd_mask_at: MonotonicNs,
    /// Masks that are not ours but are taken, because the DSP says that it has ours; the newest first.
    pub accepted_masks: [Option<StatusMask>; ACCEPTED_MASKS],
}

impl DspSession {
    /// A DSP that has just been started up.
    pub fn begin(now: MonotonicNs, start_up: StartUp) -> DspSession {
        DspSession {
            last_delivered: now,
            path: if start_up.is_path_empty {
                DspPath::Empty
            } else {
                DspPath::Unknown
            },
            has_pc_timeout: start_up.has_pc_timeout,
            ..DspSession::default()
        }
    }

    /// Whether the DSP may have taken the PC for gone by `now`, because nothing is known to have arrived there for so
    /// long.
    pub fn may_have_dropped_path(&self, now: MonotonicNs, pc_timeout: Duration) -> bool {
        self.has_pc_timeout && now.since(self.last_delivered) >= pc_timeout
    }

    /// Takes status with these groups from now on.
    pub fn accept(&mut self, groups: StatusMask) {
        self.accepted_masks.rotate_right(1);
        self.accepted_masks[0] = Some(groups);
        self.odd_mask = None;
    }
}

/// A start-up that is under way.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct StartUp {
    /// The step whose acknowledgement is awaited.
    pub step: StartupStep,
    /// The DSP empties its path buffer by itself when the PC is gone.
    pub has_pc_timeout: bool,
    /// The DSP has certainly emptied its path buffer.
    pub is_path_empty: bool,
}

impl StartUp {
    /// At its first step.
    pub const FIRST: StartUp = StartUp {
        step: StartupStep::FIRST,
        has_pc_timeout: false,
        is_path_empty: false,
    };
}

/// One step of the start-up; each waits for the acknowledgement of the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum StartupStep {
    /// The status mask is written.
    Mask,
    /// The PC announces how long it may be silent.
    AnnouncePcTimeout,
    /// A DSP without that port answers 0.
    ReadPcTimeout,
    /// Status transmission is switched on.
    ActivateStatus,
    /// The DSP's error queue is emptied.
    ClearErrors,
    /// The DSP's path buffer is emptied.
    InvalidatePath,
    /// Waypoint following is switched on.
    Following,
    /// The parameter of this index is written.
    WriteParameter(usize),
    /// The parameter is read back: the DSP may have refused it.
    ReadParameter(usize),
    /// Before the first step, in every other start-up after one that failed: the DSP empties its path buffer. One that
    /// is not heard may hear, and would take the start-up for a PC that is there and wants the path flown.
    StopPath,
}

impl StartupStep {
    /// The first step.
    pub const FIRST: StartupStep = StartupStep::Mask;

    /// The step after this one; `None` if the DSP is started up.
    pub fn next(self, config: &BridgeConfig, parameters: &ParametersConfig) -> Option<StartupStep> {
        let parameter =
            |index: usize| (index < parameters.len()).then_some(StartupStep::WriteParameter(index));
        match self {
            StartupStep::Mask if config.link.pc_timeout_ms == 0 => {
                Some(StartupStep::ActivateStatus)
            }
            StartupStep::Mask => Some(StartupStep::AnnouncePcTimeout),
            StartupStep::AnnouncePcTimeout => Some(StartupStep::ReadPcTimeout),
            StartupStep::ReadPcTimeout => Some(StartupStep::ActivateStatus),
            StartupStep::ActivateStatus => Some(StartupStep::ClearErrors),
            StartupStep::ClearErrors => Some(StartupStep::InvalidatePath),
            StartupStep::InvalidatePath => Some(StartupStep::Following),
            StartupStep::Following => parameter(0),
            StartupStep::WriteParameter(index) => Some(StartupStep::ReadParameter(index)),
            StartupStep::ReadParameter(index) => parameter(index + 1),
            StartupStep::StopPath => Some(StartupStep::FIRST),
        }
    }

    /// The command of this step.
    pub fn command(self, config: &BridgeConfig, parameters: &ParametersConfig) -> Command {
        match self {
            StartupStep::Mask => write_mask(config),
            StartupStep::AnnouncePcTimeout => Command::Write16 {
                port: port::PC_TIMEOUT_MS,
                value: config.link.pc_timeout_ms,
            },
            StartupStep::ReadPcTimeout => READ_PC_TIMEOUT,
            StartupStep::ActivateStatus => Command::ActivateStatus,
            StartupStep::ClearErrors => Command::ClearErrors,
            StartupStep::InvalidatePath | StartupStep::StopPath => Command::InvalidatePath,
            StartupStep::Following => Command::Following { on: true },
            StartupStep::WriteParameter(index) => parameters.write(index),
            StartupStep::ReadParameter(index) => read_back(parameters.write(index)),
        }
    }
}

/// Reads how long the PC may be silent.
pub const READ_PC_TIMEOUT: Command = Command::Read16 {
    port: port::PC_TIMEOUT_MS,
};

/// Reads which groups the DSP sends.
pub const READ_MASK: Command = Command::Read16 {
    port: port::STATUS_MASK,
};

/// Writes the mask of the configuration.
pub fn write_mask(config: &BridgeConfig) -> Command {
    Command::Write16 {
        port: port::STATUS_MASK,
        value: config.status.mask().0,
    }
}

/// The command that reads the port that `write` writes.
fn read_back(write: Command) -> Command {
    match write {
        Command::Write16 { port, .. } => Command::Read16 { port },
        Command::Write32 { port, .. } => Command::Read32 { port },
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_added_to_what_is_not_known() {
        let mut path = DspPath::Unknown;
        assert!(!path.add_waypoint());
        assert_eq!(path, DspPath::Unknown);
        path = DspPath::Empty;
        assert!(path.add_waypoint() && path.add_waypoint());
        assert_eq!(path, DspPath::Ours);
    }

    #[test]
    fn a_path_may_be_dropped_from_the_time_out_on() {
        let mut start_up = StartUp::FIRST;
        for has_pc_timeout in [true, false] {
            start_up.has_pc_timeout = has_pc_timeout;
            let session = DspSession::begin(MonotonicNs(5), start_up);
            for (ns, is_dropped) in [(104, false), (105, true)] {
                let timeout = Duration::from_nanos(100);
                let found = session.may_have_dropped_path(MonotonicNs(ns), timeout);
                assert_eq!(found, is_dropped && has_pc_timeout, "{ns}");
            }
        }
    }
}
