//! The packages of the readers, in a folder of their own within the target folder, where they stay for the next time.
//!
//! `RIL_TEST_READERS_PYTHON` may name an interpreter that has those of Python, and `RIL_TEST_READERS_NODE` a folder with
//! `node_modules`. What cannot be had is skipped, and that is said.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use crate::languages::{run, skip, target_folder};

use super::reader::Reader;

/// From PyPI.
const PYTHON_PACKAGES: [&str; 5] = [
    "mcap>=1.3,<2",
    "mcap-ros2-support>=0.5.5,<1",
    "rosbags>=0.11.9,<0.12",
    "numpy",
    "pandas>=2",
];
const PYTHON_IMPORTS: &str =
    "import mcap.reader, mcap_ros2.decoder, rosbags.highlevel, numpy, pandas";

/// From npm. `@lichtblick/rosmsg2-serialization` 1.0.0 needs `@lichtblick/cdr`, but does not say so.
const NODE_PACKAGES: [&str; 5] = [
    "@lichtblick/cdr@1",
    "@mcap/core@2",
    "@mcap/nodejs@1",
    "@lichtblick/rosmsg@1",
    "@lichtblick/rosmsg2-serialization@1",
];

fn folder() -> PathBuf {
    target_folder().join("tmp")
}

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
    if let Some(python) = std::env::var_os("RIL_TEST_READERS_PYTHON") {
        return Ok(python.into());
    }
    let folder = folder().join("readers-venv");
    let python = folder.join("bin/python");
    let has_packages = || run(Command::new(&python).args(["-B", "-c", PYTHON_IMPORTS]));
    if has_packages().is_err() {
        run(Command::new("python3").args(["-m", "venv"]).arg(&folder))?;
        let mut pip = Command::new(&python);
        pip.args([
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            "--retries=1",
        ]);
        run(pip.args(PYTHON_PACKAGES))?;
        has_packages()?;
    }
    Ok(python)
}

fn node() -> Result<PathBuf, String> {
    if let Some(packages) = std::env::var_os("RIL_TEST_READERS_NODE") {
        return Ok(packages.into());
    }
    run(Command::new("node").arg("--version"))?;
    let folder = folder().join("readers-node");
    let has_packages = |folder: &Path| {
        let mut names = NODE_PACKAGES
            .iter()
            .filter_map(|package| package.rsplit_once('@'));
        names.all(|(name, _)| {
            folder
                .join("node_modules")
                .join(name)
                .join("package.json")
                .is_file()
        })
    };
    if !has_packages(&folder) {
        let write = |name: &str, text| std::fs::write(folder.join(name), text);
        let made = std::fs::create_dir_all(&folder)
            .and_then(|()| write("package.json", "{\"private\": true}\n"));
        made.map_err(|error| format!("{}: {error}", folder.display()))?;
        let mut npm = Command::new("npm");
        npm.args([
            "install",
            "--no-audit",
            "--no-fund",
            "--ignore-scripts",
            "--fetch-retries=0",
        ]);
        run(npm.args(NODE_PACKAGES).current_dir(&folder))?;
    }
    match has_packages(&folder) {
        true => Ok(folder),
        false => Err("npm did not install its packages".to_owned()),
    }
}
