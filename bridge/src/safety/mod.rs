//! The safety rules that the bridge enforces itself, whatever a module asks for (`docs/safety.md`).
//!
//! [`fence`] is a pure value: it is made from its table of `bridge.toml`, is asked about a leg, and answers with the rule that is broken
//! and by how much. What follows from a [`Violation`] is decided by the [flight](crate::flight::safety).

pub mod fence;

use ipc_types::code::{Reason, SafetyAction, SafetyRule};
use serde::{Deserialize, Serialize};

/// The name of an area of the geofence as it lies in a report: what does not fit is cut off.
pub type AreaName = [u8; 32];

/// A rule that is broken.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Violation {
    /// Which.
    pub rule: SafetyRule,
    /// What is to be done.
    pub action: SafetyAction,
    /// By how much, in the rule's unit.
    pub amount: f64,
}

impl Violation {
    /// The reason that a report gives.
    pub fn reason(self) -> Reason {
        match self.rule {
            SafetyRule::PilotSwitch => Reason::PilotHasControl,
            SafetyRule::FenceInclusion
            | SafetyRule::FenceExclusion
            | SafetyRule::FenceFloor
            | SafetyRule::FenceCeiling
            | SafetyRule::FenceUnjudgeable => Reason::FenceBreach,
            SafetyRule::Battery | SafetyRule::Fuel => Reason::SupplyLow,
            SafetyRule::LinkLoss => Reason::LinkLost,
        }
    }
}
