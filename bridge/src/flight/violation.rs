//! [`Violation`]: a safety rule that is broken, by how much, and what is to be done about it.

use ipc_types::code::{Reason, SafetyAction, SafetyRule};
use serde::{Deserialize, Serialize};

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
