//! [`Samples`]: what a report is made of.

use ipc_types::module::State;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};

/// What there is of a robot: the newest sample of each topic, and which processes live.
#[derive(Clone, Copy, Debug, Default)]
pub struct Samples<'a> {
    /// The bridge's state.
    pub state: Option<&'a ModuleState>,
    /// Raw telemetry.
    pub dsp: Option<&'a DspTelemetry>,
    /// Telemetry in SI units.
    pub hero: Option<&'a HeroTelemetry>,
    /// The state of the process status.
    pub status: Option<&'a State>,
    /// Whether a process provides the bridge's state.
    pub has_bridge: bool,
    /// Whether a process provides the state of status.
    pub has_status: bool,
}

impl Samples<'_> {
    /// Whether nothing came of the robot.
    pub fn is_empty(&self) -> bool {
        self.state.is_none() && self.dsp.is_none() && self.hero.is_none() && self.status.is_none()
    }
}
