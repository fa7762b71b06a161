//! [`Requests`]: the relay as a client of one of the robot's request services.

use ipc_types::dynamic::ServiceFacts;
use ipc_types::payload::RequestReport;
use ipc_types::{DynamicClient, DynamicError, Ipc, PortSet, SendError};

use crate::names;
use crate::orders::robot::{NotSent, Traits};
use crate::request::RequestFields;

/// A request service that is carried.
pub struct Requests {
    client: DynamicClient,
    fields: RequestFields,
    id: u64,
}

impl Requests {
    /// Opens the service, and lets `ports` wake the process for its reports.
    ///
    /// # Errors
    ///
    /// See [`DynamicError`].
    pub fn open(
        ipc: &Ipc,
        facts: &ServiceFacts,
        ports: &PortSet,
    ) -> Result<Requests, DynamicError> {
        let client = DynamicClient::open(ipc, &facts.key, &facts.schema)?;
        if let Err(error) = ports.add(client.descriptor()) {
            tracing::debug!(%error, "reports are looked for at every wake alone");
        }
        Ok(Requests {
            client,
            fields: RequestFields::of(&facts.schema),
            id: names::service_id(&facts.key, &facts.schema),
        })
    }

    /// What the service is called in orders.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// Whether a request has as many bytes as the service takes.
    pub fn fits(&self, request: &[u8]) -> bool {
        self.client.schema().size() == request.len()
    }

    /// What is to be known of a request before it is handed on.
    pub fn traits(&self, request: &[u8]) -> Traits {
        self.fields.traits(request)
    }

    /// Hands a request on.
    ///
    /// # Errors
    ///
    /// When the service does not take it now.
    pub fn send(&mut self, mut request: Vec<u8>, is_repeat: bool) -> Result<(), NotSent> {
        if is_repeat {
            self.fields.set_repeat(&mut request);
        }
        match self.client.send(&request) {
            Ok(_) => Ok(()),
            Err(SendError::NoServer { .. }) => Err(NotSent::NoServer),
            Err(error) => {
                tracing::debug!(%error, "a request was not handed on");
                Err(NotSent::Full)
            }
        }
    }

    /// Gives a request up.
    pub fn give_up(&mut self, request_id: u64) {
        self.client.give_up_one(request_id);
    }

    /// Hands on the reports that have come.
    pub fn drain(&mut self, take: impl FnMut(&RequestReport)) {
        self.client.drain(take);
    }
}
