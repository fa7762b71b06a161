//! What the core says to the world; the shell implements it with shared memory and a log, tests with a recorder.

use dsp_protocol::{Command, DspErrorCode, StatusMask};
use ipc_types::payload::{DspTelemetry, ModuleState, RequestReport};

use crate::flight::request::RequestKey;
use crate::flight::violation::Violation;
use crate::link::commands::AckData;

/// Receives what the core publishes, while it works. Implementations must not block.
pub trait Outputs {
    /// Publishes a telemetry sample: `fill` writes all of it but `sequence` and `epoch_ns`, in place.
    fn telemetry(&mut self, fill: impl FnOnce(&mut DspTelemetry));

    /// Publishes the state: all of it but `sequence`, `epoch_ns` and `published_ns`.
    fn state(&mut self, state: &ModuleState);

    /// Sends `report` to the sender of a request. After a final stage the key is not used again.
    fn report(&mut self, to: RequestKey, report: &RequestReport);

    /// Takes note of something that the log should have. Requests, reports and states come by the other functions.
    fn notice(&mut self, notice: &Notice);
}

/// Something for the log (requirement H8).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Notice {
    /// The DSP reported an error; `starting` before the start-up is done.
    DspError {
        /// The error.
        code: DspErrorCode,
        /// The start-up is not done.
        starting: bool,
    },
    /// The DSP has another value than the one that the configuration wrote.
    ParameterRefused {
        /// What was written.
        written: Command,
        /// What the DSP has.
        found: AckData,
    },
    /// The DSP sends other groups than those of its mask; they are taken as they come.
    OddStatus {
        /// The groups that it sends.
        groups: StatusMask,
    },
    /// A safety rule begins to be broken, changes, or is kept again.
    Safety {
        /// The rule; `None` if all are kept again.
        violation: Option<Violation>,
    },
}
