//! The ROS graph as `rmw_zenoh` has it: what a session, a node and its publications are called in Zenoh.

use ipc_types::RobotId;
use ipc_types::schema::Schema;
use ros_messages::{Qos, Reliability, StandardMessage};
use twox_hash::XxHash3_128;

use super::type_hash::type_hash;

/// First part of every liveliness token of ROS 2.
const ADMIN_SPACE: &str = "@ros2_lv";

/// The default security enclave `/`. In a token `%` stands for `/`.
const ENCLAVE: &str = "%";

/// Name of the node that a relay is for each robot.
const NODE_NAME: &str = "ril_relay";

/// The depth that `rmw_zenoh` leaves out of a token, because it is its default.
const DEFAULT_DEPTH: u32 = 42;

/// Length of an attachment, bytes: two numbers of eight bytes, a length of one byte, an id of 16.
pub const ATTACHMENT_LEN: usize = 8 + 8 + 1 + size_of::<Gid>();

/// Id of a publisher in the ROS graph: the XXH3 hash of its liveliness token, 128 bits, least significant byte first.
///
/// A ROS 2 node computes it from the token, and finds by it which publisher a sample came from.
pub type Gid = [u8; 16];

/// The last part of a token: reliability, durability, history and depth, deadline, lifespan, liveliness. Whatever is
/// the default of `rmw_zenoh` stays empty: a receiver writes the token anew that way, and hashes it.
///
/// In `rmw_zenoh` any subscriber matches any publisher. The durability is always *volatile*: a late subscriber waits
/// for the next sample. *Transient local* would need a cache that answers queries beside each publisher. It would bring
/// little here: telemetry comes many times a second, and a state at least once a second.
fn encode(qos: Qos) -> String {
    let reliability = match qos.reliability {
        Reliability::Reliable => "",
        Reliability::BestEffort => "2",
    };
    let depth = match qos.depth {
        DEFAULT_DEPTH => String::new(),
        depth => depth.to_string(),
    };
    format!("{reliability}::,{depth}:,:,:,,")
}

/// A Zenoh session as part of the ROS graph. It hands out the ids of nodes and publications, which are unique in a
/// session.
#[derive(Debug)]
pub struct RosSession {
    domain_id: u32,
    zenoh_id: String,
    next_id: u64,
}

impl RosSession {
    /// The session with the id `zenoh_id`, as Zenoh writes it, in the ROS domain `domain_id` (`ROS_DOMAIN_ID`, 0 by
    /// default).
    pub fn new(domain_id: u32, zenoh_id: &str) -> RosSession {
        RosSession {
            domain_id,
            zenoh_id: zenoh_id.to_owned(),
            next_id: 0,
        }
    }

    fn take_id(&mut self) -> u64 {
        let id = self.next_id;
        self.next_id += 1;
        id
    }

    /// The node of a robot: `/hero1/ril_relay` for robot 1.
    pub fn node(&mut self, robot: RobotId) -> Node {
        let id = self.take_id();
        Node {
            robot,
            prefix: format!("{ADMIN_SPACE}/{}/{}/{id}", self.domain_id, self.zenoh_id),
            id,
        }
    }

    /// The publication of a robot's topic with this key and schema: `/hero1/hero_telemetry` for robot 1. The key is
    /// that of a service ([`is_key`](ipc_types::service::is_key)), so nothing in it is special to Zenoh.
    pub fn publish(&mut self, node: &Node, key: &str, schema: &Schema, qos: Qos) -> Publication {
        let type_name = schema.ros_resource_name();
        self.publication(node, key, type_name, &type_hash(schema), qos)
    }

    /// The publication of a standard message about a robot: `/hero1/imu/data` for robot 1.
    pub fn publish_standard(&mut self, node: &Node, message: StandardMessage) -> Publication {
        let type_name = message.type_name().to_owned();
        self.publication(
            node,
            message.key(),
            type_name,
            message.type_hash(),
            Qos::SENSOR_DATA,
        )
    }

    fn publication(
        &mut self,
        node: &Node,
        key: &str,
        type_name: String,
        type_hash: &str,
        qos: Qos,
    ) -> Publication {
        let id = self.take_id();
        let topic = format!("{}/{key}", node.namespace());
        let zenoh_type = zenoh_type_name(&type_name);
        let token = format!(
            "{}/{id}/MP/{}/{}/{zenoh_type}/{type_hash}/{}",
            node.prefix,
            node.names(),
            mangled(&topic),
            encode(qos)
        );
        Publication {
            key_expression: format!("{}{topic}/{zenoh_type}/{type_hash}", self.domain_id),
            gid: gid(&token),
            token,
            topic,
            type_name,
            qos,
        }
    }
}

/// A node of the ROS graph: a relay, in the namespace of one robot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Node {
    robot: RobotId,
    /// The beginning of its tokens and of those of its publications, up to the node's id.
    prefix: String,
    id: u64,
}

impl Node {
    /// The namespace, such as `/hero1`: a name in ROS 2 does not begin with a digit.
    pub fn namespace(&self) -> String {
        format!("/hero{}", self.robot)
    }

    /// The liveliness token to declare for the node.
    pub fn token(&self) -> String {
        format!("{}/{}/NN/{}", self.prefix, self.id, self.names())
    }

    /// Enclave, namespace and name, as a token has them.
    fn names(&self) -> String {
        format!("{ENCLAVE}/{}/{NODE_NAME}", mangled(&self.namespace()))
    }
}

/// A topic that a node publishes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Publication {
    /// Where to put the samples.
    pub key_expression: String,
    /// The liveliness token to declare.
    pub token: String,
    /// Id of the publisher, for the attachments.
    pub gid: Gid,
    /// Name of the topic in ROS 2, such as `/hero1/hero_telemetry`.
    pub topic: String,
    /// Name of the type in ROS 2, such as `hero_msgs/msg/HeroTelemetry`.
    pub type_name: String,
    /// Quality of service.
    pub qos: Qos,
}

/// What accompanies a sample: `sequence` counts the publication's samples from 1, `unix_ns` is when it is sent, Unix
/// time in ns.
///
/// The bytes are those of Zenoh's own serialization: numbers with the least significant byte first, and before the id
/// its length.
pub fn attachment(sequence: i64, unix_ns: i64, gid: &Gid) -> [u8; ATTACHMENT_LEN] {
    let mut bytes = [0; ATTACHMENT_LEN];
    bytes[..8].copy_from_slice(&sequence.to_le_bytes());
    bytes[8..16].copy_from_slice(&unix_ns.to_le_bytes());
    bytes[16] = size_of::<Gid>() as u8;
    bytes[17..].copy_from_slice(gid);
    bytes
}

/// `hero_msgs/msg/DspTelemetry` as `hero_msgs::msg::dds_::DspTelemetry_`.
fn zenoh_type_name(type_name: &str) -> String {
    let (package, name) = type_name.rsplit_once('/').unwrap_or(("", type_name));
    format!("{}::dds_::{name}_", package.replace('/', "::"))
}

/// A name as one part of a token.
fn mangled(name: &str) -> String {
    name.replace('/', "%")
}

/// Version 1 of the crate, which Zenoh has through `lz4_flex`, computes an early draft of XXH3: other numbers than ROS
/// 2.
fn gid(token: &str) -> Gid {
    XxHash3_128::oneshot(token.as_bytes()).to_le_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros2::own_schemas;

    const ZENOH_ID: &str = "1f2e3d4c5b6a79880102030405060708";

    fn schema(name: &str) -> Schema {
        let mut schemas = own_schemas().into_iter();
        schemas
            .find(|schema| schema.root().name == name)
            .expect("a schema of ours")
    }

    #[test]
    fn a_topic_of_ours_has_the_names_of_rmw_zenoh() {
        let mut session = RosSession::new(7, ZENOH_ID);
        let node = session.node(RobotId::new(12).unwrap());
        let schema = schema("HeroTelemetry");
        let publication = session.publish(&node, "hero_telemetry", &schema, Qos::SENSOR_DATA);
        let hash = type_hash(&schema);
        assert_eq!(
            node.token(),
            format!("@ros2_lv/7/{ZENOH_ID}/0/0/NN/%/%hero12/ril_relay")
        );
        assert_eq!(publication.topic, "/hero12/hero_telemetry");
        assert_eq!(publication.type_name, "hero_msgs/msg/HeroTelemetry");
        assert_eq!(
            publication.key_expression,
            format!("7/hero12/hero_telemetry/hero_msgs::msg::dds_::HeroTelemetry_/{hash}")
        );
        assert_eq!(
            publication.token,
            format!(
                "@ros2_lv/7/{ZENOH_ID}/0/1/MP/%/%hero12/ril_relay/%hero12%hero_telemetry/\
             hero_msgs::msg::dds_::HeroTelemetry_/{hash}/2::,5:,:,:,,"
            )
        );
    }

    #[test]
    fn a_standard_message_has_a_topic_in_the_robots_namespace() {
        let mut session = RosSession::new(0, "a");
        let node = session.node(RobotId::DEFAULT);
        let publication = session.publish_standard(&node, StandardMessage::Imu);
        assert_eq!(publication.topic, "/hero1/imu/data");
        let hash = StandardMessage::Imu.type_hash();
        assert_eq!(
            publication.key_expression,
            format!("0/hero1/imu/data/sensor_msgs::msg::dds_::Imu_/{hash}")
        );
        assert!(publication.token.contains("/%hero1%imu%data/"));
    }

    #[test]
    fn ids_are_unique_in_a_session_and_tell_publishers_apart() {
        let mut session = RosSession::new(0, ZENOH_ID);
        let nodes = [1, 2].map(|robot| session.node(RobotId::new(robot).unwrap()));
        let mut tokens: Vec<String> = nodes.iter().map(Node::token).collect();
        let mut gids = Vec::new();
        for node in &nodes {
            for message in StandardMessage::ALL {
                let publication = session.publish_standard(node, message);
                tokens.push(publication.token);
                gids.push(publication.gid);
            }
        }
        let count = tokens.len();
        tokens.sort();
        tokens.dedup();
        gids.sort();
        gids.dedup();
        assert_eq!((tokens.len(), gids.len()), (count, count - nodes.len()));
    }

    #[test]
    fn a_publisher_id_is_the_hash_of_its_token() {
        // By `xxhash.xxh3_128_intdigest` of Python.
        let token = "@ros2_lv/0/a/0/1/MP/%/%hero1/ril_relay/%hero1%fix/x/y/::,10:,:,:,,";
        assert_eq!(
            gid(token),
            0xbb34_452b_0877_f970_ad19_2b4c_5e4b_838b_u128.to_le_bytes()
        );
        let long = token.repeat(5);
        assert_eq!(
            gid(&long),
            0xecfa_05b4_2e7e_b6e0_442b_152c_e565_ac59_u128.to_le_bytes()
        );
    }

    #[test]
    fn quality_of_service_is_written_without_defaults() {
        assert_eq!(encode(Qos::SENSOR_DATA), "2::,5:,:,:,,");
        assert_eq!(encode(Qos::STATE), "::,10:,:,:,,");
        let default = Qos {
            depth: DEFAULT_DEPTH,
            ..Qos::STATE
        };
        assert_eq!(encode(default), "::,:,:,:,,");
    }

    #[test]
    fn an_attachment_has_sequence_time_and_publisher() {
        let gid: Gid = std::array::from_fn(|index| index as u8);
        let bytes = attachment(0x0102, 0x1122_3344_5566_7788, &gid);
        let mut expected = vec![2, 1, 0, 0, 0, 0, 0, 0];
        expected.extend([0x88, 0x77, 0x66, 0x55, 0x44, 0x33, 0x22, 0x11, 16]);
        expected.extend(0..16);
        assert_eq!(bytes.to_vec(), expected);
    }
}
