//! [`Mirror`]: one service of a robot as this machine has it.

use std::os::fd::BorrowedFd;

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::RequestReport;
use ipc_types::schema::CDR_HEADER;
use ipc_types::{
    DynamicError, DynamicPublisher, DynamicServer, Ipc, MonotonicNs, Ticket, WaitError,
};

use crate::clock::{Clock, RemoteNs};
use crate::description::Service;
use crate::message::SampleHeader;
use crate::names::service_id;
use crate::request::RequestFields;
use crate::telemetry::{Counts, Inlet};

/// One service of a robot on this machine.
pub struct Mirror {
    service: Service,
    port: Port,
}

enum Port {
    Topic(Box<Topic>),
    Requests(Box<Requests>),
}

/// A topic of the robot on this machine.
pub struct Topic {
    publisher: DynamicPublisher,
    /// Offsets of the moments in a sample.
    moments: Vec<usize>,
    inlet: Inlet,
}

/// A request service of the robot on this machine.
pub struct Requests {
    server: DynamicServer,
    fields: RequestFields,
    id: u64,
    /// Offset of the request's `path_id`.
    path_id: Option<usize>,
}

/// A request that a client on this machine has sent.
pub struct Arrived<'a> {
    /// By what its client is answered.
    pub ticket: Ticket,
    /// Path of the request; 0 when it has none.
    pub path_id: u64,
    /// What its struct has of what a relay reads and writes.
    pub fields: RequestFields,
    /// The request.
    pub bytes: &'a [u8],
}

impl Mirror {
    /// Provides the service here.
    ///
    /// # Errors
    ///
    /// When another process provides it here, or its schema is none.
    pub fn open(service: &Service, ipc: &Ipc) -> Result<Mirror, DynamicError> {
        Ok(Mirror {
            port: Port::open(service, ipc)?,
            service: service.clone(),
        })
    }

    /// The service.
    pub fn service(&self) -> &Service {
        &self.service
    }

    /// What to wait for.
    ///
    /// # Errors
    ///
    /// When the process has too many descriptors.
    pub fn descriptor(&self) -> Result<BorrowedFd<'_>, WaitError> {
        match &self.port {
            Port::Topic(topic) => topic.publisher.descriptor(),
            Port::Requests(requests) => requests.server.descriptor(),
        }
    }

    /// Its topic, when it is one.
    pub fn topic(&mut self) -> Option<&mut Topic> {
        match &mut self.port {
            Port::Topic(topic) => Some(topic),
            Port::Requests(_) => None,
        }
    }

    /// Its requests, when it takes some.
    pub fn requests(&mut self) -> Option<&mut Requests> {
        match &mut self.port {
            Port::Requests(requests) => Some(requests),
            Port::Topic(_) => None,
        }
    }

    /// What was counted, when it is a topic.
    pub fn counts(&self) -> Counts {
        match &self.port {
            Port::Topic(topic) => topic.inlet.counts(),
            Port::Requests(_) => Counts::default(),
        }
    }
}

impl Topic {
    /// Publishes a message, which is a sample with its CDR header, if it is news. Says whether it was.
    pub fn publish(
        &mut self,
        header: &SampleHeader,
        message: &[u8],
        clock: &Clock,
        now: MonotonicNs,
    ) -> bool {
        let Some(sample) = message.strip_prefix(&CDR_HEADER) else {
            return false;
        };
        if sample.len() != self.publisher.schema().size() || !self.inlet.take(header) {
            return false;
        }
        let moments = &self.moments;
        let published = self.publisher.publish(|bytes| {
            bytes.copy_from_slice(sample);
            translate(bytes, moments, clock, now);
        });
        if let Err(error) = published {
            tracing::debug!(%error, "a sample was not published");
        }
        true
    }

    /// Gives late joiners the latest sample.
    pub fn tend(&mut self) {
        self.publisher.tend();
    }
}

impl Requests {
    /// What the service is called in orders.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// Hands on the requests whose clients have given them up.
    pub fn vanished(&mut self, mut gone: impl FnMut(Ticket)) {
        self.server.vanished(|ticket, _| gone(ticket));
    }

    /// Hands on the requests that have come. One for which `take` has no room is refused.
    pub fn drain(&mut self, mut take: impl FnMut(&Arrived<'_>) -> bool) {
        let (fields, path_id) = (self.fields, self.path_id);
        let mut refused = Vec::new();
        let drained = self.server.drain(|ticket, bytes| {
            let is_taken = take(&Arrived {
                ticket,
                path_id: path_id.map_or(0, |offset| word(bytes, offset)),
                fields,
                bytes,
            });
            if !is_taken {
                refused.push(ticket);
            }
        });
        if let Err(error) = drained {
            tracing::debug!(%error, "requests cannot be taken");
        }
        for ticket in refused {
            self.report(
                ticket,
                &RequestReport::new(Stage::Refused, Reason::TooManyRequests),
            );
        }
    }

    /// Answers a client.
    pub fn report(&mut self, ticket: Ticket, report: &RequestReport) {
        if let Err(error) = self.server.report(ticket, report) {
            tracing::debug!(%error, "a client was not told");
        }
    }
}

impl Port {
    fn open(service: &Service, ipc: &Ipc) -> Result<Port, DynamicError> {
        if service.takes_requests {
            let server = DynamicServer::open(ipc, &service.key, &service.schema)?;
            let schema = server.schema();
            return Ok(Port::Requests(Box::new(Requests {
                fields: RequestFields::of(schema),
                id: service_id(&service.key, schema),
                path_id: schema.number("path_id").map(|leaf| leaf.offset),
                server,
            })));
        }
        let publisher = DynamicPublisher::open(ipc, &service.key, &service.schema)?;
        Ok(Port::Topic(Box::new(Topic {
            moments: publisher.schema().moments(),
            publisher,
            inlet: Inlet::default(),
        })))
    }
}

fn word(bytes: &[u8], offset: usize) -> u64 {
    let word = bytes.get(offset..).and_then(|bytes| bytes.first_chunk());
    word.map_or(0, |word| u64::from_le_bytes(*word))
}

/// Turns the robot's moments into those of this machine's clock. What is not younger than the sample can be is as old as it: no
/// moment lies in the future. 0 stands for never and stays.
fn translate(sample: &mut [u8], moments: &[usize], clock: &Clock, now: MonotonicNs) {
    for offset in moments {
        let remote = word(sample, *offset);
        if remote == 0 {
            continue;
        }
        // Without an estimate nothing is published: the link is up only with one.
        let local = clock
            .to_local(RemoteNs(remote))
            .unwrap_or_default()
            .min(now);
        if let Some(bytes) = sample.get_mut(*offset..*offset + 8) {
            bytes.copy_from_slice(&local.0.max(1).to_le_bytes());
        }
    }
}

/// The same of a report.
pub fn translate_report(report: &mut RequestReport, clock: &Clock, now: MonotonicNs) {
    let local = clock.to_local(RemoteNs(report.reported_ns)).unwrap_or(now);
    report.reported_ns = local.min(now).0;
}

#[cfg(test)]
mod tests {
    use super::*;
    use ipc_types::Schema;

    #[test]
    fn a_schema_that_is_none_is_refused_and_never_a_panic() {
        assert!(Schema::parse("").is_err());
        assert_eq!(word(&[1, 2, 3], 0), 0);
        assert_eq!(word(&[0; 8], usize::MAX), 0);
    }
}
