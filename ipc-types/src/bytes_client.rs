//! [`BytesClient`]: sends requests that are bytes, and follows their reports. It knows nothing of structs.

use std::collections::VecDeque;
use std::mem;
use std::os::fd::BorrowedFd;
use std::sync::Arc;
use std::time::Duration;

use crate::client_port::{ClientPort, Outstanding, SendError};
use crate::doorbell::{Channel, Place, place};
use crate::follow::{Follower, until_room};
use crate::open::{Offer, OpenError};
use crate::payload::RequestReport;
use crate::pollable::Pollable;
use crate::service::{MAX_OUTSTANDING, REQUEST_ID_OFFSET, word};
use crate::session::Session;
use crate::waiter::{WaitError, Waiter, Wake, sealed};

/// Sends requests that are bytes.
pub(crate) struct BytesClient {
    // First, so that the server sees the requests closed before it is woken by the end of the sender.
    outstanding: Vec<Outstanding>,
    /// Nothing while no server has been there.
    port: Option<ClientPort>,
    /// The port of the former generation, for as long as requests are open there.
    former: Option<ClientPort>,
    /// Reports that came while a handle followed another request.
    kept: VecDeque<RequestReport>,
    follower: Follower,
    waiter: Waiter,
    pollable: Pollable,
    place: Place,
    offer: Offer,
    session: Arc<Session>,
}

// SAFETY: a client owns all that shares its counts of references, see [`Svc`](crate::iox::Svc); no other thread has any of it.
#[allow(unsafe_code)]
unsafe impl Send for BytesClient {}

impl BytesClient {
    pub(crate) fn open(session: &Arc<Session>, offer: Offer) -> Result<BytesClient, OpenError> {
        let mut client = BytesClient {
            outstanding: Vec::with_capacity(MAX_OUTSTANDING),
            port: None,
            former: None,
            kept: VecDeque::new(),
            follower: Follower::new(session, &offer.key),
            waiter: Waiter::new(),
            pollable: Pollable::default(),
            place: place(&offer.key),
            offer,
            session: Arc::clone(session),
        };
        match until_room(session, client.place, || client.follow()) {
            // Its server has gone in this moment, or goes: the next one will be followed.
            Err(error @ (OpenError::Failed { .. } | OpenError::Domain(_))) => {
                tracing::debug!(%error, "there is no server yet");
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

    /// Enters another generation if there is one, unless requests are open in two already.
    fn follow(&mut self) -> Result<(), OpenError> {
        if self.outstanding.is_empty() {
            self.former = None;
        }
        if self.former.is_some() || !self.follower.is_due() {
            return Ok(());
        }
        self.change_generation()
    }

    /// Apart from [`follow`](BytesClient::follow), which every request calls: a port that is moved about takes microseconds.
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
            let former = self.port.replace(port);
            self.former = former.filter(|_| !self.outstanding.is_empty());
        }
        Ok(())
    }

    /// See [`Client::send`](crate::Client::send). The bytes are as many as the service's requests have.
    pub(crate) fn send(&mut self, request: &[u8]) -> Result<(), SendError> {
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
        let path_id = self.offer.path_offset.map(|offset| word(request, offset));
        self.outstanding.push(Outstanding {
            pending,
            request_id: word(request, REQUEST_ID_OFFSET),
            path_id: path_id.unwrap_or_default(),
            generation: port.generation.name().to_owned(),
        });
        Ok(())
    }

    /// Gives up one request: its server sees it as vanished.
    pub(crate) fn give_up_one(&mut self, request_id: u64) {
        self.give_up_those(|outstanding| outstanding.request_id == request_id);
    }

    /// The reports about other requests that a handle has kept, and keeps.
    pub(crate) fn kept(&mut self) -> &mut VecDeque<RequestReport> {
        &mut self.kept
    }

    /// See [`Client::drain`](crate::Client::drain).
    pub(crate) fn drain(&mut self, mut take: impl FnMut(&RequestReport)) -> usize {
        let kept = self.kept.len();
        self.kept.drain(..).for_each(|report| take(&report));
        kept + self.receive(take)
    }

    /// As [`BytesClient::drain`], of what comes now.
    pub(crate) fn receive(&mut self, mut take: impl FnMut(&RequestReport)) -> usize {
        for port in self.port.iter().chain(&self.former) {
            port.responses.take();
        }
        self.pollable.drained();
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

    pub(crate) fn wait(&mut self, timeout: Duration) -> Result<Wake, WaitError> {
        let waiter = mem::take(&mut self.waiter);
        let wake = waiter.wait_for_one(self, timeout);
        self.waiter = waiter;
        wake
    }

    /// See [`Client::descriptor`](crate::Client::descriptor).
    pub(crate) fn descriptor(&self) -> Result<BorrowedFd<'_>, WaitError> {
        let receiver = self.port.as_ref().map(|port| &port.responses);
        self.pollable.descriptor(receiver)
    }

    /// See [`Client::give_up`](crate::Client::give_up).
    pub(crate) fn give_up(&mut self) {
        self.kept.clear();
        self.give_up_those(|_| true);
    }

    fn give_up_those(&mut self, is_meant: impl Fn(&Outstanding) -> bool) {
        let before = self.outstanding.len();
        self.outstanding
            .retain(|outstanding| !is_meant(outstanding));
        if self.outstanding.len() < before {
            for port in self.port.iter().chain(&self.former) {
                port.requests.wake();
            }
        }
    }

    pub(crate) fn outstanding(&self) -> usize {
        self.outstanding.len()
    }

    /// See [`Client::is_server_alive`](crate::Client::is_server_alive).
    pub(crate) fn is_server_alive(&self) -> bool {
        let provider = self.session.watch(&self.offer.key).look();
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
            service: self.offer.key.clone(),
            robot: self.session.robot().get(),
        }
    }

    /// Whether draining would hand something on.
    fn has_reports(&self) -> bool {
        if !self.kept.is_empty() {
            return true;
        }
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

impl Drop for BytesClient {
    fn drop(&mut self) {
        self.give_up();
    }
}

impl sealed::Source for BytesClient {
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
