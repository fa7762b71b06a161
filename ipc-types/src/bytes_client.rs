//! [`BytesClient`]: sends requests that are bytes, and follows their reports. It knows nothing of structs.

use std::collections::VecDeque;
use std::mem;
use std::os::fd::BorrowedFd;
use std::sync::Arc;
use std::time::Duration;

use crate::client_port::{ClientPort, Outstanding, SendError};
use crate::code::Reason;
use crate::doorbell::{Channel, Place, place};
use crate::follow::{Follower, until_room};
use crate::forked::Owned;
use crate::open::{Offer, OpenError};
use crate::payload::RequestReport;
use crate::pollable::Pollable;
use crate::service::{MAX_OUTSTANDING, REQUEST_ID_OFFSET, RESPONSE_BUFFER, word};
use crate::session::Session;
use crate::waiter::{WaitError, Waiter, Wake, sealed};

/// Reports that a client keeps for its next drain: as many as can wait unread, 64. [`keep_report`] says which are dropped at the bound.
pub(crate) const MAX_KEPT: usize = MAX_OUTSTANDING * RESPONSE_BUFFER;

/// Keeps a report that the program has not asked for yet, beside at most `most` others. At that bound the oldest that is not final is
/// dropped; when all are final, the oldest.
pub fn keep_report(kept: &mut VecDeque<RequestReport>, report: RequestReport, most: usize) {
    if kept.len() >= most {
        let oldest = kept.iter().position(|report| !report.is_final());
        kept.remove(oldest.unwrap_or_default());
    }
    kept.push_back(report);
}

/// Sends requests that are bytes.
pub(crate) struct BytesClient {
    // First, so that the server sees the requests closed before it is woken by the end of the sender.
    outstanding: Vec<Outstanding>,
    /// Nothing while no server has been there.
    port: Option<ClientPort>,
    /// The ports of former generations, for as long as requests are open there.
    former: Vec<ClientPort>,
    /// Reports that came while a handle followed another request, or while a request was sent.
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
    pub(crate) fn open(
        session: &Arc<Session>,
        offer: Offer,
    ) -> Result<Owned<BytesClient>, OpenError> {
        let mut client = BytesClient {
            outstanding: Vec::with_capacity(MAX_OUTSTANDING),
            port: None,
            former: Vec::new(),
            kept: VecDeque::new(),
            follower: Follower::new(session, &offer.key),
            waiter: Waiter::new(),
            pollable: Pollable::default(),
            place: place(&offer.key),
            offer,
            session: Arc::clone(session),
        };
        let key = client.offer.key.clone();
        match until_room(session, &key, || client.follow()) {
            // Its server has gone in this moment, or goes: the next one will be followed.
            Err(error) if error.may_pass() => {
                tracing::debug!(%error, "there is no server yet");
            }
            result => result?,
        }
        Ok(Owned::new(client))
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
            self.former.extend(self.port.replace(port));
            self.drop_former();
        }
        Ok(())
    }

    /// See [`Client::send`](crate::Client::send). The bytes are as many as the service's requests have.
    pub(crate) fn send(&mut self, request: &[u8]) -> Result<(), SendError> {
        self.session
            .check_process()
            .map_err(|forked| SendError::Failed(forked.to_string()))?;
        if self.outstanding.len() >= MAX_OUTSTANDING {
            self.keep_what_came();
        }
        if self.outstanding.len() >= MAX_OUTSTANDING {
            return Err(SendError::TooManyOutstanding);
        }
        self.follow().map_err(|error| match error {
            OpenError::Full { .. } => SendError::NoPlace(error.to_string()),
            error => SendError::Failed(error.with_cause()),
        })?;
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

    /// Keeps the reports that are there for the next drain: a request whose final report is among them is open no longer.
    fn keep_what_came(&mut self) {
        let mut kept = mem::take(&mut self.kept);
        self.receive(|report| keep_report(&mut kept, *report, MAX_KEPT));
        self.kept = kept;
    }

    /// See [`DynamicClient::is_open`](crate::DynamicClient::is_open).
    pub(crate) fn is_open(&self, request_id: u64) -> bool {
        let mut open = self.outstanding.iter();
        open.any(|outstanding| outstanding.request_id == request_id)
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
        if self.session.check_process().is_err() {
            return 0;
        }
        for port in self.port.iter().chain(&self.former) {
            port.responses.take();
        }
        self.pollable.drained();
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
        self.session.check_process()?;
        let receiver = self.port.as_ref().map(|port| &port.responses);
        self.pollable.descriptor(receiver)
    }

    /// See [`Client::give_up`](crate::Client::give_up).
    pub(crate) fn give_up(&mut self) {
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
            bits: self.place.bits(Channel::Responses),
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
