//! [`Ros2Publisher`]: the robot's topics for ROS 2, over the network.
//!
//! [`Publications`] decides what there is. Samples go out over a publication as soon as the network has declared it.

use std::time::{SystemTime, UNIX_EPOCH};

use ipc_types::{MonotonicNs, RobotId, Schema};

use crate::config::{Priority, Ros2Config};
use crate::network::{Declaration, Network, Outbox, Token};
use crate::ros2::{ATTACHMENT_LEN, Publication, Publications, RosSession, UnixOffset, Way};

/// The robot's topics for ROS 2.
pub struct Ros2Publisher {
    topics: Publications<Outbox>,
    /// Last: it outlives the publications.
    _node: Token,
}

impl Ros2Publisher {
    /// Becomes a node of ROS 2. `None` if that is not configured.
    pub fn open(network: &Network, config: &Ros2Config, robot: RobotId) -> Option<Ros2Publisher> {
        if !config.enabled {
            return None;
        }
        let session = RosSession::new(config.domain_id, &network.id());
        let topics = Publications::new(session, robot, config.standard_messages);
        let node = network.token(topics.node().token().to_owned());
        tracing::info!(
            domain_id = config.domain_id,
            namespace = topics.node().namespace(),
            "a node of ROS 2"
        );
        Some(Ros2Publisher {
            topics,
            _node: node,
        })
    }

    /// The relay carries a topic from now on.
    pub fn add(&mut self, network: &Network, key: &str, schema: &Schema, priority: Priority) {
        let left_out = self.topics.add(key, schema, |publication| {
            network.outbox(declaration(publication, priority))
        });
        if let Some(standard) = left_out {
            tracing::warn!(
                key,
                "{} is not published for ROS 2, because a topic of the robot has its name",
                standard.type_name()
            );
        }
    }

    /// The relay sends a sample of a topic.
    pub fn send(&mut self, key: &str, sample: &[u8]) {
        let now = MonotonicNs::now();
        self.topics.send(key, sample, now, unix_offset(now));
    }
}

/// Unix time minus monotonic time, where `now` is the present moment.
fn unix_offset(now: MonotonicNs) -> UnixOffset {
    // A clock before 1970 is not set; it counts as 1970.
    let unix = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    let ns = |number: u128| i64::try_from(number).unwrap_or(i64::MAX);
    UnixOffset(ns(unix.as_nanos()) - ns(now.0.into()))
}

impl Way for Outbox {
    fn is_open(&self) -> bool {
        Outbox::is_open(self)
    }

    fn send(&self, payload: Vec<u8>, attachment: [u8; ATTACHMENT_LEN]) {
        Outbox::send(self, payload, attachment.to_vec());
    }
}

/// How the network declares a publication.
fn declaration(publication: &Publication, priority: Priority) -> Declaration {
    Declaration {
        key: publication.key_expression.clone(),
        priority,
        reliability: publication.qos.reliability,
        token: Some(publication.token.clone()),
    }
}
