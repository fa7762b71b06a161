//! What the core says to the world; the shell implements it with shared memory, tests with a recorder.

use ipc_types::payload::{DspTelemetry, ModuleState, RequestReport};

use crate::flight::request::RequestKey;

/// Receives what the core publishes, while it works. Implementations must not block.
pub trait Outputs {
    /// Publishes a telemetry sample: `fill` writes all of it but `sequence` and `epoch_ns`, in place.
    fn telemetry(&mut self, fill: impl FnOnce(&mut DspTelemetry));

    /// Publishes the state: all of it but `sequence`, `epoch_ns` and `published_ns`.
    fn state(&mut self, state: &ModuleState);

    /// Says `report` to the sender of a request. After a final stage the key is not used again.
    fn report(&mut self, to: RequestKey, report: &RequestReport);
}
