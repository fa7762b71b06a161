//! [`Services`]: what Foxglove clients can call, under numbers that stay the same as long as the service does.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::message::{ServiceInfo, ServiceSide};

/// How requests and answers are written.
pub(crate) const ENCODING: &str = "json";

/// How their layout is written.
const SCHEMA_ENCODING: &str = "jsonschema";

/// Most services that were ever offered: 16 of 32 robots. Further ones are not offered.
const MAX_SERVICES: usize = 512;

/// A service: its request and its answer are JSON.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct OfferedService {
    /// Such as `/robot1/hold`.
    pub name: String,
    /// Name of its type, from which those of request and answer are made.
    pub kind: String,
    /// JSON Schema of the request.
    pub request: Arc<str>,
    /// JSON Schema of the answer.
    pub response: Arc<str>,
}

/// See the module's documentation.
#[derive(Debug, Default)]
pub(crate) struct Services {
    ids: BTreeMap<OfferedService, u32>,
    offered: BTreeMap<u32, OfferedService>,
    /// Grows when what is offered changes.
    version: u64,
}

impl Services {
    /// Offers these and no others.
    pub fn set(&mut self, services: &[OfferedService]) {
        let mut offered = BTreeMap::new();
        for service in services {
            let next = self.ids.len() as u32 + 1;
            if self.ids.len() < MAX_SERVICES || self.ids.contains_key(service) {
                let id = *self.ids.entry(service.clone()).or_insert(next);
                offered.insert(id, service.clone());
            }
        }
        if offered != self.offered {
            self.offered = offered;
            self.version += 1;
        }
    }

    /// One that is offered.
    pub fn get(&self, id: u32) -> Option<&OfferedService> {
        self.offered.get(&id)
    }

    /// The numbers of all that are offered.
    pub fn ids(&self) -> impl Iterator<Item = u32> {
        self.offered.keys().copied()
    }

    /// Another one when what is offered has changed.
    pub fn version(&self) -> u64 {
        self.version
    }
}

impl OfferedService {
    /// As clients get it.
    pub(crate) fn info(&self, id: u32) -> ServiceInfo<'_> {
        let side = |part: &str, schema| ServiceSide {
            encoding: ENCODING,
            schema_name: format!("{}_{part}", self.kind),
            schema_encoding: SCHEMA_ENCODING,
            schema,
        };
        ServiceInfo {
            id,
            name: &self.name,
            kind: &self.kind,
            request: side("Request", &self.request),
            response: side("Response", &self.response),
        }
    }
}

/// The answer of a service that was not called. It is a normal answer: some clients wait for ever when a call fails.
pub(crate) fn refused(text: &str) -> Vec<u8> {
    let answer = serde_json::json!({"accepted": false, "request_id": "", "text": text});
    answer.to_string().into_bytes()
}
