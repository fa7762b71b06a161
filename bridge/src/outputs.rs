//! What the core says to the world; the shell implements it with shared memory and a log, tests with a recorder.

use std::borrow::Cow;

use dsp_protocol::{Command, DspErrorCode, StatusMask};
use ipc_types::payload::{DspTelemetry, ModuleState, RequestReport};
use module_kit::journal::raw;
use serde::{Deserialize, Serialize};

use crate::link::commands::AckData;
use crate::safety::{AreaName, Violation};

/// Which request, as the shell knows it: the service that it came through, and a number that no other open request of
/// that service has. The core only compares and returns it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum RequestKey {
    /// A control request.
    Control(u64),
    /// A movement request.
    Movement(u64),
    /// A parameter request.
    Parameter(u64),
}

/// Receives what the core publishes, while it works. Implementations must not block.
pub trait Outputs {
    /// Publishes a telemetry sample: `fill` writes all of it but `sequence` and `epoch_ns`, in place.
    fn telemetry(&mut self, fill: &mut dyn FnMut(&mut DspTelemetry));

    /// Publishes the state: all of it but `sequence`, `epoch_ns` and `published_ns`.
    fn state(&mut self, state: &ModuleState);

    /// Sends `report` to the sender of a request. After a final stage the key is not used again.
    fn report(&mut self, to: RequestKey, report: &RequestReport);

    /// The port took these bytes.
    fn sent(&mut self, _bytes: &[u8]) {}

    /// Takes note of something that the log should have. Requests, reports and states come by the other functions.
    fn notice(&mut self, notice: &Notice);
}

/// Discards what the core says.
impl Outputs for () {
    fn telemetry(&mut self, _fill: &mut dyn FnMut(&mut DspTelemetry)) {}
    fn state(&mut self, _state: &ModuleState) {}
    fn report(&mut self, _to: RequestKey, _report: &RequestReport) {}
    fn notice(&mut self, _notice: &Notice) {}
}

/// What the core said, as a value. What the publisher of a sample or a state fills in is 0. A journal has outputs as
/// this enum in postcard's format, see `docs/journal.md`; notices follow from the others.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
// A sample is most of what comes; a box would allocate for each.
#[allow(clippy::large_enum_variant)]
pub enum Output<'a> {
    /// A telemetry sample, without `sequence` and `epoch_ns`.
    Telemetry(#[serde(with = "raw")] DspTelemetry),
    /// A state, without `sequence`, `epoch_ns` and `published_ns`.
    State(#[serde(with = "raw")] ModuleState),
    /// A report, and to whom.
    Report(RequestKey, #[serde(with = "raw")] RequestReport),
    /// Bytes that the port took.
    Sent(#[serde(borrow)] Cow<'a, [u8]>),
}

/// Gives each output to `0` as a value.
#[derive(Debug)]
pub struct AsValues<F>(pub F);

impl<F: FnMut(Output<'_>)> Outputs for AsValues<F> {
    fn telemetry(&mut self, fill: &mut dyn FnMut(&mut DspTelemetry)) {
        let mut sample = DspTelemetry::default();
        fill(&mut sample);
        (self.0)(Output::Telemetry(DspTelemetry {
            sequence: 0,
            epoch_ns: 0,
            ..sample
        }));
    }

    fn state(&mut self, state: &ModuleState) {
        (self.0)(Output::State(ModuleState {
            sequence: 0,
            epoch_ns: 0,
            published_ns: 0,
            ..*state
        }));
    }

    fn report(&mut self, to: RequestKey, report: &RequestReport) {
        (self.0)(Output::Report(to, *report));
    }

    fn sent(&mut self, bytes: &[u8]) {
        (self.0)(Output::Sent(Cow::Borrowed(bytes)));
    }

    fn notice(&mut self, _notice: &Notice) {}
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
        /// The area of the geofence that is broken; empty for none.
        area: AreaName,
    },
}
