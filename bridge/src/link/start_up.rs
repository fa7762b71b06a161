//! The start-up sequence with the DSP (requirement D1; `docs/protocol.md` section 8.1): which command comes next.

use dsp_protocol::{Command, port};
use serde::{Deserialize, Serialize};

use crate::config::{BridgeConfig, Parameters};

/// A start-up that is under way.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct StartUp {
    /// The step whose acknowledgement is awaited.
    pub step: Step,
    /// The DSP empties its path buffer by itself when the PC is gone.
    pub has_pc_timeout: bool,
    /// The DSP has certainly emptied its path buffer.
    pub is_path_empty: bool,
}

impl StartUp {
    /// At its first step.
    pub const FIRST: StartUp = StartUp {
        step: Step::FIRST,
        has_pc_timeout: false,
        is_path_empty: false,
    };
}

/// One step of the start-up; each waits for the acknowledgement of the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Step {
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
    /// It is read back: the DSP may have refused it.
    ReadParameter(usize),
}

impl Step {
    /// The first step.
    pub const FIRST: Step = Step::Mask;

    /// The step after this one; `None` if the DSP is started up.
    pub fn next(self, config: &BridgeConfig, parameters: &Parameters) -> Option<Step> {
        let parameter =
            |index: usize| (index < parameters.len()).then_some(Step::WriteParameter(index));
        match self {
            Step::Mask if config.link.pc_timeout_ms == 0 => Some(Step::ActivateStatus),
            Step::Mask => Some(Step::AnnouncePcTimeout),
            Step::AnnouncePcTimeout => Some(Step::ReadPcTimeout),
            Step::ReadPcTimeout => Some(Step::ActivateStatus),
            Step::ActivateStatus => Some(Step::ClearErrors),
            Step::ClearErrors => Some(Step::InvalidatePath),
            Step::InvalidatePath => Some(Step::Following),
            Step::Following => parameter(0),
            Step::WriteParameter(index) => Some(Step::ReadParameter(index)),
            Step::ReadParameter(index) => parameter(index + 1),
        }
    }

    /// The command of this step.
    pub fn command(self, config: &BridgeConfig, parameters: &Parameters) -> Command {
        match self {
            Step::Mask => write_mask(config),
            Step::AnnouncePcTimeout => Command::Write16 {
                port: port::PC_TIMEOUT_MS,
                value: config.link.pc_timeout_ms,
            },
            Step::ReadPcTimeout => READ_PC_TIMEOUT,
            Step::ActivateStatus => Command::ActivateStatus,
            Step::ClearErrors => Command::ClearErrors,
            Step::InvalidatePath => Command::InvalidatePath,
            Step::Following => Command::Following { on: true },
            Step::WriteParameter(index) => parameters.write(index),
            Step::ReadParameter(index) => read_back(parameters.write(index)),
        }
    }
}

/// Reads how long the PC may be silent.
pub const READ_PC_TIMEOUT: Command = Command::Read16 {
    port: port::PC_TIMEOUT_MS,
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
