//! [`ClientPort`]: a client's part in one generation, and what iceoryx2 asks of it.

use std::sync::Arc;
use std::time::Duration;

use iceoryx2::pending_response::PendingResponse;
use iceoryx2::port::client::RequestSendError;
use iceoryx2::port::{BackpressureAction, SendError as IoxSendError};
use iceoryx2::prelude::{BackpressureStrategy, PortFactory};
use iceoryx2::service::port_factory::client::ClientCreateError;

use crate::code::{Reason, Stage};
use crate::doorbell::ServiceEvent;
use crate::generation::{self, Generation};
use crate::iox::{AnyRequest, RequestService, Svc};
use crate::open::{self, Offer, OpenError};
use crate::payload::RequestReport;
use crate::provider::LockWatch;
use crate::random::fresh_request_id;
use crate::service::{MAX_CLIENTS, MAX_OUTSTANDING, REQUEST_ID_OFFSET, service_name, word};
use crate::session::Session;
use crate::time::MonotonicNs;
use crate::waiter::SAFETY_BOUND;
use crate::wake::{Event, WakeReceiver, WakeSender};

/// How often a waiting client looks whether its server still lives, which takes two system calls.
pub(crate) const LIVENESS_PERIOD: Duration = SAFETY_BOUND;

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

/// A client's part in one generation.
pub(crate) struct ClientPort {
    port: IoxClient,
    service: RequestService,
    /// Bytes of a request.
    size: usize,
    /// Where a request says when it was issued, if it does.
    issued_offset: Option<usize>,
    pub(crate) responses: WakeReceiver,
    pub(crate) requests: WakeSender,
    /// Whether the server still serves the generation.
    pub(crate) server: LockWatch,
    // Last: its node must outlive the ports.
    pub(crate) generation: Generation,
}

/// A request without a final report.
pub(crate) struct Outstanding {
    pub(crate) pending: Pending,
    pub(crate) request_id: u64,
    pub(crate) path_id: u64,
    /// The generation in which it was sent: the server answers it there, or not at all.
    pub(crate) generation: String,
}

type IoxClient = iceoryx2::port::client::Client<Svc, AnyRequest, (), RequestReport, ()>;
type Pending = PendingResponse<Svc, AnyRequest, (), RequestReport, ()>;
pub(crate) type Report = iceoryx2::response::Response<Svc, RequestReport, ()>;

impl ClientPort {
    pub(crate) fn open(
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
    pub(crate) fn has_server(&self) -> bool {
        self.service.dynamic_config().number_of_servers() > 0
    }

    /// Sends the bytes of a request, which are as many as the service says, under this id. One that does not say when it was issued
    /// is issued now.
    pub(crate) fn deliver(&self, request: &[u8], request_id: u64) -> Result<Pending, SendError> {
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
        // SAFETY: the service's requests have this size, which iceoryx2 has compared, and this one is the caller's alone. The
        // eight bytes of each number lie in it, by the layout that the offsets come from.
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
/// Every client counts from 0, and a server addresses its reports by the client's place in a list and by this number. So a
/// server that still holds a request of a client that died takes the first one of the next client in its place for it. Our
/// server looks whose request it is; this is for others, and for the instant in which our server cannot look.
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
    pub(crate) fn is_of(&self, port: &ClientPort) -> bool {
        port.generation.name() == self.generation
    }

    /// Whether the server that got the request still has it.
    pub(crate) fn is_served<'p>(&self, mut ports: impl Iterator<Item = &'p ClientPort>) -> bool {
        let port = ports.find(|port| self.is_of(port));
        port.is_some_and(|port| port.server.was_held()) && self.pending.is_connected()
    }

    /// Hands on the reports about this request.
    ///
    /// When a server has gone, iceoryx2 forgets the reports about all requests as soon as one of them has nothing left
    /// to read, unless a report is still borrowed. Therefore only requests that have something are read, and the first
    /// report of a round, the anchor, is kept until all have been.
    pub(crate) fn drain(&self, anchor: &mut Option<Report>, mut take: impl FnMut(&RequestReport)) {
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
    pub(crate) fn gone(&self, reason: Reason) -> RequestReport {
        RequestReport {
            request_id: self.request_id,
            path_id: self.path_id,
            reported_ns: MonotonicNs::now().0,
            ..RequestReport::new(Stage::Unknown, reason)
        }
    }
}
