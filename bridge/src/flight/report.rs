//! What a report says about a request, besides whose it is.

use dsp_protocol::DspErrorCode;
use ipc_types::MonotonicNs;
use ipc_types::code::{ImiError, Reason, Stage};
use ipc_types::payload::{PortInfo, RequestReport};
use module_kit::rules::Refused;

use super::request::RequestHeader;
use super::violation::Violation;

/// How far a request has come, and why.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verdict {
    /// How far.
    pub stage: Stage,
    /// Why.
    pub reason: Reason,
    /// The IMI error that goes with it.
    pub error: ImiError,
    /// What the reason is about.
    pub detail: Detail,
}

/// What a reason is about.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Detail {
    /// The safety rule that was broken, and by how much.
    pub violation: Option<Violation>,
    /// The waypoint, or the leg that leads to it, counted from 1; 0 for none.
    pub waypoint: u32,
    /// The DSP's error.
    pub dsp_error: Option<DspErrorCode>,
    /// The height that was reached, m, the value of the port, or by how many seconds the request is late.
    pub value: Option<f64>,
    /// The port of a parameter request.
    pub port: Option<PortInfo>,
}

/// Why a request is not carried out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refusal {
    /// Why.
    pub reason: Reason,
    /// The error of the source.
    pub error: ImiError,
    /// What the reason is about.
    pub detail: Detail,
}

impl Verdict {
    /// The request is taken.
    pub const ACCEPTED: Verdict = Verdict::of(Stage::Accepted);
    /// The request goes on.
    pub const PROGRESS: Verdict = Verdict::of(Stage::Progress);
    /// The request is done.
    pub const DONE: Verdict = Verdict::of(Stage::Done);

    const fn of(stage: Stage) -> Verdict {
        Verdict {
            stage,
            reason: Reason::None,
            error: ImiError::None,
            detail: Detail {
                violation: None,
                waypoint: 0,
                dsp_error: None,
                value: None,
                port: None,
            },
        }
    }

    /// An early end because of `reason`.
    pub const fn ended(stage: Stage, reason: Reason, error: ImiError) -> Verdict {
        Verdict {
            reason,
            error,
            ..Verdict::of(stage)
        }
    }

    /// An early end without an error that concerns the module.
    pub const fn aborted(reason: Reason) -> Verdict {
        Verdict::ended(Stage::Aborted, reason, ImiError::None)
    }

    /// With what the reason is about.
    #[must_use]
    pub const fn about(self, detail: Detail) -> Verdict {
        Verdict { detail, ..self }
    }

    /// Writes it into a report.
    pub fn write(&self, report: &mut RequestReport) {
        let Detail {
            violation,
            waypoint,
            dsp_error,
            value,
            port,
        } = self.detail;
        report.stage = self.stage.code();
        report.reason = self.reason.code();
        report.imi_error = self.error.code();
        report.rule = violation.map_or(0, |violation| violation.rule.code());
        report.waypoint = waypoint;
        report.dsp_error_code = dsp_error.map_or(0, |code| code.0.into());
        report.dsp_error_valid = dsp_error.is_some().into();
        let value = violation.map(|violation| violation.amount).or(value);
        report.value_valid = value.is_some().into();
        report.value = value.unwrap_or_default();
        report.port = port.unwrap_or_default();
    }
}

impl Refusal {
    /// With the error of the source that the state shows.
    pub const fn with_error(reason: Reason, error: ImiError) -> Refusal {
        Refusal {
            reason,
            error,
            detail: Verdict::DONE.detail,
        }
    }

    /// The final report.
    pub const fn verdict(&self) -> Verdict {
        self.at(Stage::Refused)
    }

    /// The final report of what was accepted before.
    pub const fn at(&self, stage: Stage) -> Verdict {
        Verdict::ended(stage, self.reason, self.error).about(self.detail)
    }
}

/// Whether the moment of a request has not passed at `now`.
///
/// # Errors
/// By how much it has.
pub fn in_time(header: &RequestHeader, now: MonotonicNs) -> Result<(), Refusal> {
    match now <= header.begin_by {
        true => Ok(()),
        false => Err(too_late(header, now)),
    }
}

/// The refusal of a request whose moment has come, or has passed, at `now`.
pub fn too_late(header: &RequestHeader, now: MonotonicNs) -> Refusal {
    let detail = Detail {
        value: Some(now.since(header.begin_by).as_secs_f64()),
        ..Detail::default()
    };
    Refusal {
        detail,
        ..Reason::TooLate.into()
    }
}

impl From<Refused> for Refusal {
    fn from(refused: Refused) -> Refusal {
        Refusal::with_error(refused.reason(), refused.error())
    }
}

impl From<Reason> for Refusal {
    fn from(reason: Reason) -> Refusal {
        Refusal::with_error(reason, ImiError::None)
    }
}
