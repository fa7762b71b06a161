//! [`ServingPort`]: a server's part in one generation, and what iceoryx2 asks of it.

use std::cell::Cell;
use std::mem;
use std::panic::{AssertUnwindSafe, catch_unwind};
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
use crate::doorbell::ServiceEvent;
use crate::generation::Generation;
use crate::housekeeper::Maintained;
use crate::iox::{AnyRequest, Members, RequestService, Svc};
use crate::open::{self, Offer, OpenError};
use crate::payload::RequestReport;
use crate::provider::ProviderLock;
use crate::sequence::word;
use crate::service::{
    MAX_BORROWED_REPORTS, MAX_CLIENTS, MAX_OUTSTANDING, MAX_PROVIDERS, REQUEST_ID_OFFSET,
    RESPONSE_BUFFER, service_name,
};
use crate::session::Session;
use crate::tickets::{self, Ticket};
use crate::time::MonotonicNs;
use crate::waiter::sealed::Look;
use crate::wake::{Event, WakeReceiver, WakeSender};

/// Channels that iceoryx2 makes for the reports to one client: for each server, requests that are open and as many that
/// the client has given up; and the request that is being filled in.
const CHANNELS_PER_CLIENT: usize = MAX_PROVIDERS * 2 * MAX_OUTSTANDING + 1;

/// Memory for reports: as many as clients can leave unread in all channels, and hold in those of open requests, and one
/// that is being filled in. So clients that never read do not take the memory for the reports to another.
const MAX_REPORTS: usize = MAX_CLIENTS
    * (CHANNELS_PER_CLIENT * RESPONSE_BUFFER + MAX_OUTSTANDING * MAX_BORROWED_REPORTS)
    + 1;

/// Reports about one request that could be filled in at once. One is; but iceoryx2 reserves no more than it thinks
/// necessary, which leaves out what lies unread in the channels of earlier requests. This makes it think of
/// [`MAX_REPORTS`].
const LOANED_REPORTS: usize = MAX_REPORTS.div_ceil(MAX_CLIENTS * 2 * MAX_OUTSTANDING)
    - (RESPONSE_BUFFER + MAX_BORROWED_REPORTS);

/// Most requests of one [`Server::drain`], so that a flood leaves time for the rest of the loop: all that all clients
/// can have open, 128, and as many of clients that have gone.
const MAX_REQUESTS_PER_DRAIN: usize = 2 * MAX_CLIENTS * MAX_OUTSTANDING;

/// From so many incidents on, each of which may have made iceoryx2 keep a connection for good, a server [is
/// worn](Server::is_worn): half of the 128 that it can keep before it ends the process.
const MAX_WEAR: u32 = 64;

/// How long a client may stay without a connection until the server [is worn](Server::is_worn). One that died meanwhile
/// has been cleaned up after by then.
const UNCONNECTED_TIME: Duration = Duration::from_secs(2);

/// Requests could not be received.
#[derive(Debug, thiserror::Error)]
#[error("requests of {service} cannot be received ({reason}); the next call tries again")]
pub struct ServeError {
    pub(crate) service: String,
    pub(crate) reason: String,
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

/// Tells the ports of a server apart: the generations that it has begun, counted.
pub(crate) type PortNumber = u64;

/// A server's part in one generation.
///
/// # What iceoryx2 0.10 asks of a server
///
/// iceoryx2 addresses a report by the client's place in the list of clients, which another client may have taken
/// meanwhile; and a connection to a client that is gone is kept as long as the server holds a request of it. Both
/// change only while the connections are updated, which receiving does, and asking for requests. Therefore:
///
/// * after each update, and before anything is sent or dropped, the requests of clients that are not in the list any
///   more are closed here. A client leaves the list before its place is given away, and never comes back: a client that
///   is missing in an update is missing in a later look at the list;
/// * a request whose end would close the channel of another client is held back until it does not (`held_back`);
/// * nothing of a client that is gone is held while iceoryx2 looks for requests. It removes a wrong connection from its
///   list when one that is still held lies before two that are not (`port/details/receiver.rs:490`, `skip` and then
///   `enumerate`).
///
/// Places on the way of a request where iceoryx2 ends the server's process because of what a client did, or what became
/// of it:
///
/// | place | when | here |
/// |---|---|---|
/// | `port/details/receiver.rs:313` | 129 clients are gone whose requests are held | none is held, see above |
/// | `port/details/receiver.rs:251` | 144 connections are kept | as above, and [`ServingPort::is_worn`] tells before |
/// | `port/details/segment_state.rs:52`, `:57`; `cal/zero_copy_connection/common.rs:857` | a client gives back what it never got; the size of reports, which is divided by, is 0 | needs a client that writes where it must not |
/// | `cal/zero_copy_connection/common.rs:671`, `:688`, `:752`, `:835` | a request names a channel that there is not | needs a client that writes where it must not |
/// | no line: SIGBUS | a client cuts its own segment short | needs such a client |
///
/// On the same way, but only for the process's own faults: `port/client.rs:266`, `:753`, `port/details/sender.rs:489`,
/// `:499`, `:597`, `bb-posix/memory_mapping.rs:516`. Having no descriptors left is an error there, not an end.
///
/// Nothing is done about a client that writes where it must not: processes of one user trust one another (docs/ipc.md,
/// section 1).
pub(crate) struct ServingPort {
    number: PortNumber,
    /// Requests of clients that are gone. Each looks like an open request of the client that came after.
    held_back: Vec<Active>,
    port: iceoryx2::port::server::Server<Svc, AnyRequest, (), RequestReport, ()>,
    service: RequestService,
    round: Round,
    layout: RequestLayout,
    /// Whether connections may have been updated since the requests of those that are gone were closed.
    is_updated: Cell<bool>,
    /// Whether there may be a request of which no event will tell: one that was left for the next drain.
    may_have_more: Cell<bool>,
    /// Whether iceoryx2 has panicked when it was asked for requests.
    is_broken: Cell<bool>,
    pub(crate) requests: WakeReceiver,
    pub(crate) responses: WakeSender,
    wear: u32,
    refused_full: u64,
    /// Connections that could not be made, or broke, since the last look.
    failures: Arc<AtomicU32>,
    /// Since when a client cannot be connected, and the clients that there were. iceoryx2 tries again when the list
    /// changes.
    unconnected: Option<(MonotonicNs, Vec<UniqueClientId>)>,
    pub(crate) maintained: Arc<Maintained>,
    /// Deaths of clients that were looked after. iceoryx2 signals a death before the client has left the list.
    deaths: u32,
    // Last: its node must outlive the ports.
    generation: Generation,
}

type Active = ActiveRequest<Svc, AnyRequest, (), RequestReport, ()>;

/// What a server must know of the bytes of a request.
struct RequestLayout {
    /// Last part of the service's name.
    key: String,
    /// Bytes of a request.
    size: usize,
    /// Where its `path_id` lies, if it has one.
    path_offset: Option<usize>,
}

impl RequestLayout {
    /// The bytes of a request.
    fn bytes<'a>(&self, active: &'a Active) -> &'a [u8] {
        let payload = std::ptr::from_ref(active.payload()).cast();
        // SAFETY: the service was made for requests of this size, and iceoryx2 compares the client's with it. The bytes
        // lie in the client's segment and stay as long as the request is held.
        #[allow(unsafe_code)]
        unsafe {
            std::slice::from_raw_parts(payload, self.size)
        }
    }
}

/// Requests that have a ticket at once: twice what all clients can have open, 2 · 16 · 8. The second half is for
/// requests that their clients gave up, from one call of [`Server::vanished`](crate::Server::vanished) to the next.
///
/// So one client cannot take the tickets of another. One request more, which takes a caller that does not ask who
/// vanished, is refused with [`Reason::TooManyRequests`](crate::code::Reason::TooManyRequests); nothing that is open is
/// touched.
pub const MAX_OPEN_TICKETS: u32 = 2 * (MAX_CLIENTS * MAX_OUTSTANDING) as u32;

/// The requests that have a ticket.
pub(crate) type Tickets = tickets::Tickets<OpenRequest>;

/// A request that has a ticket.
pub(crate) struct OpenRequest {
    /// The port that got it.
    port: PortNumber,
    /// `None` if the client has given it up or is gone; the owner of the ticket has then still to be told.
    active: Option<Active>,
    pub(crate) request_id: u64,
    /// The final report, while the client has no room for it.
    pub(crate) unsent: Option<RequestReport>,
}

impl OpenRequest {
    pub(crate) fn is_open(&self) -> bool {
        self.active.as_ref().is_some_and(Active::is_connected)
    }

    pub(crate) fn is_of(&self, port: PortNumber) -> bool {
        self.port == port
    }

    /// Sends a report; `None` if the client is gone.
    pub(crate) fn send(&self, report: &RequestReport) -> Option<Result<(), ReportError>> {
        let active = self
            .active
            .as_ref()
            .filter(|active| active.is_connected())?;
        Some(send(active, report))
    }

    /// The process that sent the request, by its id in its own PID namespace.
    pub(crate) fn sender(&self) -> Option<u32> {
        let id = self.active.as_ref()?.origin().value();
        u32::try_from(UniqueSystemId::from(id).pid().value()).ok()
    }
}

fn send(to: &Active, report: &RequestReport) -> Result<(), ReportError> {
    match to.send_copy(*report) {
        Ok(()) => Ok(()),
        Err(IoxSendError::UnableToDeliver | IoxSendError::LoanError(LoanError::OutOfMemory)) => {
            Err(ReportError::BufferFull)
        }
        Err(error) => Err(ReportError::Failed(format!("{error:?}"))),
    }
}

/// What one [`Server::drain`] has read. Empty between two of them; kept for its memory.
struct Round {
    /// Requests to hand on: how many of the same client came before, and where its bytes are in `payloads`.
    taken: Vec<(usize, Ticket, usize)>,
    payloads: Vec<u8>,
    /// Whose they are, one for each.
    senders: Vec<UniqueClientId>,
    /// Requests that were given up or refused. A client has its share of a round as long as iceoryx2 counts them as
    /// held.
    ended: Vec<Active>,
}

// SAFETY: it owns all that shares its counts of references, see [`Svc`]; no other thread has any of it.
#[allow(unsafe_code)]
unsafe impl Send for ServingPort {}

impl ServingPort {
    pub(crate) fn make(
        session: &Arc<Session>,
        lock: &Arc<ProviderLock>,
        offer: &Offer,
        number: PortNumber,
    ) -> Result<ServingPort, OpenError> {
        let key = offer.key.as_str();
        session.begin(lock, offer, |generation, maintained| {
            let robot = session.robot();
            let service = open::create_request(&generation, offer, robot)?;
            let event = |channel| Event::create(&generation, robot, key, channel);
            let requests = WakeReceiver::new(event(ServiceEvent::Requests)?);
            requests.listener()?;
            let failures = Arc::new(AtomicU32::new(0));
            let counter = || {
                let (failures, failing) = (Arc::clone(&failures), Arc::clone(&maintained));
                move |_, _: &_| {
                    failures.fetch_add(1, Ordering::Relaxed);
                    failing.note_unconnected();
                    // The others are served.
                    DegradationAction::Ignore
                }
            };
            let responses = event(ServiceEvent::Responses)?;
            let port = open::port(
                &service_name(robot, key),
                ("servers", MAX_PROVIDERS),
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
            Ok(ServingPort {
                number,
                held_back: Vec::new(),
                port,
                service,
                round: Round {
                    taken: Vec::new(),
                    payloads: Vec::new(),
                    senders: Vec::new(),
                    ended: Vec::new(),
                },
                layout: RequestLayout {
                    key: offer.key.clone(),
                    size: offer.schema.size(),
                    path_offset: offer.path_offset,
                },
                is_updated: Cell::new(false),
                may_have_more: Cell::new(true),
                is_broken: Cell::new(false),
                requests,
                responses: WakeSender::make(session, responses)?,
                wear: 0,
                refused_full: 0,
                failures,
                unconnected: None,
                deaths: maintained.deaths(),
                maintained,
                generation,
            })
        })
    }

    pub(crate) fn number(&self) -> PortNumber {
        self.number
    }

    /// Requests that were refused because too many were open.
    pub(crate) fn refused_full(&self) -> u64 {
        self.refused_full
    }

    /// Brings the requests up to date before one of them is answered.
    pub(crate) fn settle(&mut self, tickets: &mut Tickets) {
        if self.is_updated.get() {
            self.close_departed(tickets);
        }
    }

    /// Lets go of it without touching what iceoryx2 may have left half done. Its clients see that it is not served any
    /// more; its requests count as given up.
    pub(crate) fn abandon(mut self, tickets: &mut Tickets) {
        // First of all: while it is locked, clients wait.
        self.generation.stop_serving();
        for entry in self.entries(tickets) {
            mem::forget(entry.active.take());
        }
        mem::forget(self);
    }

    /// Reads the requests that are there, for [`hand_on`](ServingPort::hand_on).
    pub(crate) fn read(&mut self, tickets: &mut Tickets) -> Result<(), ServeError> {
        self.requests.take();
        self.update(tickets);
        self.close_given_up(tickets);
        self.send_unsent(tickets);
        self.may_have_more.set(true);
        let mut left = MAX_REQUESTS_PER_DRAIN;
        let result = loop {
            match self.receive(tickets) {
                Ok(true) if left > 1 => left -= 1,
                Ok(_) => break Ok(()),
                Err(error) => break Err(error),
            }
        };
        self.round.senders.clear();
        self.round.ended.clear();
        self.round.taken.sort_by_key(|(turn, _, _)| *turn);
        result
    }

    /// Hands on what was read: see [`Server::drain`](crate::Server::drain).
    pub(crate) fn hand_on(&mut self, mut take: impl FnMut(Ticket, &[u8])) -> usize {
        let taken = self.round.taken.len();
        for (_, ticket, from) in self.round.taken.drain(..) {
            take(ticket, &self.round.payloads[from..][..self.layout.size]);
        }
        self.round.payloads.clear();
        taken
    }

    /// Reads one request into the round; `false` when there is none, or each client that has one has had its share.
    fn receive(&mut self, tickets: &mut Tickets) -> Result<bool, ServeError> {
        let active = match self.port.receive() {
            Ok(Some(active)) => active,
            Ok(None) => {
                self.may_have_more.set(false);
                return Ok(false);
            }
            // All that a client can have open is held of each that has more.
            Err(ReceiveError::ExceedsMaxBorrows) => return Ok(false),
            Err(error) => {
                return Err(ServeError {
                    service: self.layout.key.clone(),
                    reason: format!("{error:?}"),
                });
            }
        };
        let sender = active.origin();
        if !active.is_connected() {
            self.round.ended.push(active);
            // Before iceoryx2 looks for the next one: its client may be gone, and others with it.
            self.close_departed(tickets);
            return Ok(true);
        }
        // A copy: what a client changes afterwards does not count.
        let from = self.round.payloads.len();
        self.round
            .payloads
            .extend_from_slice(self.layout.bytes(&active));
        let entry = OpenRequest {
            port: self.number,
            active: Some(active),
            request_id: word(&self.round.payloads[from..], REQUEST_ID_OFFSET),
            unsent: None,
        };
        if tickets.len() >= MAX_OPEN_TICKETS as usize {
            self.refuse_full(entry, from);
        } else {
            let ticket = tickets.insert(entry);
            let earlier = self.round.senders.iter().filter(|of| **of == sender);
            self.round.taken.push((earlier.count(), ticket, from));
            self.round.senders.push(sender);
        }
        Ok(true)
    }

    /// `from` is where its bytes begin in the round.
    fn refuse_full(&mut self, entry: OpenRequest, from: usize) {
        self.refused_full += 1;
        let request = &self.round.payloads[from..];
        let path_id = self.layout.path_offset.map(|offset| word(request, offset));
        let report = RequestReport {
            request_id: entry.request_id,
            path_id: path_id.unwrap_or_default(),
            reported_ns: MonotonicNs::now().0,
            stage: Stage::Refused.code(),
            reason: Reason::TooManyRequests.code(),
            ..RequestReport::default()
        };
        if let Some(active) = entry.active {
            // A new request's buffer is empty. If it fails all the same, closing the stream tells the client.
            if let Err(error) = send(&active, &report) {
                crate::log::debug!(%error, "a refusal was not sent");
            }
            self.round.ended.push(active);
        }
        self.responses.wake();
    }

    /// Connects new clients, and lets go of those that are gone.
    pub(crate) fn update(&mut self, tickets: &mut Tickets) {
        self.deaths = self.maintained.deaths();
        let taken = self.service.dynamic_config();
        let places = (taken.number_of_clients(), MAX_CLIENTS);
        self.maintained.count_places(places, || {
            let mut members = Members::default();
            taken.list_clients(|it| members.add(it.node_id));
            members.count()
        });
        self.requests.count_places(&self.maintained);
        self.responses.count_places(&self.maintained);
        if let Err(error) = self.port.update_connections() {
            // The failures are counted where they happen.
            crate::log::debug!(?error, "a client was not connected");
        }
        self.close_departed(tickets);
        let failures = self.failures.swap(0, Ordering::Relaxed);
        if failures > 0 {
            crate::log::debug!(
                failures,
                service = self.layout.key,
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
    fn close_departed(&mut self, tickets: &mut Tickets) {
        self.is_updated.set(false);
        if tickets.is_empty() && self.held_back.is_empty() && self.round.ended.is_empty() {
            return;
        }
        let present = self.clients();
        let has_left = |active: &Active| !present.contains(&active.origin());
        let mut left = Vec::new();
        for entry in self.entries(tickets) {
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

    /// The requests that this port got.
    fn entries<'t>(
        &self,
        tickets: &'t mut Tickets,
    ) -> impl Iterator<Item = &'t mut OpenRequest> + use<'t> {
        let number = self.number;
        tickets
            .values_mut()
            .filter(move |entry| entry.port == number)
    }

    /// Closes the requests that their clients have given up.
    fn close_given_up(&self, tickets: &mut Tickets) {
        for entry in self.entries(tickets) {
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

    /// Whether another generation should begin.
    ///
    /// Either as much has gone wrong as may have made iceoryx2 keep 64 connections for good, half of what it can keep;
    /// or a client that could not be connected is still there after two seconds: its requests do not arrive. In a
    /// healthy domain neither happens.
    pub(crate) fn is_worn(&self) -> bool {
        let is_deaf = |(since, clients): &(MonotonicNs, Vec<UniqueClientId>)| {
            MonotonicNs::now().since(*since) >= UNCONNECTED_TIME && *clients == self.clients()
        };
        self.wear >= MAX_WEAR || self.unconnected.as_ref().is_some_and(is_deaf)
    }

    /// Tries again to send the final reports that found no room.
    fn send_unsent(&mut self, tickets: &mut Tickets) {
        let mut is_sent = false;
        let number = self.number;
        tickets.retain(|_, entry| {
            let is_over = entry.port == number
                && match (&entry.unsent, &entry.active) {
                    (Some(report), Some(active)) => send(active, report).is_ok(),
                    // It was given up: over for the caller as well.
                    (unsent, active) => unsent.is_some() && active.is_none(),
                };
            is_sent |= is_over;
            !is_over
        });
        if is_sent {
            self.responses.wake();
        }
    }

    /// A notification counts without a request too: a client may have given one up.
    ///
    /// Trouble counts as something: draining then says what it is.
    pub(crate) fn has_something(&self, look: Look) -> bool {
        if self.requests.is_pending() || self.deaths != self.maintained.deaths() || self.is_broken()
        {
            return true;
        }
        if look == Look::Quick && !self.may_have_more.get() {
            return false;
        }
        self.is_updated.set(true);
        let asked = catch_unwind(AssertUnwindSafe(|| self.port.has_requests()));
        self.is_broken.set(asked.is_err());
        let has_requests = asked.map_or(true, |has| has.unwrap_or(true));
        self.may_have_more.set(has_requests);
        has_requests
    }

    /// Whether iceoryx2 has panicked in this port when it was asked for requests.
    pub(crate) fn is_broken(&self) -> bool {
        self.is_broken.get()
    }
}
