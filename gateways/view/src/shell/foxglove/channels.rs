//! [`Channels`]: every topic of every robot for Foxglove clients, as recordings have it: the same names, layouts and
//! bytes. A topic is subscribed to while a client wants it, so that those that nothing wants cost nothing, and journals
//! are written only on request.

use std::collections::BTreeMap;

use ipc_types::discovery::Discovery;
use ipc_types::dynamic::ServiceFacts;
use ipc_types::schema::CDR_HEADER;
use ipc_types::service::Pattern;
use ipc_types::{DynamicSubscriber, Ipc, RobotId, Schema};
use operator::render::stamps::StampReader;
use operator::robot::clock::Clocks;
use recording::topic_of;

use crate::{Channel, ChannelId, Server};

/// A topic that is offered.
struct OfferedTopic {
    schema: Schema,
    /// Of the schema, as its provider has laid it down.
    text: String,
    channel: ChannelId,
    stamps: StampReader,
    /// `None` while no client wants it.
    subscriber: Option<DynamicSubscriber>,
    is_failing: bool,
}

/// The topics of one robot.
struct RobotTopics {
    ipc: Ipc,
    discovery: Discovery,
    /// What [`Ipc::generations`] was at the last look; `None` before the first, and when something is to be looked at
    /// again.
    seen: Option<u32>,
    /// By key.
    topics: BTreeMap<String, OfferedTopic>,
}

/// Every topic of every robot for Foxglove clients, subscribed to while a client wants it.
#[derive(Default)]
pub(crate) struct Channels {
    robots: BTreeMap<RobotId, RobotTopics>,
    /// A sample as a CDR message; kept, so that only the server's copy is made of each.
    cdr: Vec<u8>,
}

impl Channels {
    /// Offers the topics of a robot that is shown, and sends what has come of those that a client wants.
    pub fn drain(&mut self, ipc: &Ipc, server: &mut Server, clock: Clocks) {
        let robot = ipc.robot();
        let robot = self.robots.entry(robot).or_insert_with(|| RobotTopics {
            ipc: ipc.clone(),
            discovery: Discovery::default(),
            seen: None,
            topics: BTreeMap::new(),
        });
        robot.look(server);
        let mut has_time = false;
        for (key, topic) in &mut robot.topics {
            if !server.is_subscribed(topic.channel) {
                topic.subscriber = None;
                continue;
            }
            let mut send = |sample: &[u8]| {
                // The time of a batch stands before it.
                if !std::mem::replace(&mut has_time, true) {
                    server.time(clock.unix_ns(clock.now));
                }
                let sent = topic.stamps.read(sample, clock.now).sent;
                self.cdr.clear();
                self.cdr.extend_from_slice(&CDR_HEADER);
                self.cdr.extend_from_slice(sample);
                let at = clock.unix_ns(sent.min(clock.now));
                server.sample(topic.channel, at, self.cdr.as_slice());
            };
            let drained = subscriber(&mut topic.subscriber, &robot.ipc, key, &topic.schema)
                .and_then(|port| port.drain(&mut send).map_err(|error| error.to_string()));
            let was_failing = std::mem::replace(&mut topic.is_failing, drained.is_err());
            if let Err(error) = drained
                && !was_failing
            {
                tracing::warn!(key, error, "a topic cannot be read");
            }
        }
    }
}

/// The port of a topic, opened when it is wanted first.
fn subscriber<'a>(
    port: &'a mut Option<DynamicSubscriber>,
    ipc: &Ipc,
    key: &str,
    schema: &Schema,
) -> Result<&'a mut DynamicSubscriber, String> {
    if port.is_none() {
        let opened = DynamicSubscriber::open(ipc, key, schema);
        *port = Some(opened.map_err(|error| error.to_string())?);
    }
    port.as_mut().ok_or_else(String::new)
}

impl RobotTopics {
    /// Offers topics that are new. One whose layout is another one than before is another channel.
    fn look(&mut self, server: &mut Server) {
        let generations = self.ipc.generations();
        if self.seen == Some(generations) {
            return;
        }
        // What changes from here on is seen by the next look.
        self.seen = Some(generations);
        let mut discovery = std::mem::take(&mut self.discovery);
        let ipc = self.ipc.clone();
        discovery.look(&ipc, |pattern, facts| match pattern {
            Pattern::PublishSubscribe => self.offer(facts, server),
            Pattern::RequestResponse => true,
        });
        self.discovery = discovery;
    }

    /// Returns whether the topic needs no further work.
    fn offer(&mut self, facts: ServiceFacts, server: &mut Server) -> bool {
        if let Some(former) = self.topics.get(&facts.key) {
            if former.text == facts.text {
                // Another life of its publisher, which the subscriber follows by itself.
                return true;
            }
            server.withdraw(former.channel);
            self.topics.remove(&facts.key);
        }
        let channel = server.channel(Channel {
            topic: topic_of(self.ipc.robot(), &facts.key),
            encoding: "cdr".to_owned(),
            schema_name: facts.schema.ros_resource_name(),
            schema_encoding: "ros2msg".to_owned(),
            schema: facts.text.as_str().into(),
        });
        // There are more topics than a server offers: the further ones are left out.
        let Some(channel) = channel else {
            tracing::warn!(key = facts.key, "not offered: there are too many topics");
            return true;
        };
        let topic = OfferedTopic {
            stamps: StampReader::of(&facts.schema),
            schema: facts.schema,
            text: facts.text,
            channel,
            subscriber: None,
            is_failing: false,
        };
        self.topics.insert(facts.key, topic);
        true
    }
}
