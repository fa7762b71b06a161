//! [`Client`]: sends requests, several at once, and follows the reports about each to its final report.
//! [`RequestHandle`] follows one of them: what an action's goal handle is in ROS 2. `ClientPort` is a client's part in
//! one generation, and what iceoryx2 asks of it.
//!
//! Nothing is fire-and-forget: a request without a server is refused here, and one whose server vanishes ends with
//! [`Reason::BridgeGone`], so that its sender never waits for ever. Whether the request was carried out is then
//! unknown.

use std::collections::VecDeque;
use std::mem;
use std::sync::Arc;
use std::time::Duration;

use iceoryx2::pending_response::PendingResponse;
use iceoryx2::port::client::RequestSendError;
use iceoryx2::port::{BackpressureAction, SendError as IoxSendError};
use iceoryx2::prelude::{BackpressureStrategy, PortFactory};
use iceoryx2::service::port_factory::client::ClientCreateError;

use crate::code::{Reason, Stage};
use crate::doorbell::ServiceEvent;
use crate::follow::{Follower, until_room};
use crate::generation::{self, Generation};
use crate::iox::{AnyRequest, RequestService, Svc};
use crate::lease::Lease;
use crate::open::{self, Offer, OpenError};
use crate::payload::RequestReport;
use crate::pollable::Pollable;
use crate::port::{self, Payload, Port};
use crate::provider::LockWatch;
use crate::random::fresh_request_id;
use crate::sequence::word;
use crate::service::{
    MAX_CLIENTS, MAX_OUTSTANDING, REQUEST_ID_OFFSET, RESPONSE_BUFFER, service_name,
};
use crate::session::Session;
use crate::time::MonotonicNs;
use crate::waiter::{SAFETY_BOUND, WaitError, Waiter, sealed};
use crate::wake::{Event, WakeReceiver, WakeSender};

/// How often a waiting client looks whether its server still lives, which takes two system calls.
const LIVENESS_PERIOD: Duration = SAFETY_BOUND;

/// So many numbers a client's requests may begin with. Passing over one takes 0.2 µs.
const NUMBERS: u64 = 1 << 12;

/// A request was not sent.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SendError {
    /// No process serves: the bridge of this robot, or the module, does not run.
    #[error("no process serves {service} of robot {robot}: start {}", server_of(.service))]
    NoServer {
        /// Key of the service.
        service: String,
        /// Of which robot.
        robot: u32,
    },
    /// Too many requests of this client are open.
    #[error("{MAX_OUTSTANDING} requests are open: wait for final reports")]
    TooManyOutstanding,
    /// The service has as many clients as it can have.
    #[error("the request was not sent ({0})")]
    NoPlace(String),
    /// The server does not read its requests.
    #[error("the server does not take requests: its queue is full")]
    ServerFull,
    /// iceoryx2 failed.
    #[error("the request was not sent ({0})")]
    Failed(String),
}

/// The process that has to be started for a service.
fn server_of(key: &str) -> String {
    match key.split_once('/') {
        Some((module, _)) => format!("its module `{module}`"),
        None => "its bridge".to_owned(),
    }
}

/// Sends requests and follows their reports.
///
/// ```no_run
/// use ipc_types::payload::MovementData;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let robot = ipc_types::Ipc::connect("operator")?;
/// let mut client = robot.client::<MovementData>()?;
/// let order = MovementData::take_off(ipc_types::fresh_request_id(), 10.0);
/// println!("{:?}", client.request(&order)?.result()?.stage());
/// # Ok(())
/// # }
/// ```
///
/// [`Client::request`] follows one request; [`Client::send`] and [`Client::drain`] follow several at once.
pub type Client<R> = Port<BytesClient, R>;

impl<P: Payload> Client<P> {
    /// Sends a request, and follows it alone: its progress and its result.
    ///
    /// # Errors
    ///
    /// See [`SendError`]; nothing was sent then.
    pub fn request(&mut self, request: &P::View) -> Result<RequestHandle<'_>, SendError> {
        RequestHandle::send(&mut self.core, &self.waiter, P::as_bytes(request))
    }

    /// Sends a request: a struct, or of a [`Schema`](crate::Schema) as many bytes as that says. Its reports come out of
    /// [`Client::drain`], the last with a final stage. A `request_id` of 0 is replaced by a fresh one. Returns the
    /// request's id.
    ///
    /// Requests whose final report has come do not count as open, drained or not: their reports are kept for the next
    /// drain, see [`keep_report`].
    ///
    /// # Errors
    ///
    /// See [`SendError`]; nothing was sent then.
    pub fn send(&mut self, request: &P::View) -> Result<u64, SendError> {
        self.core.send(P::as_bytes(request))
    }

    /// Hands on every report that is there and says how many those were. A request whose server is gone gets its final
    /// report from here: [`Stage::Unknown`](crate::code::Stage::Unknown),
    /// [`Reason::BridgeGone`].
    pub fn drain(&mut self, take: impl FnMut(&RequestReport)) -> usize {
        self.core.drain(take)
    }

    /// Gives up all open requests: their server sees them as vanished.
    pub fn give_up(&mut self) {
        self.core.give_up();
    }

    /// Gives up one request: its server sees it as vanished.
    pub fn give_up_one(&mut self, request_id: u64) {
        self.core.give_up_one(request_id);
    }

    /// Whether this request was sent and its final report has not come yet.
    pub fn is_open(&self, request_id: u64) -> bool {
        let mut open = self.core.outstanding.iter();
        open.any(|outstanding| outstanding.request_id == request_id)
    }

    /// Requests without a final report.
    pub fn outstanding(&self) -> usize {
        self.core.outstanding.len()
    }

    /// Whether a live process serves. One that hangs counts as alive.
    pub fn is_server_alive(&self) -> bool {
        let provider = self.core.session.provider(self.key());
        provider.is_ok_and(|provider| provider.is_some())
    }
}

/// Reports that a client keeps for its next drain: as many as can wait unread, 64. [`keep_report`] says which are
/// dropped at the bound.
const MAX_KEPT: usize = MAX_OUTSTANDING * RESPONSE_BUFFER;

/// Keeps a report that the program has not asked for yet, beside at most `most` others. At that bound the oldest that
/// is not final is dropped; when all are final, the oldest.
pub fn keep_report(kept: &mut VecDeque<RequestReport>, report: RequestReport, most: usize) {
    if kept.len() >= most {
        let oldest = kept.iter().position(|report| !report.is_final());
        kept.remove(oldest.unwrap_or_default());
    }
    kept.push_back(report);
}

/// Sends requests that are bytes.
pub struct BytesClient {
    // First, so that the server sees the requests closed before it is woken by the end of the sender.
    outstanding: Vec<Outstanding>,
    /// `None` while no server has been there.
    port: Option<ClientPort>,
    /// The ports of former generations, for as long as requests are open there.
    former: Vec<ClientPort>,
    /// Reports that came while a handle followed another request, or while a request was sent.
    kept: VecDeque<RequestReport>,
    /// Of the paths that are open: renewed whenever the program looks at its client.
    leases: Vec<Lease>,
    follower: Follower,
    pollable: Pollable,
    offer: Offer,
    session: Arc<Session>,
}

// SAFETY: a client owns all that shares its counts of references, see [`Svc`]; no other thread has any of it.
#[allow(unsafe_code)]
unsafe impl Send for BytesClient {}

impl BytesClient {
    pub(crate) fn open(session: &Arc<Session>, offer: Offer) -> Result<BytesClient, OpenError> {
        let mut client = BytesClient {
            outstanding: Vec::with_capacity(MAX_OUTSTANDING),
            port: None,
            former: Vec::new(),
            kept: VecDeque::new(),
            leases: Vec::new(),
            follower: Follower::new(session, &offer.key),
            pollable: Pollable::default(),
            offer,
            session: Arc::clone(session),
        };
        let key = client.offer.key.clone();
        match until_room(session, &key, || client.follow()) {
            // Its server has gone in this moment, or goes: the next one will be followed.
            Err(error) if error.may_pass() => {
                crate::log::debug!(%error, "there is no server yet");
            }
            result => result?,
        }
        Ok(client)
    }

    /// Enters another generation if there is one.
    fn enter(&self) -> Result<Option<ClientPort>, OpenError> {
        let present = self.port.as_ref().map(|port| port.generation.name());
        self.follower.follow(present, |session, generation| {
            ClientPort::open(session, generation, &self.offer)
        })
    }

    /// Enters another generation if there is one.
    fn follow(&mut self) -> Result<(), OpenError> {
        self.drop_former();
        match self.follower.is_due() {
            true => self.change_generation(),
            false => Ok(()),
        }
    }

    fn drop_former(&mut self) {
        let open = &self.outstanding;
        self.former
            .retain(|port| open.iter().any(|request| request.is_of(port)));
    }

    /// Apart from `follow`, which every request calls: a port that is moved about takes microseconds.
    #[cold]
    fn change_generation(&mut self) -> Result<(), OpenError> {
        let entered = match self.enter() {
            Err(error) if error.is_no_room() && self.session.make_room() => {
                self.follower.forget();
                self.enter()?
            }
            entered => entered?,
        };
        if let Some(port) = entered {
            self.pollable.change(&port.responses);
            self.former.extend(self.port.replace(port));
            self.drop_former();
        }
        Ok(())
    }

    /// Sends a request, and returns its id: the sender's own, or a fresh one for 0.
    fn send(&mut self, request: &[u8]) -> Result<u64, SendError> {
        self.session
            .check_process()
            .map_err(|forked| SendError::Failed(forked.to_string()))?;
        let schema = &self.offer.schema;
        if request.len() != schema.size() {
            return Err(SendError::Failed(format!(
                "a request `{}` has {} bytes, {} were given",
                schema.type_name(),
                schema.size(),
                request.len()
            )));
        }
        if self.outstanding.len() >= MAX_OUTSTANDING {
            self.keep_what_came();
        }
        if self.outstanding.len() >= MAX_OUTSTANDING {
            return Err(SendError::TooManyOutstanding);
        }
        self.follow().map_err(|error| match error {
            OpenError::Full { .. } => SendError::NoPlace(error.to_string()),
            error if error.may_pass() && !self.is_served() => self.no_server(),
            error => SendError::Failed(error.with_cause()),
        })?;
        let port = self.port.as_ref().filter(|port| port.server.look());
        let port = port.ok_or_else(|| self.no_server())?;
        let request_id = match word(request, REQUEST_ID_OFFSET) {
            0 => fresh_request_id(),
            given => given,
        };
        let path_id = self.offer.path_offset.map(|offset| word(request, offset));
        let path_id = path_id.unwrap_or_default();
        let lease = self.lease(request, path_id)?;
        let pending = port
            .deliver(request, request_id)
            .map_err(|error| match error {
                SendError::Failed(_) if !self.is_served() => self.no_server(),
                error => error,
            })?;
        if pending.number_of_server_connections() == 0 {
            // It lives, but it has not read anything of this client yet, and the queue is full; or it ends at this
            // moment.
            return Err(match port.has_server() {
                true => SendError::ServerFull,
                false => self.no_server(),
            });
        }
        port.requests.wake();
        self.leases.extend(lease);
        self.outstanding.push(Outstanding {
            pending,
            request_id,
            path_id,
            generation: port.generation.name().to_owned(),
        });
        Ok(request_id)
    }

    /// The lease that a request asks for and its path does not have yet.
    fn lease(&self, request: &[u8], path_id: u64) -> Result<Option<Lease>, SendError> {
        let offset = self.offer.lease_offset.unwrap_or(request.len());
        let asks = request[offset..].iter().take(4).any(|byte| *byte != 0);
        if !asks || self.leases.iter().any(|lease| lease.path_id() == path_id) {
            return Ok(None);
        }
        match Lease::take(&self.session, path_id) {
            Some(lease) => Ok(Some(lease)),
            None => Err(SendError::NoPlace(
                "no place for a lease is free".to_owned(),
            )),
        }
    }

    /// Drops the leases of paths of which no request is open.
    fn drop_leases(&mut self) {
        let open = &self.outstanding;
        self.leases.retain(|lease| {
            open.iter()
                .any(|request| request.path_id == lease.path_id())
        });
    }

    /// The program looks at its client, so it follows its paths.
    fn renew_leases(&self) {
        self.leases.iter().for_each(Lease::renew);
    }

    /// Keeps the reports that are there for the next drain: a request whose final report is among them is open no
    /// longer.
    fn keep_what_came(&mut self) {
        let mut kept = mem::take(&mut self.kept);
        self.receive(|report| keep_report(&mut kept, *report, MAX_KEPT));
        self.kept = kept;
    }

    fn give_up_one(&mut self, request_id: u64) {
        self.give_up_those(|outstanding| outstanding.request_id == request_id);
    }

    fn drain(&mut self, mut take: impl FnMut(&RequestReport)) -> usize {
        let kept = self.kept.len();
        self.kept.drain(..).for_each(|report| take(&report));
        kept + self.receive(take)
    }

    /// As [`BytesClient::drain`], of what comes now.
    fn receive(&mut self, mut take: impl FnMut(&RequestReport)) -> usize {
        if self.session.check_process().is_err() {
            return 0;
        }
        for port in self.port.iter().chain(&self.former) {
            port.responses.take();
        }
        self.pollable.drained();
        self.renew_leases();
        // Before the reports are read: whatever a server said before it went comes out first.
        if !self.outstanding.is_empty() {
            self.look_in_time();
        }
        let ports = || self.port.iter().chain(&self.former);
        let gone = gone_reason(&self.offer.key);
        let mut taken = 0;
        let mut anchor = None;
        self.outstanding.retain(|outstanding| {
            let is_served = outstanding.is_served(ports());
            let mut is_closed = false;
            outstanding.drain(&mut anchor, |report| {
                is_closed |= report.is_final();
                taken += 1;
                take(report);
            });
            if !is_served && !is_closed {
                is_closed = true;
                taken += 1;
                take(&outstanding.gone(gone));
            }
            !is_closed
        });
        self.drop_leases();
        taken
    }

    fn give_up(&mut self) {
        self.kept.clear();
        self.give_up_those(|_| true);
    }

    fn give_up_those(&mut self, is_meant: impl Fn(&Outstanding) -> bool) {
        if self.session.check_process().is_err() {
            return;
        }
        let before = self.outstanding.len();
        self.outstanding
            .retain(|outstanding| !is_meant(outstanding));
        if self.outstanding.len() < before {
            self.drop_leases();
            for port in self.port.iter().chain(&self.former) {
                port.requests.wake();
            }
        }
    }

    /// Looks at the servers if the last look is a period ago.
    fn look_in_time(&self) {
        for port in self.port.iter().chain(&self.former) {
            port.server.look_after(LIVENESS_PERIOD);
        }
    }

    /// Whether there is a server that does not end just now: one withdraws its generation first, and gives up its lock
    /// last. What fails meanwhile fails for want of a server.
    fn is_served(&self) -> bool {
        let folder = self.session.service_folder(&self.offer.key);
        let is_announced = generation::current(&folder).is_ok_and(|current| current.is_some());
        let provider = self.session.provider(&self.offer.key);
        is_announced && provider.is_ok_and(|provider| provider.is_some())
    }

    fn no_server(&self) -> SendError {
        SendError::NoServer {
            service: self.offer.key.clone(),
            robot: self.session.robot().get(),
        }
    }

    /// Whether draining would hand something on.
    fn has_reports(&self) -> bool {
        self.renew_leases();
        if !self.kept.is_empty() {
            return true;
        }
        if self.outstanding.is_empty() {
            return false;
        }
        self.look_in_time();
        self.outstanding.iter().any(|outstanding| {
            let ports = self.port.iter().chain(&self.former);
            outstanding.pending.has_response() || !outstanding.is_served(ports)
        })
    }
}

/// Why a request ends whose server is gone.
fn gone_reason(key: &str) -> Reason {
    match key.contains('/') {
        true => Reason::ModuleGone,
        false => Reason::BridgeGone,
    }
}

impl Drop for BytesClient {
    fn drop(&mut self) {
        self.give_up();
    }
}

impl sealed::Source for BytesClient {
    fn has_something(&self, _look: sealed::Look) -> bool {
        self.has_reports()
    }

    fn sense(&self) -> sealed::Sense<'_> {
        sealed::Sense::Port {
            doorbell: self.session.doorbell(),
            bits: self.offer.slot.bits(ServiceEvent::Responses),
            receiver: self.port.as_ref().map(|port| &port.responses),
            by_descriptor: false,
            // Without a request there is no server to look for.
            bound: match self.outstanding.is_empty() {
                true => sealed::Bound::LONG,
                false => sealed::Bound::SHORT,
            },
        }
    }
}

port::core!(BytesClient);

/// A client's part in one generation.
struct ClientPort {
    port: IoxClient,
    service: RequestService,
    /// Bytes of a request.
    size: usize,
    /// Where a request says when it was issued, if it does.
    issued_offset: Option<usize>,
    responses: WakeReceiver,
    requests: WakeSender,
    /// Whether the server still serves the generation.
    server: LockWatch,
    // Last: its node must outlive the ports.
    generation: Generation,
}

/// A request without a final report.
struct Outstanding {
    pending: Pending,
    request_id: u64,
    path_id: u64,
    /// The generation in which it was sent: the server answers it there, or not at all.
    generation: String,
}

type IoxClient = iceoryx2::port::client::Client<Svc, AnyRequest, (), RequestReport, ()>;
type Pending = PendingResponse<Svc, AnyRequest, (), RequestReport, ()>;
type Report = iceoryx2::response::Response<Svc, RequestReport, ()>;

impl ClientPort {
    fn open(
        session: &Arc<Session>,
        generation: Generation,
        offer: &Offer,
    ) -> Result<ClientPort, OpenError> {
        let (robot, key) = (session.robot(), offer.key.as_str());
        let service = open::open_request(&generation, offer, robot)?;
        let event = |channel| Event::open(&generation, robot, key, channel);
        let responses = WakeReceiver::new(event(ServiceEvent::Responses)?);
        let requests = event(ServiceEvent::Requests)?;
        let port = open::port(
            &service_name(robot, key),
            ("clients", MAX_CLIENTS),
            |error| error == ClientCreateError::ExceedsMaxSupportedClients,
            || {
                service
                    .client_builder()
                    .backpressure_strategy(BackpressureStrategy::DiscardData)
                    // Not in silence: a request that was not taken must be known.
                    .set_backpressure_handler(|_| BackpressureAction::DiscardDataAndFail)
                    .create()
            },
        )?;
        start_somewhere(&port);
        Ok(ClientPort {
            port,
            service,
            size: offer.schema.size(),
            issued_offset: offer.issued_offset,
            responses,
            requests: WakeSender::make(session, requests)?,
            server: generation::provider_watch(generation.path()),
            generation,
        })
    }

    /// Whether the server's port is open. One that ends closes it a moment before it gives up its lock.
    fn has_server(&self) -> bool {
        self.service.dynamic_config().number_of_servers() > 0
    }

    /// Sends the bytes of a request, which are as many as the service says, under this id. One that does not say when
    /// it was issued is issued now.
    fn deliver(&self, request: &[u8], request_id: u64) -> Result<Pending, SendError> {
        assert_eq!(request.len(), self.size, "bytes of a request");
        let mut loaned = self
            .port
            .loan_uninit()
            .map_err(|error| SendError::Failed(format!("{error:?}")))?;
        let payload: *mut u8 = loaned.payload_mut().as_mut_ptr().cast();
        let unissued = self
            .issued_offset
            .filter(|offset| word(request, *offset) == 0)
            .map(|offset| (offset, MonotonicNs::now().0));
        // SAFETY: the service's requests have this size, which iceoryx2 has compared, and this one is the caller's
        // alone. The eight bytes of each number lie in it, by the layout that the offsets come from.
        #[allow(unsafe_code)]
        let loaned = unsafe {
            payload.copy_from_nonoverlapping(request.as_ptr(), self.size);
            for (offset, number) in [(REQUEST_ID_OFFSET, request_id)]
                .into_iter()
                .chain(unissued)
            {
                let bytes = number.to_ne_bytes();
                payload
                    .add(offset)
                    .copy_from_nonoverlapping(bytes.as_ptr(), bytes.len());
            }
            loaned.assume_init()
        };
        loaned.send().map_err(|error| match error {
            RequestSendError::ExceedsMaxActiveRequests => SendError::TooManyOutstanding,
            RequestSendError::SendError(IoxSendError::UnableToDeliver) => SendError::ServerFull,
            error => SendError::Failed(format!("{error:?}")),
        })
    }
}

/// Makes the numbers by which iceoryx2 tells the requests of this client apart begin somewhere.
///
/// Every client counts from 0, and a server addresses its reports by the client's place in a list and by this number.
/// So a server that still holds a request of a client that died takes the first one of the next client in its place for
/// it. Our server looks whose request it is; this is for others, and for the instant in which our server cannot look.
fn start_somewhere(port: &IoxClient) {
    for _ in 0..fresh_request_id() % NUMBERS {
        // The number is used up though nothing is sent.
        if port.loan_uninit().is_err() {
            return;
        }
    }
}

impl Outstanding {
    /// Whether it was sent by this port.
    fn is_of(&self, port: &ClientPort) -> bool {
        port.generation.name() == self.generation
    }

    /// Whether the server that got the request still has it.
    fn is_served<'p>(&self, mut ports: impl Iterator<Item = &'p ClientPort>) -> bool {
        let port = ports.find(|port| self.is_of(port));
        port.is_some_and(|port| port.server.was_held()) && self.pending.is_connected()
    }

    /// Hands on the reports about this request.
    ///
    /// When a server has gone, iceoryx2 forgets the reports about all requests as soon as one of them has nothing left
    /// to read, unless a report is still borrowed. Therefore only requests that have something are read, and the first
    /// report of a round, the anchor, is kept until all have been.
    fn drain(&self, anchor: &mut Option<Report>, mut take: impl FnMut(&RequestReport)) {
        while self.pending.has_response() {
            match self.pending.receive() {
                Ok(Some(report)) => {
                    // A server may mistake this client for the one that had its place before: see `start_somewhere`.
                    if report.request_id == self.request_id {
                        take(&report);
                    }
                    anchor.get_or_insert(report);
                }
                Ok(None) => return,
                // The connection is broken; that the server is gone shows by its lock.
                Err(error) => {
                    crate::log::debug!(?error, "reports cannot be received");
                    return;
                }
            }
        }
    }

    /// The final report for a request whose server is gone.
    fn gone(&self, reason: Reason) -> RequestReport {
        RequestReport {
            request_id: self.request_id,
            path_id: self.path_id,
            reported_ns: MonotonicNs::now().0,
            ..RequestReport::new(Stage::Unknown, reason)
        }
    }
}

/// A request that was sent: what an action's goal handle is in ROS 2. [`Client::request`](crate::Client::request) makes
/// it.
///
/// ```no_run
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let robot = ipc_types::Ipc::connect("operator")?;
/// # let mut client = robot.client::<ipc_types::payload::MovementData>()?;
/// # let order = ipc_types::payload::MovementData::land(ipc_types::fresh_request_id());
/// let mut landing = client.request(&order)?;
/// for feedback in landing.feedback() {
///     println!("{} waypoints reached", feedback?.waypoints_reached);
/// }
/// println!("{:?}", landing.result()?.stage());
/// # Ok(())
/// # }
/// ```
///
/// **Dropping it before the result gives the request up**: a request that its server has not read is then not carried
/// out, and the server of one that it has read sees its client as vanished. The bridge flies an accepted movement to
/// its end all the same (docs/ipc.md, section 4). Reports about other requests of the client are kept for
/// [`Client::drain`](crate::Client::drain).
pub struct RequestHandle<'c> {
    client: &'c mut BytesClient,
    waiter: &'c Waiter,
    request_id: u64,
    /// Reports about this request that were not handed on yet.
    reports: VecDeque<RequestReport>,
    /// Reports about other requests.
    others: VecDeque<RequestReport>,
    /// The final report, once it was handed on.
    result: Option<RequestReport>,
}

impl<'c> RequestHandle<'c> {
    fn send(
        client: &'c mut BytesClient,
        waiter: &'c Waiter,
        request: &[u8],
    ) -> Result<RequestHandle<'c>, SendError> {
        Ok(RequestHandle {
            request_id: client.send(request)?,
            reports: VecDeque::new(),
            // Taken out, so that they do not end the handle's waits.
            others: mem::take(&mut client.kept),
            result: None,
            client,
            waiter,
        })
    }

    /// Id of the request.
    pub fn request_id(&self) -> u64 {
        self.request_id
    }

    /// The next report, the final one included; `None` if none is there, or the final one was handed on.
    pub fn try_recv(&mut self) -> Option<RequestReport> {
        if self.reports.is_empty() && self.result.is_none() {
            let (id, reports, others) = (self.request_id, &mut self.reports, &mut self.others);
            self.client.receive(|report| match report.request_id == id {
                true => reports.push_back(*report),
                false => keep_report(others, *report, MAX_KEPT),
            });
        }
        let report = self.reports.pop_front()?;
        if report.is_final() {
            self.result = Some(report);
            self.reports.clear();
        }
        Some(report)
    }

    /// As [`RequestHandle::try_recv`], but sleeps until there is a report or `timeout` has passed. A signal does not
    /// end it.
    ///
    /// # Errors
    ///
    /// See [`WaitError`].
    pub fn recv_timeout(&mut self, timeout: Duration) -> Result<Option<RequestReport>, WaitError> {
        let deadline = MonotonicNs::now() + timeout;
        loop {
            if let Some(report) = self.try_recv() {
                return Ok(Some(report));
            }
            let now = MonotonicNs::now();
            if self.result.is_some() || now >= deadline {
                return Ok(None);
            }
            self.waiter.wait_for_one(self.client, deadline.since(now))?;
        }
    }

    /// The reports before the final one, as they come. Sleeps while there is none, and ends with the result.
    pub fn feedback(&mut self) -> impl Iterator<Item = Result<RequestReport, WaitError>> {
        std::iter::from_fn(|| {
            self.recv_timeout(Duration::MAX)
                .map(|report| report.filter(|report| !report.is_final()))
                .transpose()
        })
    }

    /// Waits for the final report, and drops what comes before it. The report says *unknown, bridge-gone* when the
    /// server is gone. While a live server does not answer there is no end to it: [`RequestHandle::result_timeout`] has
    /// one.
    ///
    /// # Errors
    ///
    /// See [`WaitError`].
    pub fn result(&mut self) -> Result<RequestReport, WaitError> {
        loop {
            if let Some(result) = self.result_timeout(Duration::MAX)? {
                return Ok(result);
            }
        }
    }

    /// As [`RequestHandle::result`], but waits no longer than `timeout`; `None` if there is no result by then.
    ///
    /// # Errors
    ///
    /// See [`WaitError`].
    pub fn result_timeout(
        &mut self,
        timeout: Duration,
    ) -> Result<Option<RequestReport>, WaitError> {
        let deadline = MonotonicNs::now() + timeout;
        while self.result.is_none() {
            let left = deadline.since(MonotonicNs::now());
            if self.recv_timeout(left)?.is_none() {
                break;
            }
        }
        Ok(self.result)
    }
}

impl Drop for RequestHandle<'_> {
    fn drop(&mut self) {
        if self.result.is_none() {
            self.client.give_up_one(self.request_id);
        }
        self.client.kept = mem::take(&mut self.others);
    }
}
