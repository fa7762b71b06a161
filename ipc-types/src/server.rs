//! [`Server`]: takes requests and answers each with a stream of reports that ends in a final word.

use std::sync::Arc;
use std::time::Duration;

use iceoryx2::active_request::ActiveRequest;
use iceoryx2::port::{BackpressureAction, LoanError, SendError as IoxSendError};
use iceoryx2::prelude::BackpressureStrategy;
use iceoryx2::service::port_factory::server::ServerCreateError;
use iceoryx2_bb_posix::unique_system_id::UniqueSystemId;

use crate::code::{Reason, Stage};
use crate::doorbell;
use crate::event::{Channel, Event};
use crate::generation::Generation;
use crate::housekeeper::Tended;
use crate::iox::Svc;
use crate::open::{self, OpenError};
use crate::payload::RequestReport;
use crate::provider::ProviderLock;
use crate::service::{MAX_PROVIDERS, Request};
use crate::session::Session;
use crate::ticket::{Ticket, Tickets};
use crate::time::MonotonicNs;
use crate::waiter::{WaitError, Waiter, Wake, sealed};
use crate::wake::{WakeReceiver, WakeSender};

/// Requests that may be open at a server at once: three whole paths of 64 waypoints and 64 single requests.
///
/// One more is refused with [`Reason::TooManyRequests`]; nothing that is open is touched.
pub const MAX_OPEN_TICKETS: u32 = 256;

/// Reports that may be on their way to clients at once, at one server: eight for each open request.
///
/// iceoryx2 would reserve for the worst case of all clients at once, 30 MB for every client that connects. At the bound
/// the server is told [`ReportError::BufferFull`], as when one client's buffer is full.
const MAX_REPORTS_IN_FLIGHT: usize = 8 * MAX_OPEN_TICKETS as usize;

/// Most requests of one [`Server::drain`], so that a flood leaves time for the rest of the loop.
const MAX_REQUESTS_PER_DRAIN: usize = 256;

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
pub struct Server<R: Request> {
    // First, so that open requests are closed before the port goes, and their clients woken last of all.
    tickets: Tickets<Open<R>>,
    port: iceoryx2::port::server::Server<Svc, R, (), RequestReport, ()>,
    requests: WakeReceiver,
    responses: WakeSender,
    waiter: Waiter,
    refused_full: u64,
    /// Whether there are reports of which the clients were not told.
    is_quiet: bool,
    _tended: Arc<Tended>,
    _generation: Generation,
    _lock: ProviderLock,
    session: Arc<Session>,
}

struct Open<R: Request> {
    active: ActiveRequest<Svc, R, (), RequestReport, ()>,
    request_id: u64,
    /// The final word, while the client has no room for it.
    unsent: Option<RequestReport>,
}

impl<R: Request> Open<R> {
    fn send(&self, report: &RequestReport) -> Result<(), ReportError> {
        match self.active.send_copy(*report) {
            Ok(()) => Ok(()),
            Err(
                IoxSendError::UnableToDeliver | IoxSendError::LoanError(LoanError::OutOfMemory),
            ) => Err(ReportError::BufferFull),
            Err(error) => Err(ReportError::Failed(format!("{error:?}"))),
        }
    }
}

impl<R: Request> Server<R> {
    pub(crate) fn open(session: &Arc<Session>) -> Result<Server<R>, OpenError> {
        let robot = session.robot();
        let lock = session.provide(R::SERVICE)?;
        session.begin(R::SERVICE, |generation, tended| {
            let service = open::create_request::<R>(&generation, robot)?;
            let event = |channel| Event::create(&generation, robot, R::SERVICE, channel);
            let requests = WakeReceiver::new(event(Channel::Requests)?);
            requests.listener()?;
            let responses = event(Channel::Responses)?;
            let port = open::port(
                &R::SERVICE.name(robot),
                ("servers", MAX_PROVIDERS),
                |error| error == ServerCreateError::ExceedsMaxSupportedServers,
                || {
                    service
                        .server_builder()
                        .max_loaned_responses_per_request(1)
                        .override_response_preallocation(|_| MAX_REPORTS_IN_FLIGHT)
                        .backpressure_strategy(BackpressureStrategy::DiscardData)
                        // Not in silence: the caller must know that a report was not taken.
                        .set_backpressure_handler(|_| BackpressureAction::DiscardDataAndFail)
                        .create()
                },
            )?;
            Ok(Server {
                tickets: Tickets::with_capacity(MAX_OPEN_TICKETS),
                port,
                requests,
                responses: WakeSender::make(session, responses, R::SERVICE, Channel::Responses)?,
                waiter: Waiter::new(),
                refused_full: 0,
                is_quiet: false,
                _tended: tended,
                _generation: generation,
                _lock: lock,
                session: Arc::clone(session),
            })
        })
    }

    /// Hands on every request that is there, each with its ticket, and says how many those were.
    ///
    /// A request that finds no free ticket is refused here, with [`Reason::TooManyRequests`].
    ///
    /// # Errors
    ///
    /// [`ServeError`] when a client cannot be reached; what was handed on before counts.
    pub fn drain(&mut self, mut take: impl FnMut(Ticket, &R)) -> Result<usize, ServeError> {
        self.requests.take();
        self.send_unsent();
        let mut taken = 0;
        for _ in 0..MAX_REQUESTS_PER_DRAIN {
            let active = match self.port.receive() {
                Ok(None) => break,
                Ok(Some(active)) => active,
                Err(error) => {
                    return Err(ServeError {
                        service: R::SERVICE.spec().key,
                        reason: format!("{error:?}"),
                    });
                }
            };
            let request = *active.payload();
            let entry = Open {
                active,
                request_id: request.request_id(),
                unsent: None,
            };
            match self.tickets.insert(entry) {
                Ok(ticket) => {
                    take(ticket, &request);
                    taken += 1;
                }
                Err(entry) => self.refuse_full(&entry, &request),
            }
        }
        Ok(taken)
    }

    fn refuse_full(&mut self, entry: &Open<R>, request: &R) {
        self.refused_full += 1;
        let report = RequestReport {
            request_id: request.request_id(),
            path_id: request.path_id(),
            reported_ns: MonotonicNs::now().0,
            stage: Stage::Refused.code(),
            reason: Reason::TooManyRequests.code(),
            ..RequestReport::default()
        };
        // A new request's buffer is empty. If it fails all the same, closing the stream tells the client.
        if let Err(error) = entry.send(&report) {
            tracing::debug!(%error, "a refusal was not sent");
        }
        self.responses.wake();
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
        let entry = self.tickets.get_mut(ticket).ok_or(ReportError::NotOpen)?;
        if entry.unsent.is_some() {
            return Err(ReportError::NotOpen);
        }
        if !entry.active.is_connected() {
            self.tickets.remove(ticket);
            return Err(ReportError::Vanished);
        }
        let mut report = *report;
        report.request_id = entry.request_id;
        if report.reported_ns == 0 {
            report.reported_ns = MonotonicNs::now().0;
        }
        // An unknown stage is not final: the stream goes on.
        let is_final = Stage::from_code(report.stage).is_some_and(Stage::is_final);
        match entry.send(&report) {
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
            self.responses.wake();
        }
    }

    /// Hands on each open request whose client gave it up or died, with its id, and closes its ticket.
    ///
    /// [`ReportError::Vanished`] tells the same: a ticket is told of once, by either. A client that was killed is noticed
    /// when somebody cleans up after it.
    pub fn vanished(&mut self, mut gone: impl FnMut(Ticket, u64)) {
        // Also brings the port's list of clients up to date.
        let _ = self.port.has_requests();
        self.tickets.remove_where(
            |entry| !entry.active.is_connected(),
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
        let id = self.tickets.get(ticket)?.active.origin().value();
        u32::try_from(UniqueSystemId::from(id).pid().value()).ok()
    }

    /// Requests that are open.
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
            |entry| match &entry.unsent {
                Some(report) => entry.send(report).is_ok(),
                None => false,
            },
            |_, _| is_sent = true,
        );
        if is_sent {
            self.responses.wake();
        }
    }
}

/// Trouble counts as something: draining then says what it is.
fn has_requests<R: Request>(
    port: &iceoryx2::port::server::Server<Svc, R, (), RequestReport, ()>,
) -> bool {
    port.has_requests().unwrap_or(true)
}

impl<R: Request> sealed::Source for Server<R> {
    /// A notification counts without a request too: a client may have given one up.
    fn has_something(&self) -> bool {
        self.requests.is_pending() || has_requests(&self.port)
    }

    /// Clients of other languages, and those that vanish, are only heard by the listener.
    fn sense(&self) -> sealed::Sense<'_> {
        sealed::Sense::Port {
            doorbell: self.session.doorbell(),
            bits: doorbell::bits(R::SERVICE, Channel::Requests),
            receiver: Some(&self.requests),
            by_descriptor: true,
        }
    }
}
