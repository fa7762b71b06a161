//! What a request is answered: each gets one final report, and none is executed twice (requirement D15).

use dsp_protocol::DspErrorCode;
use dsp_protocol::port::{Access, PORTS_16, PORTS_32, Port};
use ipc_types::MonotonicNs;
use ipc_types::code::{CameBetween, ImiError, PortKind, Reason, Stage};
use ipc_types::payload::{PortInfo, RequestReport};
use module_kit::answers::Completed;
use module_kit::rules::Refused;
use serde::{Deserialize, Serialize};

use super::control::Who;
use super::last_order::LastOrder;
use super::request::{IssueMark, RequestHeader};
use crate::safety::{AreaName, Intervention, Violation};

/// Final reports that are remembered: of two whole paths of 1024 waypoints, 320 KiB.
const REMEMBERED: usize = 2048;

/// How far a request has come, and why. As an error it is a refusal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verdict {
    /// How far the request has come.
    pub stage: Stage,
    /// Why it is there.
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
    /// The area of the geofence that was broken; empty for none.
    pub area: AreaName,
    /// The waypoint, or the leg that leads to it, counted from 1; 0 for none.
    pub waypoint: u32,
    /// The DSP's error.
    pub dsp_error: Option<DspErrorCode>,
    /// The height that was reached, m, the value of the port, by how many seconds the request is late, or how many
    /// metres away the waypoint is.
    pub value: Option<f64>,
    /// The port of a parameter request.
    pub port: Option<Port>,
    /// How many metres away the waypoint may be; 0 when the reason is another one.
    pub most_m: f64,
    /// What came between the request and the step before, or after it was issued.
    pub between: Option<LastOrder>,
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
                area: [0; 32],
                waypoint: 0,
                dsp_error: None,
                value: None,
                port: None,
                most_m: 0.0,
                between: None,
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

    /// The DSP does not do what it was ordered to, perhaps with this error.
    pub fn refused_by_dsp(dsp_error: Option<DspErrorCode>) -> Verdict {
        Verdict::aborted(Reason::RefusedByDsp).about(Detail {
            dsp_error,
            ..Detail::default()
        })
    }

    /// The moment of a request has come, or has passed, at `now`.
    pub fn too_late(header: &RequestHeader, now: MonotonicNs) -> Verdict {
        Verdict::from(Reason::TooLate).about(Detail {
            value: Some(now.since(header.begin_by).as_secs_f64()),
            ..Detail::default()
        })
    }

    /// Adds what the reason is about.
    #[must_use]
    pub const fn about(self, detail: Detail) -> Verdict {
        Verdict { detail, ..self }
    }

    /// This verdict for a request that has come as far as `stage`.
    #[must_use]
    pub const fn at(self, stage: Stage) -> Verdict {
        Verdict { stage, ..self }
    }

    /// Writes the verdict into a report.
    pub fn write(&self, report: &mut RequestReport) {
        let Detail {
            violation,
            area,
            waypoint,
            dsp_error,
            value,
            port,
            most_m,
            between,
        } = self.detail;
        report.stage = self.stage.code();
        report.reason = self.reason.code();
        report.imi_error = self.error.code();
        let rule = violation.map(|violation| violation.rule);
        let rule = rule.or_else(|| between.and_then(|last| last.rule));
        report.rule = rule.map_or(0, |rule| rule.code());
        report.waypoint = waypoint;
        report.dsp_error_code = dsp_error.map_or(0, |code| code.0.into());
        report.dsp_error_valid = dsp_error.is_some().into();
        let value = violation.map(|violation| violation.amount).or(value);
        report.value_valid = value.is_some().into();
        report.value = value.unwrap_or_default();
        let of_limit = PortInfo {
            name: area,
            max: most_m,
            ..PortInfo::default()
        };
        report.port = port.map_or(of_limit, info);
        report.between = between.map_or(0, |last| last.what.code());
        report.between_request_id = between.map_or(0, |last| last.request_id);
        let sender = between.and_then(|last| last.sender);
        report.between_sender = sender.as_ref().map(Who::published).unwrap_or_default();
    }
}

impl From<Reason> for Verdict {
    fn from(reason: Reason) -> Verdict {
        Verdict::ended(Stage::Refused, reason, ImiError::None)
    }
}

impl From<Refused> for Verdict {
    fn from(refused: Refused) -> Verdict {
        Verdict::ended(Stage::Refused, refused.reason(), refused.error())
    }
}

impl From<Intervention> for Verdict {
    fn from(intervention: Intervention) -> Verdict {
        let Intervention {
            violation,
            leg,
            area,
        } = intervention;
        Verdict::from(violation.reason()).about(Detail {
            violation: Some(violation),
            area,
            waypoint: leg,
            ..Detail::default()
        })
    }
}

/// Whether the moment of a request has not passed at `now`.
///
/// # Errors
/// By how much it has.
pub fn in_time(header: &RequestHeader, now: MonotonicNs) -> Result<(), Verdict> {
    match now <= header.begin_by {
        true => Ok(()),
        false => Err(Verdict::too_late(header, now)),
    }
}

/// A port as a report describes it.
fn info(port: Port) -> PortInfo {
    let (number, name, kind, min, max, access) = match port {
        Port::Bits16(port) => {
            let kind = if port.signed {
                PortKind::I16
            } else {
                PortKind::U16
            };
            let (min, max) = (f64::from(port.min), f64::from(port.max));
            (port.number, port.name, kind, min, max, port.access)
        }
        Port::Bits32(port) => {
            let (min, max) = (f64::from(port.min), f64::from(port.max));
            (port.number, port.name, PortKind::F32, min, max, port.access)
        }
    };
    let access = match access {
        Access::Bridge => 0,
        Access::OnGround => PortInfo::WRITABLE,
        Access::Always => PortInfo::WRITABLE | PortInfo::WRITABLE_IN_FLIGHT,
    };
    PortInfo {
        min,
        max,
        number: number.into(),
        kind: kind.code(),
        access,
        count: (PORTS_16.len() + PORTS_32.len()) as u32,
        name: PortInfo::name_bytes(name),
    }
}

/// The requests that were answered, and the last order that was taken.
#[derive(Debug, Serialize, Deserialize)]
pub struct Answers {
    completed: Completed,
    mark: IssueMark,
    last: LastOrder,
}

/// None. All memory that they will ever need is taken here.
impl Default for Answers {
    fn default() -> Self {
        Answers {
            completed: Completed::with_capacity(REMEMBERED),
            mark: IssueMark::default(),
            last: LastOrder::default(),
        }
    }
}

impl Answers {
    /// After a snapshot: takes the memory again.
    pub fn configure(&mut self) {
        self.completed.set_capacity(REMEMBERED);
    }

    /// Remembers a final report.
    pub fn note(&mut self, report: &RequestReport) {
        self.completed.note(report);
    }

    /// An order was taken as `what`.
    pub fn take(&mut self, header: &RequestHeader, what: CameBetween) {
        self.mark.take(&header.issued);
        self.last = LastOrder::request(header, what);
    }

    /// An event that no request ordered: no step follows it, and no order that was issued before it.
    pub fn take_event(&mut self, event: LastOrder, now: MonotonicNs) {
        self.mark.take_event(now);
        self.last = event;
    }

    /// The bridge ended a path because its sender was lost. No step follows; the age of others' orders does not change.
    pub fn take_loss(&mut self) {
        self.last = LastOrder::event(CameBetween::SenderLost);
    }

    /// A parameter write was taken.
    pub fn wrote(&mut self, header: &RequestHeader) {
        self.last.wrote(header);
    }

    /// A request was refused: no step follows it.
    pub fn refused(&mut self, header: &RequestHeader) {
        self.last.refused(header);
    }

    /// Whether the request, if it is a step, follows the last order.
    ///
    /// # Errors
    /// What came between.
    pub fn follows(&self, header: &RequestHeader) -> Result<(), Verdict> {
        match self.last.is_before(header) {
            true => Ok(()),
            false => Err(self.superseded()),
        }
    }

    /// The refusal of a request that the last order has overtaken.
    fn superseded(&self) -> Verdict {
        Verdict::from(Reason::Superseded).about(Detail {
            between: Some(self.last),
            ..Detail::default()
        })
    }

    /// Whether an order may begin at `now`, or begin on the DSP after it was accepted.
    ///
    /// # Errors
    /// A later order was taken, or its moment has passed.
    pub fn may_begin(&self, header: &RequestHeader, now: MonotonicNs) -> Result<(), Verdict> {
        self.may_begin_after(None, header, now)
    }

    /// Whether an order may begin at `now` that must not have been issued before `newest` either: the newest waypoint
    /// of another path.
    ///
    /// # Errors
    /// A later order was taken, or its moment has passed.
    pub fn may_begin_after(
        &self,
        newest: Option<&RequestHeader>,
        header: &RequestHeader,
        now: MonotonicNs,
    ) -> Result<(), Verdict> {
        let mut mark = self.mark;
        if let Some(newest) = newest
            && newest.path_id != header.path_id
        {
            mark.take(&newest.issued);
        }
        match mark.supersedes(&header.issued) {
            true if self.mark.supersedes(&header.issued) => Err(self.superseded()),
            true => Err(Reason::Superseded.into()),
            false => in_time(header, now),
        }
    }

    /// The final report of this request, if it is remembered.
    pub fn report_of(&self, request_id: u64) -> Option<&RequestReport> {
        self.completed.report_of(request_id)
    }
}
