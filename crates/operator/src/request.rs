//! Sends the requests of a command to the bridge and follows them: [`Exchange`], a pure value, says what to send when,
//! what to wait for and when it is over.
//!
//! A path is one exchange of several requests: each waypoint goes out when the one before it has been accepted, and the
//! first that is refused ends the exchange, because the bridge then discards the whole path.
//!
//! A waypoint before the last is `done` when the bridge has taken the next one. So at most two requests of a path are
//! open, and when a path is broken, the newest open waypoint is answered with the reason.
//!
//! A screen or a page orders by `ports`, which feed what is known of the robot; `followed`: what becomes of its orders.

pub mod cruise;
pub mod followed;
pub mod ports;
#[cfg(test)]
mod tests;

use std::time::Duration;

use ipc_types::code::{ControlCommand, Reason, SenderLost, Stage};
use ipc_types::payload::{ModuleControl, MovementData, RequestReport};
use ipc_types::{Client, Descriptor, MonotonicNs, Request, SendError, Source, fresh_request_id};
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::output::standard_output;

use crate::options::RequestArgs;
use crate::render::messages::object::ReportObject;
use crate::render::messages::{self, FinalReport, Verb};
use crate::render::{Weight, json_text, tell};
use crate::robot::absence::absent;
use crate::session::{OrderContext, Session, UrgentContext};

/// When the exchange is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Until {
    /// The final report ends it.
    Final,
    /// The acceptance of the last request ends it.
    Accepted,
}

impl Until {
    /// What the operator asked for.
    pub fn of(args: &RequestArgs) -> Until {
        match args.no_wait {
            true => Until::Accepted,
            false => Until::Final,
        }
    }
}

/// What to do next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Next {
    /// Send the request of this index.
    Send(usize),
    /// Wait for a report, at most until then.
    Wait(Option<MonotonicNs>),
    /// Nothing; it is over.
    Over(Outcome),
}

/// How the exchange ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// The last request was accepted, which was all that was asked for.
    Accepted,
    /// The final report.
    Final(FinalReport),
    /// The bridge did not answer the request of this index in time.
    NoAnswer(usize),
}

/// How far the exchange is, for a command that must end early.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// The bridge has not taken all requests, and without their sender it never will.
    Incomplete,
    /// The bridge has taken them and goes on with them.
    Taken,
}

/// The requests of one command: says what to send when, what to wait for and when it is over.
#[derive(Debug)]
pub struct Exchange {
    requests: Vec<RequestState>,
    sent: usize,
    until: Until,
    timeout: Duration,
    /// Until when the awaited report must have come.
    due: MonotonicNs,
}

/// What has been reported about a request.
#[derive(Clone, Copy, Debug)]
struct RequestState {
    request_id: u64,
    is_answered: bool,
    end: Option<FinalReport>,
}

impl RequestState {
    fn failed(&self) -> Option<FinalReport> {
        self.end.filter(|end| end.stage != Stage::Done)
    }
}

impl Exchange {
    /// The exchange about the requests with these ids, in this order. `timeout` bounds the first answer to each.
    pub fn new(
        request_ids: impl IntoIterator<Item = u64>,
        until: Until,
        timeout: Duration,
    ) -> Exchange {
        let state = |request_id| RequestState {
            request_id,
            is_answered: false,
            end: None,
        };
        Exchange {
            requests: request_ids.into_iter().map(state).collect(),
            sent: 0,
            until,
            timeout,
            due: MonotonicNs(u64::MAX),
        }
    }

    /// The bridge has so long from now on for its first answer, and for each later one.
    pub fn await_for(&mut self, timeout: Duration, now: MonotonicNs) {
        self.timeout = timeout;
        self.due = now + timeout;
    }

    /// The request that [`Next::Send`] named has been sent.
    pub fn sent(&mut self, now: MonotonicNs) {
        self.sent += 1;
        self.due = now + self.timeout;
    }

    /// Takes a report and gives the index of the request that it answers; `None` if it is none of these.
    pub fn take(&mut self, report: &RequestReport, now: MonotonicNs) -> Option<usize> {
        let index = self
            .requests
            .iter()
            .position(|request| request.request_id == report.request_id)?;
        let had_failed = self
            .requests
            .iter()
            .any(|request| request.failed().is_some());
        let request = &mut self.requests[index];
        request.is_answered = true;
        request.end = request.end.or(FinalReport::of(report));
        if !had_failed && request.failed().is_some() {
            // The final reports about the other waypoints of a broken path come together with the first one.
            self.due = now + self.timeout;
        }
        Some(index)
    }

    /// When [`Exchange::next`] is to be asked although no report comes; `None` if there is no such moment.
    pub fn due(&self) -> Option<MonotonicNs> {
        match self.next(MonotonicNs(0)) {
            Next::Wait(until) => until,
            _ => None,
        }
    }

    /// What to do at `now`.
    pub fn next(&self, now: MonotonicNs) -> Next {
        let (sent, unsent) = self.requests.split_at(self.sent.min(self.requests.len()));
        if let Some(culprit) = culprit(sent) {
            let all_answered = sent.iter().all(|request| request.end.is_some());
            return if all_answered || now >= self.due {
                Next::Over(Outcome::Final(culprit))
            } else {
                Next::Wait(Some(self.due))
            };
        }
        match (sent.last(), unsent.is_empty()) {
            (Some(last), _) if !last.is_answered => {
                if now >= self.due {
                    Next::Over(Outcome::NoAnswer(sent.len() - 1))
                } else {
                    Next::Wait(Some(self.due))
                }
            }
            (_, false) => Next::Send(sent.len()),
            (Some(last), true) => match last.end {
                Some(end) => Next::Over(Outcome::Final(end)),
                None if self.until == Until::Accepted => Next::Over(Outcome::Accepted),
                None => Next::Wait(None),
            },
            (None, true) => Next::Over(Outcome::Accepted),
        }
    }

    /// A refusal of one of several requests says which, unless the bridge has said it. The first one is refused for
    /// what holds for the whole path.
    fn placed(&self, mut end: FinalReport) -> FinalReport {
        let id = end.report.request_id;
        let mut requests = self.requests.iter();
        let index = requests.position(|request| request.request_id == id);
        let is_unplaced = end.stage == Stage::Refused && end.report.waypoint == 0;
        if let Some(later @ 1..) = index.filter(|_| is_unplaced) {
            end.report.waypoint = later as u32 + 1;
        }
        end
    }

    /// How far it is.
    pub fn progress(&self) -> Progress {
        match self.requests.last() {
            Some(last) if !last.is_answered => Progress::Incomplete,
            _ => Progress::Taken,
        }
    }
}

/// The failure that says most: the newest that is not the mere consequence of another one, else the newest.
fn culprit(sent: &[RequestState]) -> Option<FinalReport> {
    let failures = || sent.iter().rev().filter_map(RequestState::failed);
    let is_cause =
        |end: &FinalReport| !matches!(end.reason, Reason::PathBroken | Reason::PathWithoutHead);
    failures().find(is_cause).or_else(|| failures().next())
}

/// Whether a report ends its request otherwise than done.
fn is_failure(report: &RequestReport) -> bool {
    FinalReport::of(report).is_some_and(|end| end.exit_code() != ExitCode::Ok)
}

/// How reports are printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Not at all: the command needs the answer itself.
    Silent,
    /// Lines for people.
    Text,
    /// JSON objects, one a line.
    Json,
}

impl Format {
    /// JSON if it was asked for.
    pub fn of(json: bool) -> Format {
        match json {
            true => Format::Json,
            false => Format::Text,
        }
    }
}

/// A start, a stop or a reload that was issued at `issued`, to be begun within `deadline_ms` of that.
pub fn control_request(
    command: ControlCommand,
    issued: MonotonicNs,
    deadline_ms: u32,
) -> ModuleControl {
    ModuleControl {
        issued_ns: issued.0,
        begin_by_ns: begin_by_ns(issued.0, deadline_ms),
        ..ModuleControl::new(fresh_request_id(), command)
    }
}

/// Until when an order may begin that was issued at `issued_ns`; 0 leaves it to the bridge, as a deadline of 0 does.
pub fn begin_by_ns(issued_ns: u64, deadline_ms: u32) -> u64 {
    match deadline_ms {
        0 => 0,
        ms => (MonotonicNs(issued_ns) + Duration::from_millis(ms.into())).0,
    }
}

/// `request` to be begun within `deadline_ms` of its issue; says also whether it replaces a path that is under way.
pub fn complete(request: MovementData, preempt: bool, deadline_ms: u32) -> MovementData {
    MovementData {
        begin_by_ns: begin_by_ns(request.issued_ns, deadline_ms),
        preempt: u16::from(preempt),
        ..request
    }
}

/// How long the first step of a command of several has to begin, from when it is sent: as long as the bridge gives by
/// itself. Steps that need no order, and checks, come before it.
const FIRST_STEP_MS: u32 = 5000;

/// Reports that are kept for an exchange that is followed later: more than the requests of a command have that are
/// begun together. A further one is discarded.
const MAX_KEPT: usize = 16;

/// The steps of one command: each names the one before, so that none is done after something newer. The first one was
/// issued with the command.
pub struct Steps {
    issued: MonotonicNs,
    deadline_ms: u32,
    /// The request that was the last step; 0 if there is none.
    before: u64,
}

impl Steps {
    /// None is done yet of the command that was given so.
    pub fn of(asked: &OrderContext) -> Steps {
        Steps::new(asked.issued, asked.deadline_ms)
    }

    /// None is done yet of a command that was given at `issued`, with so many ms to begin; 0 for the bridge's time.
    pub fn new(issued: MonotonicNs, deadline_ms: u32) -> Steps {
        Steps {
            issued,
            deadline_ms,
            before: 0,
        }
    }

    /// The request that was the last step, which the next one names; 0 if there is none.
    pub fn before(&self) -> u64 {
        self.before
    }

    /// The requests of the next step. Several are a path.
    pub fn next(&self, requests: impl IntoIterator<Item = MovementData>) -> Vec<MovementData> {
        let first_ms = match self.deadline_ms {
            0 => FIRST_STEP_MS,
            deadline_ms => deadline_ms,
        };
        let next = |request: MovementData| match self.before {
            0 => MovementData {
                issued_ns: self.issued.0,
                begin_by_ns: begin_by_ns(request.issued_ns, first_ms),
                ..request
            },
            before => complete(request.following(before), false, self.deadline_ms),
        };
        requests.into_iter().map(next).collect()
    }

    /// A step was done by these requests.
    pub fn done(&mut self, requests: &[MovementData]) {
        if let Some(last) = requests.last() {
            self.before = last.request_id;
        }
    }
}

/// A command that makes its requests and only follows them: over the service `key`, with what `requests` makes.
///
/// # Errors
///
/// As [`Conversation::follow`], and what `requests` fails with.
pub fn ask<R: Request>(
    verb: Verb,
    key: &'static str,
    args: &RequestArgs,
    requests: impl FnOnce(&OrderContext) -> Result<Vec<R>, Failure>,
) -> Result<(), Failure> {
    let asked = OrderContext::of(&args.ask)?;
    let requests = requests(&asked)?;
    Conversation::open_at(&asked.session, key, verb, asked.timeout)?
        .follow(&requests, Until::of(args), Format::of(args.ask.json))
        .map(drop)
}

/// A command whose one request goes out before anything else is read or printed.
///
/// # Errors
///
/// As [`Conversation::follow`].
pub fn ask_at_once<R: Request>(
    verb: Verb,
    key: &'static str,
    args: &RequestArgs,
    request: impl FnOnce(&UrgentContext) -> R,
) -> Result<(), Failure> {
    let asked = UrgentContext::of(&args.ask)?;
    let requests = [request(&asked)];
    let mut bridge = Conversation::open_at(&asked.session, key, verb, Duration::ZERO)?;
    let mut exchange = bridge.begin(&requests, Until::of(args))?;
    exchange.await_for(asked.timeout(), MonotonicNs::now());
    let format = Format::of(args.ask.json);
    bridge.follow_begun(exchange, &requests, format).map(drop)
}

/// Something that a command looks at while it follows a request.
pub trait Companion {
    /// What wakes it.
    fn source(&mut self) -> &mut dyn Source;

    /// Takes what is there.
    ///
    /// # Errors
    ///
    /// What ends the command.
    fn look(&mut self) -> Result<(), Failure>;

    /// Takes what it shows off the terminal: something else is printed.
    ///
    /// # Errors
    ///
    /// When standard output was closed.
    fn clear(&mut self) -> Result<(), Failure> {
        Ok(())
    }

    /// What it adds to the line about a report.
    fn remark(&self, _report: &RequestReport) -> String {
        String::new()
    }
}

/// A command's conversations with the bridge over one service.
pub struct Conversation<'a, R: Request> {
    verb: Verb,
    timeout: Duration,
    key: &'static str,
    session: &'a Session,
    client: Client<R>,
    inbox: Vec<RequestReport>,
    previous_value: Option<f64>,
    /// Why the last exchange failed, as its final report says.
    failed: Option<Reason>,
    /// Whether each line says which robot it is about: the command is about several.
    names_robot: bool,
    /// Of a path: what becomes of it without this command; `None` leaves it to the bridge.
    without_sender: Option<SenderLost>,
    companion: Option<&'a mut (dyn Companion + 'a)>,
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

    /// Opens a conversation over the service `key`, which carries `R` too.
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
            failed: None,
            names_robot: false,
            without_sender: None,
            companion: None,
        })
    }

    /// Says what becomes of the path when the command ends before it; `None` leaves it to the bridge.
    pub fn without_sender(mut self, action: Option<SenderLost>) -> Self {
        self.without_sender = action;
        self
    }

    /// Beside a companion, which looks whenever the command wakes, and once before the end. The command ends with what
    /// it fails with.
    pub fn beside(mut self, companion: &'a mut (dyn Companion + 'a)) -> Self {
        self.companion = Some(companion);
        self
    }

    /// Each line says which robot it is about.
    pub fn name_robot(mut self) -> Self {
        self.names_robot = true;
        self
    }

    /// From here on final reports about a parameter show the value that it had before, if that is known.
    pub fn show_previous(&mut self, value: Option<f64>) {
        self.previous_value = value;
    }

    /// Why the last exchange failed; `None` if it did not, or no final report has come.
    pub fn failed(&self) -> Option<Reason> {
        self.failed
    }

    /// Sends `requests`, prints the reports about them and returns the final one; `None` if the last request was
    /// accepted and that was enough.
    ///
    /// # Errors
    ///
    /// When the final report is not `done`, with the exit code that goes with it; when there is no bridge, when it does
    /// not answer in time, and when a signal or a closed output ends the command early.
    pub fn follow(
        &mut self,
        requests: &[R],
        until: Until,
        format: Format,
    ) -> Result<Option<RequestReport>, Failure> {
        let ids = requests.iter().map(Request::request_id);
        let exchange = Exchange::new(ids, until, self.timeout);
        let ended = self.follow_begun(exchange, requests, format);
        // When the reader of the output has gone, the outcome is known all the same.
        let _ = self.companion.as_mut().map(|one| one.clear());
        ended
    }

    /// Sends the first request, so that others can be sent before this one is followed.
    ///
    /// # Errors
    ///
    /// As [`Conversation::follow`].
    pub fn begin(&mut self, requests: &[R], until: Until) -> Result<Exchange, Failure> {
        let ids = requests.iter().map(Request::request_id);
        let mut exchange = Exchange::new(ids, until, self.timeout);
        if let Some(first) = requests.first() {
            self.send(first)?;
            exchange.sent(MonotonicNs::now());
        }
        Ok(exchange)
    }

    /// Follows what was begun.
    ///
    /// # Errors
    ///
    /// As [`Conversation::follow`].
    pub fn follow_begun(
        &mut self,
        mut exchange: Exchange,
        requests: &[R],
        format: Format,
    ) -> Result<Option<RequestReport>, Failure> {
        // Nobody was there to read it from the beginning when standard output was closed before: what was begun is
        // followed then.
        let prints = format != Format::Silent || self.companion.is_some();
        let output = prints.then(standard_output);
        let output = output.filter(|output| !output.is_closed());
        loop {
            let now = MonotonicNs::now();
            let printed = self.receive(&mut exchange, requests.len(), format, now);
            let looked = self.companion.as_mut().map_or(Ok(()), |one| one.look());
            let is_closed = output.is_some_and(|output| output.is_closed() || printed.is_err());
            match exchange.next(now) {
                Next::Over(outcome) => return self.judge(&exchange, outcome),
                _ if is_closed => {
                    let why = "standard output was closed";
                    return Err(self.leave(why, &exchange));
                }
                _ if self.session.termination.requested() => {
                    return Err(self.leave("interrupted", &exchange));
                }
                _ if looked.is_err() && output.is_some() => return looked.map(|()| None),
                Next::Send(index) => {
                    self.send(&requests[index])?;
                    exchange.sent(now);
                }
                Next::Wait(until) => {
                    let client: &mut dyn Source = &mut self.client;
                    let beside = self.companion.as_mut().map(|one| one.source());
                    let mut closed = output
                        .and_then(|output| output.closed())
                        .map(Descriptor::new);
                    let closed = closed.as_mut().map(|closed| closed as &mut dyn Source);
                    let others = [client].into_iter().chain(beside).chain(closed);
                    self.session.wait(others, until)?;
                }
            }
        }
    }

    /// Takes every report that is there, and prints it as long as that is possible.
    fn receive(
        &mut self,
        exchange: &mut Exchange,
        total: usize,
        format: Format,
        now: MonotonicNs,
    ) -> Result<(), Failure> {
        self.client.drain(|report| self.inbox.push(*report));
        let mut printed = Ok(());
        for report in std::mem::take(&mut self.inbox) {
            match exchange.take(&report, now) {
                Some(index) => {
                    let place = (index, total);
                    printed = printed.and_then(|()| self.print(place, &report, format));
                }
                // It is about a request that was begun as well, and is followed later.
                None if self.inbox.len() < MAX_KEPT => self.inbox.push(report),
                None => {}
            }
        }
        printed
    }

    /// Prints a report about the request of this index, of so many.
    fn print(
        &mut self,
        (index, total): (usize, usize),
        report: &RequestReport,
        format: Format,
    ) -> Result<(), Failure> {
        let robot = self.names_robot.then(|| self.session.ipc.robot().get());
        let weight = match report.is_final() {
            true => Weight::Result,
            false => Weight::Progress,
        };
        match format {
            Format::Silent => Ok(()),
            Format::Json => {
                let object = ReportObject::new(self.verb, report);
                let object = object.with_previous(report, self.previous_value);
                tell(weight, json_text(&object.of_robot(robot))?)
            }
            // It is the error that the command ends with, and is printed as that.
            Format::Text if is_failure(report) => Ok(()),
            Format::Text => match messages::line(self.verb, index, total, report) {
                None => Ok(()),
                Some(line) => {
                    let was = messages::previous(report, self.previous_value);
                    let remark = self.companion.as_ref().map(|one| one.remark(report));
                    if let Some(companion) = &mut self.companion {
                        companion.clear()?;
                    }
                    let robot = robot.map_or_else(String::new, |robot| format!("robot {robot}: "));
                    let remark = remark.unwrap_or_default();
                    tell(weight, format!("{robot}{line}{was}{remark}\n"))
                }
            },
        }
    }

    fn send(&mut self, request: &R) -> Result<(), Failure> {
        match self.client.send(request) {
            Ok(_) => Ok(()),
            Err(SendError::NoServer { .. }) => Err(absent(self.session, self.key)),
            Err(error @ SendError::ServerFull) => Err(Failure::new(ExitCode::Timeout, error)),
            Err(
                error @ (SendError::TooManyOutstanding
                | SendError::NoPlace(_)
                | SendError::Failed(_)),
            ) => Err(Failure::internal(error)),
        }
    }

    /// What the command ends with.
    fn judge(
        &mut self,
        exchange: &Exchange,
        outcome: Outcome,
    ) -> Result<Option<RequestReport>, Failure> {
        let total = exchange.requests.len();
        match outcome {
            Outcome::Accepted => Ok(None),
            Outcome::Final(end) => self.judge_final(&exchange.placed(end)),
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

    fn judge_final(&mut self, end: &FinalReport) -> Result<Option<RequestReport>, Failure> {
        match end.exit_code() {
            ExitCode::Ok => Ok(Some(end.report)),
            code => {
                self.failed = Some(end.reason);
                let (text, next_step) = messages::ending_parts(self.verb, end);
                let failure = Failure::new(code, text);
                Err(match next_step {
                    Some(next_step) => failure.with_next_step(next_step),
                    None => failure,
                })
            }
        }
    }

    /// The command ends before the final report.
    fn leave(&self, why: &str, exchange: &Exchange) -> Failure {
        let (progress, total) = (exchange.progress(), exchange.requests.len());
        let what = match progress {
            Progress::Incomplete if total > 1 => {
                "the path was not complete, so nothing of it is flown".to_owned()
            }
            Progress::Taken => messages::without_sender(self.verb, self.without_sender).to_owned(),
            Progress::Incomplete => {
                "it was withdrawn before the bridge answered; `ril status` shows whether it took effect".to_owned()
            }
        };
        let name = self.verb.name();
        let text = format!("{why} before the final report about {name}: {what}");
        Failure::new(ExitCode::OutcomeUnknown, text)
    }
}
