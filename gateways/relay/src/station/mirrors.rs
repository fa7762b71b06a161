//! [`Mirrors`]: the services of a robot as this machine has them.
//!
//! A mirror outlives the robot's relay: the next instance of it describes the same service again, and consumers notice
//! nothing.

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::RequestReport;
use ipc_types::schema::CDR_HEADER;
use ipc_types::service::is_key;
use ipc_types::{DynamicError, DynamicPublisher, DynamicServer, Ipc, MonotonicNs, PortSet, Ticket};

use crate::budget::Budget;
use crate::clock::Clock;
use crate::message::SampleHeader;
use crate::message::{MAX_SERVICES, Service};
use crate::names::{is_carried, service_id};
use crate::request::RequestFields;
use crate::telemetry::{SampleCounts, SampleReceiver};

use super::moments::translate_sample;

/// Most requests of clients that are open: those of the orders, and those that are refused meanwhile.
const MAX_OPEN: usize = 256;

/// Services that are provided in a second, and at once: all of a robot, and all of them anew. Each makes files.
const OPENINGS: (u64, u64) = (2, 256);

/// Longest key that a message repeats, characters.
const MAX_QUOTED: usize = 64;

/// One service of a robot on this machine.
struct Mirror {
    service: Service,
    port: MirrorPort,
}

enum MirrorPort {
    Topic(Box<MirroredTopic>),
    Requests(Box<MirroredRequests>),
}

/// A topic of the robot on this machine.
struct MirroredTopic {
    publisher: DynamicPublisher,
    /// Offsets of the moments in a sample.
    moments: Vec<usize>,
    receiver: SampleReceiver,
}

/// A request service of the robot on this machine.
struct MirroredRequests {
    server: DynamicServer,
    fields: RequestFields,
    /// What the service is called in orders.
    id: u64,
}

/// A request of a client on this machine that has no final report yet.
struct OpenRequest {
    handle: u64,
    service: u64,
    ticket: Ticket,
}

/// A request that has come from a client on this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Taken {
    /// By what it is known here.
    pub handle: u64,
    /// Which service of the robot.
    pub service: u64,
    /// What its struct has of what a relay reads and writes.
    pub fields: RequestFields,
    /// The request.
    pub bytes: Vec<u8>,
}

/// All services of a robot that this machine has.
pub struct Mirrors {
    list: Vec<Mirror>,
    /// Described, but not there yet: another process provides them here.
    pending: Vec<Service>,
    open: Vec<OpenRequest>,
    next_handle: u64,
    ports: PortSet,
    openings: Budget,
    /// Descriptions that were refused because there are too many.
    refused: u64,
}

impl Mirrors {
    /// None yet.
    ///
    /// # Errors
    ///
    /// When the process has too many descriptors.
    pub fn new() -> Result<Mirrors, rustix::io::Errno> {
        Ok(Mirrors {
            list: Vec::new(),
            pending: Vec::new(),
            open: Vec::new(),
            next_handle: 1,
            ports: PortSet::new()?,
            openings: Budget::new(OPENINGS.0, OPENINGS.1),
            refused: 0,
        })
    }

    /// What to wait for.
    pub fn ports(&self) -> &PortSet {
        &self.ports
    }

    /// The robot has described a service. Nothing changes when it is here already.
    pub fn provide(&mut self, service: Service, ipc: &Ipc) {
        self.try_to_provide(service, ipc, true);
    }

    fn try_to_provide(&mut self, service: Service, ipc: &Ipc, is_first: bool) {
        if self.list.iter().any(|mirror| mirror.service == service) {
            return;
        }
        let is_none = !is_carried(&service.key) || !is_key(&service.key);
        let others = self
            .list
            .iter()
            .filter(|mirror| mirror.service.key != service.key);
        if is_none || others.count() >= usize::from(MAX_SERVICES) {
            return self.refuse(&service);
        }
        if !self.openings.grant(1, MonotonicNs::now()) {
            return self.postpone(service);
        }
        // Its struct has changed: consumers find the new one in a new generation.
        self.list.retain(|mirror| mirror.service.key != service.key);
        match MirrorPort::open(&service, ipc) {
            Ok(port) => {
                let descriptor = match &port {
                    MirrorPort::Topic(topic) => topic.publisher.descriptor(),
                    MirrorPort::Requests(requests) => requests.server.descriptor(),
                };
                if let Err(error) = self.ports.add(descriptor) {
                    tracing::debug!(%error, "a port is looked at with every wake alone");
                }
                tracing::info!(key = service.key, robot = %ipc.robot(), "provided here");
                self.list.push(Mirror { service, port });
            }
            Err(error) => {
                if is_first && !self.pending.contains(&service) {
                    tracing::warn!(key = service.key, %error, "a service of the robot cannot be provided here");
                }
                self.postpone(service);
            }
        }
    }

    /// Tried again later, when there are not too many of the kind. Of a key only the newest is.
    fn postpone(&mut self, service: Service) {
        self.pending.retain(|other| other.key != service.key);
        if self.pending.len() < usize::from(MAX_SERVICES) {
            self.pending.push(service);
        }
    }

    /// Said once, and then each time that their number has doubled.
    fn refuse(&mut self, service: &Service) {
        self.refused += 1;
        if self.refused.is_power_of_two() {
            let key: String = service.key.escape_debug().take(MAX_QUOTED).collect();
            tracing::warn!(
                key,
                count = self.refused,
                "a service is described that no robot has, or one too many"
            );
        }
    }

    /// Tries again what another process provided here.
    pub fn retry(&mut self, ipc: &Ipc) {
        for service in std::mem::take(&mut self.pending) {
            self.try_to_provide(service, ipc, false);
        }
    }

    /// A sample of the topic `key` has come, with its CDR header. Says whether it was published.
    pub fn publish(
        &mut self,
        key: &str,
        header: &SampleHeader,
        message: &[u8],
        clock: &Clock,
        now: MonotonicNs,
    ) -> bool {
        let mut mirrors = self.list.iter_mut();
        match mirrors.find(|mirror| mirror.service.key == key) {
            Some(Mirror {
                port: MirrorPort::Topic(topic),
                ..
            }) => topic.publish(header, message, clock, now),
            _ => false,
        }
    }

    /// Gives late joiners the latest samples, and hands on what clients have sent and given up.
    pub fn serve(&mut self, mut take: impl FnMut(Taken), mut gone: impl FnMut(u64)) {
        let (open, next_handle) = (&mut self.open, &mut self.next_handle);
        for mirror in &mut self.list {
            match &mut mirror.port {
                MirrorPort::Topic(topic) => topic.publisher.service(),
                MirrorPort::Requests(requests) => {
                    requests.serve(open, next_handle, &mut take, &mut gone);
                }
            }
        }
    }

    /// Answers a client on this machine.
    pub fn report(&mut self, handle: u64, report: &RequestReport) {
        let Some(index) = self.open.iter().position(|open| open.handle == handle) else {
            return;
        };
        let OpenRequest {
            service, ticket, ..
        } = self.open[index];
        if report.is_final() {
            self.open.remove(index);
        }
        for mirror in &mut self.list {
            match &mut mirror.port {
                MirrorPort::Requests(requests) if requests.id == service => {
                    return requests.report(ticket, report);
                }
                _ => {}
            }
        }
    }

    /// What was counted of all topics.
    pub fn counts(&self) -> SampleCounts {
        let counts = self.list.iter().filter_map(|mirror| match &mirror.port {
            MirrorPort::Topic(topic) => Some(topic.receiver.counts()),
            MirrorPort::Requests(_) => None,
        });
        counts.fold(SampleCounts::default(), SampleCounts::plus)
    }
}

impl MirrorPort {
    /// Provides the service here. It fails if another process provides it, or its schema is none.
    fn open(service: &Service, ipc: &Ipc) -> Result<MirrorPort, DynamicError> {
        if service.takes_requests {
            let server = DynamicServer::open(ipc, &service.key, &service.schema)?;
            let schema = server.schema();
            return Ok(MirrorPort::Requests(Box::new(MirroredRequests {
                fields: RequestFields::of(schema),
                id: service_id(&service.key, schema),
                server,
            })));
        }
        let publisher = DynamicPublisher::open(ipc, &service.key, &service.schema)?;
        Ok(MirrorPort::Topic(Box::new(MirroredTopic {
            moments: publisher.schema().moments(),
            publisher,
            receiver: SampleReceiver::default(),
        })))
    }
}

impl MirroredTopic {
    /// Publishes a message, which is a sample with its CDR header, if it is newer than all before. Says whether it was.
    fn publish(
        &mut self,
        header: &SampleHeader,
        message: &[u8],
        clock: &Clock,
        now: MonotonicNs,
    ) -> bool {
        let Some(sample) = message.strip_prefix(&CDR_HEADER) else {
            return false;
        };
        if sample.len() != self.publisher.schema().size() || !self.receiver.take(header) {
            return false;
        }
        let moments = &self.moments;
        let published = self.publisher.publish(|bytes| {
            bytes.copy_from_slice(sample);
            translate_sample(bytes, moments, clock, now);
        });
        if let Err(error) = published {
            tracing::debug!(%error, "a sample was not published");
        }
        true
    }
}

impl MirroredRequests {
    /// Hands on the requests that have come, and those whose clients have given them up. One for which there is no room
    /// is refused.
    fn serve(
        &mut self,
        open: &mut Vec<OpenRequest>,
        next_handle: &mut u64,
        take: &mut impl FnMut(Taken),
        gone: &mut impl FnMut(u64),
    ) {
        let (service, fields) = (self.id, self.fields);
        self.server.vanished(|ticket, _| {
            let is_it = |entry: &OpenRequest| entry.service == service && entry.ticket == ticket;
            if let Some(index) = open.iter().position(is_it) {
                gone(open.remove(index).handle);
            }
        });
        let mut refused = Vec::new();
        let drained = self.server.drain(|ticket, bytes| {
            if open.len() == MAX_OPEN {
                return refused.push(ticket);
            }
            let handle = *next_handle;
            *next_handle += 1;
            open.push(OpenRequest {
                handle,
                service,
                ticket,
            });
            take(Taken {
                handle,
                service,
                fields,
                bytes: bytes.to_vec(),
            });
        });
        if let Err(error) = drained {
            tracing::debug!(%error, "requests cannot be taken");
        }
        let report = RequestReport::new(Stage::Refused, Reason::TooManyRequests);
        for ticket in refused {
            self.report(ticket, &report);
        }
    }

    /// Answers a client.
    fn report(&mut self, ticket: Ticket, report: &RequestReport) {
        if let Err(error) = self.server.report(ticket, report) {
            tracing::debug!(%error, "a report did not reach its client");
        }
    }
}
