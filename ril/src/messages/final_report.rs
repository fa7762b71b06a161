//! [`FinalReport`]: how a request ended, and the exit code that says it to scripts.

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::RequestReport;
use runtime::exit::ExitCode;

/// A final report, whose stage is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FinalReport {
    /// One of the final stages.
    pub stage: Stage,
    /// Why; [`Reason::None`] also for a number that is not in the contract.
    pub reason: Reason,
    /// The whole report, for its details.
    pub report: RequestReport,
}

impl FinalReport {
    /// `report` if it is final; `None` if more follows.
    pub fn of(report: &RequestReport) -> Option<FinalReport> {
        let stage = report.stage().filter(|stage| stage.is_final())?;
        let reason = report.reason().unwrap_or(Reason::None);
        Some(FinalReport {
            stage,
            reason,
            report: *report,
        })
    }

    /// The exit code of a command whose request ended so.
    pub const fn exit_code(&self) -> ExitCode {
        exit_code(self.stage, self.reason)
    }
}

/// The exit code for a final report. After a stage that is not final the outcome is unknown.
pub const fn exit_code(stage: Stage, reason: Reason) -> ExitCode {
    match (stage, reason) {
        (Stage::Done, _) => ExitCode::Ok,
        (
            Stage::Refused | Stage::Aborted,
            Reason::LinkDown | Reason::LinkLost | Reason::RelayLinkDown,
        ) => ExitCode::LinkDown,
        (
            Stage::Aborted,
            Reason::TooLate
            | Reason::MovementTimeout
            | Reason::CommunicationFatalError
            | Reason::DeliveryFailed,
        ) => ExitCode::Timeout,
        (Stage::Refused | Stage::Aborted, _) => ExitCode::Refused,
        (Stage::Unknown | Stage::Accepted | Stage::Progress, _) => ExitCode::OutcomeUnknown,
    }
}
