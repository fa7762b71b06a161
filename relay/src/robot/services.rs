//! [`Services`]: the services of the robot that its relay carries. They only become more in one life of the relay.
//!
//! A service whose struct changes, because its module was installed anew, becomes another one under the same key; the station
//! takes the newest.

use std::num::NonZeroU32;
use std::time::Duration;

use ipc_types::dynamic::{self, ServiceFacts};
use ipc_types::schema::CDR_HEADER;
use ipc_types::{DynamicClient, DynamicError, DynamicSubscriber, Ipc, MonotonicNs};

use crate::config::TopicsConfig;
use crate::message::{Service, encode};
use crate::names;
use crate::network::{Network, Outbox};
use crate::ports::PortSet;
use crate::request::RequestFields;
use crate::station::link::MAX_SERVICES;
use crate::telemetry::Outlet;

use super::ros2_outlet::Ros2Outlet;

/// A service that is carried.
struct Carried {
    key: String,
    text: String,
    port: Port,
}

/// What the relay has of a service.
enum Port {
    Topic(Box<Topic>),
    Requests(Box<Requests>),
    /// Another one has taken its place.
    Replaced {
        takes_requests: bool,
    },
}

struct Topic {
    subscriber: DynamicSubscriber,
    outlet: Outlet,
    outbox: Outbox,
    is_failing: bool,
}

/// A client of a request service.
pub struct Requests {
    /// Sends requests and takes reports.
    pub client: DynamicClient,
    /// What the relay reads and writes in a request.
    pub fields: RequestFields,
    /// What the service is called in orders.
    id: u64,
}

/// All services that are carried.
pub struct Services {
    life: u64,
    robot: NonZeroU32,
    carried: Vec<Carried>,
    ports: PortSet,
    ros2: Option<Ros2Outlet>,
}

impl Services {
    /// None yet. With `ros2` the topics are published for ROS 2 too.
    ///
    /// # Errors
    ///
    /// When the process has too many descriptors.
    pub fn new(
        life: u64,
        robot: NonZeroU32,
        ros2: Option<Ros2Outlet>,
    ) -> Result<Services, rustix::io::Errno> {
        Ok(Services {
            life,
            robot,
            carried: Vec::new(),
            ports: PortSet::new()?,
            ros2,
        })
    }

    /// Looks for services that are not carried yet, and carries those that are to be.
    ///
    /// Request services are carried also where no station may command, so that an operator is told that and not that there is
    /// no bridge.
    pub fn look(&mut self, ipc: &Ipc, network: &Network, config: &TopicsConfig) {
        for facts in dynamic::topics(ipc) {
            if let Some(plan) = config.plan(&facts.key)
                && self.is_new(&facts)
            {
                let (life, key) = (self.life, names::topic(self.robot, &facts.key));
                let topic = DynamicSubscriber::open(ipc, &facts.key, &facts.schema)
                    .map_err(|error| error.to_string())
                    .and_then(|subscriber| {
                        let outbox = network
                            .outbox(&key, plan.priority)
                            .map_err(|error| error.to_string())?;
                        self.ports
                            .add(subscriber.descriptor())
                            .map_err(|error| error.to_string())?;
                        Ok(Port::Topic(Box::new(Topic {
                            subscriber,
                            outlet: Outlet::new(life, plan.period),
                            outbox,
                            is_failing: false,
                        })))
                    });
                if let (Ok(_), Some(ros2)) = (&topic, &mut self.ros2) {
                    ros2.add(&facts.key, &facts.schema, plan.priority);
                }
                self.carry(facts, topic);
            }
        }
        for facts in dynamic::request_services(ipc) {
            if !facts.key.starts_with("relay/") && self.is_new(&facts) {
                let requests = self
                    .requests(ipc, &facts)
                    .map_err(|error| error.to_string());
                self.carry(facts, requests);
            }
        }
    }

    fn requests(&self, ipc: &Ipc, facts: &ServiceFacts) -> Result<Port, DynamicError> {
        let client = DynamicClient::open(ipc, &facts.key, &facts.schema)?;
        if let Err(error) = self.ports.add(client.descriptor()) {
            tracing::debug!(%error, "reports are looked for at every wake alone");
        }
        Ok(Port::Requests(Box::new(Requests {
            client,
            fields: RequestFields::of(&facts.schema),
            id: names::service_id(&facts.key, &facts.schema),
        })))
    }

    fn is_new(&self, facts: &ServiceFacts) -> bool {
        let newest = self
            .carried
            .iter()
            .rfind(|carried| carried.key == facts.key);
        self.carried.len() < usize::from(MAX_SERVICES)
            && facts.provider.is_some()
            && newest.is_none_or(|carried| carried.text != facts.text)
    }

    fn carry(&mut self, facts: ServiceFacts, port: Result<Port, String>) {
        let port = match port {
            Ok(port) => port,
            // It is tried again at the next look.
            Err(error) => {
                return tracing::warn!(key = facts.key, %error, "a service is not relayed");
            }
        };
        for former in &mut self.carried {
            if former.key == facts.key {
                let takes_requests = former.takes_requests();
                former.port = Port::Replaced { takes_requests };
            }
        }
        tracing::info!(key = facts.key, "relayed");
        self.carried.push(Carried {
            key: facts.key,
            text: facts.text,
            port,
        });
    }

    /// What to wait for.
    pub fn ports(&self) -> &PortSet {
        &self.ports
    }

    /// How many there are.
    pub fn count(&self) -> u16 {
        self.carried.len() as u16
    }

    /// The service of this index, as a station is told.
    pub fn describe(&self, index: u16) -> Option<Service> {
        let carried = self.carried.get(usize::from(index))?;
        Some(Service {
            robot_life: self.life,
            index,
            key: carried.key.clone(),
            takes_requests: carried.takes_requests(),
            schema: carried.text.clone(),
        })
    }

    /// The request service that orders call so.
    pub fn requests_of(&mut self, id: u64) -> Option<&mut Requests> {
        self.all_requests()
            .find_map(|(other, requests)| (other == id).then_some(requests))
    }

    /// All request services, with what orders call them.
    pub fn all_requests(&mut self) -> impl Iterator<Item = (u64, &mut Requests)> {
        self.carried
            .iter_mut()
            .filter_map(|carried| match &mut carried.port {
                Port::Requests(requests) => Some((requests.id, &mut **requests)),
                Port::Topic(_) | Port::Replaced { .. } => None,
            })
    }

    /// Reads what has been published, and sends what is due. Says how many samples went out.
    pub fn send_samples(&mut self, now: MonotonicNs) -> u64 {
        let topics = self.carried.iter_mut().filter_map(Carried::topic);
        let mut ros2 = self.ros2.as_mut();
        topics
            .map(|topic| topic.send(now, ros2.as_deref_mut()))
            .sum()
    }

    /// Sends the latest sample of each topic again.
    pub fn send_latest(&self) {
        for carried in &self.carried {
            if let Port::Topic(topic) = &carried.port {
                let lost = topic.subscriber.losses().lost;
                topic.outlet.send_again(lost, |header, sample| {
                    topic.outbox.send(with_cdr_header(sample), encode(header));
                });
            }
        }
    }

    /// When a sample is due that has come already.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let deadline = |carried: &Carried| match &carried.port {
            Port::Topic(topic) => topic.outlet.deadline(),
            Port::Requests(_) | Port::Replaced { .. } => None,
        };
        self.carried.iter().filter_map(deadline).min()
    }
}

impl Carried {
    fn topic(&mut self) -> Option<&mut Topic> {
        match &mut self.port {
            Port::Topic(topic) => Some(topic),
            Port::Requests(_) | Port::Replaced { .. } => None,
        }
    }

    fn takes_requests(&self) -> bool {
        match &self.port {
            Port::Topic(_) => false,
            Port::Requests(_) => true,
            Port::Replaced { takes_requests } => *takes_requests,
        }
    }
}

impl Topic {
    fn send(&mut self, now: MonotonicNs, mut ros2: Option<&mut Ros2Outlet>) -> u64 {
        let outlet = &mut self.outlet;
        let drained = self.subscriber.drain(|sample| outlet.take(sample));
        let was_failing = std::mem::replace(&mut self.is_failing, drained.is_err());
        if let Err(error) = drained
            && !was_failing
        {
            tracing::warn!(key = self.subscriber.key(), %error, "a topic cannot be read");
        }
        let lost = self.subscriber.losses().lost;
        let before = self.outlet.sent();
        let (key, outbox) = (self.subscriber.key(), &self.outbox);
        self.outlet.send(now, lost, |header, sample| {
            outbox.send(with_cdr_header(sample), encode(header));
            if let Some(ros2) = &mut ros2 {
                ros2.send(key, sample);
            }
        });
        self.outlet.sent() - before
    }
}

/// A sample as it goes over the network: a CDR message, which ROS 2 and recorders read as it is.
fn with_cdr_header(sample: &[u8]) -> Vec<u8> {
    [&CDR_HEADER[..], sample].concat()
}

/// How often the robot is looked at for services that are new.
pub const LOOK_PERIOD: Duration = Duration::from_secs(1);
