//! The packages of the readers, in a folder of their own within the target folder, where they stay for the next time.
//!
//! `RIL_TEST_READERS_PYTHON` may name an interpreter that has those of Python, and `RIL_TEST_READERS_NODE` a folder
//! with `node_modules`. What cannot be had is skipped, and that is said.

use std::path::PathBuf;
use std::sync::OnceLock;

use crate::languages::skip;
use crate::packages;

use super::reader::Reader;

/// From PyPI.
const PYTHON_PACKAGES: &str =
    "mcap>=1.3,<2 mcap-ros2-support>=0.5.5,<1 rosbags>=0.11.9,<0.12 numpy pandas>=2";

/// From npm. `@lichtblick/rosmsg2-serialization` 1.0.0 needs `@lichtblick/cdr`, but does not say so.
const NODE_PACKAGES: [&str; 5] = [
    "@lichtblick/cdr@1",
    "@mcap/core@2",
    "@mcap/nodejs@1",
    "@lichtblick/rosmsg@1",
    "@lichtblick/rosmsg2-serialization@1",
];

/// The readers that can be had; says which are skipped.
pub fn readers_or_skip(what: &str) -> Vec<Reader> {
    static PYTHON: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    static NODE: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    let (python, node) = std::thread::scope(|scope| {
        let node = scope.spawn(|| NODE.get_or_init(node));
        (PYTHON.get_or_init(python), node.join().expect("no panic"))
    });
    let mut readers = Vec::new();
    match python {
        Ok(interpreter) => {
            readers.extend(["mcap", "rosbags", "hero_ril"].map(|name| Reader::Python {
                interpreter: interpreter.clone(),
                name,
            }))
        }
        Err(why) => skip(&format!("{what} in Python"), why),
    }
    match node {
        Ok(packages) => readers.extend(["indexed", "stream"].map(|name| Reader::Node {
            packages: packages.clone(),
            name,
        })),
        Err(why) => skip(&format!("{what} in JavaScript"), why),
    }
    readers
}

fn python() -> Result<PathBuf, String> {
    match std::env::var_os("RIL_TEST_READERS_PYTHON") {
        Some(python) => Ok(python.into()),
        None => packages::python(PYTHON_PACKAGES),
    }
}

fn node() -> Result<PathBuf, String> {
    match std::env::var_os("RIL_TEST_READERS_NODE") {
        Some(packages) => Ok(packages.into()),
        None => packages::node("readers", &NODE_PACKAGES),
    }
}
