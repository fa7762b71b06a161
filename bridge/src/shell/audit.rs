//! The audit trail: every request, refusal, phase, DSP error, safety rule and link change is one structured log line
//! (requirement H8).
//!
//! A request is logged with its id, the process that sent it and, when it came over the relay, the station that ordered
//! it; every later line about it has the same id. What repeats quickly is logged at onset and then once a second with
//! the number of repetitions, so that a flood from the line cannot fill a disk.
//!
//! To make a line takes longer than to send an order. So lines are kept until [`Audit::write`], which comes when bytes
//! and reports are out, or another line of the bridge follows; at most [`MAX_LINES`]. A line's time is when it was
//! written. A bridge that ends, also by a panic, writes them; one that is killed loses those of the wake under way.

use std::cell::RefCell;
use std::time::Duration;

use dsp_protocol::DspErrorCode;
use ipc_types::MonotonicNs;
use ipc_types::code::{ImiError, LinkState};
use ipc_types::payload::{
    ControlSender, ModuleControl, ModuleState, MovementData, ParameterRequest, RelayStations,
    RequestReport,
};
use ipc_types::{Ipc, OpenError, Subscriber};

use crate::outputs::{Notice, RequestKey};

mod lines;

pub use lines::AuditedSender;
use lines::{
    log_control, log_dsp_error, log_flapping, log_holder, log_link, log_movement, log_notice,
    log_parameter, log_path, log_phase, log_report, log_sender_gone,
};

/// Time between two lines about the same repeated trouble.
const REPETITION_PERIOD: Duration = Duration::from_secs(1);

/// How often the link may come up within [`FLAPPING_PERIOD`] with each change logged. Of one that comes up more often,
/// such as that of a DSP which answers and sends no status, each period is one line, until one has no more.
const COMEBACKS: u32 = 3;

/// The period in which comebacks are counted.
const FLAPPING_PERIOD: Duration = Duration::from_secs(60);

/// Lines that are kept; with so many all are written at once.
const MAX_LINES: usize = 64;

/// DSP errors that have a count of their own; more than the documented ones. Others share the last place.
const ERROR_CODES: usize = 32;

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
    /// The link and the error that the log shows.
    logged_link: u32,
    logged_error: u32,
    /// The kinds of trouble that may repeat.
    dsp_errors: Vec<(DspErrorCode, Repeated)>,
}

/// How often the link came up in the period under way.
#[derive(Clone, Copy, Debug, Default)]
struct Comebacks {
    since: MonotonicNs,
    count: u32,
    /// The link's changes are counted and not logged.
    is_flapping: bool,
}

impl Comebacks {
    /// The link has come up.
    fn add(&mut self, now: MonotonicNs) {
        if self.count == 0 && !self.is_flapping {
            self.since = now;
        }
        self.count = self.count.saturating_add(1);
        self.is_flapping |= self.count > COMEBACKS;
    }

    /// Ends a period that is over. Gives how often the link came up in it, if its changes were not logged.
    fn end(&mut self, now: MonotonicNs) -> Option<u32> {
        if now.since(self.since) < FLAPPING_PERIOD {
            return None;
        }
        let (count, was_flapping) = (self.count, self.is_flapping);
        *self = Comebacks {
            since: now,
            count: 0,
            is_flapping: count > COMEBACKS,
        };
        was_flapping.then_some(count)
    }
}

/// Trouble that was logged and may repeat.
#[derive(Clone, Copy, Debug)]
struct Repeated {
    logged: MonotonicNs,
    unlogged: u32,
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
        self.keep(move || log_control(&sender, &request));
    }

    /// A movement request arrived.
    pub fn movement(&self, sender: AuditedSender, movement: MovementData) {
        self.keep(move || log_movement(&sender, &movement));
    }

    /// A parameter request arrived.
    pub fn parameter(&self, sender: AuditedSender, request: ParameterRequest) {
        self.keep(move || log_parameter(&sender, &request));
    }

    /// The sender of a request is gone.
    pub fn sender_gone(&self, key: RequestKey, request_id: u64) {
        self.keep(move || log_sender_gone(key, request_id));
    }

    /// A report goes to the sender of a request.
    pub fn report(&self, report: &RequestReport) {
        let report = *report;
        self.keep(move || log_report(&report));
    }

    /// The state is published: its changes of phase, link and path buffer.
    pub fn state(&mut self, state: &ModuleState, now: MonotonicNs) {
        let before = std::mem::replace(&mut self.state, *state);
        let who = |sender: ControlSender| [sender.origin, sender.session];
        if let Some(times) = self.comebacks.end(now) {
            self.flapped(times, state);
        }
        if before.link.state != state.link.state && state.link.state == LinkState::Up.code() {
            self.comebacks.add(now);
        }
        let is_flapping = self.comebacks.is_flapping;
        let doing = |state: &ModuleState| (state.functionality, state.status, state.blocked);
        // The error of a link that is silent comes and goes with a flapping one.
        let silence = ImiError::CommunicationFatalError;
        let is_of_link = state.imi_error().named() == Some(silence);
        let error = match is_flapping && is_of_link {
            true => self.logged_error,
            false => state.imi_error,
        };
        let was = before.functionality;
        let state = *state;
        if doing(&before) != doing(&state) || error != self.logged_error {
            self.logged_error = state.imi_error;
            self.keep(move || log_phase(was, &state));
        }
        if before.holder().map(who) != state.holder().map(who) {
            self.keep(move || log_holder(&state));
        }
        let (from, link) = (before.link, state.link);
        if from.state != link.state && !is_flapping {
            self.logged_link = link.state;
            self.keep(move || log_link(from.state, &link));
        }
        if from.dsp_path != link.dsp_path {
            self.keep(move || log_path(&link));
        }
    }

    /// How often a flapping link came up, and what it is now, if that is not what the log shows.
    fn flapped(&mut self, times: u32, state: &ModuleState) {
        let link = state.link.state;
        if times == 0 && link == self.logged_link {
            return;
        }
        self.logged_link = link;
        self.keep(move || log_flapping(times, link));
    }

    /// Writes what is kept, and what a flapping link is in the end.
    pub fn finish(&mut self) {
        if std::mem::take(&mut self.comebacks.is_flapping) {
            let state = self.state;
            self.flapped(self.comebacks.count, &state);
        }
        self.write();
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
        self.finish();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_that_comes_and_goes_is_counted_until_a_minute_is_quiet() {
        let second = |at: u64| MonotonicNs(at * 1_000_000_000);
        let mut comebacks = Comebacks::default();
        for at in 100..220 {
            let ended = comebacks.end(second(at));
            assert_eq!(ended, (at == 160).then_some(60), "{at} s");
            comebacks.add(second(at));
            assert_eq!(comebacks.is_flapping, at >= 103, "{at} s");
        }
        assert_eq!(comebacks.end(second(220)), Some(60));
        comebacks.add(second(250));
        assert_eq!(comebacks.end(second(280)), Some(1), "a quiet minute");
        assert!(!comebacks.is_flapping);
        comebacks.add(second(400));
        assert_eq!(comebacks.end(second(500)), None, "it was logged");
    }
}
