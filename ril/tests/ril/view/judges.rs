//! The view through clients that others wrote: `@foxglove/ws-protocol`, the protocol library of Lichtblick, with
//! `@lichtblick/rosmsg` and `@lichtblick/rosmsg2-serialization` from npm, and `robo-ws-bridge` (GPL, for this test
//! alone) from PyPI.
//!
//! The packages are installed into a folder of their own: [`packages`]. What is missing is said, and then nothing is
//! tested.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use ipc_types::payload::{ModuleState, SharedStruct};
use ril_tests::languages::{root, skip};
use ril_tests::process::Signal;
use ril_tests::{Process, Sandbox, StandInBridge, packages};
use serde_json::{Value, json};

use super::View;
use crate::common::{FOR_SLOW_MACHINES, end, sandbox};

/// From npm. `@lichtblick/rosmsg2-serialization` 1.0.0 needs `@lichtblick/cdr`, but does not say so.
const NODE_PACKAGES: [&str; 5] = [
    "@foxglove/ws-protocol@0.8",
    "@lichtblick/cdr@1",
    "@lichtblick/rosmsg@1",
    "@lichtblick/rosmsg2-serialization@1",
    "ws@8",
];

/// From PyPI.
const PYTHON_PACKAGES: &str = "robo-ws-bridge>=0.11,<0.12";

/// Messages of each topic.
const COUNT: usize = 3;

/// Names for `ril echo`, and the topics of the view.
const TOPICS: [(&str, &str); 4] = [
    ("hero", "/robot1/hero/telemetry"),
    ("dsp", "/robot1/dsp/telemetry"),
    ("state", "/robot1/bridge/state"),
    ("status/state", "/robot1/status/state"),
];

/// Topics that the view makes.
const DERIVED: [&str; 8] = [
    "/tf",
    "/diagnostics",
    "/robot1/fix",
    "/robot1/imu/data",
    "/robot1/battery_state",
    "/robot1/pose",
    "/robot1/chart",
    "/robot1/log",
];

/// What a program prints.
#[track_caller]
fn output(mut command: Command) -> String {
    let output = command.output().expect("a program that can be started");
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {error}");
    String::from_utf8(output.stdout).expect("text")
}

fn file(name: &str) -> std::path::PathBuf {
    root().join("ril/tests/ril/view").join(name)
}

/// Messages as fields by name, by topic.
type Messages = BTreeMap<String, Vec<BTreeMap<String, String>>>;

fn judge_in_javascript(packages: &Path, view: &View) -> Messages {
    let mut command = Command::new("node");
    command.arg(file("judge.mjs")).arg(packages);
    command.arg(format!("ws://127.0.0.1:{}/", view.port));
    command.args(TOPICS.map(|(_, topic)| format!("{topic}={COUNT}")));
    command.args(DERIVED.map(|topic| format!("{topic}=1")));
    let mut messages = Messages::new();
    for line in output(command).lines() {
        let mut parts = line.split('\t');
        let topic = parts.next().expect("a topic").to_owned();
        let fields = parts.map(|field| {
            let (name, value) = field.split_once('=').expect("a value");
            (name.to_owned(), value.to_owned())
        });
        messages.entry(topic).or_default().push(fields.collect());
    }
    messages
}

/// The numbers of a JSON object by their paths, as the judge writes them.
fn numbers(path: &str, value: &Value, found: &mut BTreeMap<String, f64>) {
    match value {
        Value::Object(fields) => {
            for (name, value) in fields {
                let dot = if path.is_empty() { "" } else { "." };
                numbers(&format!("{path}{dot}{name}"), value, found);
            }
        }
        Value::Array(elements) => {
            for (index, element) in elements.iter().enumerate() {
                numbers(&format!("{path}[{index}]"), element, found);
            }
        }
        Value::Number(number) => {
            _ = found.insert(path.to_owned(), number.as_f64().expect("a number"))
        }
        _ => {}
    }
}

/// Whether a field of the judge is this number. It writes integers as such, and floats as the bits that they have in
/// 64; the shortest text of a float with 32 is another one of 64.
fn is(text: &str, expected: f64) -> bool {
    let float = u64::from_str_radix(text, 16).ok().map(f64::from_bits);
    let values = [text.parse().ok(), float];
    let is_it = |found: f64| found == expected || found as f32 == expected as f32;
    values.into_iter().flatten().any(is_it)
}

/// `ril echo` of a topic, as JSON on a line each.
fn echo(rig: &Sandbox, name: &str) -> Process {
    let mut process = rig.start(&format!("echo {name} --json"));
    process.wait_for_text("\"sequence\"");
    process
}

#[test]
fn lichtblicks_library_gets_each_topic_as_ril_echo_prints_it() {
    let packages = match packages::node("judges", &NODE_PACKAGES) {
        Ok(packages) => packages,
        Err(why) => return skip("the view in @foxglove/ws-protocol", &why),
    };
    let rig = sandbox();
    rig.write("bridge.toml", FOR_SLOW_MACHINES);
    let robot = rig.start_robot(1, 1);
    let view = View::start(&rig);
    let echoes = TOPICS.map(|(name, topic)| (topic, echo(&rig, name)));
    let messages = judge_in_javascript(&packages, &view);
    for (topic, echo) in echoes {
        let printed = end(echo, Signal::INT).stdout;
        let printed = printed
            .iter()
            .map(|line| serde_json::from_str::<Value>(line).expect("JSON"));
        let printed: BTreeMap<String, Value> = printed
            .map(|sample| (sample["sequence"].to_string(), sample))
            .collect();
        let mut compared = 0;
        for message in &messages[topic] {
            // The judge subscribed later than the echo, but gets the newest sample from before.
            let Some(sample) = printed.get(&message["sequence"]) else {
                continue;
            };
            let mut expected = BTreeMap::new();
            numbers("", sample, &mut expected);
            assert!(expected.len() > 5, "{sample}");
            for (name, expected) in &expected {
                let text = message
                    .get(name)
                    .unwrap_or_else(|| panic!("{topic}: no {name}"));
                assert!(
                    is(text, *expected),
                    "{topic}: {name} is {expected}, and {text}"
                );
            }
            compared += 1;
        }
        assert!(compared > 0, "{topic}: {printed:?}");
    }
    for topic in DERIVED {
        let messages = messages.get(topic);
        assert!(
            messages.is_some_and(|messages| !messages[0].is_empty()),
            "{topic}"
        );
    }
    // What is made of telemetry is of a sample of telemetry.
    let telemetry = &messages["/robot1/hero/telemetry"];
    let altitude = |fix: &BTreeMap<String, String>| fix["altitude"].clone();
    let altitudes: Vec<_> = messages["/robot1/fix"].iter().map(altitude).collect();
    let is_of =
        |sample: &BTreeMap<String, String>| altitudes.contains(&sample["geodetic.altitude_m"]);
    assert!(telemetry.iter().any(is_of), "{altitudes:?}");
    view.end();
    robot.end();
}

#[test]
fn a_client_in_python_reads_and_can_order_nothing() {
    let python = match packages::python(PYTHON_PACKAGES) {
        Ok(python) => python,
        Err(why) => return skip("the view in robo-ws-bridge", &why),
    };
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    let state = StandInBridge::idle_state();
    bridge.publish_state(&state);
    let view = View::start(&rig);
    let mut command = Command::new(python);
    command.arg("-B").arg(file("judge.py"));
    command.arg(format!(
        "ws://127.0.0.1:{}/?token={}",
        view.port, view.token
    ));
    let found: Value = serde_json::from_str(&output(command)).expect("JSON");
    let hex = found["message"].as_str().expect("a text").as_bytes();
    let digit = |digit: u8| char::from(digit).to_digit(16).expect("a digit") as u8;
    let (pairs, _) = hex.as_chunks::<2>();
    // Behind the header of CDR.
    let bytes = pairs
        .iter()
        .skip(4)
        .map(|[high, low]| digit(*high) << 4 | digit(*low));
    let bytes: Vec<u8> = bytes.collect();
    let got = ModuleState::from_bytes(&bytes).expect("a state");
    assert_eq!(
        (got.status, got.functionality),
        (state.status, state.functionality)
    );
    let services = found["services"].as_array().expect("a list");
    assert!(services.is_empty(), "{found}");
    assert_eq!(found["capabilities"], json!(["time", "assets"]));
    let asset = found["asset"].as_str().expect("a text");
    assert!(asset.contains("base_link"), "{asset}");
    view.end();
    drop(bridge);
}
