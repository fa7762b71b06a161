//! The start-up sequence with the DSP (requirement D1; `docs/protocol.md` section 8.1).

use dsp_protocol::{Command, StatusMask, port};

use crate::config::Parameters;

/// The commands of the start-up, in the order in which each waits for the acknowledgement of the one before.
pub fn sequence(mask: StatusMask, parameters: &Parameters) -> impl Iterator<Item = Command> + '_ {
    [
        Command::Write16 {
            port: port::STATUS_MASK,
            value: mask.0,
        },
        Command::ActivateStatus,
        Command::ClearErrors,
        Command::InvalidatePath,
        Command::Following { on: true },
    ]
    .into_iter()
    .chain(parameters.writes())
}
