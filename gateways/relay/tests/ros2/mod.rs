//! Topics for ROS 2 against other implementations: type hashes and messages against `rosbags`, the graph and the samples against
//! `zenoh-ros2-sdk`, both in Python.
//!
//! `RIL_TEST_ROS2_PYTHON` names an interpreter that has the packages; else a virtual environment is made in the target folder, for
//! which they come from PyPI. What is missing is said, and the test is skipped visibly.

mod packages;
mod python;
mod relay_process;
mod samples;

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Stdio};

use ipc_types::{RobotId, Schema};
use relay::ros2::{RosSession, StandardMessage, add_packages, attachment, own_schemas, type_hash};
use ril_tests::languages::run;
use ril_tests::relayed::free_endpoint;
use ril_tests::stranger::STRANGER;
use serde_json::{Value, json};

use python::{python_or_skip, script};
use samples::{Sample, ZENOH_ID, samples};

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
    let endpoint = free_endpoint();
    let plan = folder.path().join("plan.json");
    fs::write(&plan, publisher_plan(&endpoint, &samples).to_string()).expect("a file");
    let _publisher = Publisher::start(python, &plan);

    check_topics(python, &endpoint, &samples, folder.path());
}

/// Runs `check_topics.py`, which ends well when it gets `samples` from a publisher at `endpoint`. The folder has the packages.
fn check_topics(python: &Path, endpoint: &str, samples: &[Sample], folder: &Path) {
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
    let expected = folder.join("expected.json");
    fs::write(&expected, json!({ "topics": topics }).to_string()).expect("a file");
    let mut command = script(python, "check_topics.py");
    command
        .args(["--endpoint", endpoint, "--packages"])
        .arg(folder)
        .arg("--expected")
        .arg(expected);
    run(&mut command).unwrap();
}

/// What `publish.py` is to publish: every token, and one sample of each topic again and again.
fn publisher_plan(endpoint: &str, samples: &[Sample]) -> Value {
    let node = RosSession::new(0, ZENOH_ID).node(RobotId::DEFAULT);
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

/// A new folder with the packages of `schemas`.
fn folder_with_packages(schemas: &[Schema]) -> tempfile::TempDir {
    let mut files = BTreeMap::new();
    add_packages(schemas, &mut files).expect("no two types of one name");
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
