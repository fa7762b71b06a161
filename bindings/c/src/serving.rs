//! [`Serving`]: a server that hands on its requests one at a time, and says which clients are gone; or one that hands
//! on each request once, by the rules of [`module_kit::requests`].

use std::collections::{HashMap, VecDeque};
use std::time::{Duration, Instant};

use ipc_types::payload::RequestReport;
use ipc_types::service::REQUEST_ID_OFFSET;
use ipc_types::{DynamicServer, Ipc, MonotonicNs, ReportError, Schema, Ticket, Wake};
use module_kit::answers::Answers;
use module_kit::requests::late;

use crate::error::Error;
use crate::service::ServiceName;

/// A server that hands on its requests one at a time: those of one drain wait here. There are at most
/// [`MAX_OPEN_TICKETS`](ipc_types::server::MAX_OPEN_TICKETS) of them, because each has a ticket.
pub struct Serving {
    server: DynamicServer,
    /// Requests that were not taken yet.
    waiting: VecDeque<(Ticket, Vec<u8>)>,
    /// Requests that were taken and whose client is gone, of which the caller was not told yet.
    gone: VecDeque<Ticket>,
    /// Of a server that hands on each request once.
    once: Option<Once>,
}

/// What a server remembers that hands on each request once.
struct Once {
    answers: Answers,
    /// The ids of requests that were handed on, by the tickets that their first clients had.
    ids: HashMap<Ticket, u64>,
    /// Where `begin_by_ns` lies in a request, if it has that field.
    begin_by: Option<usize>,
}

impl Once {
    fn new(schema: &Schema) -> Once {
        Once {
            answers: Answers::new(),
            ids: HashMap::new(),
            begin_by: schema.number("begin_by_ns").map(|field| field.offset),
        }
    }

    /// The answer to a request that is not handed on; `None` if it is.
    fn answer(&mut self, ticket: Ticket, request: &[u8]) -> Option<RequestReport> {
        let number = |offset| {
            let bytes = request.get(offset..)?.first_chunk()?;
            Some(u64::from_ne_bytes(*bytes))
        };
        let request_id = number(REQUEST_ID_OFFSET)?;
        let known = self.answers.known(request_id, ticket);
        if known.is_some() {
            return known;
        }
        let begin_by = self.begin_by.and_then(number).unwrap_or_default();
        let refused = late(MonotonicNs(begin_by), MonotonicNs::now());
        let first = RequestReport {
            request_id,
            ..refused.unwrap_or_default()
        };
        self.answers.begin(ticket, &first);
        if refused.is_none() {
            self.ids.insert(ticket, request_id);
        }
        refused
    }

    /// Notes a report about the request that was handed on with `ticket`: the client that hears it, if there is one.
    fn note(
        &mut self,
        ticket: Ticket,
        report: &RequestReport,
    ) -> Result<Option<Ticket>, ReportError> {
        let id = *self.ids.get(&ticket).ok_or(ReportError::NotOpen)?;
        let report = RequestReport {
            request_id: id,
            ..*report
        };
        if report.is_final() {
            self.ids.remove(&ticket);
        }
        self.answers.go_on(&report).ok_or(ReportError::NotOpen)
    }
}

/// What there is to do for a server.
#[derive(Debug)]
pub enum ServingEvent {
    /// Carry out this request.
    Request(Ticket, Vec<u8>),
    /// Stop working on this request: its client gave it up or died, and its ticket is closed.
    Gone(Ticket),
    /// The time is over.
    Nothing,
    /// A signal came first.
    Interrupted,
}

/// What became of a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reported {
    /// It is on its way.
    Sent,
    /// It was progress, for which the client has no room.
    Dropped,
    /// The client is gone; the ticket is closed.
    Gone,
}

impl Serving {
    /// Becomes the one server of a request service.
    ///
    /// # Errors
    ///
    /// See [`ServiceName::server`].
    pub fn open(ipc: &Ipc, service: &ServiceName<'_>) -> Result<Serving, Error> {
        Ok(Serving {
            server: service.server(ipc)?,
            waiting: VecDeque::new(),
            gone: VecDeque::new(),
            once: None,
        })
    }

    /// Opens the service so that each request is carried out once: one that is sent again gets the reports of the
    /// first. A client that is gone ends nothing, so no [`ServingEvent::Gone`] comes.
    ///
    /// # Errors
    ///
    /// See [`ServiceName::server`].
    pub fn open_once(ipc: &Ipc, service: &ServiceName<'_>) -> Result<Serving, Error> {
        let mut serving = Serving::open(ipc, service)?;
        serving.once = Some(Once::new(serving.server.schema()));
        Ok(serving)
    }

    /// The server below, for what needs no queue.
    pub fn server(&self) -> &DynamicServer {
        &self.server
    }

    /// The server below, as something to wait for.
    pub fn source(&mut self) -> &mut DynamicServer {
        &mut self.server
    }

    /// Bytes of a request.
    pub fn request_size(&self) -> usize {
        self.server.schema().size()
    }

    /// Whether there is something to do that was received before.
    pub fn has_waiting(&self) -> bool {
        !self.waiting.is_empty() || !self.gone.is_empty()
    }

    /// What is to be done next, waiting for it as long as `timeout`. That a client is gone comes before any request.
    ///
    /// # Errors
    ///
    /// When requests cannot be received, or waiting is not possible; the next call tries again.
    pub fn take(&mut self, timeout: Duration) -> Result<ServingEvent, Error> {
        let mut deadline = None;
        loop {
            let received = self.receive();
            if let Some(ticket) = self.gone.pop_front() {
                return Ok(ServingEvent::Gone(ticket));
            }
            while let Some((ticket, request)) = self.waiting.pop_front() {
                let once = self.once.as_mut();
                match once.and_then(|once| once.answer(ticket, &request)) {
                    Some(report) => self.tell(ticket, &report),
                    None => return Ok(ServingEvent::Request(ticket, request)),
                }
            }
            // What came before the failure is handed on first.
            received?;
            let now = Instant::now();
            let until = *deadline.get_or_insert(now + timeout);
            if now >= until {
                return Ok(ServingEvent::Nothing);
            }
            if self.server.wait(until - now)? == Wake::Interrupted {
                return Ok(ServingEvent::Interrupted);
            }
        }
    }

    fn receive(&mut self) -> Result<(), Error> {
        let (waiting, gone, once) = (&mut self.waiting, &mut self.gone, &mut self.once);
        self.server.vanished(|ticket, _| {
            if let Some(once) = once {
                once.answers.vanished(ticket);
            }
            match waiting.iter().position(|(of, _)| *of == ticket) {
                // The caller never saw it.
                Some(place) => {
                    waiting.remove(place);
                }
                None if once.is_some() => {}
                None => gone.push_back(ticket),
            }
        });
        self.server
            .drain(|ticket, request| waiting.push_back((ticket, request.to_vec())))?;
        Ok(())
    }

    /// Answers a request. A final stage closes it. A report without a client counts as sent where each request is
    /// handed on once: a client that asks again gets it.
    ///
    /// # Errors
    ///
    /// When the ticket is that of no open request, or the report could not be sent.
    pub fn report(&mut self, ticket: Ticket, report: &RequestReport) -> Result<Reported, Error> {
        let Some(once) = &mut self.once else {
            return self.send(ticket, report);
        };
        let Some(client) = once.note(ticket, report)? else {
            return Ok(Reported::Sent);
        };
        match self.send(client, report)? {
            Reported::Gone => Ok(Reported::Sent),
            sent => Ok(sent),
        }
    }

    /// Answers a request that is not handed on. What cannot be sent to its client concerns nobody else.
    fn tell(&mut self, ticket: Ticket, report: &RequestReport) {
        if let Err(error) = self.send(ticket, report) {
            tracing::debug!(%error, "a report was not sent");
        }
    }

    fn send(&mut self, ticket: Ticket, report: &RequestReport) -> Result<Reported, Error> {
        let sent = match self.server.report(ticket, report) {
            Ok(()) => Reported::Sent,
            Err(ReportError::BufferFull) => Reported::Dropped,
            Err(ReportError::Vanished) => Reported::Gone,
            // Closed by a look that the caller was not told of yet: now it is.
            Err(ReportError::NotOpen) => {
                let place = self.gone.iter().position(|of| *of == ticket);
                let place = place.ok_or(ReportError::NotOpen)?;
                self.gone.remove(place);
                Reported::Gone
            }
            Err(error) => return Err(error.into()),
        };
        if sent == Reported::Gone
            && let Some(once) = &mut self.once
        {
            once.answers.vanished(ticket);
        }
        Ok(sent)
    }
}
