//! [`Topics`]: what a robot's relay publishes for ROS 2, a pure value.
//!
//! The relay adds each topic that it carries, and hands on each sample that it sends. Where publications are declared and samples
//! are put is a [`Way`], which is given from outside.

use std::collections::{BTreeMap, BTreeSet};

use ipc_types::payload::{HeroTelemetry, SharedStruct};
use ipc_types::{MonotonicNs, RobotId, Schema, Topic as _};
use ros_messages::{StandardMessage, UnixOffset, message};

use super::graph::{ATTACHMENT_LEN, Gid, NameError, Node, Publication, Qos, Session, attachment};
use super::source_time::SourceTime;

/// A way out for the samples of one publication.
pub trait Way {
    /// Whether samples can go out. It may be declared in the background.
    fn is_open(&self) -> bool;

    /// Sends a sample. It may be lost.
    fn send(&self, payload: Vec<u8>, attachment: [u8; ATTACHMENT_LEN]);
}

/// The publications of one robot.
///
/// There are never more of them than topics that the relay carries, and the four standard messages.
#[derive(Debug)]
pub struct Topics<W> {
    robot: RobotId,
    session: Session,
    node: Node,
    has_standard: bool,
    /// By key.
    topics: BTreeMap<String, Topic<W>>,
    standard: BTreeMap<StandardMessage, Publisher<W>>,
    /// Standard messages whose names are those of topics that the relay carries.
    taken: BTreeSet<StandardMessage>,
}

/// A topic that the relay carries.
#[derive(Debug)]
struct Topic<W> {
    publisher: Publisher<W>,
    source_time: SourceTime,
}

/// One publication, and how many samples went out.
#[derive(Debug)]
struct Publisher<W> {
    way: W,
    gid: Gid,
    sent: i64,
}

/// What a new topic has changed.
#[derive(Debug, PartialEq, Eq)]
pub struct Change<W> {
    /// Ways that are not needed any more.
    pub closed: Vec<W>,
    /// The standard message that is left out from now on, because the topic has its name.
    pub left_out: Option<StandardMessage>,
}

impl<W: Way> Topics<W> {
    /// No topics yet. `has_standard` says whether standard messages are made of `hero_telemetry`.
    pub fn new(mut session: Session, robot: RobotId, has_standard: bool) -> Topics<W> {
        Topics {
            node: session.node(robot),
            robot,
            session,
            has_standard,
            topics: BTreeMap::new(),
            standard: BTreeMap::new(),
            taken: BTreeSet::new(),
        }
    }

    /// The node, whose token is to be declared before any publication.
    pub fn node(&self) -> &Node {
        &self.node
    }

    /// The relay carries a topic from now on, instead of a former one with the same key. `open` is called for each publication
    /// that this needs.
    ///
    /// # Errors
    ///
    /// When ROS 2 cannot have the name; then nothing has changed.
    pub fn add(
        &mut self,
        key: &str,
        schema: &Schema,
        mut open: impl FnMut(&Publication) -> W,
    ) -> Result<Change<W>, NameError> {
        let publication = self
            .session
            .publish(&self.node, key, schema, Qos::of_key(key))?;
        let mut change = Change {
            closed: Vec::new(),
            left_out: None,
        };
        if let Some(standard) = StandardMessage::of_key(key) {
            let is_news = self.taken.insert(standard);
            change.left_out = (self.has_standard && is_news).then_some(standard);
            let closed = self.standard.remove(&standard);
            change.closed.extend(closed.map(|publisher| publisher.way));
        }
        let topic = Topic {
            publisher: Publisher::new(&publication, &mut open),
            source_time: SourceTime::of(schema),
        };
        let former = self.topics.insert(key.to_owned(), topic);
        change
            .closed
            .extend(former.map(|former| former.publisher.way));
        if key == HeroTelemetry::KEY {
            self.follow_telemetry(schema, &mut change, open);
        }
        Ok(change)
    }

    /// Standard messages can be made of the struct that this program was built with, and of no other.
    fn follow_telemetry(
        &mut self,
        schema: &Schema,
        change: &mut Change<W>,
        mut open: impl FnMut(&Publication) -> W,
    ) {
        if schema.layout_hash() != Schema::of::<HeroTelemetry>().layout_hash() {
            let closed = std::mem::take(&mut self.standard).into_values();
            return change.closed.extend(closed.map(|publisher| publisher.way));
        }
        for standard in StandardMessage::ALL {
            let is_free = !self.taken.contains(&standard) && !self.standard.contains_key(&standard);
            if self.has_standard && is_free {
                let publication = self.session.publish_standard(&self.node, standard);
                let publisher = Publisher::new(&publication, &mut open);
                self.standard.insert(standard, publisher);
            }
        }
    }

    /// The relay sends a sample of the topic `key`. Each publication whose way is not open yet leaves it out.
    pub fn send(&mut self, key: &str, sample: &[u8], now: MonotonicNs, offset: UnixOffset) {
        let Some(topic) = self.topics.get_mut(key) else {
            return;
        };
        let unix_ns = offset.unix_ns(topic.source_time.of_sample(sample, now));
        topic.publisher.send(unix_ns, || Some(message(sample)));
        if key != HeroTelemetry::KEY || self.standard.is_empty() {
            return;
        }
        let Some(telemetry) = HeroTelemetry::from_bytes(sample) else {
            return;
        };
        for (standard, publisher) in &mut self.standard {
            publisher.send(unix_ns, || standard.write(&telemetry, self.robot, offset));
        }
    }
}

impl<W: Way> Publisher<W> {
    fn new(publication: &Publication, open: &mut impl FnMut(&Publication) -> W) -> Publisher<W> {
        Publisher {
            way: open(publication),
            gid: publication.gid,
            sent: 0,
        }
    }

    fn send(&mut self, unix_ns: i64, message: impl FnOnce() -> Option<Vec<u8>>) {
        if !self.way.is_open() {
            return;
        }
        if let Some(message) = message() {
            self.sent += 1;
            let attachment = attachment(self.sent, unix_ns, &self.gid);
            self.way.send(message, attachment);
        }
    }
}

#[cfg(test)]
mod tests;
