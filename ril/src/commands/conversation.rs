//! Sends the requests of a command to the bridge and follows them, as [`Exchange`] says.

use std::io::{self, Write};
use std::time::Duration;

use ipc_types::payload::RequestReport;
use ipc_types::{Client, MonotonicNs, Request, SendError, Source};
use runtime::exit::{ExitCode, Failure, OrFail};

use super::exchange::{Exchange, Next, Outcome, Progress, Until};
use super::{Session, absent, json_line};
use crate::messages::{self, FinalReport, ReportObject, Verb};

/// Whether a report ends its request otherwise than done.
fn is_failure(report: &RequestReport) -> bool {
    FinalReport::of(report).is_some_and(|end| end.exit_code() != ExitCode::Ok)
}

/// How reports are printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    /// Not at all: the command needs the answer itself.
    Silent,
    /// As lines for people.
    Text,
    /// As JSON objects, one a line.
    Json,
}

impl Format {
    pub fn of(json: bool) -> Format {
        match json {
            true => Format::Json,
            false => Format::Text,
        }
    }
}

/// Something that a command looks at while it follows a request.
pub(super) trait Companion {
    /// What wakes it.
    fn source(&mut self) -> &mut dyn Source;

    /// Takes what is there.
    ///
    /// # Errors
    ///
    /// What ends the command.
    fn look(&mut self) -> Result<(), Failure>;
}

/// A command's conversations with the bridge over one service.
pub(super) struct Conversation<'a, R: Request> {
    verb: Verb,
    timeout: Duration,
    key: &'static str,
    session: &'a Session,
    client: Client<R>,
    inbox: Vec<RequestReport>,
    previous_value: Option<f64>,
}

impl<'a, R: Request> Conversation<'a, R> {
    /// Opens the service. `timeout` bounds the bridge's first answer to each request.
    pub fn open(
        session: &'a Session,
        verb: Verb,
        timeout: Duration,
    ) -> Result<Conversation<'a, R>, Failure> {
        Conversation::open_at(session, R::KEY, verb, timeout)
    }

    /// The same over the service `key`, which carries `R` too.
    pub fn open_at(
        session: &'a Session,
        key: &'static str,
        verb: Verb,
        timeout: Duration,
    ) -> Result<Conversation<'a, R>, Failure> {
        Ok(Conversation {
            verb,
            timeout,
            key,
            session,
            client: session.ipc.client_of(key).or_fail(ExitCode::Internal)?,
            inbox: Vec::new(),
            previous_value: None,
        })
    }

    /// From here on final reports about a parameter show the value that it had before, if that is known.
    pub fn show_previous(&mut self, value: Option<f64>) {
        self.previous_value = value;
    }

    /// Sends `requests`, prints the reports about them and returns the final one; nothing when the last request was
    /// accepted and that was enough.
    ///
    /// # Errors
    ///
    /// When the final report is not `done`, with the exit code that goes with it; when there is no bridge, when it does not
    /// answer in time, and when a signal ends the command early.
    pub fn hold(
        &mut self,
        requests: &[R],
        until: Until,
        format: Format,
    ) -> Result<Option<RequestReport>, Failure> {
        self.hold_beside(requests, until, format, None)
    }

    /// The same, beside a companion, which looks whenever the command wakes, and once before the end.
    ///
    /// # Errors
    ///
    /// As [`Conversation::hold`], and what the companion fails with.
    pub fn hold_beside(
        &mut self,
        requests: &[R],
        until: Until,
        format: Format,
        mut companion: Option<&mut dyn Companion>,
    ) -> Result<Option<RequestReport>, Failure> {
        let ids = requests.iter().map(Request::request_id);
        let mut exchange = Exchange::new(ids, until, self.timeout);
        loop {
            let now = MonotonicNs::now();
            self.receive(&mut exchange, requests.len(), format, now)?;
            if let Some(companion) = &mut companion {
                companion.look()?;
            }
            match exchange.next(now) {
                Next::Over(outcome) => return self.judge(outcome, requests.len()),
                _ if self.session.termination.requested() => {
                    return Err(self.interrupted(exchange.progress(), requests.len()));
                }
                Next::Send(index) => {
                    self.send(&requests[index])?;
                    exchange.sent(now);
                }
                Next::Wait(until) => {
                    let client: &mut dyn Source = &mut self.client;
                    let beside = companion.as_mut().map(|companion| companion.source());
                    self.session
                        .wait([client].into_iter().chain(beside), until)?;
                }
            }
        }
    }

    /// Takes every report that is there, and prints it.
    fn receive(
        &mut self,
        exchange: &mut Exchange,
        total: usize,
        format: Format,
        now: MonotonicNs,
    ) -> Result<(), Failure> {
        self.client.drain(|report| self.inbox.push(*report));
        let mut out = io::stdout().lock();
        for report in self.inbox.drain(..) {
            let Some(index) = exchange.take(&report, now) else {
                continue;
            };
            match format {
                Format::Silent => {}
                Format::Json => {
                    let object = ReportObject::new(self.verb, &report);
                    json_line(
                        &mut out,
                        &object.with_previous(&report, self.previous_value),
                    )?;
                }
                // It is the error that the command ends with, and is printed as that.
                Format::Text if is_failure(&report) => {}
                Format::Text => {
                    if let Some(line) = messages::line(self.verb, index, total, &report) {
                        let was = messages::previous(&report, self.previous_value);
                        writeln!(out, "{line}{was}").map_err(Failure::output)?;
                    }
                }
            }
        }
        Ok(())
    }

    fn send(&mut self, request: &R) -> Result<(), Failure> {
        match self.client.send(request) {
            Ok(()) => Ok(()),
            Err(SendError::NoServer { .. }) => Err(absent(self.key, self.session.ipc.robot())),
            Err(error @ SendError::ServerFull) => Err(Failure::new(ExitCode::Timeout, error)),
            Err(error @ (SendError::TooManyOutstanding | SendError::Failed(_))) => {
                Err(Failure::internal(error))
            }
        }
    }

    /// What the command ends with.
    fn judge(&self, outcome: Outcome, total: usize) -> Result<Option<RequestReport>, Failure> {
        match outcome {
            Outcome::Accepted => Ok(None),
            Outcome::Final(end) => self.judge_final(&end),
            Outcome::NoAnswer(index) => {
                let robot = self.session.ipc.robot();
                let which = match total {
                    1 => self.verb.name().to_owned(),
                    total => format!("waypoint {} of {total}", index + 1),
                };
                let (process, look) = match self.key.split_once('/') {
                    None => ("the bridge", "ril status".to_owned()),
                    Some((module, _)) => (module, format!("ril topic echo {module}/state")),
                };
                let text = format!(
                    "{process} of robot {robot} did not answer to {which} in time: it may hang. The request was withdrawn"
                );
                let next_step =
                    format!("`{look} --robot {robot}` shows whether it took effect all the same");
                Err(Failure::new(ExitCode::Timeout, text).with_next_step(next_step))
            }
        }
    }

    fn judge_final(&self, end: &FinalReport) -> Result<Option<RequestReport>, Failure> {
        match end.exit_code() {
            ExitCode::Ok => Ok(Some(end.report)),
            code => {
                let (text, next_step) = messages::ending_parts(self.verb, end);
                let failure = Failure::new(code, text);
                Err(match next_step {
                    Some(next_step) => failure.with_next_step(next_step),
                    None => failure,
                })
            }
        }
    }

    fn interrupted(&self, progress: Progress, total: usize) -> Failure {
        let what = match progress {
            Progress::Taken => self.verb.goes_on(),
            Progress::Incomplete if total > 1 => {
                "the path was not complete, so nothing of it is flown"
            }
            Progress::Incomplete => {
                "it was withdrawn before the bridge answered; `ril status` shows whether it took effect"
            }
        };
        let name = self.verb.name();
        let text = format!("interrupted before the final report about {name}: {what}");
        Failure::new(ExitCode::OutcomeUnknown, text)
    }
}
