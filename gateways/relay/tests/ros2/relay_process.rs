//! The program `ril-relay` beside stand-ins that publish, as a node of ROS 2.

use std::collections::BTreeSet;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState, SharedStruct};
use ipc_types::{RobotId, Schema};
use relay::ros2::{Qos, RosSession, StandardMessage, own_schemas};
use ril_tests::languages::run;
use ril_tests::relayed::free_endpoint;
use ril_tests::{Process, Publishing, Sandbox, StandInStatus, StandInTopic};
use serde_json::{Value, json};
use zenoh::Wait;
use zenoh::sample::{Sample, SampleKind};

use super::samples::{self, samples};
use super::{check_topics, folder_with_packages, python_or_skip, script};

ipc_types::shared_struct! {
    /// A topic of a module, with a name that a standard message has too.
    pub struct ImuData("imu.ImuData.v1") = 24 {
        /// Counts the samples of this publisher from 1.
        pub sequence: u64,
        /// When the publisher began, host monotonic ns.
        pub epoch_ns: u64,
        /// Of the sensor. [K]
        pub temperature_k: f64,
    }
}
ipc_types::topic!(ImuData, "imu/data");

/// How often the stand-ins publish.
const PERIOD: Duration = Duration::from_millis(50);

/// The relay of a robot whose stand-ins publish as long as this value lives.
struct Robot {
    relay: Process,
    endpoint: String,
    publishing: Publishing,
}

/// The relay's program in a domain and a folder of its own.
fn machine() -> Sandbox {
    Sandbox::of(env!("CARGO_BIN_EXE_ril-relay"))
}

impl Robot {
    /// Starts `publish`, which is called again and again, and the relay; returns when the relay carries `keys`.
    fn start(machine: &Sandbox, keys: &[&str], publish: impl FnMut() + Send + 'static) -> Robot {
        let publishing = Publishing::start(PERIOD, || publish);
        let endpoint = free_endpoint();
        let config = format!("[robot]\nlisten = [\"{endpoint}\"]\n[ros2]\nenabled = true\n");
        machine.write("relay.toml", &config);
        let mut relay = machine.start("robot --robot 1");
        for key in keys {
            relay.wait_for_line(|line| {
                line.text.contains("relayed") && line.text.contains(&format!("\"{key}\""))
            });
        }
        Robot {
            relay,
            endpoint,
            publishing,
        }
    }

    /// Ends it, and returns what the relay has logged.
    fn end(self) -> Vec<String> {
        let finished = self.relay.end();
        drop(self.publishing);
        finished.stderr
    }
}

#[test]
fn zenoh_ros2_sdk_lists_and_echoes_what_the_running_relay_publishes() {
    let Some(python) = python_or_skip("zenoh-ros2-sdk with ril-relay") else {
        return;
    };
    let machine = machine();
    let status = StandInStatus::start_lossy(&machine.domain, RobotId::DEFAULT);
    let dsp = StandInTopic::<DspTelemetry>::start_lossy(&machine.domain, RobotId::DEFAULT);
    let state = StandInTopic::<ModuleState>::start_lossy(&machine.domain, RobotId::DEFAULT);
    let keys = ["hero_telemetry", "dsp_telemetry", "module_state"];
    let robot = Robot::start(&machine, &keys, move || {
        status.publish(&samples::telemetry());
        dsp.publish(&samples::dsp());
        state.publish(&samples::state());
    });
    let mut expected = samples();
    for sample in &mut expected {
        leave_out_what_each_run_changes(&mut sample.values);
    }
    let folder = folder_with_packages(&own_schemas());
    check_topics(&python, &robot.endpoint, &expected, folder.path());
    robot.end();
}

/// Keys, messages and samples as the document has them, by Zenoh's own library for another language.
#[test]
fn eclipse_zenoh_reads_the_documented_keys_as_a_peer_and_as_a_client() {
    let Some(python) = python_or_skip("eclipse-zenoh with ril-relay") else {
        return;
    };
    let machine = machine();
    let status = StandInStatus::start_lossy(&machine.domain, RobotId::DEFAULT);
    let robot = Robot::start(&machine, &["hero_telemetry"], move || {
        status.publish(&samples::telemetry());
    });
    let mut samples = samples().into_iter();
    let hero = samples.find(|sample| sample.publication.topic == "/hero1/hero_telemetry");
    let mut hero = hero.expect("telemetry");
    leave_out_what_each_run_changes(&mut hero.values);
    let expected = json!({
        "robot": 1,
        "key": "hero_telemetry",
        "type": hero.publication.type_name,
        "ros2_key": hero.publication.key_expression,
        "timeout_s": 30,
        "values": hero.values,
    });
    let mut command = script(&python, "check_keys.py");
    command.args(["--endpoint", &robot.endpoint, "--expected"]);
    run(command.arg(expected.to_string())).unwrap();
    robot.end();
}

/// The publishers count and stamp the samples, and the relay knows the real time.
fn leave_out_what_each_run_changes(values: &mut Value) {
    let values = values.as_object_mut().expect("a struct");
    for field in ["sequence", "epoch_ns", "published_ns"] {
        values.remove(field);
    }
    if let Some(header) = values.get_mut("header") {
        header.as_object_mut().expect("a struct").remove("stamp");
    }
}

/// A session in the place of ROS 2.
fn other_node(endpoint: &str) -> zenoh::Session {
    let mut config = zenoh::Config::default();
    for (key, value) in [
        ("mode", "\"peer\"".to_owned()),
        ("listen/endpoints", "[]".to_owned()),
        ("connect/endpoints", format!("[\"{endpoint}\"]")),
        ("scouting/multicast/enabled", "false".to_owned()),
    ] {
        config.insert_json5(key, &value).expect("a setting");
    }
    zenoh::open(config).wait().expect("a session")
}

#[test]
fn a_module_s_topic_keeps_its_name_and_the_standard_message_is_left_out_with_one_warning() {
    let machine = machine();
    let status = StandInStatus::start_lossy(&machine.domain, RobotId::DEFAULT);
    let imu = StandInTopic::<ImuData>::start_lossy(&machine.domain, RobotId::DEFAULT);
    let robot = Robot::start(&machine, &["hero_telemetry", "imu/data"], move || {
        status.publish(&samples::telemetry());
        imu.publish(&ImuData::default());
    });
    let node = other_node(&robot.endpoint);
    let tokens = node
        .liveliness()
        .declare_subscriber("@ros2_lv/0/**")
        .history(true)
        .wait()
        .expect("a subscriber");
    let expected = BTreeSet::from([
        "NN/%/%hero1/ril_relay".to_owned(),
        of("hero_telemetry", "hero_msgs::msg::dds_::HeroTelemetry_"),
        of("imu%data", "imu_msgs::msg::dds_::ImuData_"),
        of("fix", "sensor_msgs::msg::dds_::NavSatFix_"),
        of("battery_state", "sensor_msgs::msg::dds_::BatteryState_"),
        of("velocity", "geometry_msgs::msg::dds_::TwistStamped_"),
    ]);
    let mut seen = BTreeSet::new();
    while seen != expected {
        let token = tokens.recv().expect("a token");
        let entity = entity(token.key_expr().as_str());
        match token.kind() {
            SampleKind::Put => seen.insert(entity),
            SampleKind::Delete => seen.remove(&entity),
        };
    }
    let log = robot.end();
    let warnings = log.iter().filter(|line| line.contains("is not published"));
    assert_eq!(warnings.count(), 1, "{log:#?}");
}

/// A publisher's token without its ids, hash and quality of service.
fn of(topic: &str, type_name: &str) -> String {
    format!("MP/%/%hero1/ril_relay/%hero1%{topic}/{type_name}")
}

fn entity(token: &str) -> String {
    // `@ros2_lv/<domain>/<session>/<node>/<id>/<kind>/<enclave>/<namespace>/<node name>/<topic>/<type>/…`
    token
        .split('/')
        .skip(5)
        .take(6)
        .collect::<Vec<_>>()
        .join("/")
}

#[test]
fn samples_arrive_as_they_were_published_with_the_unix_time_of_their_publishing() {
    let machine = machine();
    let status = StandInStatus::start_lossy(&machine.domain, RobotId::DEFAULT);
    let began_ns = unix_ns();
    let robot = Robot::start(&machine, &["hero_telemetry"], move || {
        status.publish(&samples::telemetry());
    });
    let node = other_node(&robot.endpoint);
    let topic = node
        .declare_subscriber("0/hero1/**")
        .wait()
        .expect("a subscriber");
    let mut session = RosSession::new(0, "a");
    let ros_node = session.node(RobotId::DEFAULT);
    let schema = Schema::of::<HeroTelemetry>();
    let own = session.publish(&ros_node, "hero_telemetry", &schema, Qos::SENSOR_DATA);
    let fix = session.publish_standard(&ros_node, StandardMessage::NavSatFix);
    let mut last_sequence = 0;
    let mut fixes = 0;
    while last_sequence == 0 || fixes == 0 {
        let sample = topic.recv().expect("a sample");
        if sample.key_expr().as_str() == fix.key_expression {
            fixes += 1;
        } else if sample.key_expr().as_str() == own.key_expression {
            let (sequence, time_ns) = attached(&sample);
            assert!(sequence > last_sequence);
            last_sequence = sequence;
            assert!((began_ns..=unix_ns()).contains(&time_ns), "{time_ns}");
            let payload = sample.payload().to_bytes();
            let telemetry = HeroTelemetry::from_bytes(&payload[4..]).expect("a struct");
            let expected = HeroTelemetry {
                sequence: telemetry.sequence,
                epoch_ns: telemetry.epoch_ns,
                published_ns: telemetry.published_ns,
                ..samples::telemetry()
            };
            assert_eq!(telemetry, expected);
        }
    }
    robot.end();
}

/// Sequence and Unix time in ns.
fn attached(sample: &Sample) -> (i64, i64) {
    let attachment = sample.attachment().expect("an attachment").to_bytes();
    let number = |from: usize| i64::from_le_bytes(*attachment[from..].first_chunk().expect("8"));
    assert_eq!(attachment.len(), 33);
    (number(0), number(8))
}

fn unix_ns() -> i64 {
    let unix = SystemTime::now().duration_since(UNIX_EPOCH);
    unix.expect("after 1970").as_nanos() as i64
}
