//! [`Client`]: sends requests, several at once, and follows the reports about each to its final report. [`RequestHandle`] follows
//! one of them. What a client does with bytes, `BytesClient` does.
//!
//! Nothing is fire-and-forget: a request without a server is refused here, and one whose server vanishes ends with
//! [`Reason::BridgeGone`](crate::code::Reason::BridgeGone), so that its sender never waits for ever. Whether the request was
//! carried out is then unknown.

use std::marker::PhantomData;
use std::os::fd::BorrowedFd;
use std::sync::Arc;
use std::time::Duration;

use crate::bytes_client::BytesClient;
pub use crate::client_port::SendError;
use crate::forked::Owned;
use crate::open::{Offer, OpenError};
use crate::payload::RequestReport;
use crate::request_handle::RequestHandle;
use crate::service::Request;
use crate::session::Session;
use crate::waiter::{WaitError, Wake, sealed};

/// Sends requests and follows their reports.
///
/// ```no_run
/// use ipc_types::payload::MovementData;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let robot = ipc_types::Ipc::connect("operator")?;
/// let mut client = robot.client::<MovementData>()?;
/// let order = MovementData::take_off(ipc_types::fresh_request_id(), 10.0);
/// println!("{:?}", client.request(&order)?.result()?.stage());
/// # Ok(())
/// # }
/// ```
///
/// [`Client::request`] follows one request; [`Client::send`] and [`Client::drain`] follow several at once.
pub struct Client<R: Request> {
    bytes: Owned<BytesClient>,
    payload: PhantomData<fn(R)>,
}

impl<R: Request> Client<R> {
    /// `key` is that of `R`, or of another service that carries the same struct.
    pub(crate) fn open(session: &Arc<Session>, key: &str) -> Result<Client<R>, OpenError> {
        Ok(Client {
            bytes: BytesClient::open(session, Offer::of_request::<R>(key))?,
            payload: PhantomData,
        })
    }

    /// Sends a request, and follows it alone: its progress and its result.
    ///
    /// # Errors
    ///
    /// See [`SendError`]; nothing was sent then.
    pub fn request(&mut self, request: &R) -> Result<RequestHandle<'_>, SendError> {
        RequestHandle::send(&mut self.bytes, request.bytes())
    }

    /// Sends a request. Its reports come out of [`Client::drain`], the last with a final stage.
    ///
    /// Requests whose final report has come do not count as open, drained or not: their reports are kept for the next drain, see
    /// [`keep_report`](crate::keep_report).
    ///
    /// # Errors
    ///
    /// See [`SendError`]; nothing was sent then.
    pub fn send(&mut self, request: &R) -> Result<(), SendError> {
        self.bytes.send(request.bytes())
    }

    /// Hands on every report that is there and says how many those were. A request whose server is gone gets its final
    /// report from here: [`Stage::Unknown`](crate::code::Stage::Unknown),
    /// [`Reason::BridgeGone`](crate::code::Reason::BridgeGone).
    pub fn drain(&mut self, take: impl FnMut(&RequestReport)) -> usize {
        self.bytes.drain(take)
    }

    /// Sleeps until there is a report, the server is gone, a signal comes or `timeout` has passed.
    ///
    /// # Errors
    ///
    /// See [`WaitError`].
    pub fn wait(&mut self, timeout: Duration) -> Result<Wake, WaitError> {
        self.bytes.wait(timeout)
    }

    /// As [`Subscriber::descriptor`](crate::Subscriber::descriptor): it can be read once there are reports, and [`Client::drain`]
    /// empties it.
    ///
    /// # Errors
    ///
    /// As there.
    pub fn descriptor(&self) -> Result<BorrowedFd<'_>, WaitError> {
        self.bytes.descriptor()
    }

    /// Gives up all open requests: their server sees them as vanished.
    pub fn give_up(&mut self) {
        self.bytes.give_up();
    }

    /// Requests without a final report.
    pub fn outstanding(&self) -> usize {
        self.bytes.outstanding()
    }

    /// Whether a live process serves. One that hangs counts as alive.
    pub fn is_server_alive(&self) -> bool {
        self.bytes.is_server_alive()
    }
}

impl<R: Request> sealed::Source for Client<R> {
    fn has_something(&self, look: sealed::Look) -> bool {
        self.bytes.has_something(look)
    }

    fn sense(&self) -> sealed::Sense<'_> {
        self.bytes.sense()
    }
}
