//! Topics for ROS 2 against other implementations: type hashes and messages against `rosbags`, the graph and the samples against
//! `zenoh-ros2-sdk`, both in Python.
//!
//! `RIL_TEST_ROS2_PYTHON` names an interpreter that has the packages; else a virtual environment is made in the target folder, for
//! which they come from PyPI. What is missing is said, and the test is skipped visibly.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::io::{BufRead, BufReader, Write as _};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;

use ipc_types::payload::{
    DspTelemetry, HeroAcceleration, HeroAngularRate, HeroAttitude, HeroGeodetic, HeroSupply,
    HeroTelemetry, HeroVelocity, ModuleState, SharedStruct,
};
use ipc_types::{RobotId, Schema};
use relay::ros2::{
    Publication, Qos, Session, StandardMessage, UnixOffset, attachment, message, own_schemas,
    type_hash, write_packages,
};
use serde_json::{Value, json};

/// The packages, and what they are imported as.
const PACKAGES: [&str; 4] = [
    "rosbags>=0.11,<0.12",
    "zenoh-ros2-sdk>=0.1.8,<0.2",
    "eclipse-zenoh>=1.10,<2",
    "xxhash>=3,<4",
];
const IMPORTS: &str = "import rosbags.typesys, zenoh_ros2_sdk, zenoh, xxhash";

/// Id of the session that publishes.
const ZENOH_ID: &str = "1f2e3d4c5b6a7988a1b2c3d4e5f60718";

/// A schema of another module, with what the robot's own do not have.
const STRANGER: &str = "\
# Layout: battery_watch.Battery.v3

uint64 sequence
uint64 epoch_ns
int64 offset_ns
float64[3] gains
battery_watch_msgs/Cell[2] cells
analog_msgs/Channel channel

================================================================================
MSG: battery_watch_msgs/Cell
# Layout: battery_watch.Cell.v1

float32 voltage_v
int16[2] temperatures
uint16 age_s
int8 sign
uint8[5] name

================================================================================
MSG: analog_msgs/Channel
# Layout: analog.Channel.v1

int32 offset_adc
uint32 scale_adc
";

#[test]
fn rosbags_computes_the_same_hashes_and_reads_the_same_values() {
    let Some(python) = python_or_skip("rosbags") else {
        return;
    };
    let mut schemas = own_schemas();
    schemas.push(Schema::parse(STRANGER).expect("a schema"));
    let mut hashes: BTreeMap<String, String> = schemas
        .iter()
        .map(|schema| (schema.ros_resource_name(), type_hash(schema)))
        .collect();
    for message in StandardMessage::ALL {
        let names = (message.type_name(), message.type_hash());
        hashes.insert(names.0.to_owned(), names.1.to_owned());
    }
    let messages: Vec<Value> = samples()
        .into_iter()
        .map(|sample| {
            json!({
                "type": sample.publication.type_name,
                "cdr": hex(&sample.payload),
                "values": sample.values,
            })
        })
        .collect();
    let folder = folder_with_packages(&schemas);
    let expected = folder.path().join("expected.json");
    let text = json!({ "hashes": hashes, "messages": messages }).to_string();
    fs::write(&expected, text).expect("a file");
    let mut command = script(python, "check_rosbags.py");
    run(command.arg(folder.path()).arg(expected)).unwrap();
}

#[test]
fn zenoh_ros2_sdk_lists_and_echoes_the_topics() {
    let Some(python) = python_or_skip("zenoh-ros2-sdk") else {
        return;
    };
    let samples = samples();
    let folder = folder_with_packages(&own_schemas());
    let endpoint = format!("tcp/127.0.0.1:{}", free_port());
    let plan = folder.path().join("plan.json");
    fs::write(&plan, publisher_plan(&endpoint, &samples).to_string()).expect("a file");
    let _publisher = Publisher::start(python, &plan);

    let topics: Vec<Value> = samples
        .iter()
        .map(|sample| {
            let publication = &sample.publication;
            let hash = publication.key_expression.rsplit('/').next();
            json!({
                "topic": publication.topic,
                "type": publication.type_name,
                "hash": hash,
                "values": sample.values,
            })
        })
        .collect();
    let expected = folder.path().join("expected.json");
    fs::write(&expected, json!({ "topics": topics }).to_string()).expect("a file");
    let mut command = script(python, "check_topics.py");
    command
        .args(["--endpoint", &endpoint, "--packages"])
        .arg(folder.path())
        .arg("--expected")
        .arg(expected);
    run(&mut command).unwrap();
}

/// One sample of a topic, and what a program in ROS 2 should see of it.
struct Sample {
    publication: Publication,
    payload: Vec<u8>,
    values: Value,
}

/// A sample of each topic of a robot.
fn samples() -> Vec<Sample> {
    let mut session = Session::new(0, ZENOH_ID).expect("a Zenoh id");
    let robot = RobotId::DEFAULT;
    let node = session.node(robot);
    let telemetry = telemetry();
    let mut samples = Vec::new();
    let mut own = |key: &str, schema: Schema, bytes: &[u8], values: Value| {
        let publication = session.publish(&node, key, &schema, Qos::of_key(key));
        samples.push(Sample {
            publication: publication.expect("a key"),
            payload: message(bytes),
            values,
        });
    };
    let values = serde_json::to_value(telemetry).expect("JSON");
    let schema = Schema::of::<HeroTelemetry>();
    own("hero_telemetry", schema, telemetry.bytes(), values);
    let dsp = DspTelemetry {
        sequence: 9,
        flying: 1,
        ..DspTelemetry::ZERO
    };
    let values = serde_json::to_value(dsp).expect("JSON");
    own(
        "dsp_telemetry",
        Schema::of::<DspTelemetry>(),
        dsp.bytes(),
        values,
    );
    let state = ModuleState {
        sequence: 11,
        module_id: 1,
        ..ModuleState::ZERO
    };
    let values = serde_json::to_value(state).expect("JSON");
    own(
        "module_state",
        Schema::of::<ModuleState>(),
        state.bytes(),
        values,
    );
    for standard in StandardMessage::ALL {
        let offset = UnixOffset(1_700_000_000_000_000_000);
        samples.push(Sample {
            publication: session.publish_standard(&node, standard),
            payload: standard
                .write(&telemetry, robot, offset)
                .expect("valid groups"),
            values: standard_values(standard),
        });
    }
    samples
}

/// A sample with all groups valid: level, to the north.
fn telemetry() -> HeroTelemetry {
    HeroTelemetry {
        sequence: 42,
        epoch_ns: u64::MAX,
        received_ns: 3_250_000_001,
        valid_groups: 0xffff,
        gps_quality: 4,
        geodetic: HeroGeodetic {
            latitude_rad: 0.75,
            longitude_rad: -0.1,
            altitude_m: 120.5,
        },
        velocity: HeroVelocity {
            north_mps: 3.0,
            east_mps: 4.1,
            up_mps: -1.5,
            ..HeroVelocity::ZERO
        },
        attitude: HeroAttitude::ZERO,
        acceleration: HeroAcceleration {
            forward_mps2: 0.5,
            right_mps2: 0.25,
            down_mps2: -9.75,
        },
        angular_rate: HeroAngularRate {
            forward_radps: 0.5,
            right_radps: 0.25,
            down_radps: 0.125,
        },
        supply: HeroSupply {
            battery_v: 12.3,
            ..HeroSupply::ZERO
        },
        ..HeroTelemetry::ZERO
    }
}

/// What a standard message made of [`telemetry`] says.
fn standard_values(message: StandardMessage) -> Value {
    let header = |frame: &str| {
        json!({
            "stamp": { "sec": 1_700_000_003, "nanosec": 250_000_001 },
            "frame_id": frame,
        })
    };
    let unknown = [0.0; 9];
    match message {
        StandardMessage::NavSatFix => json!({
            "header": header("hero1/base_link"),
            "status": { "status": 2, "service": 1 },
            "latitude": 0.75_f64.to_degrees(),
            "longitude": (-0.1_f64).to_degrees(),
            "altitude": 120.5,
            "position_covariance": unknown,
            "position_covariance_type": 0,
        }),
        StandardMessage::Imu => json!({
            "header": header("hero1/base_link"),
            "orientation": { "x": 0.0, "y": 0.0 },
            "orientation_covariance": unknown,
            "angular_velocity": { "x": 0.5, "y": -0.25, "z": -0.125 },
            "angular_velocity_covariance": unknown,
            "linear_acceleration": { "x": 0.5, "y": -0.25, "z": 9.75 },
            "linear_acceleration_covariance": unknown,
        }),
        StandardMessage::BatteryState => json!({
            "header": header("hero1/base_link"),
            "voltage": 12.3,
            "temperature": null,
            "current": null,
            "percentage": null,
            "power_supply_status": 0,
            "present": true,
            "cell_voltage": [],
            "location": "",
            "serial_number": "",
        }),
        StandardMessage::TwistStamped => json!({
            "header": header("map"),
            "twist": { "linear": { "x": 4.1, "y": 3.0, "z": -1.5 }, "angular": { "z": -0.125 } },
        }),
    }
}

/// What `publish.py` is to publish: every token, and one sample of each topic again and again.
fn publisher_plan(endpoint: &str, samples: &[Sample]) -> Value {
    let node = Session::new(0, ZENOH_ID)
        .expect("a Zenoh id")
        .node(RobotId::DEFAULT);
    let publications = samples.iter().map(|sample| &sample.publication);
    let tokens: Vec<String> = [node.token()]
        .into_iter()
        .chain(publications.map(|publication| publication.token.clone()))
        .collect();
    let samples: Vec<Value> = samples
        .iter()
        .map(|sample| {
            let publication = &sample.publication;
            let attachment = attachment(1, 1_700_000_003_300_000_000, &publication.gid);
            json!({
                "key": publication.key_expression,
                "payload": hex(&sample.payload),
                "attachment": hex(&attachment),
            })
        })
        .collect();
    json!({ "listen": endpoint, "zenoh_id": ZENOH_ID, "tokens": tokens, "samples": samples })
}

/// `publish.py`, which ends with this value: its standard input ends.
struct Publisher(Child);

impl Publisher {
    fn start(python: &Path, plan: &Path) -> Publisher {
        let mut command = script(python, "publish.py");
        command
            .arg(plan)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped());
        let mut publisher = Publisher(command.spawn().expect("Python"));
        let output = publisher.0.stdout.take().expect("a pipe");
        let mut id = String::new();
        BufReader::new(output)
            .read_line(&mut id)
            .expect("the id of the session");
        assert_eq!(id.trim_end(), ZENOH_ID, "the session publishes");
        publisher
    }
}

impl Drop for Publisher {
    fn drop(&mut self) {
        drop(self.0.stdin.take());
        let _ = self.0.wait();
    }
}

/// A port that was free a moment ago.
fn free_port() -> u16 {
    let listener = TcpListener::bind("127.0.0.1:0").expect("loopback");
    listener.local_addr().expect("an address").port()
}

/// A new folder with the packages of `schemas`.
fn folder_with_packages(schemas: &[Schema]) -> tempfile::TempDir {
    let mut files = BTreeMap::new();
    write_packages(schemas, &mut files).expect("no two types of one name");
    let folder = tempfile::tempdir().expect("a folder");
    for (path, text) in files {
        let path = folder.path().join(path);
        fs::create_dir_all(path.parent().expect("a package")).expect("a folder");
        fs::write(path, text).expect("a file");
    }
    folder
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// The command that runs one of the scripts beside this file.
fn script(python: &Path, name: &str) -> Command {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/ros2");
    let mut command = Command::new(python);
    command
        .args(["-u", "-B"])
        .arg(folder.join(name))
        .env_remove("ROS_DOMAIN_ID")
        .env_remove("ZENOH_CONFIG_OVERRIDE")
        .env_remove("ZENOH_SESSION_CONFIG_URI");
    command
}

/// Runs a program to its end, or says why that did not work.
fn run(command: &mut Command) -> Result<(), String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let output = command
        .output()
        .map_err(|error| format!("{name}: {error}"))?;
    match output.status.success() {
        true => Ok(()),
        false => Err(format!(
            "{name}: {}{}",
            String::from_utf8_lossy(&output.stdout),
            String::from_utf8_lossy(&output.stderr)
        )),
    }
}

/// An interpreter with the packages. When there is none, says past the capture of the tests' output that `what` is skipped.
fn python_or_skip(what: &str) -> Option<&'static Path> {
    static PYTHON: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    match PYTHON.get_or_init(python) {
        Ok(python) => Some(python),
        Err(why) => {
            let _ = writeln!(std::io::stderr(), "SKIPPED: {what}: {why}");
            None
        }
    }
}

fn python() -> Result<PathBuf, String> {
    if let Some(python) = std::env::var_os("RIL_TEST_ROS2_PYTHON") {
        return Ok(python.into());
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("ros2-venv");
    let python = folder.join("bin/python");
    let has_packages = || run(Command::new(&python).args(["-c", IMPORTS]));
    if has_packages().is_err() {
        run(Command::new("python3").args(["-m", "venv"]).arg(&folder))?;
        let mut pip = Command::new(&python);
        pip.args(["-m", "pip", "install", "--quiet"])
            .arg("--disable-pip-version-check")
            .args(PACKAGES);
        run(&mut pip)?;
        has_packages()?;
    }
    Ok(python)
}
