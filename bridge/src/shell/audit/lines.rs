//! What the lines of the audit trail have. Numbers that were measured end at the third decimal, and only values that a
//! kind uses are there.

use dsp_protocol::{Command, DspErrorCode};
use ipc_types::code::{
    Functionality, LinkState, ModuleStatus, MovementKind, ParameterOperation, Reason, Stage,
};
use ipc_types::payload::{
    LinkHealth, ModuleControl, ModuleState, MovementData, ParameterRequest, RequestReport,
    ascii_text,
};

use crate::outputs::{Notice, RequestKey};

/// Who sent a request.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct AuditedSender {
    /// The process; `None` if it is not known.
    pub pid: Option<u32>,
    /// The station whose order the relay handed on; `None` if a program on the robot gave it.
    pub station: Option<String>,
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

pub(super) fn log_control(sender: &AuditedSender, request: &ModuleControl) {
    tracing::info!(
        request = request.request_id,
        sender = sender.pid,
        station = sender.station,
        command = request
            .command()
            .map_or("unknown", |command| command.name()),
        "request"
    );
}

pub(super) fn log_movement(sender: &AuditedSender, movement: &MovementData) {
    let kind = movement.kind();
    let waypoint = (kind == Some(MovementKind::GoToWaypoint)).then_some(movement);
    let take_off = (kind == Some(MovementKind::TakeOff)).then_some(movement);
    tracing::info!(
        request = movement.request_id,
        sender = sender.pid,
        station = sender.station,
        command = kind.map_or("unknown", MovementKind::name),
        height_m = take_off.map(|to| to.altitude_m),
        path = waypoint.map(|to| to.path_id),
        first = waypoint.map(|to| to.first),
        last = waypoint.map(|to| to.last),
        latitude_deg = waypoint.map(|to| to.latitude_deg),
        longitude_deg = waypoint.map(|to| to.longitude_deg),
        altitude_m = waypoint.map(|to| to.altitude_m),
        preempt = (movement.preempt != 0).then_some(true),
        repeat = (movement.repeat != 0).then_some(true),
        after = (movement.after != 0).then_some(movement.after),
        "request"
    );
}

/// The description of a port is looked up for each name that an operator gives, and commands nothing.
pub(super) fn log_parameter(sender: &AuditedSender, parameter: &ParameterRequest) {
    let (request, pid, station) = (parameter.request_id, sender.pid, &sender.station);
    if parameter.operation() == Some(ParameterOperation::List) {
        let index = parameter.port;
        tracing::debug!(
            request,
            sender = pid,
            station,
            command = "list",
            index,
            "request"
        );
        return;
    }
    let (port, value) = (Some(parameter.port), Some(parameter.value));
    let (command, port, value) = match parameter.operation() {
        Some(ParameterOperation::Write) => ("write", port, value),
        Some(ParameterOperation::Read) => ("read", port, None),
        _ => ("unknown", None, None),
    };
    tracing::info!(
        request,
        sender = pid,
        station,
        command,
        port,
        value,
        "request"
    );
}

pub(super) fn log_sender_gone(key: RequestKey, request_id: u64) {
    tracing::info!(
        request = request_id,
        service = service(key),
        "sender is gone"
    );
}

/// Progress is for the curious.
pub(super) fn log_report(report: &RequestReport) {
    let stage = named!(Stage, report.stage);
    let reason = named!(Reason, report.reason);
    let rule = report.rule().map(|rule| rule.name());
    let waypoint = (report.waypoint > 0).then_some(report.waypoint);
    let (dsp_error, area) = (report.dsp_error(), report.area());
    let value = report.value().map(rounded);
    let request = report.request_id;
    let is_description = report.port.count > 0 && value.is_none();
    match report.stage() {
        Some(Stage::Done) if is_description => tracing::debug!(request, stage, "report"),
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
            request,
            stage,
            reason,
            rule,
            area,
            waypoint,
            dsp_error,
            value,
            between = report.in_between(),
            "report"
        ),
    }
}

/// `was` is what it did before.
pub(super) fn log_phase(was: u32, state: &ModuleState) {
    tracing::info!(
        doing = named!(Functionality, state.functionality),
        was = named!(Functionality, was),
        status = named!(ModuleStatus, state.status),
        error = %state.imi_error(),
        blocked = state.is_blocked(),
        "phase"
    );
}

pub(super) fn log_holder(state: &ModuleState) {
    let holder = state.holder();
    tracing::info!(
        session = holder.map(|holder| holder.session),
        sender = holder.map(|holder| holder.process),
        origin = holder.map(|holder| holder.origin),
        "control"
    );
}

pub(super) fn log_path(link: &LinkHealth) {
    tracing::debug!(
        may_hold = link.dsp_path().map_or("unknown", |path| path.name()),
        "the DSP's path buffer"
    );
}

/// How often the link came up, and what it is now.
pub(super) fn log_flapping(times: u32, link: u32) {
    let now = named!(LinkState, link);
    tracing::warn!(times, now, "the link came and went unlogged");
}

pub(super) fn log_link(from: u32, link: &LinkHealth) {
    tracing::info!(
        from = named!(LinkState, from),
        to = named!(LinkState, link.state),
        "link"
    );
    if link.state == LinkState::Up.code() && link.pc_timeout_supported == 0 {
        tracing::warn!(
            "the DSP has no time-out for a bridge that is gone, or `link.pc_timeout_ms` is 0: if this process dies in flight, the \
             waypoints that the DSP has are flown"
        );
    }
}

pub(super) fn log_notice(notice: &Notice) {
    match notice {
        // It may be a repetition: `log_dsp_error` has how often.
        Notice::DspError { .. } => {}
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
            area,
        } => tracing::warn!(
            rule = violation.rule.name(),
            action = violation.action.name(),
            amount = rounded(violation.amount),
            area = ascii_text(area).filter(|area| !area.is_empty()),
            "safety rule"
        ),
        Notice::Safety {
            violation: None, ..
        } => tracing::info!("all safety rules are kept again"),
    }
}

pub(super) fn log_dsp_error(code: DspErrorCode, starting: bool, unlogged: u32) {
    tracing::warn!(
        code = code.0,
        text = code.text(),
        starting,
        repeated = unlogged,
        "DSP error"
    );
}

/// To the third decimal: the log is read by people, and a millimetre or a millivolt is the least that the DSP measures.
fn rounded(value: f64) -> f64 {
    (value * 1000.0).round() / 1000.0
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_rounded_to_what_the_dsp_measures() {
        for (value, expected) in [
            (0.501_000_000_000_001_2, "0.501"),
            (-12.345_678, "-12.346"),
            (5.0, "5"),
        ] {
            assert_eq!(rounded(value).to_string(), expected);
        }
        assert!(rounded(f64::NAN).is_nan());
    }
}
