//! [`Server`]: takes requests and answers each with a stream of reports that ends in a final word.

use std::cell::Cell;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use iceoryx2::active_request::ActiveRequest;
use iceoryx2::identifiers::UniqueClientId;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::port::{
    BackpressureAction, DegradationAction, LoanError, ReceiveError, SendError as IoxSendError,
};
use iceoryx2::prelude::{BackpressureStrategy, CallbackProgression, PortFactory};
use iceoryx2::service::port_factory::server::ServerCreateError;
use iceoryx2_bb_posix::unique_system_id::UniqueSystemId;

use crate::code::{Reason, Stage};
use crate::domain::OwnerLock;
use crate::ear::{Ear, Signal};
use crate::event::Channel;
use crate::iox::{RequestService, Svc};
use crate::open::{self, OpenError};
use crate::payload::RequestReport;
use crate::service::{
    MAX_BORROWED_REPORTS, MAX_CLIENTS, MAX_OUTSTANDING, MAX_SERVERS, RESPONSE_BUFFER, Request,
};
use crate::session::Session;
use crate::ticket::{Ticket, Tickets};
use crate::time::MonotonicNs;
use crate::waiter::{WaitError, Waiter, Wake, sealed};

/// Requests that have a ticket at once: twice what all clients can have open, 2 · 16 · 8. The second half is for requests
/// that their clients gave up, from one call of [`Server::vanished`] to the next.
///
/// So one client cannot take the tickets of another. One request more, which takes a caller that does not ask who vanished,
/// is refused with [`Reason::TooManyRequests`]; nothing that is open is touched.
pub const MAX_OPEN_TICKETS: u32 = 2 * (MAX_CLIENTS * MAX_OUTSTANDING) as u32;

/// Channels that iceoryx2 makes for the reports to one client: for each server, requests that are open and as many that the
/// client has given up; and the request that is being filled in.
const CHANNELS_PER_CLIENT: usize = MAX_SERVERS * 2 * MAX_OUTSTANDING + 1;

/// Memory for reports: as many as clients can leave unread in all channels, and hold in those of open requests, and one that
/// is being filled in. So clients that never read do not take the memory for the reports to another.
const MAX_REPORTS: usize = MAX_CLIENTS
    * (CHANNELS_PER_CLIENT * RESPONSE_BUFFER + MAX_OUTSTANDING * MAX_BORROWED_REPORTS)
    + 1;

/// Reports about one request that could be filled in at once. One is; but iceoryx2 reserves no more than it thinks necessary,
/// which leaves out what lies unread in the channels of earlier requests. This makes it think of [`MAX_REPORTS`].
const LOANED_REPORTS: usize = MAX_REPORTS.div_ceil(MAX_CLIENTS * 2 * MAX_OUTSTANDING)
    - (RESPONSE_BUFFER + MAX_BORROWED_REPORTS);

/// Most requests of one [`Server::drain`], so that a flood leaves time for the rest of the loop: all that all clients can
/// have open, 128, and as many of clients that have gone.
const MAX_REQUESTS_PER_DRAIN: usize = 2 * MAX_CLIENTS * MAX_OUTSTANDING;

/// From so many incidents on, each of which may have made iceoryx2 keep a connection for good, a server [is
/// worn](Server::is_worn): half of the 128 that it can keep before it ends the process.
const MAX_WEAR: u32 = 64;

/// How long a client may stay without a connection until the server [is worn](Server::is_worn). One that died meanwhile has
/// been cleaned up after by then.
const UNCONNECTED_TIME: Duration = Duration::from_secs(2);

/// Requests could not be received.
#[derive(Debug, thiserror::Error)]
#[error("requests of {service} cannot be received ({reason}); the next call tries again")]
pub struct ServeError {
    service: &'static str,
    reason: String,
}

/// A report could not be sent.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReportError {
    /// The ticket's request has had its final report, or its client vanished.
    #[error("the request is not open any more")]
    NotOpen,
    /// The client is gone; the ticket is closed.
    #[error("the client of the request is gone")]
    Vanished,
    /// The client does not read, so that as many reports are waiting as can. Only progress is ever refused for that.
    #[error("the client does not read its reports")]
    BufferFull,
    /// iceoryx2 failed; the request stays open.
    #[error("the report was not sent ({0})")]
    Failed(String),
}

/// Takes the requests of a service, of which a robot has one server.
///
/// [`Server::drain`] gives each request a [`Ticket`]; [`Server::report`] answers by it as often as need be, until a
/// final stage closes it.
///
/// # What iceoryx2 0.10 asks of a server
///
/// iceoryx2 addresses a report by the client's place in the list of clients, which another client may have taken meanwhile;
/// and a connection to a client that is gone is kept as long as the server holds a request of it. Both change only while the
/// connections are updated, which receiving does, and asking for requests. Therefore:
///
/// * after each update, and before anything is sent or dropped, the requests of clients that are not in the list any more
///   are closed here. A client leaves the list before its place is given away, and never comes back: so whoever is missing
///   in an update is missing in a later look at the list;
/// * a request whose end would close the channel of another client is held back until it does not (`held_back`);
/// * nothing of a client that is gone is held while iceoryx2 looks for requests. It removes a wrong connection from its list
///   when one that is still held lies before two that are not (`port/details/receiver.rs:490`, `skip` and then
///   `enumerate`).
///
/// Places on the way of a request where iceoryx2 ends the server's process because of what a client did, or what became of it:
///
/// | place | when | here |
/// |---|---|---|
/// | `port/details/receiver.rs:313` | 129 clients are gone whose requests are held | none is held, see above |
/// | `port/details/receiver.rs:251` | 144 connections are kept | as above, and [`Server::is_worn`] tells before |
/// | `port/details/segment_state.rs:52`, `:57`; `cal/zero_copy_connection/common.rs:857` | a client gives back what it never got; the size of reports, which is divided by, is 0 | needs a client that writes where it must not |
/// | `cal/zero_copy_connection/common.rs:671`, `:688`, `:752`, `:835` | a request names a channel that there is not | needs a client that writes where it must not |
/// | no line: SIGBUS | a client cuts its own segment short; `/dev/shm` is full | needs such a client; joining asks for free space |
///
/// On the same way, but only for the process's own faults: `port/client.rs:266`, `:753`, `port/details/sender.rs:489`, `:499`,
/// `:597`, `bb-posix/memory_mapping.rs:516`. Having no descriptors left is an error there, not an end.
///
/// Nothing is done about a client that writes where it must not: processes of one user trust one another (docs/ipc.md,
/// section 1).
pub struct Server<R: Request> {
    // First, so that open requests are closed before the port goes, and their clients woken last of all.
    tickets: Tickets<Entry<R>>,
    /// Requests of clients that are gone. Each looks like an open request of the client that came after.
    held_back: Vec<Active<R>>,
    port: iceoryx2::port::server::Server<Svc, R, (), RequestReport, ()>,
    service: RequestService<R>,
    round: Round<R>,
    /// Whether connections may have been updated since the requests of those that are gone were closed.
    is_updated: Cell<bool>,
    requests: Ear,
    responses: Signal,
    waiter: Waiter,
    refused_full: u64,
    wear: u32,
    /// Connections that could not be made, or broke, since the last look.
    failures: Arc<AtomicU32>,
    /// Since when a client cannot be connected, and the clients that there were. iceoryx2 tries again when the list changes.
    unconnected: Option<(MonotonicNs, Vec<UniqueClientId>)>,
    /// Whether there are reports of which the clients were not told.
    is_quiet: bool,
    _owner: OwnerLock,
    _session: Rc<Session>,
}

type Active<R> = ActiveRequest<Svc, R, (), RequestReport, ()>;

/// A request that has a ticket.
struct Entry<R: Request> {
    /// Nothing when the client has given it up or is gone; the owner of the ticket has then still to be told.
    active: Option<Active<R>>,
    request_id: u64,
    /// The final word, while the client has no room for it.
    unsent: Option<RequestReport>,
}

impl<R: Request> Entry<R> {
    fn is_open(&self) -> bool {
        self.active.as_ref().is_some_and(Active::is_connected)
    }
}

fn send<R: Request>(to: &Active<R>, report: &RequestReport) -> Result<(), ReportError> {
    match to.send_copy(*report) {
        Ok(()) => Ok(()),
        Err(IoxSendError::UnableToDeliver | IoxSendError::LoanError(LoanError::OutOfMemory)) => {
            Err(ReportError::BufferFull)
        }
        Err(error) => Err(ReportError::Failed(format!("{error:?}"))),
    }
}

/// What one [`Server::drain`] has read. Empty between two of them; kept for its memory.
struct Round<R: Request> {
    /// Requests to hand on, with how many of the same client came before.
    taken: Vec<(usize, Ticket, R)>,
    /// Whose they are, one for each.
    senders: Vec<UniqueClientId>,
    /// Requests that were given up or refused. A client has its share of a round as long as iceoryx2 counts them as held.
    ended: Vec<Active<R>>,
}

impl<R: Request> Server<R> {
    pub(crate) fn open(session: &Rc<Session>) -> Result<Server<R>, OpenError> {
        let robot = session.robot();
        let owner = session.provide(R::SERVICE)?;
        let service = open::request::<R>(session, robot)?;
        let requests = Ear::make(session, R::SERVICE, Channel::Requests)?;
        requests.listener()?;
        let failures = Arc::new(AtomicU32::new(0));
        let counter = || {
            let failures = Arc::clone(&failures);
            move |_, _: &_| {
                failures.fetch_add(1, Ordering::Relaxed);
                // The others are served.
                DegradationAction::Ignore
            }
        };
        let port = open::port(
            session,
            &R::SERVICE.name(robot),
            ("servers", MAX_SERVERS),
            |error| error == ServerCreateError::ExceedsMaxSupportedServers,
            || {
                service
                    .server_builder()
                    .max_loaned_responses_per_request(LOANED_REPORTS)
                    .override_response_preallocation(|_| MAX_REPORTS)
                    .backpressure_strategy(BackpressureStrategy::DiscardData)
                    // Not in silence: the caller must know that a report was not taken.
                    .set_backpressure_handler(|_| BackpressureAction::DiscardDataAndFail)
                    .set_request_degradation_handler(counter())
                    .set_response_degradation_handler(counter())
                    .create()
            },
        )?;
        let responses = Signal::make(session, R::SERVICE, Channel::Responses)?;
        Ok(Server {
            tickets: Tickets::with_capacity(MAX_OPEN_TICKETS),
            held_back: Vec::new(),
            port,
            service,
            round: Round {
                taken: Vec::new(),
                senders: Vec::new(),
                ended: Vec::new(),
            },
            is_updated: Cell::new(false),
            requests,
            responses,
            waiter: Waiter::new(),
            refused_full: 0,
            wear: 0,
            failures,
            unconnected: None,
            is_quiet: false,
            _owner: owner,
            _session: Rc::clone(session),
        })
    }

    /// Hands on the requests that are there, each with its ticket, and says how many those were.
    ///
    /// Clients are served in turn: the first request of each, then the second of each. Each has a share of
    /// [`MAX_OUTSTANDING`] in one call, however quickly it sends; what it sends beyond waits for the next.
    ///
    /// A request whose client has given it up, or is gone, is dropped unseen. One that finds no free ticket is refused here,
    /// with [`Reason::TooManyRequests`]. Ask before who has [`vanished`](Server::vanished).
    ///
    /// # Errors
    ///
    /// [`ServeError`] when iceoryx2 fails; what was handed on counts. A client that cannot be connected is no error here: see
    /// [`Server::is_worn`].
    pub fn drain(&mut self, mut take: impl FnMut(Ticket, &R)) -> Result<usize, ServeError> {
        self.requests.take();
        self.update();
        self.close_given_up();
        self.send_unsent();
        let mut left = MAX_REQUESTS_PER_DRAIN;
        let result = loop {
            match self.receive() {
                Ok(true) if left > 1 => left -= 1,
                Ok(_) => break Ok(()),
                Err(error) => break Err(error),
            }
        };
        self.round.senders.clear();
        self.round.ended.clear();
        self.round.taken.sort_by_key(|(turn, _, _)| *turn);
        let taken = self.round.taken.len();
        for (_, ticket, request) in self.round.taken.drain(..) {
            take(ticket, &request);
        }
        result.map(|()| taken)
    }

    /// Reads one request into the round; `false` when there is none, or each client that has one has had its share.
    fn receive(&mut self) -> Result<bool, ServeError> {
        let active = match self.port.receive() {
            Ok(Some(active)) => active,
            // All that a client can have open is held of each that has more.
            Ok(None) | Err(ReceiveError::ExceedsMaxBorrows) => return Ok(false),
            Err(error) => {
                return Err(ServeError {
                    service: R::SERVICE.spec().key,
                    reason: format!("{error:?}"),
                });
            }
        };
        let sender = active.origin();
        if !active.is_connected() {
            self.round.ended.push(active);
            // Before iceoryx2 looks for the next one: its client may be gone, and others with it.
            self.close_departed();
            return Ok(true);
        }
        let request = *active.payload();
        let entry = Entry {
            active: Some(active),
            request_id: request.request_id(),
            unsent: None,
        };
        match self.tickets.insert(entry) {
            Ok(ticket) => {
                let earlier = self.round.senders.iter().filter(|of| **of == sender);
                self.round.taken.push((earlier.count(), ticket, request));
                self.round.senders.push(sender);
            }
            Err(entry) => self.refuse_full(entry, &request),
        }
        Ok(true)
    }

    fn refuse_full(&mut self, entry: Entry<R>, request: &R) {
        self.refused_full += 1;
        let report = RequestReport {
            request_id: request.request_id(),
            path_id: request.path_id(),
            reported_ns: MonotonicNs::now().0,
            stage: Stage::Refused.code(),
            reason: Reason::TooManyRequests.code(),
            ..RequestReport::default()
        };
        if let Some(active) = entry.active {
            // A new request's buffer is empty. If it fails all the same, closing the stream tells the client.
            if let Err(error) = send(&active, &report) {
                tracing::debug!(%error, "a refusal was not sent");
            }
            self.round.ended.push(active);
        }
        self.responses.raise();
    }

    /// Connects new clients, and lets go of those that are gone.
    fn update(&mut self) {
        if let Err(error) = self.port.update_connections() {
            // The failures are counted where they happen.
            tracing::debug!(?error, "a client was not connected");
        }
        self.close_departed();
        let failures = self.failures.swap(0, Ordering::Relaxed);
        if failures > 0 {
            tracing::debug!(
                failures,
                service = R::SERVICE.spec().key,
                "a client was not connected"
            );
            self.wear = self.wear.saturating_add(failures);
            self.unconnected = Some((MonotonicNs::now(), self.clients()));
        } else if self
            .unconnected
            .as_ref()
            .is_some_and(|(_, then)| *then != self.clients())
        {
            // Another list was another attempt.
            self.unconnected = None;
        }
    }

    /// Closes the requests of clients that are not in the list any more: see [`Server`].
    fn close_departed(&mut self) {
        self.is_updated.set(false);
        if self.tickets.len() == 0 && self.held_back.is_empty() && self.round.ended.is_empty() {
            return;
        }
        let present = self.clients();
        let has_left = |active: &Active<R>| !present.contains(&active.origin());
        let mut left = Vec::new();
        for entry in self.tickets.entries_mut() {
            left.extend(entry.active.take_if(|active| has_left(active)));
        }
        left.extend(self.round.ended.extract_if(.., |active| has_left(active)));
        let held_before = self.held_back.len();
        self.held_back.append(&mut left);
        // Dropping one closes its channel if that is open for a request of the same number.
        self.held_back.retain(Active::is_connected);
        let held = self.held_back.len().saturating_sub(held_before);
        self.wear = self.wear.saturating_add(held as u32);
    }

    /// Closes the requests that their clients have given up.
    fn close_given_up(&mut self) {
        for entry in self.tickets.entries_mut() {
            entry.active.take_if(|active| !active.is_connected());
        }
    }

    /// The clients in iceoryx2's list.
    fn clients(&self) -> Vec<UniqueClientId> {
        let mut clients = Vec::with_capacity(MAX_CLIENTS);
        self.service.dynamic_config().list_clients(|client| {
            clients.push(client.client_id);
            CallbackProgression::Continue
        });
        clients
    }

    /// Whether a new server should take this one's place at the next opportunity.
    ///
    /// Either as much has gone wrong as may have made iceoryx2 keep 64 connections for good, half of what it can keep; or a
    /// client that could not be connected is still there after two seconds: its requests do not arrive. In a healthy domain
    /// neither happens.
    pub fn is_worn(&self) -> bool {
        let is_deaf = |(since, clients): &(MonotonicNs, Vec<UniqueClientId>)| {
            MonotonicNs::now().since(*since) >= UNCONNECTED_TIME && *clients == self.clients()
        };
        self.wear >= MAX_WEAR || self.unconnected.as_ref().is_some_and(is_deaf)
    }

    /// Answers a request. A final stage closes it; its ticket is then worth nothing.
    ///
    /// `request_id` is written here, and `reported_ns` if it is 0. A final report that the client has no room for is
    /// kept and sent by a later [`Server::drain`]; this counts as sent.
    ///
    /// # Errors
    ///
    /// See [`ReportError`]. Losing progress to a full buffer is not serious: the final word always comes.
    pub fn report(&mut self, ticket: Ticket, report: &RequestReport) -> Result<(), ReportError> {
        let result = self.report_quietly(ticket, report);
        self.wake_clients();
        result
    }

    /// As [`Server::report`], but leaves the clients asleep until [`Server::wake_clients`]: for a server that has something
    /// more urgent to do than to wake others, who would take its processor.
    ///
    /// # Errors
    ///
    /// As [`Server::report`].
    pub fn report_quietly(
        &mut self,
        ticket: Ticket,
        report: &RequestReport,
    ) -> Result<(), ReportError> {
        if self.is_updated.get() {
            self.close_departed();
        }
        let entry = self.tickets.get_mut(ticket).ok_or(ReportError::NotOpen)?;
        if entry.unsent.is_some() {
            return Err(ReportError::NotOpen);
        }
        let Some(active) = entry.active.as_ref().filter(|active| active.is_connected()) else {
            self.tickets.remove(ticket);
            return Err(ReportError::Vanished);
        };
        let mut report = *report;
        report.request_id = entry.request_id;
        if report.reported_ns == 0 {
            report.reported_ns = MonotonicNs::now().0;
        }
        // An unknown stage is not final: the stream goes on.
        let is_final = Stage::from_code(report.stage).is_some_and(Stage::is_final);
        match send(active, &report) {
            Ok(()) if is_final => {
                self.tickets.remove(ticket);
            }
            Ok(()) => {}
            Err(ReportError::BufferFull) if is_final => entry.unsent = Some(report),
            Err(error) => return Err(error),
        }
        self.is_quiet = true;
        Ok(())
    }

    /// Wakes the clients if there was a quiet report since the last time.
    pub fn wake_clients(&mut self) {
        if std::mem::take(&mut self.is_quiet) {
            self.responses.raise();
        }
    }

    /// Hands on each open request whose client gave it up or died, with its id, and closes its ticket.
    ///
    /// [`ReportError::Vanished`] tells the same: a ticket is told of once, by either. A client that was killed is noticed
    /// when somebody cleans up after it: see [`Ipc::clean_dead`](crate::Ipc::clean_dead).
    pub fn vanished(&mut self, mut gone: impl FnMut(Ticket, u64)) {
        self.update();
        self.tickets.remove_where(
            |entry| !entry.is_open(),
            |ticket, entry| {
                // A request that had its final word, though the client never read it, is over for the caller.
                if entry.unsent.is_none() {
                    gone(ticket, entry.request_id);
                }
            },
        );
    }

    /// Sleeps until there is a request, a signal comes or `timeout` has passed.
    ///
    /// # Errors
    ///
    /// See [`WaitError`].
    pub fn wait(&mut self, timeout: Duration) -> Result<Wake, WaitError> {
        self.waiter.wait(&[&*self], Some(timeout))
    }

    /// The process that sent a request which is open, by its id in the sender's own PID namespace.
    pub fn sender(&self, ticket: Ticket) -> Option<u32> {
        let id = self.tickets.get(ticket)?.active.as_ref()?.origin().value();
        u32::try_from(UniqueSystemId::from(id).pid().value()).ok()
    }

    /// Requests that have a ticket.
    pub fn open_tickets(&self) -> usize {
        self.tickets.len()
    }

    /// Requests that were refused because too many were open.
    pub fn refused_full(&self) -> u64 {
        self.refused_full
    }

    /// Tries again to send the final words that found no room.
    fn send_unsent(&mut self) {
        let mut is_sent = false;
        self.tickets.remove_where(
            |entry| match (&entry.unsent, &entry.active) {
                (Some(report), Some(active)) => send(active, report).is_ok(),
                // It was given up: over for the caller as well.
                (unsent, active) => unsent.is_some() && active.is_none(),
            },
            |_, _| is_sent = true,
        );
        if is_sent {
            self.responses.raise();
        }
    }
}

impl<R: Request> sealed::Source for Server<R> {
    /// A notification counts without a request too: a client may have given one up.
    fn has_something(&self) -> bool {
        if self.requests.is_pending() {
            return true;
        }
        self.is_updated.set(true);
        // Trouble counts as something: draining then says what it is.
        self.port.has_requests().unwrap_or(true)
    }

    /// Clients of other languages, and those that vanish, are only heard by the listener.
    fn sense(&self) -> sealed::Sense<'_> {
        sealed::Sense::Listener(&self.requests)
    }
}
