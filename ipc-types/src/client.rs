//! [`Client`]: sends requests, several at once, and follows the reports about each to its final report.
//!
//! Nothing is fire-and-forget: a request without a server is refused here, and one whose server vanishes ends with
//! [`Reason::BridgeGone`], so that its sender never waits for ever. Whether the request was carried out is then unknown.

use std::cell::{Cell, RefCell};
use std::os::fd::BorrowedFd;
use std::sync::Arc;
use std::time::Duration;

use iceoryx2::pending_response::PendingResponse;
use iceoryx2::port::client::RequestSendError;
use iceoryx2::port::{BackpressureAction, SendError as IoxSendError};
use iceoryx2::prelude::BackpressureStrategy;
use iceoryx2::service::port_factory::client::ClientCreateError;

use crate::code::{Reason, Stage};
use crate::doorbell::{Channel, Place, place};
use crate::event::Event;
use crate::follow::Follower;
use crate::generation::Generation;
use crate::iox::Svc;
use crate::open::{self, OpenError};
use crate::payload::RequestReport;
use crate::provider::LockWatch;
use crate::request_id::fresh_request_id;
use crate::service::{MAX_CLIENTS, MAX_OUTSTANDING, Request, service_name};
use crate::session::Session;
use crate::time::MonotonicNs;
use crate::waiter::{SAFETY_BOUND, WaitError, Waiter, Wake, sealed};
use crate::wake::{WakeReceiver, WakeSender};

/// How often a waiting client looks whether its server still lives, which takes two system calls.
const LIVENESS_PERIOD: Duration = SAFETY_BOUND;

/// So many numbers a client's requests may begin with. Passing over one takes 0.2 µs.
const NUMBERS: u64 = 1 << 12;

/// A request was not sent.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SendError {
    /// Nobody serves: the bridge of this robot does not run.
    #[error("nobody serves {service} of robot {robot}: start its bridge")]
    NoServer {
        /// Which service.
        service: &'static str,
        /// Of which robot.
        robot: u32,
    },
    /// Too many requests of this client are open.
    #[error("{MAX_OUTSTANDING} requests are open: wait for final reports")]
    TooManyOutstanding,
    /// The server does not read its requests.
    #[error("the server does not take requests: its queue is full")]
    ServerFull,
    /// iceoryx2 failed.
    #[error("the request was not sent ({0})")]
    Failed(String),
}

/// Sends requests and follows their reports.
pub struct Client<R: Request> {
    // First, so that the server sees the requests closed before it is woken by the end of the sender.
    outstanding: Vec<Outstanding<R>>,
    /// Nothing while no server has been there.
    port: Option<Port<R>>,
    /// The port of the former generation, for as long as requests are open there.
    former: Option<Port<R>>,
    follower: Follower,
    waiter: Waiter,
    place: Place,
    /// Last part of the service's name: that of `R`, or another that carries the same struct.
    key: &'static str,
    session: Arc<Session>,
}

/// A client's part in one generation.
struct Port<R: Request> {
    port: iceoryx2::port::client::Client<Svc, R, (), RequestReport, ()>,
    responses: WakeReceiver,
    requests: WakeSender,
    server: ServerWatch,
    // Last: its node must outlive the ports.
    generation: Generation,
}

/// Remembers whether the server still serves a generation, so that looking at reports takes no system call.
struct ServerWatch {
    lock: RefCell<LockWatch>,
    is_there: Cell<bool>,
    looked: Cell<MonotonicNs>,
}

struct Outstanding<R: Request> {
    pending: Pending<R>,
    request_id: u64,
    path_id: u64,
    /// The generation in which it was sent: the server answers it there, or not at all.
    generation: String,
}

type Pending<R> = PendingResponse<Svc, R, (), RequestReport, ()>;
type Report = iceoryx2::response::Response<Svc, RequestReport, ()>;

// SAFETY: a client owns all that shares its counts of references, see [`Svc`]; no other thread has any of it.
#[allow(unsafe_code)]
unsafe impl<R: Request> Send for Client<R> {}

impl<R: Request> Port<R> {
    fn open(
        session: &Arc<Session>,
        generation: Generation,
        key: &'static str,
    ) -> Result<Port<R>, OpenError> {
        let robot = session.robot();
        let service = open::open_request::<R>(&generation, robot, key)?;
        let event = |channel| Event::open(&generation, robot, key, channel);
        let responses = WakeReceiver::new(event(Channel::Responses)?);
        let requests = event(Channel::Requests)?;
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
        Ok(Port {
            port,
            responses,
            requests: WakeSender::make(session, requests, place(key), Channel::Requests)?,
            server: ServerWatch::new(generation.provider_watch()),
            generation,
        })
    }

    fn deliver(&self, request: &R) -> Result<Pending<R>, SendError> {
        let loaned = self
            .port
            .loan_uninit()
            .map_err(|error| SendError::Failed(format!("{error:?}")))?;
        loaned
            .write_payload(*request)
            .send()
            .map_err(|error| match error {
                RequestSendError::ExceedsMaxActiveRequests => SendError::TooManyOutstanding,
                RequestSendError::SendError(IoxSendError::UnableToDeliver) => SendError::ServerFull,
                error => SendError::Failed(format!("{error:?}")),
            })
    }
}

impl<R: Request> Client<R> {
    pub(crate) fn open(session: &Arc<Session>, key: &'static str) -> Result<Client<R>, OpenError> {
        let mut client = Client {
            outstanding: Vec::with_capacity(MAX_OUTSTANDING),
            port: None,
            former: None,
            follower: Follower::new(session, key),
            waiter: Waiter::new(),
            place: place(key),
            key,
            session: Arc::clone(session),
        };
        match client.follow() {
            // Its server has gone in this moment, or goes: the next one will be followed.
            Err(error @ (OpenError::Failed { .. } | OpenError::Domain(_))) => {
                tracing::debug!(%error, "there is no server yet");
            }
            result => result?,
        }
        Ok(client)
    }

    /// Enters another generation if there is one.
    fn enter(&self) -> Result<Option<Port<R>>, OpenError> {
        let present = self.port.as_ref().map(|port| port.generation.name());
        self.follower.follow(present, |session, generation| {
            Port::open(session, generation, self.key)
        })
    }

    /// Enters another generation if there is one, unless requests are open in two already.
    fn follow(&mut self) -> Result<(), OpenError> {
        if self.outstanding.is_empty() {
            self.former = None;
        }
        if self.former.is_some() {
            return Ok(());
        }
        let entered = match self.enter() {
            Err(error) if error.is_no_room() && self.session.make_room() => {
                self.follower.forget();
                self.enter()?
            }
            entered => entered?,
        };
        if let Some(port) = entered {
            let former = self.port.replace(port);
            self.former = former.filter(|_| !self.outstanding.is_empty());
        }
        Ok(())
    }

    /// Sends a request. Its reports come out of [`Client::drain`], the last with a final stage.
    ///
    /// # Errors
    ///
    /// See [`SendError`]; nothing was sent then.
    pub fn send(&mut self, request: &R) -> Result<(), SendError> {
        if self.outstanding.len() >= MAX_OUTSTANDING {
            return Err(SendError::TooManyOutstanding);
        }
        self.follow()
            .map_err(|error| SendError::Failed(error.to_string()))?;
        let port = self.port.as_ref().filter(|port| port.server.look());
        let port = port.ok_or_else(|| self.no_server())?;
        let pending = port.deliver(request)?;
        if pending.number_of_server_connections() == 0 {
            // It lives, but it has not read anything of this client yet, and the queue is full.
            return Err(SendError::ServerFull);
        }
        port.requests.wake();
        self.outstanding.push(Outstanding {
            pending,
            request_id: request.request_id(),
            path_id: request.path_id(),
            generation: port.generation.name().to_owned(),
        });
        Ok(())
    }

    /// Hands on every report that is there and says how many those were. A request whose server is gone gets its final
    /// report from here: [`Stage::Unknown`], [`Reason::BridgeGone`].
    pub fn drain(&mut self, mut take: impl FnMut(&RequestReport)) -> usize {
        for port in self.port.iter().chain(&self.former) {
            port.responses.take();
        }
        // Before the reports are read: whatever a server said before it went comes out first.
        if !self.outstanding.is_empty() {
            self.look_in_time();
        }
        let ports = [self.port.as_ref(), self.former.as_ref()];
        let mut taken = 0;
        let mut anchor = None;
        self.outstanding.retain(|outstanding| {
            let is_served = outstanding.is_served(&ports);
            let mut is_closed = false;
            outstanding.drain(&mut anchor, |report| {
                is_closed |= report.is_final();
                taken += 1;
                take(report);
            });
            if !is_served && !is_closed {
                is_closed = true;
                taken += 1;
                take(&outstanding.gone());
            }
            !is_closed
        });
        taken
    }

    /// Sleeps until there is a report, the server is gone, a signal comes or `timeout` has passed.
    ///
    /// # Errors
    ///
    /// See [`WaitError`].
    pub fn wait(&mut self, timeout: Duration) -> Result<Wake, WaitError> {
        let waiter = std::mem::take(&mut self.waiter);
        let wake = waiter.wait_for_one(self, timeout);
        self.waiter = waiter;
        wake
    }

    /// A file descriptor that can be read once there are reports, for a reactor of the caller's own; [`Client::drain`] empties
    /// it. Nothing while there has been no server; another one after a new server has come. Drain at least every
    /// [`SAFETY_BOUND`] in any case: as of [`Subscriber::descriptor`](crate::Subscriber::descriptor).
    ///
    /// # Errors
    ///
    /// When there are more listeners than the contract allows.
    pub fn descriptor(&self) -> Result<Option<BorrowedFd<'_>>, OpenError> {
        self.port
            .as_ref()
            .map(|port| port.responses.lend_descriptor())
            .transpose()
    }

    /// Gives up all open requests: their server sees them as vanished.
    pub fn give_up(&mut self) {
        if !self.outstanding.is_empty() {
            self.outstanding.clear();
            for port in self.port.iter().chain(&self.former) {
                port.requests.wake();
            }
        }
    }

    /// Requests without a final report.
    pub fn outstanding(&self) -> usize {
        self.outstanding.len()
    }

    /// Whether a live process serves. One that hangs counts as alive.
    pub fn is_server_alive(&self) -> bool {
        let provider = self.session.watch(self.key).look();
        provider.is_ok_and(|provider| provider.is_some())
    }

    /// Looks at the servers if the last look is a period ago.
    fn look_in_time(&self) {
        for port in self.port.iter().chain(&self.former) {
            port.server.look_in_time();
        }
    }

    fn no_server(&self) -> SendError {
        SendError::NoServer {
            service: self.key,
            robot: self.session.robot().get(),
        }
    }

    /// Whether draining would hand something on.
    fn has_reports(&self) -> bool {
        if self.outstanding.is_empty() {
            return false;
        }
        self.look_in_time();
        let ports = [self.port.as_ref(), self.former.as_ref()];
        self.outstanding
            .iter()
            .any(|outstanding| outstanding.pending.has_response() || !outstanding.is_served(&ports))
    }
}

/// Makes the numbers by which iceoryx2 tells the requests of this client apart begin somewhere.
///
/// Every client counts from 0, and a server addresses its reports by the client's place in a list and by this number. So a
/// server that still holds a request of a client that died takes the first one of the next client in its place for it. Our
/// server looks whose request it is; this is for others, and for the instant in which our server cannot look.
fn start_somewhere<R: Request>(
    port: &iceoryx2::port::client::Client<Svc, R, (), RequestReport, ()>,
) {
    for _ in 0..fresh_request_id() % NUMBERS {
        // The number is used up though nothing is sent.
        if port.loan_uninit().is_err() {
            return;
        }
    }
}

impl ServerWatch {
    fn new(lock: LockWatch) -> ServerWatch {
        ServerWatch {
            lock: RefCell::new(lock),
            is_there: Cell::new(true),
            looked: Cell::default(),
        }
    }

    /// Whether the server serves the generation.
    fn look(&self) -> bool {
        let is_there = self.lock.borrow_mut().is_held().unwrap_or_else(|error| {
            tracing::debug!(%error, "the server cannot be looked for");
            false
        });
        self.is_there.set(is_there);
        self.looked.set(MonotonicNs::now());
        is_there
    }

    /// Looks if the last look is a period ago.
    fn look_in_time(&self) {
        if MonotonicNs::now().since(self.looked.get()) >= LIVENESS_PERIOD {
            self.look();
        }
    }
}

impl<R: Request> Outstanding<R> {
    /// Whether the server that got the request still has it.
    fn is_served(&self, ports: &[Option<&Port<R>>]) -> bool {
        let mut ports = ports.iter().flatten();
        let port = ports.find(|port| port.generation.name() == self.generation);
        port.is_some_and(|port| port.server.is_there.get()) && self.pending.is_connected()
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
                    tracing::debug!(?error, "reports cannot be received");
                    return;
                }
            }
        }
    }

    /// The final report for a request whose server is gone.
    fn gone(&self) -> RequestReport {
        RequestReport {
            request_id: self.request_id,
            path_id: self.path_id,
            reported_ns: MonotonicNs::now().0,
            ..RequestReport::new(Stage::Unknown, Reason::BridgeGone)
        }
    }
}

impl<R: Request> Drop for Client<R> {
    fn drop(&mut self) {
        self.give_up();
    }
}

impl<R: Request> sealed::Source for Client<R> {
    fn has_something(&self) -> bool {
        self.has_reports()
    }

    fn sense(&self) -> sealed::Sense<'_> {
        sealed::Sense::Port {
            doorbell: self.session.doorbell(),
            bits: self.place.bits(Channel::Responses),
            receiver: self.port.as_ref().map(|port| &port.responses),
            by_descriptor: false,
        }
    }
}
