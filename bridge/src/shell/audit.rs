//! The audit trail: every request, refusal, phase, DSP error, safety rule and link change is one structured log line
//! (requirement H8).
//!
//! A request is logged with its id and the process that sent it; every later line about it has the same id. What repeats
//! quickly is logged at onset and then once a second with the number of repetitions, so that a flood from the line cannot fill
//! a disk.

use std::time::Duration;

use dsp_protocol::{Command, DspErrorCode};
use ipc_types::MonotonicNs;
use ipc_types::code::{Functionality, LinkState, ModuleStatus, Reason, Stage};
use ipc_types::payload::{
    ModuleControl, ModuleState, MovementData, ParameterRequest, RequestReport,
};

use crate::flight::request::RequestKey;
use crate::outputs::Notice;

/// Time between two lines about the same repeated trouble.
const REPETITION_PERIOD: Duration = Duration::from_secs(1);

/// DSP errors that have a count of their own; more than the documented ones. Others share the last place.
const ERROR_CODES: usize = 32;

/// What the log has, so that each change is logged once.
#[derive(Debug, Default)]
pub struct Audit {
    state: ModuleState,
    /// The kinds of trouble that may repeat.
    dsp_errors: Vec<(DspErrorCode, Repeated)>,
}

/// Trouble that was logged and may repeat.
#[derive(Clone, Copy, Debug)]
struct Repeated {
    logged: MonotonicNs,
    unlogged: u32,
}

/// A name, or the number that has none.
macro_rules! named {
    ($type:ty, $code:expr) => {
        <$type>::from_code($code).map_or("unknown", <$type>::name)
    };
}

/// The service that a request came through.
fn service(key: RequestKey) -> &'static str {
    match key {
        RequestKey::Control(_) => "control",
        RequestKey::Movement(_) => "movement",
        RequestKey::Parameter(_) => "parameter",
    }
}

impl Audit {
    /// A control request arrived.
    pub fn control(&self, sender: Option<u32>, request: &ModuleControl) {
        tracing::info!(
            request = request.request_id,
            sender,
            command = request
                .command()
                .map_or("unknown", |command| command.name()),
            "request"
        );
    }

    /// A movement request arrived.
    pub fn movement(&self, sender: Option<u32>, request: &MovementData) {
        tracing::info!(
            request = request.request_id,
            sender,
            command = request.kind().map_or("unknown", |kind| kind.name()),
            path = request.path_id,
            first = request.first,
            last = request.last,
            latitude_deg = request.latitude_deg,
            longitude_deg = request.longitude_deg,
            altitude_m = request.altitude_m,
            preempt = request.preempt,
            repeat = request.repeat,
            "request"
        );
    }

    /// A parameter request arrived.
    pub fn parameter(&self, sender: Option<u32>, request: &ParameterRequest) {
        tracing::info!(
            request = request.request_id,
            sender,
            command = request
                .operation()
                .map_or("unknown", |operation| operation.name()),
            port = request.port,
            value = request.value,
            "request"
        );
    }

    /// The sender of a request is gone.
    pub fn sender_gone(&self, key: RequestKey, request_id: u64) {
        tracing::info!(
            request = request_id,
            service = service(key),
            "sender is gone"
        );
    }

    /// A report goes to the sender of a request. Progress is for the curious.
    pub fn report(&self, report: &RequestReport) {
        let stage = named!(Stage, report.stage);
        let reason = named!(Reason, report.reason);
        let rule = report.rule().map(|rule| rule.name());
        let waypoint = (report.waypoint > 0).then_some(report.waypoint);
        let (dsp_error, value) = (report.dsp_error(), report.value());
        let request = report.request_id;
        match report.stage() {
            Some(Stage::Progress) => tracing::debug!(
                request,
                stage,
                sent = report.waypoints_sent,
                reached = report.waypoints_reached,
                "report"
            ),
            Some(Stage::Accepted | Stage::Done) => {
                tracing::info!(request, stage, value, "report");
            }
            _ => tracing::warn!(
                request, stage, reason, rule, waypoint, dsp_error, value, "report"
            ),
        }
    }

    /// The state is published: its changes of phase, link and path buffer.
    pub fn state(&mut self, state: &ModuleState) {
        let before = std::mem::replace(&mut self.state, *state);
        let phase = |state: &ModuleState| {
            (
                state.functionality,
                state.status,
                state.imi_error,
                state.blocked,
            )
        };
        if phase(&before) != phase(state) {
            tracing::info!(
                doing = named!(Functionality, state.functionality),
                was = named!(Functionality, before.functionality),
                status = named!(ModuleStatus, state.status),
                error = %state.imi_error(),
                blocked = state.is_blocked(),
                "phase"
            );
        }
        if before.link.state != state.link.state {
            tracing::info!(
                from = named!(LinkState, before.link.state),
                to = named!(LinkState, state.link.state),
                "link"
            );
            if state.link.state == LinkState::Up.code() && state.link.pc_timeout_supported == 0 {
                tracing::warn!(
                    "the DSP has no time-out for a bridge that is gone, or `link.pc_timeout_ms` is 0: if this process dies in \
                     flight, the waypoints that the DSP has are flown"
                );
            }
        }
        if before.link.dsp_path != state.link.dsp_path {
            tracing::debug!(
                may_hold = state.link.dsp_path().map_or("unknown", |path| path.name()),
                "the DSP's path buffer"
            );
        }
    }

    /// The core takes note of something.
    pub fn notice(&mut self, notice: &Notice, now: MonotonicNs) {
        match notice {
            Notice::DspError { code, starting } => self.dsp_error(*code, *starting, now),
            Notice::ParameterRefused { written, found } => {
                let (port, wanted) = parameter(written);
                tracing::error!(
                    parameter = port,
                    wanted,
                    ?found,
                    "the DSP refused a parameter of the configuration and keeps its own value"
                );
            }
            Notice::OddStatus { groups } => {
                let groups: Vec<_> = groups.groups().map(|group| group.name()).collect();
                tracing::warn!(
                    groups = groups.join(","),
                    "the DSP sends other groups than its mask says; they are taken as they come, those that were not asked for \
                     are left out, and without its time they are published in the order of the line"
                );
            }
            Notice::Safety {
                violation: Some(violation),
            } => tracing::warn!(
                rule = violation.rule.name(),
                action = violation.action.name(),
                amount = violation.amount,
                "safety rule"
            ),
            Notice::Safety { violation: None } => tracing::info!("all safety rules are kept again"),
        }
    }

    fn dsp_error(&mut self, code: DspErrorCode, starting: bool, now: MonotonicNs) {
        let known = self.dsp_errors.iter().position(|(other, _)| *other == code);
        let full = self.dsp_errors.len() == ERROR_CODES;
        let place = known.or_else(|| full.then_some(ERROR_CODES - 1));
        let Some(place) = place else {
            let repeated = Repeated {
                logged: now,
                unlogged: 0,
            };
            self.dsp_errors.push((code, repeated));
            return log_dsp_error(code, starting, 0);
        };
        let repeated = &mut self.dsp_errors[place].1;
        if now.since(repeated.logged) < REPETITION_PERIOD {
            repeated.unlogged = repeated.unlogged.saturating_add(1);
            return;
        }
        repeated.logged = now;
        let unlogged = std::mem::take(&mut repeated.unlogged);
        log_dsp_error(code, starting, unlogged);
    }
}

fn log_dsp_error(code: DspErrorCode, starting: bool, unlogged: u32) {
    tracing::warn!(
        code = code.0,
        text = code.text(),
        starting,
        repeated = unlogged,
        "DSP error"
    );
}

/// Name and value of the parameter that a command writes.
fn parameter(write: &Command) -> (&'static str, f64) {
    match *write {
        Command::Write16 { port, value } => dsp_protocol::port::port16(port)
            .map_or(("unknown", value.into()), |port| {
                (port.name, port.value_of(value).into())
            }),
        Command::Write32 { port, value } => dsp_protocol::port::port32(port)
            .map_or(("unknown", value.into()), |port| (port.name, value.into())),
        _ => ("unknown", 0.0),
    }
}
