//! [`Serving`]: a server that hands on its requests one at a time, and says which clients are gone.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use ipc_types::payload::RequestReport;
use ipc_types::{DynamicServer, Ipc, ReportError, Ticket, Wake};

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
}

/// What there is to do for a server.
#[derive(Debug)]
pub enum Order {
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
        })
    }

    /// The server below, for what needs no queue.
    pub fn server(&self) -> &DynamicServer {
        &self.server
    }

    /// The same, to wait for.
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
    pub fn take(&mut self, timeout: Duration) -> Result<Order, Error> {
        let mut deadline = None;
        loop {
            let received = self.receive();
            if let Some(ticket) = self.gone.pop_front() {
                return Ok(Order::Gone(ticket));
            }
            if let Some((ticket, request)) = self.waiting.pop_front() {
                return Ok(Order::Request(ticket, request));
            }
            // What came before the failure is handed on first.
            received?;
            let now = Instant::now();
            let until = *deadline.get_or_insert(now + timeout);
            if now >= until {
                return Ok(Order::Nothing);
            }
            if self.server.wait(until - now)? == Wake::Interrupted {
                return Ok(Order::Interrupted);
            }
        }
    }

    fn receive(&mut self) -> Result<(), Error> {
        let (waiting, gone) = (&mut self.waiting, &mut self.gone);
        self.server.vanished(|ticket, _| {
            match waiting.iter().position(|(of, _)| *of == ticket) {
                // The caller never saw it.
                Some(place) => {
                    waiting.remove(place);
                }
                None => gone.push_back(ticket),
            }
        });
        self.server
            .drain(|ticket, request| waiting.push_back((ticket, request.to_vec())))?;
        Ok(())
    }

    /// Answers a request. A final stage closes it.
    ///
    /// # Errors
    ///
    /// When the ticket is that of no open request, or the report could not be sent.
    pub fn report(&mut self, ticket: Ticket, report: &RequestReport) -> Result<Reported, Error> {
        match self.server.report(ticket, report) {
            Ok(()) => Ok(Reported::Sent),
            Err(ReportError::BufferFull) => Ok(Reported::Dropped),
            Err(ReportError::Vanished) => Ok(Reported::Gone),
            // Closed by a look that the caller was not told of yet: now it is.
            Err(ReportError::NotOpen) => match self.gone.iter().position(|of| *of == ticket) {
                Some(place) => {
                    self.gone.remove(place);
                    Ok(Reported::Gone)
                }
                None => Err(ReportError::NotOpen.into()),
            },
            Err(error) => Err(error.into()),
        }
    }
}
