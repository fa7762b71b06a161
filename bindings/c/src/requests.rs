//! [`Requests`]: sends requests to the robot's own services and to those of modules, and follows each to its final
//! report.

use std::collections::VecDeque;
use std::os::fd::{AsRawFd, RawFd};
use std::time::{Duration, Instant};

use ipc_types::code::{ControlCommand, Reason, SenderLost, Stage};
use ipc_types::lease::LEASES_MS;
use ipc_types::payload::{ModuleControl, MovementData, RequestReport, WaypointPosition};
use ipc_types::waiter::SAFETY_BOUND;
use ipc_types::{
    DynamicClient, Ipc, Request, SendError, Source, Waiter, Wake, fresh_request_id, keep_report,
};

use crate::error::Error;
use crate::service::ServiceName;

/// Reports that wait until the caller asks for them. When there are more, the oldest that is not final is dropped; when
/// all are final, the oldest: it belongs to a request that the caller does not follow.
const MAX_WAITING: usize = 256;

/// Most waypoints of a path: a path of more is refused by the bridge.
const MAX_WAYPOINTS: usize = 1024;

/// How long sending waits for one of eight requests to end. A hold that is replaced ends in less than a millisecond.
const ROOM_TIMEOUT: Duration = SAFETY_BOUND;

/// How long a waypoint of a path may take to be taken. The bridge answers in less than a millisecond.
const WAYPOINT_TIMEOUT: Duration = Duration::from_secs(5);

/// A client of each request service, made when a request is first sent to it.
pub struct Requests {
    ipc: Ipc,
    clients: Vec<DynamicClient>,
    /// Reports that were received and not asked for yet.
    waiting: VecDeque<RequestReport>,
    /// Waypoints of paths before the last one, of whose reports only a refusal is handed on.
    quiet: Vec<u64>,
    /// What becomes of the paths of [`Requests::go_to`] without this program: a number of `SenderLost`, and a lease.
    when_lost: (u32, u32),
    /// The step before of the next request; 0 if it follows no other.
    before: u64,
    waiter: Waiter,
}

/// What came of waiting for a report.
#[derive(Debug)]
pub enum ReportWait {
    /// A report.
    Report(RequestReport),
    /// The time is over.
    Nothing,
    /// A signal came first.
    Interrupted,
}

impl Requests {
    /// A part in the requests of a robot; opens nothing yet.
    pub fn new(ipc: &Ipc) -> Requests {
        Requests {
            ipc: ipc.clone(),
            clients: Vec::new(),
            waiting: VecDeque::new(),
            quiet: Vec::new(),
            when_lost: (0, 0),
            before: 0,
            waiter: Waiter::new(),
        }
    }

    /// Sends a request as its struct's bytes, to the robot's own services or to a module's. A `request_id` of 0 is
    /// replaced by a fresh one. Returns the request's id.
    ///
    /// A request that has ended does not count as open, whether or not its reports were read. While as many are open as
    /// can be, this waits for one to end, 0.25 s at most.
    ///
    /// # Errors
    ///
    /// When it was not sent.
    pub fn send(&mut self, service: &ServiceName<'_>, request: &[u8]) -> Result<u64, Error> {
        // The number of bytes is the size of the caller's struct.
        let service = ServiceName {
            size: request.len(),
            ..*service
        };
        let place = self
            .clients
            .iter()
            .position(|client| client.key() == service.key);
        let place = match place {
            Some(place) => {
                service.check_client(&self.clients[place])?;
                place
            }
            None => {
                self.clients.push(service.client(&self.ipc)?);
                self.clients.len() - 1
            }
        };
        let deadline = Instant::now() + ROOM_TIMEOUT;
        loop {
            let client = &mut self.clients[place];
            let left = deadline.saturating_duration_since(Instant::now());
            match client.send(request) {
                Err(SendError::TooManyOutstanding) if !left.is_zero() => client.wait(left)?,
                sent => return Ok(sent?),
            };
            self.drain();
        }
    }

    /// The next start, stop or movement is the step of a command whose step before is the request `before`: it is taken
    /// only if nothing came between.
    pub fn follow(&mut self, before: u64) {
        self.before = before;
    }

    fn movement(&mut self, movement: MovementData) -> Result<u64, Error> {
        let before = std::mem::take(&mut self.before);
        self.send_own(&movement.following(before))
    }

    /// Sends a request of the robot's own.
    fn send_own<R: Request>(&mut self, request: &R) -> Result<u64, Error> {
        self.send(&ServiceName::of_key(R::KEY), request.bytes())
    }

    /// Starts or stops the module.
    ///
    /// # Errors
    ///
    /// When the request was not sent.
    pub fn control(&mut self, command: ControlCommand) -> Result<u64, Error> {
        let control = ModuleControl {
            after: std::mem::take(&mut self.before),
            ..ModuleControl::new(0, command)
        };
        self.send_own(&control)
    }

    /// Takes off and climbs to this height above take-off, m.
    ///
    /// # Errors
    ///
    /// When the request was not sent.
    pub fn take_off(&mut self, altitude_m: f64) -> Result<u64, Error> {
        self.movement(MovementData::take_off(0, altitude_m))
    }

    /// Lands; with `preempt` out of a path that is under way.
    ///
    /// # Errors
    ///
    /// When the request was not sent.
    pub fn land(&mut self, preempt: bool) -> Result<u64, Error> {
        let land = MovementData::land(0);
        self.movement(if preempt { land.preempting() } else { land })
    }

    /// Hovers on the spot; a path that is under way ends as replaced.
    ///
    /// # Errors
    ///
    /// When the request was not sent.
    pub fn hold(&mut self) -> Result<u64, Error> {
        self.movement(MovementData::hold(0))
    }

    /// From now on a path of [`Requests::go_to`] says what becomes of it when this program ends: a `SenderLost`, or 0
    /// for the bridge's default. With a lease that is not 0, ms, the same when this program does not look at its
    /// reports for so long.
    ///
    /// # Errors
    ///
    /// When the contract has no such action, or lease.
    pub fn when_lost(&mut self, action: u32, lease_ms: u32) -> Result<(), Error> {
        let is_known = action == 0 || SenderLost::from_code(action).is_some();
        if !is_known || lease_ms != 0 && !LEASES_MS.contains(&lease_ms) {
            return Err(Error::Invalid(format!(
                "a path says 0 to 3, and has a lease of {} to {} ms, or of 0; {action} and {lease_ms} were given",
                LEASES_MS.start(),
                LEASES_MS.end()
            )));
        }
        self.when_lost = (action, lease_ms);
        Ok(())
    }

    /// Flies a path. Returns the id of the request to follow: that of the last waypoint, or of the one that was
    /// refused.
    ///
    /// Each waypoint before the last is accepted before the next one is sent, which takes less than a millisecond. What
    /// else the bridge says about these is of no interest unless it is a refusal (docs/ipc.md, "a path").
    ///
    /// # Errors
    ///
    /// When a waypoint was not sent.
    pub fn go_to(&mut self, path: &[WaypointPosition], preempt: bool) -> Result<u64, Error> {
        let before = std::mem::take(&mut self.before);
        check_waypoints(path.len())?;
        let last = path.len() - 1;
        let path_id = fresh_request_id();
        for (index, waypoint) in MovementData::path(path_id, path, fresh_request_id).enumerate() {
            let waypoint = waypoint.following(before);
            let waypoint = match preempt {
                true => waypoint.preempting(),
                false => waypoint,
            };
            let (sender_lost, lease_ms) = self.when_lost;
            let id = self.send_own(&MovementData {
                sender_lost,
                lease_ms,
                ..waypoint
            })?;
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

    /// Waits until a waypoint is accepted. If the path is broken instead, this is the request whose final report says
    /// why; it is left for the caller.
    fn refusal(&mut self, id: u64, path_id: u64) -> Result<Option<u64>, Error> {
        let deadline = Instant::now() + WAYPOINT_TIMEOUT;
        loop {
            match self.next_report(id, deadline.saturating_duration_since(Instant::now()))? {
                ReportWait::Report(report) if !report.is_final() => return Ok(None),
                ReportWait::Report(report) => {
                    self.waiting.push_back(report);
                    // An earlier waypoint's reason is the cause of this one's.
                    let of_path = |report: &&RequestReport| report.path_id == path_id;
                    let first = self.waiting.iter().find(of_path);
                    return Ok(first.map(|report| report.request_id));
                }
                ReportWait::Interrupted => {}
                ReportWait::Nothing => {
                    return Err(Error::NoAnswer);
                }
            }
        }
    }

    /// The oldest report about the request `id`, of any request for 0, waiting for it as long as `timeout`.
    ///
    /// # Errors
    ///
    /// [`Error::NotOpen`] when no report about `id` can come any more; and when waiting is not possible.
    pub fn next_report(&mut self, id: u64, timeout: Duration) -> Result<ReportWait, Error> {
        self.ipc.check_process()?;
        let mut deadline = None;
        loop {
            self.drain();
            let place = self
                .waiting
                .iter()
                .position(|report| id == 0 || report.request_id == id);
            if let Some(report) = place.and_then(|place| self.waiting.remove(place)) {
                return Ok(ReportWait::Report(report));
            }
            if id != 0 && !self.clients.iter().any(|client| client.is_open(id)) {
                return Err(Error::NotOpen(id));
            }
            let now = Instant::now();
            let until = *deadline.get_or_insert(now + timeout);
            if now >= until {
                return Ok(ReportWait::Nothing);
            }
            let left = Some(until - now);
            let clients = self.clients.iter_mut();
            let mut sources: Vec<_> = clients
                .map(|client| ((), client as &mut dyn Source))
                .collect();
            if self.waiter.wait(&mut sources, left)? == Wake::Interrupted {
                return Ok(ReportWait::Interrupted);
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
            keep_report(waiting, *report, MAX_WAITING);
        };
        for client in &mut self.clients {
            client.drain(&mut take);
        }
    }

    /// Whether a report was received that the caller has not asked for yet.
    pub fn has_waiting(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// The clients that are open, to wait for.
    pub fn sources(&mut self) -> Vec<&mut dyn Source> {
        let clients = self.clients.iter_mut();
        clients.map(|client| client as &mut dyn Source).collect()
    }

    /// Descriptors that can be read once there may be reports, for an event loop: one for each service that was sent
    /// to, the same for as long as this lives.
    ///
    /// # Errors
    ///
    /// When the process has too many descriptors.
    pub fn descriptors(&self) -> Result<Vec<RawFd>, Error> {
        let mut descriptors = Vec::with_capacity(self.clients.len());
        for client in &self.clients {
            descriptors.push(client.descriptor()?.as_raw_fd());
        }
        Ok(descriptors)
    }

    /// Gives up all requests without a final report: the bridge sees them as vanished.
    pub fn give_up(&mut self) {
        for client in &mut self.clients {
            client.give_up();
        }
        self.waiting.clear();
        self.quiet.clear();
    }
}

/// Whether a path can have so many waypoints.
///
/// # Errors
///
/// [`Error::Invalid`] when it cannot.
pub fn check_waypoints(count: usize) -> Result<(), Error> {
    match count {
        1..=MAX_WAYPOINTS => Ok(()),
        _ => Err(Error::Invalid(format!(
            "a path has 1 to {MAX_WAYPOINTS} waypoints, {count} were given"
        ))),
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
