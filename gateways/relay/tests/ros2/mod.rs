//! Topics for ROS 2 against other implementations: type hashes and messages against `rosbags`, the graph and the
//! samples of the running relay against `zenoh-ros2-sdk` and `eclipse-zenoh`, all in Python.
//!
//! `RIL_TEST_ROS2_PYTHON` names an interpreter that has the packages; else a virtual environment is made in the target
//! folder, for which they come from PyPI. What is missing is said, and the test is skipped visibly.

mod packages;
mod relay_process;
mod samples;

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use ipc_types::Schema;
use relay::ros2::{StandardMessage, add_packages, own_schemas, type_hash};
use ril_tests::languages::{run, skip};
use ril_tests::stranger::STRANGER;
use serde_json::{Value, json};

use samples::{Sample, samples};

/// The packages of Python.
const PACKAGES: &str =
    "rosbags>=0.11.9,<0.12 zenoh-ros2-sdk>=0.1.8,<0.2 eclipse-zenoh>=1.10,<2 xxhash>=3,<4";

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

/// An interpreter with the packages. When there is none, says past the capture of the tests' output that `what` is
/// skipped.
fn python_or_skip(what: &str) -> Option<PathBuf> {
    let python = match std::env::var_os("RIL_TEST_ROS2_PYTHON") {
        Some(python) => Ok(python.into()),
        None => ril_tests::packages::python(PACKAGES),
    };
    python.inspect_err(|why| skip(what, why)).ok()
}

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
    let mut command = script(&python, "check_rosbags.py");
    run(command.arg(folder.path()).arg(expected)).unwrap();
}

/// Runs `check_topics.py`, which ends well when it gets `samples` from a publisher at `endpoint`. The folder has the
/// packages.
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
