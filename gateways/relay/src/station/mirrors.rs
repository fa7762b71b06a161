//! [`Mirrors`]: the services of a robot as this machine has them.
//!
//! A mirror outlives the robot's relay: the next life of it describes the same service again, and consumers notice nothing.

use ipc_types::payload::RequestReport;
use ipc_types::service::is_key;
use ipc_types::{Ipc, MonotonicNs, PortSet, Ticket};

use super::catalog::MAX_SERVICES;
use super::mirror::{Mirror, Requests};
use crate::budget::Budget;
use crate::clock::Clock;
use crate::description::Service;
use crate::message::SampleHeader;
use crate::request::RequestFields;
use crate::telemetry::Counts;

/// Most requests of clients that are open: those of the orders, and those that are refused meanwhile.
const MAX_OPEN: usize = 256;

/// Services that are provided in a second, and at once: all of a robot, and all of them anew. Each makes files.
const OPENINGS: (u64, u64) = (2, 256);

/// Longest key that a message repeats, characters.
const MAX_QUOTED: usize = 64;

/// A request of a client on this machine that has no final report yet.
struct Open {
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
    /// Path of the request; 0 when it has none.
    pub path_id: u64,
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
    open: Vec<Open>,
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
        if self.list.iter().any(|mirror| *mirror.service() == service) {
            return;
        }
        // Each machine has the relay's own topics itself. The robot's relay describes none of them.
        let is_none = service.key.starts_with("relay/") || !is_key(&service.key);
        let others = self
            .list
            .iter()
            .filter(|mirror| mirror.service().key != service.key);
        if is_none || others.count() >= usize::from(MAX_SERVICES) {
            return self.refuse(&service);
        }
        if !self.openings.grant(1, MonotonicNs::now()) {
            return self.postpone(service);
        }
        // Its struct has changed: consumers find the new one in a new generation.
        self.list
            .retain(|mirror| mirror.service().key != service.key);
        match Mirror::open(&service, ipc) {
            Ok(mirror) => {
                if let Err(error) = self.ports.add(mirror.descriptor()) {
                    tracing::debug!(%error, "a port is looked at with every wake alone");
                }
                tracing::info!(key = service.key, robot = %ipc.robot(), "provided here");
                self.list.push(mirror);
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
        mirrors
            .find(|mirror| mirror.service().key == key)
            .and_then(Mirror::topic)
            .is_some_and(|topic| topic.publish(header, message, clock, now))
    }

    /// Gives late joiners the latest samples, and hands on what clients have sent and given up.
    pub fn serve(&mut self, mut take: impl FnMut(Taken), mut gone: impl FnMut(u64)) {
        for mirror in &mut self.list {
            if let Some(topic) = mirror.topic() {
                topic.tend();
            }
            let Some(requests) = mirror.requests() else {
                continue;
            };
            let (open, next_handle) = (&mut self.open, &mut self.next_handle);
            let service = requests.id();
            requests.vanished(|ticket| {
                let is_it = |entry: &Open| entry.service == service && entry.ticket == ticket;
                if let Some(index) = open.iter().position(is_it) {
                    gone(open.remove(index).handle);
                }
            });
            requests.drain(|arrived| {
                if open.len() == MAX_OPEN {
                    return false;
                }
                let handle = *next_handle;
                *next_handle += 1;
                open.push(Open {
                    handle,
                    service,
                    ticket: arrived.ticket,
                });
                take(Taken {
                    handle,
                    service,
                    path_id: arrived.path_id,
                    fields: arrived.fields,
                    bytes: arrived.bytes.to_vec(),
                });
                true
            });
        }
    }

    /// Answers a client on this machine.
    pub fn report(&mut self, handle: u64, report: &RequestReport) {
        let Some(index) = self.open.iter().position(|open| open.handle == handle) else {
            return;
        };
        let Open {
            service, ticket, ..
        } = self.open[index];
        if report.is_final() {
            self.open.remove(index);
        }
        let mut all = self.list.iter_mut().filter_map(Mirror::requests);
        if let Some(requests) = all.find(|requests: &&mut Requests| requests.id() == service) {
            requests.report(ticket, report);
        }
    }

    /// What was counted of all topics.
    pub fn counts(&self) -> Counts {
        let counts = self.list.iter().map(Mirror::counts);
        counts.fold(Counts::default(), Counts::plus)
    }
}
