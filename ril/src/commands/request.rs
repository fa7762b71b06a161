//! `ril start | stop | takeoff | land | goto`: sends the requests of one command and follows them to the final word.
//!
//! It decides nothing about the conversation, which is [`Exchange`]'s, nor about words and exit codes, which are in
//! [`messages`].

use std::io::{self, Write};

use ipc_types::code::ControlCommand;
use ipc_types::payload::{ModuleControl, MovementData, RequestReport};
use ipc_types::{Client, MonotonicNs, Request, SendError, fresh_request_id};
use runtime::exit::{ExitCode, Failure, OrFail};

use super::exchange::{Exchange, Next, Outcome, Progress, Until};
use super::{Session, absent, configuration, json_line};
use crate::cli::{GotoArgs, RequestArgs, TakeoffArgs};
use crate::messages::{self, ReportObject, Verb};

/// `ril start`
///
/// # Errors
///
/// As all requests: see [`messages::exit_code`]; code 3 when there is no bridge, 4 when it does not answer, 7 when a signal
/// ends the command before the final word.
pub fn start(args: &RequestArgs) -> Result<(), Failure> {
    control(Verb::Start, ControlCommand::Start, args)
}

/// `ril stop`
///
/// # Errors
///
/// As [`start`].
pub fn stop(args: &RequestArgs) -> Result<(), Failure> {
    control(Verb::Stop, ControlCommand::Stop, args)
}

/// `ril takeoff`
///
/// # Errors
///
/// As [`start`].
pub fn take_off(args: &TakeoffArgs) -> Result<(), Failure> {
    let request = MovementData::take_off(fresh_request_id(), args.altitude);
    movement(Verb::TakeOff, vec![request], &args.request)
}

/// `ril land`
///
/// # Errors
///
/// As [`start`].
pub fn land(args: &RequestArgs) -> Result<(), Failure> {
    movement(
        Verb::Land,
        vec![MovementData::land(fresh_request_id())],
        args,
    )
}

/// `ril goto`
///
/// # Errors
///
/// As [`start`].
pub fn go_to(args: &GotoArgs) -> Result<(), Failure> {
    let requests = MovementData::path(fresh_request_id(), &args.waypoints, fresh_request_id);
    movement(Verb::GoTo, requests.collect(), &args.request)
}

fn control(verb: Verb, command: ControlCommand, args: &RequestArgs) -> Result<(), Failure> {
    let mut request = ModuleControl::new(fresh_request_id(), command);
    run(verb, args, |deadline_ms| {
        request.deadline_ms = deadline_ms;
        vec![request]
    })
}

fn movement(
    verb: Verb,
    mut requests: Vec<MovementData>,
    args: &RequestArgs,
) -> Result<(), Failure> {
    run(verb, args, |deadline_ms| {
        for request in &mut requests {
            request.deadline_ms = deadline_ms;
        }
        requests
    })
}

/// Runs one command; `with_deadline` gives its requests once the deadline is known.
fn run<R: Request>(
    verb: Verb,
    args: &RequestArgs,
    with_deadline: impl FnOnce(u32) -> Vec<R>,
) -> Result<(), Failure> {
    let Some(config) = configuration(&args.common)? else {
        return Ok(());
    };
    let session = Session::join(&args.common)?;
    let requests = with_deadline(args.deadline.unwrap_or(config.request.deadline_ms));
    let timeout = args.timeout.unwrap_or_else(|| config.request.timeout());
    let until = if args.no_wait {
        Until::Accepted
    } else {
        Until::Final
    };
    let exchange = Exchange::new(requests.iter().map(Request::request_id), until, timeout);
    let client = session.ipc.client::<R>().or_fail(ExitCode::Internal)?;
    let mut conversation = Conversation {
        verb,
        json: args.json,
        requests,
        exchange,
        client,
        inbox: Vec::new(),
    };
    let outcome = conversation.hold(&session)?;
    conversation.judge(outcome, &session)
}

/// The requests of one command on their way.
struct Conversation<R: Request> {
    verb: Verb,
    json: bool,
    requests: Vec<R>,
    exchange: Exchange,
    client: Client<R>,
    inbox: Vec<RequestReport>,
}

impl<R: Request> Conversation<R> {
    /// Talks until it is over. Nothing comes out when a signal ended it before.
    fn hold(&mut self, session: &Session) -> Result<Option<Outcome>, Failure> {
        loop {
            let now = MonotonicNs::now();
            self.listen(now)?;
            match self.exchange.next(now) {
                Next::Over(outcome) => return Ok(Some(outcome)),
                _ if session.termination.requested() => return Ok(None),
                Next::Send(index) => self.send(index, now, session)?,
                Next::Wait(until) => session.wait(&[&self.client], until)?,
            }
        }
    }

    /// Takes every report that is there, and prints it.
    fn listen(&mut self, now: MonotonicNs) -> Result<(), Failure> {
        self.client.drain(|report| self.inbox.push(*report));
        let mut out = io::stdout().lock();
        for report in self.inbox.drain(..) {
            let Some(index) = self.exchange.take(&report, now) else {
                continue;
            };
            if self.json {
                json_line(&mut out, &ReportObject::new(self.verb, &report))?;
            } else if let Some(line) =
                messages::line(self.verb, index, self.requests.len(), &report)
            {
                writeln!(out, "{line}").map_err(Failure::output)?;
            }
        }
        Ok(())
    }

    fn send(&mut self, index: usize, now: MonotonicNs, session: &Session) -> Result<(), Failure> {
        match self.client.send(&self.requests[index]) {
            Ok(()) => {
                self.exchange.sent(now);
                Ok(())
            }
            Err(SendError::NoServer { .. }) => Err(absent(R::SERVICE, session.ipc.robot())),
            Err(error @ SendError::ServerFull) => Err(Failure::new(ExitCode::Timeout, error)),
            Err(error @ (SendError::TooManyOutstanding | SendError::Failed(_))) => {
                Err(Failure::internal(error))
            }
        }
    }

    /// What the command ends with.
    fn judge(&self, outcome: Option<Outcome>, session: &Session) -> Result<(), Failure> {
        let (name, robot) = (self.verb.name(), session.ipc.robot());
        match outcome {
            Some(Outcome::Accepted) => Ok(()),
            Some(Outcome::Final(word)) => match word.exit_code() {
                ExitCode::Ok => Ok(()),
                code => Err(Failure::new(code, messages::ending(self.verb, word))),
            },
            Some(Outcome::NoAnswer(index)) => {
                let which = match self.requests.len() {
                    1 => name.to_owned(),
                    total => format!("waypoint {} of {total}", index + 1),
                };
                let text = format!(
                    "the bridge of robot {robot} did not answer to {which} in time: it may hang. The request was \
                     withdrawn; `ril state --robot {robot}` shows whether it took effect all the same"
                );
                Err(Failure::new(ExitCode::Timeout, text))
            }
            None => {
                let what = match self.exchange.progress() {
                    Progress::Taken => self.verb.goes_on(),
                    Progress::Incomplete if self.requests.len() > 1 => {
                        "the path was not complete, so nothing of it is flown"
                    }
                    Progress::Incomplete => {
                        "it was withdrawn before the bridge answered; `ril state` shows whether it took effect"
                    }
                };
                let text = format!("interrupted before the final word to {name}: {what}");
                Err(Failure::new(ExitCode::OutcomeUnknown, text))
            }
        }
    }
}
