//! The audit trail: every request, refusal, phase, DSP error, safety rule and link change is one structured log line
//! (requirement H8).
//!
//! A request is logged with its id, the process that sent it and, when it came over the relay, the station that ordered
//! it; every later line about it has the same id. What repeats quickly is logged at onset and then once a second with
//! the number of repetitions, so that a flood from the line cannot fill a disk.
//!
//! To make a line takes longer than to send an order. So lines are kept until [`Audit::write`], which comes when bytes
//! and reports are out; at most [`MAX_LINES`], and a bridge that ends, also by a panic, writes them.

use std::cell::RefCell;
use std::time::Duration;

use dsp_protocol::{Command, DspErrorCode};
use ipc_types::MonotonicNs;
use ipc_types::code::{
    Functionality, LinkState, ModuleStatus, MovementKind, ParameterOperation, Reason, Stage,
};
use ipc_types::payload::{
    ControlSender, LinkHealth, ModuleControl, ModuleState, MovementData, ParameterRequest,
    RelayStations, RequestReport, ascii_text,
};
use ipc_types::{Ipc, OpenError, Subscriber};

use crate::outputs::{Notice, RequestKey};

/// Time between two lines about the same repeated trouble.
const REPETITION_PERIOD: Duration = Duration::from_secs(1);

/// How often the link may come up within [`FLAPPING_PERIOD`] with each change logged. One that comes and goes all the
/// time, such as that of a DSP which answers and sends no status, is then logged as one line for each period.
const COMEBACKS: u32 = 3;

/// The period in which comebacks are counted.
const FLAPPING_PERIOD: Duration = Duration::from_secs(60);

/// Lines that are kept; the next one lets all be written at once.
const MAX_LINES: usize = 64;

/// DSP errors that have a count of their own; more than the documented ones. Others share the last place.
const ERROR_CODES: usize = 32;

/// Who sent a request.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct AuditedSender {
    /// The process; `None` if it is not known.
    pub pid: Option<u32>,
    /// The station whose order the relay handed on; `None` if a program on the robot gave it.
    pub station: Option<String>,
}

/// The stations that the relay knows, which it says before the first request of each.
pub struct RelayStationNames {
    port: Subscriber<RelayStations>,
    newest: RelayStations,
}

impl RelayStationNames {
    /// Opens the port, whether there is a relay or not.
    pub fn open(ipc: &Ipc) -> Result<RelayStationNames, OpenError> {
        Ok(RelayStationNames {
            port: ipc.subscriber()?,
            newest: RelayStations::default(),
        })
    }

    /// Takes what the relay says. Nothing waits for it: a look now and then connects the port long before a station's
    /// first order. What cannot be read leaves the log without names.
    pub fn drain(&mut self) {
        if let Ok(Some(newest)) = self.port.latest() {
            self.newest = newest;
        }
    }

    /// The station whose requests have this `origin`.
    pub fn name_of(&self, origin: u32) -> Option<String> {
        if origin == 0 {
            return None;
        }
        let name = self
            .newest
            .of_origin(origin)
            .and_then(|station| station.name());
        Some(name.unwrap_or("unknown").to_owned())
    }
}

/// Makes a line.
type Line = Box<dyn FnOnce()>;

/// What the log has, so that each change is logged once.
#[derive(Default)]
pub struct Audit {
    lines: RefCell<Vec<Line>>,
    state: ModuleState,
    comebacks: Comebacks,
    /// The kinds of trouble that may repeat.
    dsp_errors: Vec<(DspErrorCode, Repeated)>,
}

/// How often the link came up in the period under way.
#[derive(Clone, Copy, Debug, Default)]
struct Comebacks {
    since: MonotonicNs,
    count: u32,
}

impl Comebacks {
    /// Ends a period that is over. Gives how often the link came up unlogged in it.
    fn end(&mut self, now: MonotonicNs) -> Option<u32> {
        if self.count == 0 || now.since(self.since) < FLAPPING_PERIOD {
            return None;
        }
        let unlogged = self.count.saturating_sub(COMEBACKS);
        self.count = 0;
        Some(unlogged).filter(|unlogged| *unlogged > 0)
    }

    /// The link has come up.
    fn add(&mut self, now: MonotonicNs) {
        if self.count == 0 {
            self.since = now;
        }
        self.count = self.count.saturating_add(1);
    }

    /// Whether the link's changes are counted and not logged.
    fn is_flapping(&self) -> bool {
        self.count > COMEBACKS
    }
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
    /// Writes the lines that are kept, oldest first.
    pub fn write(&self) {
        let lines = self.lines.take();
        lines.into_iter().for_each(|line| line());
    }

    fn keep(&self, line: impl FnOnce() + 'static) {
        self.lines.borrow_mut().push(Box::new(line));
        if self.lines.borrow().len() >= MAX_LINES {
            self.write();
        }
    }

    /// A control request arrived.
    pub fn control(&self, sender: AuditedSender, request: ModuleControl) {
        self.keep(move || {
            tracing::info!(
                request = request.request_id,
                sender = sender.pid,
                station = sender.station,
                command = request
                    .command()
                    .map_or("unknown", |command| command.name()),
                "request"
            );
        });
    }

    /// A movement request arrived. Only values that its kind uses are logged.
    pub fn movement(&self, sender: AuditedSender, movement: MovementData) {
        self.keep(move || log_movement(&sender, &movement));
    }

    /// A parameter request arrived. The description of a port is looked up for each name that an operator gives, and
    /// commands nothing.
    pub fn parameter(&self, sender: AuditedSender, request: ParameterRequest) {
        self.keep(move || log_parameter(&sender, &request));
    }

    /// The sender of a request is gone.
    pub fn sender_gone(&self, key: RequestKey, request_id: u64) {
        self.keep(move || {
            tracing::info!(
                request = request_id,
                service = service(key),
                "sender is gone"
            );
        });
    }

    /// A report goes to the sender of a request. Progress is for the curious.
    pub fn report(&self, report: &RequestReport) {
        let report = *report;
        self.keep(move || log_report(&report));
    }

    /// The state is published: its changes of phase, link and path buffer.
    pub fn state(&mut self, state: &ModuleState, now: MonotonicNs) {
        let before = std::mem::replace(&mut self.state, *state);
        let who = |sender: ControlSender| [sender.origin, sender.session];
        let is_up = state.link.state == LinkState::Up.code();
        if let Some(times) = self.comebacks.end(now) {
            let now = named!(LinkState, state.link.state);
            self.keep(move || tracing::warn!(times, now, "the link came and went unlogged"));
        }
        if before.link.state != state.link.state && is_up {
            self.comebacks.add(now);
        }
        let is_flapping = self.comebacks.is_flapping();
        let doing = |state: &ModuleState| (state.functionality, state.status, state.blocked);
        // An error that comes and goes with a flapping link says no more than the link.
        let is_new_error = before.imi_error != state.imi_error && !is_flapping;
        let (was, state) = (before.functionality, *state);
        if doing(&before) != doing(&state) || is_new_error {
            self.keep(move || {
                tracing::info!(
                    doing = named!(Functionality, state.functionality),
                    was = named!(Functionality, was),
                    status = named!(ModuleStatus, state.status),
                    error = %state.imi_error(),
                    blocked = state.is_blocked(),
                    "phase"
                );
            });
        }
        if before.holder().map(who) != state.holder().map(who) {
            self.keep(move || {
                let holder = state.holder();
                tracing::info!(
                    session = holder.map(|holder| holder.session),
                    sender = holder.map(|holder| holder.process),
                    origin = holder.map(|holder| holder.origin),
                    "control"
                );
            });
        }
        let (from, link) = (before.link, state.link);
        if from.state != link.state && !is_flapping {
            self.keep(move || log_link(from.state, &link));
        }
        if from.dsp_path != link.dsp_path {
            self.keep(move || {
                tracing::debug!(
                    may_hold = link.dsp_path().map_or("unknown", |path| path.name()),
                    "the DSP's path buffer"
                );
            });
        }
    }

    /// The core takes note of something.
    pub fn notice(&mut self, notice: &Notice, now: MonotonicNs) {
        match *notice {
            Notice::DspError { code, starting } => self.dsp_error(code, starting, now),
            notice => self.keep(move || log_notice(&notice)),
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
            return self.keep(move || log_dsp_error(code, starting, 0));
        };
        let repeated = &mut self.dsp_errors[place].1;
        if now.since(repeated.logged) < REPETITION_PERIOD {
            repeated.unlogged = repeated.unlogged.saturating_add(1);
            return;
        }
        repeated.logged = now;
        let unlogged = std::mem::take(&mut repeated.unlogged);
        self.keep(move || log_dsp_error(code, starting, unlogged));
    }
}

impl Drop for Audit {
    fn drop(&mut self) {
        self.write();
    }
}

fn log_movement(sender: &AuditedSender, movement: &MovementData) {
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

fn log_parameter(sender: &AuditedSender, request: &ParameterRequest) {
    let id = request.request_id;
    let port = request.port;
    match request.operation() {
        Some(ParameterOperation::List) => {
            tracing::debug!(
                request = id,
                sender = sender.pid,
                station = sender.station,
                command = "list",
                index = port,
                "request"
            );
        }
        Some(ParameterOperation::Write) => {
            let value = request.value;
            tracing::info!(
                request = id,
                sender = sender.pid,
                station = sender.station,
                command = "write",
                port,
                value,
                "request"
            );
        }
        Some(ParameterOperation::Read) => {
            tracing::info!(
                request = id,
                sender = sender.pid,
                station = sender.station,
                command = "read",
                port,
                "request"
            );
        }
        None => tracing::info!(
            request = id,
            sender = sender.pid,
            station = sender.station,
            command = "unknown",
            "request"
        ),
    }
}

fn log_report(report: &RequestReport) {
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

fn log_link(from: u32, link: &LinkHealth) {
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

fn log_notice(notice: &Notice) {
    match notice {
        // It may be a repetition.
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

fn log_dsp_error(code: DspErrorCode, starting: bool, unlogged: u32) {
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
    fn a_link_that_comes_and_goes_is_counted_and_a_quiet_minute_later_logged_again() {
        let second = |at: u64| MonotonicNs(at * 1_000_000_000);
        let mut comebacks = Comebacks::default();
        for at in 0..60 {
            assert_eq!(comebacks.end(second(at)), None, "{at} s");
            comebacks.add(second(at));
            assert_eq!(comebacks.is_flapping(), at >= 3, "{at} s");
        }
        assert_eq!(comebacks.end(second(60)), Some(57));
        assert!(!comebacks.is_flapping());
        assert_eq!(comebacks.end(second(200)), None);
        comebacks.add(second(200));
        assert_eq!(comebacks.end(second(300)), None, "it was logged");
    }

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
