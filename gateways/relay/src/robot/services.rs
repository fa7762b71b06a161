//! [`CarriedServices`]: the services of the robot that its relay carries. They only become more in one instance of the
//! relay.
//!
//! A service whose struct changes, because its module was installed anew, becomes another one under the same key; the
//! station takes the newest.

use std::num::NonZeroU32;
use std::time::Duration;

use ipc_types::discovery::Discovery;
use ipc_types::dynamic::ServiceFacts;
use ipc_types::payload::RelayStations;
use ipc_types::service::Pattern;
use ipc_types::{
    DynamicClient, DynamicError, DynamicSubscriber, Ipc, MonotonicNs, PortSet, SendError,
    Topic as _,
};
use ros_messages::{Reliability, message as cdr_message};

use super::ros2_publisher::Ros2Publisher;
use crate::config::{TopicPlan, TopicsConfig};
use crate::message::encode;
use crate::message::{MAX_SERVICES, Part, Service, ServicesPage};
use crate::names;
use crate::network::{Declaration, Network, Outbox};
use crate::orders::robot::NotSent;
use crate::pace::Pace;
use crate::request::RequestFields;
use crate::telemetry::SampleSender;

/// How often the robot is looked at for services that are new.
pub const LOOK_PERIOD: Duration = Duration::from_secs(1);

/// A service that is carried.
struct Carried {
    service: Service,
    port: CarriedPort,
}

/// What the relay has of a service.
enum CarriedPort {
    Topic(Box<CarriedTopic>),
    Requests(Box<CarriedRequests>),
    /// A service of another layout has taken its place.
    Replaced,
}

/// All services that are carried.
pub struct CarriedServices {
    instance: u64,
    robot: NonZeroU32,
    discovery: Discovery,
    carried: Vec<Carried>,
    /// What describes them, in their order.
    pages: Vec<ServicesPage>,
    ports: PortSet,
    ros2: Option<Ros2Publisher>,
    /// How much goes out.
    pub pace: Pace,
    /// The topic that is sent first, so that each has its turn when the pace holds some back.
    first: usize,
}

impl CarriedServices {
    /// None yet. With `ros2` the topics are published for ROS 2 too.
    ///
    /// # Errors
    ///
    /// When the process has too many descriptors.
    pub fn new(
        instance: u64,
        robot: NonZeroU32,
        ros2: Option<Ros2Publisher>,
    ) -> Result<CarriedServices, rustix::io::Errno> {
        Ok(CarriedServices {
            instance,
            robot,
            discovery: Discovery::default(),
            carried: Vec::new(),
            pages: Vec::new(),
            ports: PortSet::new()?,
            ros2,
            pace: Pace::default(),
            first: 0,
        })
    }

    /// Looks for services that are not carried yet, and carries those that are to be.
    ///
    /// Request services are carried also where no station may command, so that an operator reads that and not that
    /// there is no bridge.
    pub fn look(&mut self, ipc: &Ipc, network: &Network, config: &TopicsConfig) {
        let mut discovery = std::mem::take(&mut self.discovery);
        let before = self.carried.len();
        discovery.look(ipc, |pattern, facts| {
            let key = facts.key.clone();
            let taken = match pattern {
                Pattern::PublishSubscribe => match config.plan(&key) {
                    Some(plan) => self.take_topic(ipc, network, facts, plan),
                    None => Ok(()),
                },
                Pattern::RequestResponse if !names::is_carried(&key) => Ok(()),
                Pattern::RequestResponse => self.take_requests(ipc, facts),
            };
            taken
                .inspect_err(|error| tracing::warn!(key, error, "a service is not relayed"))
                .is_ok()
        });
        self.discovery = discovery;
        let found = self.carried[before..].iter();
        let found: Vec<_> = found.map(|carried| carried.service.clone()).collect();
        self.pages.extend(ServicesPage::of(&found));
    }

    fn take_topic(
        &mut self,
        ipc: &Ipc,
        network: &Network,
        facts: ServiceFacts,
        plan: TopicPlan,
    ) -> Result<(), String> {
        if !self.is_new(&facts) {
            return Ok(());
        }
        let subscriber = DynamicSubscriber::open(ipc, &facts.key, &facts.schema)
            .map_err(|error| error.to_string())?;
        self.ports
            .add(subscriber.descriptor())
            .map_err(|error| error.to_string())?;
        let outbox = network.outbox(Declaration {
            key: names::topic(self.robot, &facts.key),
            priority: plan.priority,
            reliability: Reliability::BestEffort,
            token: None,
        });
        if let Some(ros2) = &mut self.ros2
            && facts.key != RelayStations::KEY
        {
            ros2.add(network, &facts.key, &facts.schema, plan.priority);
        }
        let topic = CarriedTopic {
            subscriber,
            sender: SampleSender::new(self.instance, plan.selection),
            outbox,
            is_failing: false,
        };
        self.carry(facts, CarriedPort::Topic(Box::new(topic)), false);
        Ok(())
    }

    fn take_requests(&mut self, ipc: &Ipc, facts: ServiceFacts) -> Result<(), String> {
        if !self.is_new(&facts) {
            return Ok(());
        }
        let requests =
            CarriedRequests::open(ipc, &facts, &self.ports).map_err(|error| error.to_string())?;
        self.carry(facts, CarriedPort::Requests(Box::new(requests)), true);
        Ok(())
    }

    fn is_new(&self, facts: &ServiceFacts) -> bool {
        let mut carried = self.carried.iter().map(|carried| &carried.service);
        let newest = carried.rfind(|service| service.key == facts.key);
        self.carried.len() < usize::from(MAX_SERVICES)
            && newest.is_none_or(|service| service.schema != facts.text)
    }

    fn carry(&mut self, facts: ServiceFacts, port: CarriedPort, takes_requests: bool) {
        for former in &mut self.carried {
            if former.service.key == facts.key {
                former.port = CarriedPort::Replaced;
            }
        }
        tracing::info!(key = facts.key, "relayed");
        self.carried.push(Carried {
            service: Service {
                key: facts.key,
                takes_requests,
                schema: facts.text,
            },
            port,
        });
    }

    /// What to wait for.
    pub fn ports(&self) -> &PortSet {
        &self.ports
    }

    /// How many pages describe them.
    pub fn pages(&self) -> u16 {
        self.pages.len() as u16
    }

    /// A part of the page of this index, for a station.
    pub fn describe(&self, index: u16, from: u32) -> Option<Part> {
        self.pages
            .get(usize::from(index))?
            .part(self.instance, index, from)
    }

    /// The request service that orders call so. `None` if the robot does not have it.
    pub fn requests_of(&mut self, id: u64) -> Option<&mut CarriedRequests> {
        self.all_requests().find(|requests| requests.id == id)
    }

    /// All request services.
    pub fn all_requests(&mut self) -> impl Iterator<Item = &mut CarriedRequests> {
        self.carried
            .iter_mut()
            .filter_map(|carried| match &mut carried.port {
                CarriedPort::Requests(requests) => Some(&mut **requests),
                CarriedPort::Topic(_) | CarriedPort::Replaced => None,
            })
    }

    /// Reads what has been published, and sends what is due. Says how many samples went out.
    pub fn send_samples(&mut self, now: MonotonicNs) -> u64 {
        let count = self.carried.len();
        let (mut ros2, pace) = (self.ros2.as_mut(), &mut self.pace);
        let mut sent = 0;
        for place in 0..count {
            let index = (self.first + place) % count;
            let Some(topic) = self.carried[index].topic() else {
                continue;
            };
            let of_topic = topic.send(now, pace, ros2.as_deref_mut());
            sent += of_topic;
            if of_topic > 0 && !pace.is_open(now) {
                self.first = index + 1;
            }
        }
        sent
    }

    /// The latest sample of each topic is to be sent again, as the pace lets it.
    pub fn want_latest(&mut self) {
        for carried in &mut self.carried {
            if let Some(topic) = carried.topic() {
                topic.sender.want_latest();
            }
        }
    }

    /// When a sample is due that has come already.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let deadline = |carried: &Carried| match &carried.port {
            CarriedPort::Topic(topic) => topic.deadline(&self.pace),
            CarriedPort::Requests(_) | CarriedPort::Replaced => None,
        };
        self.carried.iter().filter_map(deadline).min()
    }
}

impl Carried {
    fn topic(&mut self) -> Option<&mut CarriedTopic> {
        match &mut self.port {
            CarriedPort::Topic(topic) => Some(topic),
            CarriedPort::Requests(_) | CarriedPort::Replaced => None,
        }
    }
}

/// A topic that is carried: on its way from the robot's shared memory to the stations.
struct CarriedTopic {
    subscriber: DynamicSubscriber,
    sender: SampleSender,
    outbox: Outbox,
    is_failing: bool,
}

impl CarriedTopic {
    /// Reads what has been published, and sends what is due. Says how many samples went out.
    fn send(
        &mut self,
        now: MonotonicNs,
        pace: &mut Pace,
        mut ros2: Option<&mut Ros2Publisher>,
    ) -> u64 {
        let sender = &mut self.sender;
        let drained = self.subscriber.drain(|sample| sender.take(sample));
        let was_failing = std::mem::replace(&mut self.is_failing, drained.is_err());
        if let Err(error) = drained
            && !was_failing
        {
            tracing::warn!(key = self.subscriber.key(), %error, "a topic cannot be read");
        }
        // What waits goes out when the network has opened the way, and wakes the process for it.
        if !self.outbox.is_open() {
            return 0;
        }
        let lost = self.subscriber.losses().lost;
        let before = self.sender.sent();
        let (key, outbox) = (self.subscriber.key(), &self.outbox);
        self.sender.send(now, lost, pace, |header, sample| {
            outbox.send(cdr_message(sample), encode(header));
            if let Some(ros2) = &mut ros2 {
                ros2.send(key, sample);
            }
        });
        self.sender.sent() - before
    }

    /// When a sample is due that has come already.
    fn deadline(&self, pace: &Pace) -> Option<MonotonicNs> {
        self.sender.deadline(pace).filter(|_| self.outbox.is_open())
    }
}

/// A request service that is carried: the relay is its client.
pub struct CarriedRequests {
    /// Gives requests up, and has their reports.
    pub client: DynamicClient,
    /// What the requests say that a relay reads and writes.
    pub fields: RequestFields,
    /// What the service is called in orders.
    pub id: u64,
}

impl CarriedRequests {
    /// Opens the service, and lets `ports` wake the process for its reports.
    fn open(
        ipc: &Ipc,
        facts: &ServiceFacts,
        ports: &PortSet,
    ) -> Result<CarriedRequests, DynamicError> {
        let client = DynamicClient::open(ipc, &facts.key, &facts.schema)?;
        if let Err(error) = ports.add(client.descriptor()) {
            tracing::debug!(%error, "reports are looked for at every wake alone");
        }
        Ok(CarriedRequests {
            client,
            fields: RequestFields::of(&facts.schema),
            id: names::service_id(&facts.key, &facts.schema),
        })
    }

    /// Hands a request on, with the `origin` of its station: what the station itself wrote there does not count.
    ///
    /// # Errors
    ///
    /// The service does not take it now.
    pub fn send(
        &mut self,
        mut request: Vec<u8>,
        is_repeat: bool,
        origin: u32,
    ) -> Result<(), NotSent> {
        self.fields.set_origin(&mut request, origin);
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
}
