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
    let mut session = Session::new(7, ZENOH_ID).unwrap();
    let node = session.node(RobotId::new(12).unwrap());
    let schema = schema("HeroTelemetry");
    let publication = session
        .publish(&node, "hero_telemetry", &schema, Qos::SENSOR_DATA)
        .unwrap();
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
    let mut session = Session::new(0, "a").unwrap();
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
    let mut session = Session::new(0, ZENOH_ID).unwrap();
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
    assert_eq!(Qos::SENSOR_DATA.encode(), "2::,5:,:,:,,");
    assert_eq!(Qos::STATE.encode(), "::,10:,:,:,,");
    let default = Qos {
        reliability: Reliability::Reliable,
        depth: DEFAULT_DEPTH,
    };
    assert_eq!(default.encode(), "::,:,:,:,,");
}

#[test]
fn states_are_reliable_and_measurements_are_not() {
    for key in ["module_state", "status/state", "battery_watch/state"] {
        assert_eq!(Qos::of_key(key), Qos::STATE, "{key}");
    }
    for key in ["hero_telemetry", "battery_watch/cell_voltages"] {
        assert_eq!(Qos::of_key(key), Qos::SENSOR_DATA, "{key}");
    }
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

#[test]
fn names_that_break_a_key_expression_are_refused() {
    for id in ["", "A1", "1/2", "*", "00112233445566778899aabbccddeeff0"] {
        assert!(Session::new(0, id).is_err(), "{id}");
    }
    let mut session = Session::new(0, "a").unwrap();
    let node = session.node(RobotId::DEFAULT);
    let schema = schema("ModuleState");
    for key in ["", "/state", "a//b", "a/*", "a%b", "a$b", "Großes"] {
        let error = session.publish(&node, key, &schema, Qos::STATE);
        assert!(matches!(error, Err(NameError::Key(_))), "{key}");
    }
}
