//! [`Requests`]: sends requests of any of the robot's services, and follows each to its final report.

use std::collections::VecDeque;
use std::os::fd::{AsRawFd, RawFd};
use std::time::{Duration, Instant};

use ipc_types::code::{ControlCommand, Reason, Stage};
use ipc_types::payload::{
    ModuleControl, MovementData, ParameterRequest, RequestReport, SharedStruct, WaypointPosition,
};
use ipc_types::{Client, Ipc, Request, Source, Waiter, Wake, fresh_request_id};

use crate::error::Error;

/// Reports that wait for a caller who does not ask for them. When there are more, the oldest is dropped: it belongs to a
/// request that nobody follows.
const MAX_WAITING: usize = 256;

/// How long a waypoint of a path may take to be taken. The bridge answers in less than a millisecond.
const WAYPOINT_TIMEOUT: Duration = Duration::from_secs(5);

/// A client of each request service, made when it is first needed.
pub struct Requests {
    ipc: Ipc,
    control: Option<Client<ModuleControl>>,
    movement: Option<Client<MovementData>>,
    parameters: Option<Client<ParameterRequest>>,
    /// Reports that were received and not asked for yet.
    waiting: VecDeque<RequestReport>,
    /// Waypoints of paths before the last one, whose reports nobody wants unless they are refused.
    quiet: Vec<u64>,
    waiter: Waiter,
}

/// What came of waiting for a report.
#[derive(Debug)]
pub enum Answer {
    /// A report.
    Report(RequestReport),
    /// The time is over.
    Nothing,
    /// A signal came first.
    Interrupted,
}

fn client<'c, R: Request>(
    client: &'c mut Option<Client<R>>,
    ipc: &Ipc,
) -> Result<&'c mut Client<R>, Error> {
    match client {
        Some(client) => Ok(client),
        None => Ok(client.insert(ipc.client::<R>()?)),
    }
}

/// A request out of a caller's bytes.
fn request<R: SharedStruct>(bytes: &[u8]) -> Result<R, Error> {
    R::from_bytes(bytes).ok_or_else(|| {
        Error::Layout(format!(
            "a request `{}` has {} bytes, {} were given",
            R::TYPE_NAME,
            size_of::<R>(),
            bytes.len()
        ))
    })
}

impl Requests {
    /// A part in the requests of a robot; opens nothing yet.
    pub fn new(ipc: &Ipc) -> Requests {
        Requests {
            ipc: ipc.clone(),
            control: None,
            movement: None,
            parameters: None,
            waiting: VecDeque::new(),
            quiet: Vec::new(),
            waiter: Waiter::new(),
        }
    }

    /// Sends a request of the service `key` as its struct's bytes. A `request_id` of 0 is replaced by a fresh one. Returns the
    /// request's id.
    ///
    /// # Errors
    ///
    /// When it was not sent.
    pub fn send_bytes(&mut self, key: &str, bytes: &[u8]) -> Result<u64, Error> {
        match key {
            ModuleControl::KEY => self.send_control(request(bytes)?),
            MovementData::KEY => self.send_movement(request(bytes)?),
            ParameterRequest::KEY => self.send_parameter(request(bytes)?),
            _ => Err(Error::Invalid(format!(
                "`{key}` is no request service of the robot: use `{}`, `{}` or `{}`",
                ModuleControl::KEY,
                MovementData::KEY,
                ParameterRequest::KEY
            ))),
        }
    }

    fn send_control(&mut self, mut request: ModuleControl) -> Result<u64, Error> {
        choose(&mut request.request_id);
        client(&mut self.control, &self.ipc)?.send(&request)?;
        Ok(request.request_id)
    }

    fn send_movement(&mut self, mut request: MovementData) -> Result<u64, Error> {
        choose(&mut request.request_id);
        client(&mut self.movement, &self.ipc)?.send(&request)?;
        Ok(request.request_id)
    }

    fn send_parameter(&mut self, mut request: ParameterRequest) -> Result<u64, Error> {
        choose(&mut request.request_id);
        client(&mut self.parameters, &self.ipc)?.send(&request)?;
        Ok(request.request_id)
    }

    /// Starts or stops the module.
    ///
    /// # Errors
    ///
    /// When the request was not sent.
    pub fn control(&mut self, command: ControlCommand) -> Result<u64, Error> {
        self.send_control(ModuleControl::new(0, command))
    }

    /// Takes off and climbs to so many meters over the point of take-off.
    ///
    /// # Errors
    ///
    /// When the request was not sent.
    pub fn take_off(&mut self, altitude_m: f64) -> Result<u64, Error> {
        self.send_movement(MovementData::take_off(0, altitude_m))
    }

    /// Lands; with `preempt` out of a path that is under way.
    ///
    /// # Errors
    ///
    /// When the request was not sent.
    pub fn land(&mut self, preempt: bool) -> Result<u64, Error> {
        let land = MovementData::land(0);
        self.send_movement(if preempt { land.preempting() } else { land })
    }

    /// Hovers on the spot; a path that is under way ends as replaced.
    ///
    /// # Errors
    ///
    /// When the request was not sent.
    pub fn hold(&mut self) -> Result<u64, Error> {
        self.send_movement(MovementData::hold(0))
    }

    /// Flies a path. Returns the id of the request to follow: that of the last waypoint, or of the one that was refused.
    ///
    /// Each waypoint before the last is accepted before the next one is sent, which takes less than a millisecond. What else the
    /// bridge says about these is of no interest unless it is a refusal (docs/ipc.md, "a path").
    ///
    /// # Errors
    ///
    /// When a waypoint was not sent.
    pub fn go_to(&mut self, path: &[WaypointPosition], preempt: bool) -> Result<u64, Error> {
        let Some(last) = path.len().checked_sub(1) else {
            return Err(Error::Invalid(
                "a path needs at least one waypoint".to_owned(),
            ));
        };
        let path_id = fresh_request_id();
        for (index, waypoint) in MovementData::path(path_id, path, fresh_request_id).enumerate() {
            let waypoint = match preempt {
                true => waypoint.preempting(),
                false => waypoint,
            };
            let id = self.send_movement(waypoint)?;
            if index == last {
                return Ok(id);
            }
            if let Some(refused) = self.refusal(id, path_id)? {
                return Ok(refused);
            }
            self.quiet.push(id);
        }
        unreachable!("the last waypoint returns")
    }

    /// Waits until a waypoint is accepted. If the path is broken instead, this is the request whose final report says why; it is
    /// left for the caller.
    fn refusal(&mut self, id: u64, path_id: u64) -> Result<Option<u64>, Error> {
        let deadline = Instant::now() + WAYPOINT_TIMEOUT;
        loop {
            match self.next_report(id, deadline.saturating_duration_since(Instant::now()))? {
                Answer::Report(report) if !report.is_final() => return Ok(None),
                Answer::Report(report) => {
                    self.waiting.push_back(report);
                    // An earlier waypoint's reason is the cause of this one's.
                    let of_path = |report: &&RequestReport| report.path_id == path_id;
                    let first = self.waiting.iter().find(of_path);
                    return Ok(first.map(|report| report.request_id));
                }
                Answer::Interrupted => {}
                Answer::Nothing => {
                    return Err(Error::NoAnswer);
                }
            }
        }
    }

    /// The oldest report about the request `id`, of any request for 0, waiting for it as long as `timeout`.
    ///
    /// # Errors
    ///
    /// When waiting is not possible.
    pub fn next_report(&mut self, id: u64, timeout: Duration) -> Result<Answer, Error> {
        let mut deadline = None;
        loop {
            self.drain();
            let place = self
                .waiting
                .iter()
                .position(|report| id == 0 || report.request_id == id);
            if let Some(report) = place.and_then(|place| self.waiting.remove(place)) {
                return Ok(Answer::Report(report));
            }
            let now = Instant::now();
            let until = *deadline.get_or_insert(now + timeout);
            if now >= until || self.outstanding() == 0 {
                return Ok(Answer::Nothing);
            }
            let left = Some(until - now);
            let waiter = std::mem::take(&mut self.waiter);
            let mut sources: Vec<_> = self
                .sources()
                .into_iter()
                .map(|source| ((), source))
                .collect();
            let wake = waiter.wait(&mut sources, left);
            self.waiter = waiter;
            if wake? == Wake::Interrupted {
                return Ok(Answer::Interrupted);
            }
        }
    }

    /// Receives what is there.
    fn drain(&mut self) {
        let (waiting, quiet) = (&mut self.waiting, &mut self.quiet);
        let mut take = |report: &RequestReport| {
            if let Some(place) = quiet.iter().position(|id| *id == report.request_id) {
                if report.is_final() {
                    quiet.swap_remove(place);
                }
                if !report.is_final() || report.stage() == Some(Stage::Done) {
                    return;
                }
            }
            if waiting.len() == MAX_WAITING {
                waiting.pop_front();
            }
            waiting.push_back(*report);
        };
        if let Some(client) = &mut self.control {
            client.drain(&mut take);
        }
        if let Some(client) = &mut self.movement {
            client.drain(&mut take);
        }
        if let Some(client) = &mut self.parameters {
            client.drain(&mut take);
        }
    }

    /// Requests without a final report.
    pub fn outstanding(&self) -> usize {
        fn of<R: Request>(client: &Option<Client<R>>) -> usize {
            client.as_ref().map_or(0, Client::outstanding)
        }
        of(&self.control) + of(&self.movement) + of(&self.parameters)
    }

    /// Whether a report was received that nobody has asked for yet.
    pub fn has_waiting(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// The clients that are open, to wait for.
    pub fn sources(&mut self) -> Vec<&mut dyn Source> {
        fn of<R: Request>(client: &mut Option<Client<R>>) -> Option<&mut dyn Source> {
            client.as_mut().map(|client| client as &mut dyn Source)
        }
        [
            of(&mut self.control),
            of(&mut self.movement),
            of(&mut self.parameters),
        ]
        .into_iter()
        .flatten()
        .collect()
    }

    /// Descriptors that can be read once there are reports, for an event loop. They change when the bridge starts again: ask
    /// after each [`next_report`](Requests::next_report), and look all the same every [`RECHECK_MS`](crate::topic::RECHECK_MS).
    ///
    /// # Errors
    ///
    /// When there are more listeners than the contract allows.
    pub fn descriptors(&self) -> Result<Vec<RawFd>, Error> {
        fn of<R: Request>(client: &Option<Client<R>>) -> Result<Option<RawFd>, Error> {
            let descriptor = client.as_ref().map(Client::descriptor).transpose()?;
            Ok(descriptor.flatten().map(|fd| fd.as_raw_fd()))
        }
        let all = [
            of(&self.control)?,
            of(&self.movement)?,
            of(&self.parameters)?,
        ];
        Ok(all.into_iter().flatten().collect())
    }

    /// Gives up all requests without a final report: the bridge sees them as vanished.
    pub fn give_up(&mut self) {
        if let Some(client) = &mut self.control {
            client.give_up();
        }
        if let Some(client) = &mut self.movement {
            client.give_up();
        }
        if let Some(client) = &mut self.parameters {
            client.give_up();
        }
        self.waiting.clear();
        self.quiet.clear();
    }
}

fn choose(id: &mut u64) {
    if *id == 0 {
        *id = fresh_request_id();
    }
}

/// Name of a stage, such as `done`.
pub fn stage_name(code: u32) -> &'static str {
    Stage::from_code(code).map_or("unknown-stage", Stage::name)
}

/// Name of a reason, such as `not-flying`.
pub fn reason_name(code: u32) -> &'static str {
    Reason::from_code(code).map_or("unknown-reason", Reason::name)
}
