//! [`DynamicClient`] and [`DynamicServer`]: requests whose struct this program was not built with, by their schema.

use std::os::fd::BorrowedFd;
use std::time::Duration;

use super::check::{check_key, check_provider, is_request, parse};
use super::error::DynamicError;
use crate::bytes_client::BytesClient;
use crate::client_port::SendError;
use crate::forked::Owned;
use crate::ipc::Ipc;
use crate::open::Offer;
use crate::payload::RequestReport;
use crate::request_handle::RequestHandle;
use crate::request_id::fresh_request_id;
use crate::schema::Schema;
use crate::server::{BytesServer, ReportError, ServeError};
use crate::service::{Pattern, REQUEST_ID_OFFSET, word};
use crate::ticket::Ticket;
use crate::waiter::{WaitError, Wake, sealed};

/// Sends requests whose struct is known by its schema alone, and follows their reports.
pub struct DynamicClient {
    bytes: Owned<BytesClient>,
    schema: Schema,
    key: String,
    /// The request that is being sent, with its id.
    request: Vec<u8>,
}

impl DynamicClient {
    /// Opens the request service `key` of the robot, whose requests `schema` describes; [`schema_of`](super::schema_of) finds it.
    /// The client may be there before the server.
    ///
    /// # Errors
    ///
    /// When the service carries something else: see [`DynamicError`].
    pub fn open(ipc: &Ipc, key: &str, schema: &Schema) -> Result<DynamicClient, DynamicError> {
        check(key, schema)?;
        // What the text would be for lies beside the service.
        let offer = Offer::of_request_schema(key, schema, "");
        Ok(DynamicClient {
            bytes: BytesClient::open(ipc.session(), offer)?,
            schema: schema.clone(),
            key: key.to_owned(),
            request: vec![0; schema.size()],
        })
    }

    /// What lies in a request.
    pub fn schema(&self) -> &Schema {
        &self.schema
    }

    /// Key of the service.
    pub fn key(&self) -> &str {
        &self.key
    }

    /// As [`Client::send`](crate::Client::send), of bytes, which are as many as the schema says. A `request_id` of 0 is replaced by
    /// a fresh one. Returns the request's id.
    ///
    /// # Errors
    ///
    /// See [`SendError`]; nothing was sent then.
    pub fn send(&mut self, request: &[u8]) -> Result<u64, SendError> {
        self.fill(request)?;
        self.bytes.send(&self.request)?;
        Ok(word(&self.request, REQUEST_ID_OFFSET))
    }

    /// As [`Client::request`](crate::Client::request), of bytes; see [`DynamicClient::send`].
    ///
    /// # Errors
    ///
    /// As [`DynamicClient::send`].
    pub fn request(&mut self, request: &[u8]) -> Result<RequestHandle<'_>, SendError> {
        self.fill(request)?;
        RequestHandle::send(&mut self.bytes, &self.request)
    }

    fn fill(&mut self, request: &[u8]) -> Result<(), SendError> {
        if request.len() != self.request.len() {
            return Err(SendError::Failed(format!(
                "a request `{}` has {} bytes, {} were given",
                self.schema.type_name(),
                self.request.len(),
                request.len()
            )));
        }
        self.request.copy_from_slice(request);
        if word(request, REQUEST_ID_OFFSET) == 0 {
            self.request[REQUEST_ID_OFFSET..][..8]
                .copy_from_slice(&fresh_request_id().to_ne_bytes());
        }
        Ok(())
    }

    /// As [`Client::drain`](crate::Client::drain).
    pub fn drain(&mut self, take: impl FnMut(&RequestReport)) -> usize {
        self.bytes.drain(take)
    }

    /// As [`Client::wait`](crate::Client::wait).
    ///
    /// # Errors
    ///
    /// See [`WaitError`].
    pub fn wait(&mut self, timeout: Duration) -> Result<Wake, WaitError> {
        self.bytes.wait(timeout)
    }

    /// As [`Client::descriptor`](crate::Client::descriptor).
    ///
    /// # Errors
    ///
    /// As there.
    pub fn descriptor(&self) -> Result<BorrowedFd<'_>, WaitError> {
        self.bytes.descriptor()
    }

    /// As [`Client::give_up`](crate::Client::give_up).
    pub fn give_up(&mut self) {
        self.bytes.give_up();
    }

    /// Gives up one request: its server sees it as vanished.
    pub fn give_up_one(&mut self, request_id: u64) {
        self.bytes.give_up_one(request_id);
    }

    /// Whether this request was sent and its final report has not come yet.
    pub fn is_open(&self, request_id: u64) -> bool {
        self.bytes.is_open(request_id)
    }

    /// Requests without a final report.
    pub fn outstanding(&self) -> usize {
        self.bytes.outstanding()
    }
}

impl sealed::Source for DynamicClient {
    fn has_something(&self, look: sealed::Look) -> bool {
        self.bytes.has_something(look)
    }

    fn sense(&self) -> sealed::Sense<'_> {
        self.bytes.sense()
    }
}

/// Serves requests whose struct is known by its schema alone: for other languages, and for tools.
pub struct DynamicServer {
    bytes: Owned<BytesServer>,
    schema: Schema,
}

impl DynamicServer {
    /// Becomes the one server of the request service `key` of the robot, whose requests the text of a schema describes; see
    /// [`schema`](crate::schema). One of the robot's own services can only carry what it always does.
    ///
    /// # Errors
    ///
    /// See [`DynamicError`]; [`OpenError::AlreadyProvided`](crate::OpenError::AlreadyProvided) in it names the live process that serves.
    pub fn open(ipc: &Ipc, key: &str, schema: &str) -> Result<DynamicServer, DynamicError> {
        let text = schema;
        let schema = parse(key, text)?;
        check(key, &schema)?;
        check_provider(key, ipc.session().process_name())?;
        let offer = Offer::of_request_schema(key, &schema, text);
        Ok(DynamicServer {
            bytes: BytesServer::open(ipc.session(), offer)?,
            schema,
        })
    }

    /// What lies in a request.
    pub fn schema(&self) -> &Schema {
        &self.schema
    }

    /// As [`Server::drain`](crate::Server::drain), of bytes: as many as the schema says, and valid for the call alone.
    ///
    /// # Errors
    ///
    /// See [`ServeError`].
    pub fn drain(&mut self, take: impl FnMut(Ticket, &[u8])) -> Result<usize, ServeError> {
        self.bytes.drain(take)
    }

    /// As [`Server::report`](crate::Server::report).
    ///
    /// # Errors
    ///
    /// See [`ReportError`].
    pub fn report(&mut self, ticket: Ticket, report: &RequestReport) -> Result<(), ReportError> {
        self.bytes.report(ticket, report)
    }

    /// As [`Server::vanished`](crate::Server::vanished).
    pub fn vanished(&mut self, gone: impl FnMut(Ticket, u64)) {
        self.bytes.vanished(gone);
    }

    /// As [`Server::wait`](crate::Server::wait).
    ///
    /// # Errors
    ///
    /// See [`WaitError`].
    pub fn wait(&mut self, timeout: Duration) -> Result<Wake, WaitError> {
        self.bytes.wait(timeout)
    }

    /// As [`Server::descriptor`](crate::Server::descriptor).
    ///
    /// # Errors
    ///
    /// As there.
    pub fn descriptor(&self) -> Result<BorrowedFd<'_>, WaitError> {
        self.bytes.descriptor()
    }

    /// Generations of shared memory that this server has begun, the first included.
    pub fn generations(&self) -> u64 {
        self.bytes.generations()
    }
}

impl sealed::Source for DynamicServer {
    fn has_something(&self, look: sealed::Look) -> bool {
        self.bytes.has_something(look)
    }

    fn sense(&self) -> sealed::Sense<'_> {
        self.bytes.sense()
    }
}

/// Whether a request service with this schema may have this key.
fn check(key: &str, schema: &Schema) -> Result<(), DynamicError> {
    if !is_request(schema) {
        return Err(DynamicError::NoRequest(key.to_owned()));
    }
    check_key(key, Pattern::RequestResponse, schema.request_layout_hash())
}

#[cfg(test)]
mod tests;
