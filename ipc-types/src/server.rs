//! [`Server`]: takes requests and answers each with a stream of reports that ends in a final report.

use std::any::Any;
use std::mem;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::time::Duration;

use crate::code::Stage;
use crate::doorbell::ServiceEvent;
use crate::generation;
use crate::open::{Offer, OpenError};
use crate::payload::RequestReport;
use crate::pollable::Pollable;
use crate::port::{self, Payload, Port};
use crate::provider::ProviderLock;
pub use crate::serving_port::{MAX_OPEN_TICKETS, ReportError, ServeError};
use crate::serving_port::{ServingPort, Tickets};
use crate::session::Session;
pub use crate::tickets::Ticket;
use crate::time::MonotonicNs;
use crate::waiter::sealed;

/// How long a server at least takes requests in its former generation too. Clients change with their next request.
const OVERLAP: Duration = Duration::from_secs(1);

/// How long after a failure the server tries again to begin a new generation.
const RETRY: Duration = Duration::from_secs(1);

/// Former generations in which requests are open still. When there are more, the oldest is given up: what becomes of
/// its requests cannot be known to their clients.
const MAX_FORMER: usize = 3;

/// Takes the requests of a service, of which a robot has one server.
///
/// ```no_run
/// use ipc_types::code::{Reason, Stage};
/// use ipc_types::payload::{ModuleControl, RequestReport};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let mut server = ipc_types::Ipc::connect("bridge")?.server::<ModuleControl>()?;
/// let mut tickets = Vec::new();
/// server.drain(|ticket, request| tickets.push((ticket, request.request_id)))?;
/// for (ticket, _) in tickets {
///     server.report(ticket, &RequestReport::new(Stage::Done, Reason::None))?;
/// }
/// # Ok(())
/// # }
/// ```
///
/// [`Server::drain`] gives each request a [`Ticket`]; [`Server::report`] answers by it as often as need be, until a
/// final stage closes it.
pub type Server<R> = Port<BytesServer, R>;

impl<P: Payload> Server<P> {
    /// Hands on the requests that are there, each with its ticket, and says how many those were.
    ///
    /// Clients are served in turn: the first request of each, then the second of each. Each has a share of
    /// [`MAX_OUTSTANDING`](crate::service::MAX_OUTSTANDING) in one call, however quickly it sends; what it sends beyond
    /// waits for the next.
    ///
    /// A request whose client has given it up, or is gone, is dropped unseen. One that finds no free ticket is refused
    /// here, with [`Reason::TooManyRequests`](crate::code::Reason::TooManyRequests). Ask before who has
    /// [`vanished`](Server::vanished).
    ///
    /// # Errors
    ///
    /// [`ServeError`] when iceoryx2 fails; what was handed on counts. Where a client cannot be connected, a new
    /// generation begins.
    pub fn drain(&mut self, mut take: impl FnMut(Ticket, &P::View)) -> Result<usize, ServeError> {
        self.core
            .drain(|ticket, request| P::read(request, |request| take(ticket, request)))
    }

    /// Answers a request. A final stage closes it; its ticket is then worth nothing.
    ///
    /// `request_id` is written here, and `reported_ns` if it is 0. A final report that the client has no room for is
    /// kept and sent by a later [`Server::drain`]; this counts as sent.
    ///
    /// # Errors
    ///
    /// See [`ReportError`]. Losing progress to a full buffer is not serious: the final report always comes.
    pub fn report(&mut self, ticket: Ticket, report: &RequestReport) -> Result<(), ReportError> {
        self.core.report(ticket, report)
    }

    /// As [`Server::report`], but leaves the clients asleep until [`Server::wake_clients`]: for a server that has
    /// something more urgent to do than to wake others, who would take its processor.
    ///
    /// # Errors
    ///
    /// As [`Server::report`].
    pub fn report_quietly(
        &mut self,
        ticket: Ticket,
        report: &RequestReport,
    ) -> Result<(), ReportError> {
        self.core.report_quietly(ticket, report)
    }

    /// Wakes the clients if there was a quiet report since the last time.
    pub fn wake_clients(&mut self) {
        self.core.wake_clients();
    }

    /// Hands on each open request whose client gave it up or died, with its id, and closes its ticket.
    ///
    /// [`ReportError::Vanished`] tells the same: a ticket is told of once, by either. A client that was killed is
    /// noticed within two seconds.
    pub fn vanished(&mut self, gone: impl FnMut(Ticket, u64)) {
        self.core.vanished(gone);
    }

    /// The process that sent a request which is open, by its id in the sender's own PID namespace.
    pub fn sender(&self, ticket: Ticket) -> Option<u32> {
        self.core.tickets.get(ticket)?.sender()
    }

    /// Requests that have a ticket.
    pub fn open_tickets(&self) -> usize {
        self.core.tickets.len()
    }

    /// Requests that were refused because too many were open.
    pub fn refused_full(&self) -> u64 {
        self.core.refused_full + self.core.port.refused_full()
    }

    /// Generations of shared memory that this server has begun, the first included.
    pub fn generations(&self) -> u64 {
        self.core.port.number()
    }

    /// Begins a new generation at the next [`Server::drain`], as if the present one were worn: for tests.
    #[doc(hidden)]
    pub fn wear_out(&self) {
        self.core.port.maintained.wear_out("it was asked for");
    }
}

/// Takes requests that are bytes.
pub struct BytesServer {
    // First, so that open requests are closed before the ports go, and their clients woken last of all.
    tickets: Tickets,
    port: ServingPort,
    /// The ports of former generations, until their last request is answered, and when they began to be former.
    former: Vec<(ServingPort, MonotonicNs)>,
    /// When to try again to begin a new generation.
    retry: MonotonicNs,
    pollable: Pollable,
    refused_full: u64,
    /// Whether there are reports of which the clients were not told.
    is_quiet: bool,
    offer: Offer,
    lock: Arc<ProviderLock>,
    session: Arc<Session>,
}

// SAFETY: the requests that it has taken share counts of references with its ports alone, see [`Svc`](crate::iox::Svc).
#[allow(unsafe_code)]
unsafe impl Send for BytesServer {}

impl BytesServer {
    pub(crate) fn open(session: &Arc<Session>, offer: Offer) -> Result<BytesServer, OpenError> {
        let lock = session.provide(&offer.key)?;
        Ok(BytesServer {
            tickets: Tickets::with_capacity(MAX_OPEN_TICKETS as usize),
            port: ServingPort::make(session, &lock, &offer, 1)?,
            former: Vec::with_capacity(MAX_FORMER),
            retry: MonotonicNs::default(),
            pollable: Pollable::default(),
            refused_full: 0,
            is_quiet: false,
            offer,
            lock,
            session: Arc::clone(session),
        })
    }

    fn drain(&mut self, mut take: impl FnMut(Ticket, &[u8])) -> Result<usize, ServeError> {
        self.session
            .check_process()
            .map_err(|forked| self.failed(forked.to_string()))?;
        self.change_generation();
        self.pollable.drained();
        let read = self.guarded(ServingPort::read);
        let ports = self.former.iter_mut().map(|(former, _)| former);
        let taken = ports
            .chain([&mut self.port])
            .map(|port| port.hand_on(&mut take))
            .sum();
        read.map(|()| taken)
    }

    /// Does with all ports what calls iceoryx2. A port in which that panics is not touched again; in the place of the
    /// present one a new generation begins.
    fn guarded(
        &mut self,
        act: impl Fn(&mut ServingPort, &mut Tickets) -> Result<(), ServeError>,
    ) -> Result<(), ServeError> {
        let tickets = &mut self.tickets;
        let mut guard = |port: &mut ServingPort| match port.is_broken() {
            true => Err(Box::new("asked for requests") as Box<dyn Any + Send>),
            false => catch_unwind(AssertUnwindSafe(|| act(port, tickets))),
        };
        // What fails in a former one has no consequence: its clients change to the new generation.
        let is_broken = |(former, _): &mut (ServingPort, _)| guard(former).is_err();
        let broken: Vec<_> = self.former.extract_if(.., is_broken).collect();
        let result = guard(&mut self.port);
        for (port, _) in broken {
            self.abandon(port);
        }
        result.unwrap_or_else(|panic| self.replace_broken(panic))
    }

    /// Gives up a broken port. Its listener, which stays open and is not emptied again, would keep an event loop awake.
    fn abandon(&mut self, broken: ServingPort) {
        self.pollable.forget(&broken.requests);
        broken.abandon(&mut self.tickets);
    }

    fn replace_broken(&mut self, panic: Box<dyn Any + Send>) -> Result<(), ServeError> {
        let number = self.port.number() + 1;
        let Ok(port) = ServingPort::make(&self.session, &self.lock, &self.offer, number) else {
            // The locks go with the process.
            resume_unwind(panic);
        };
        let broken = self.replace_port(port);
        self.abandon(broken);
        Err(self.failed("iceoryx2 panicked; a new generation has begun".to_owned()))
    }

    fn failed(&self, reason: String) -> ServeError {
        ServeError {
            service: self.offer.key.clone(),
            reason,
        }
    }

    fn replace_port(&mut self, port: ServingPort) -> ServingPort {
        self.pollable.change(&port.requests);
        mem::replace(&mut self.port, port)
    }

    fn change_generation(&mut self) {
        self.drop_former();
        let is_worn = self.port.maintained.is_worn() || self.port.is_worn();
        if !is_worn {
            return;
        }
        let now = MonotonicNs::now();
        if now < self.retry {
            return;
        }
        self.retry = now + RETRY;
        match ServingPort::make(
            &self.session,
            &self.lock,
            &self.offer,
            self.port.number() + 1,
        ) {
            Ok(port) => {
                let former = self.replace_port(port);
                if self.former.len() == MAX_FORMER {
                    let (oldest, _) = self.former.remove(0);
                    self.tickets
                        .retain(|_, entry| !entry.is_of(oldest.number()));
                    self.pollable.forget(&oldest.requests);
                    self.session.housekeeper().drop_later(oldest);
                }
                self.former.push((former, now));
            }
            Err(error) => crate::log::warn!(%error, "the generation stays as it is"),
        }
    }

    /// Drops former ports whose requests are all answered.
    fn drop_former(&mut self) {
        if self.former.is_empty() {
            return;
        }
        let now = MonotonicNs::now();
        let tickets = &mut self.tickets;
        for (former, _) in self.former.extract_if(.., |(former, since)| {
            let number = former.number();
            now.since(*since) >= OVERLAP && !tickets.values().any(|entry| entry.is_of(number))
        }) {
            self.refused_full += former.refused_full();
            self.pollable.forget(&former.requests);
            self.session.housekeeper().drop_later(former);
        }
    }

    fn report(&mut self, ticket: Ticket, report: &RequestReport) -> Result<(), ReportError> {
        let result = self.report_quietly(ticket, report);
        self.wake_clients();
        result
    }

    fn report_quietly(
        &mut self,
        ticket: Ticket,
        report: &RequestReport,
    ) -> Result<(), ReportError> {
        self.session
            .check_process()
            .map_err(|forked| ReportError::Failed(forked.to_string()))?;
        self.port.settle(&mut self.tickets);
        for (former, _) in &mut self.former {
            former.settle(&mut self.tickets);
        }
        let entry = self.tickets.get_mut(ticket).ok_or(ReportError::NotOpen)?;
        if entry.unsent.is_some() {
            return Err(ReportError::NotOpen);
        }
        let mut report = *report;
        report.request_id = entry.request_id;
        if report.reported_ns == 0 {
            report.reported_ns = MonotonicNs::now().0;
        }
        // An unknown stage is not final: the stream goes on.
        let is_final = Stage::from_code(report.stage).is_some_and(Stage::is_final);
        match entry.send(&report) {
            None => {
                self.tickets.remove(ticket);
                return Err(ReportError::Vanished);
            }
            Some(Ok(())) if is_final => {
                self.tickets.remove(ticket);
            }
            Some(Ok(())) => {}
            Some(Err(ReportError::BufferFull)) if is_final => entry.unsent = Some(report),
            Some(Err(error)) => return Err(error),
        }
        self.is_quiet = true;
        Ok(())
    }

    fn wake_clients(&mut self) {
        if mem::take(&mut self.is_quiet) && self.session.check_process().is_ok() {
            self.port.responses.wake();
            for (former, _) in &self.former {
                former.responses.wake();
            }
        }
    }

    fn vanished(&mut self, mut gone: impl FnMut(Ticket, u64)) {
        if self.session.check_process().is_err() {
            return;
        }
        let updated = self.guarded(|port, tickets| {
            port.update(tickets);
            Ok(())
        });
        // That of a broken port, whose requests are said to be gone here. `drain` hands such an error to its caller.
        if let Err(error) = updated {
            crate::log::warn!("{error}");
        }
        self.tickets.retain(|ticket, entry| {
            let is_open = entry.is_open();
            // A request that had its final report, though the client never read it, is over for the caller.
            if !is_open && entry.unsent.is_none() {
                gone(ticket, entry.request_id);
            }
            is_open
        });
    }
}

impl Drop for BytesServer {
    fn drop(&mut self) {
        generation::withdraw(&self.lock);
    }
}

impl sealed::Source for BytesServer {
    fn has_something(&self, look: sealed::Look) -> bool {
        // The listeners of former generations do not wake the waiter.
        let mut former = self.former.iter().map(|(former, _)| former);
        self.port.has_something(look)
            || former.any(|port| port.has_something(sealed::Look::Thorough))
    }

    /// Clients of other languages, and those that vanish, are only heard by the listener.
    fn sense(&self) -> sealed::Sense<'_> {
        sealed::Sense::Port {
            doorbell: self.session.doorbell(),
            bits: self.offer.slot.bits(ServiceEvent::Requests),
            receiver: Some(&self.port.requests),
            by_descriptor: true,
            bound: match self.former.is_empty() {
                true => sealed::Bound::LONG,
                false => sealed::Bound::SHORT,
            },
        }
    }
}

port::core!(BytesServer);
