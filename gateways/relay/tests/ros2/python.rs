//! Scripts in Python, and the packages that they need.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use ril_tests::languages::{run, skip};

/// The packages, and what they are imported as.
const PACKAGES: [&str; 4] = [
    "rosbags>=0.11.9,<0.12",
    "zenoh-ros2-sdk>=0.1.8,<0.2",
    "eclipse-zenoh>=1.10,<2",
    "xxhash>=3,<4",
];
const IMPORTS: &str = "import rosbags.typesys, zenoh_ros2_sdk, zenoh, xxhash";

/// The command that runs one of the scripts beside this file.
pub fn script(python: &Path, name: &str) -> Command {
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

/// An interpreter with the packages. When there is none, says past the capture of the tests' output that `what` is skipped.
pub fn python_or_skip(what: &str) -> Option<&'static Path> {
    static PYTHON: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    match PYTHON.get_or_init(python) {
        Ok(python) => Some(python),
        Err(why) => {
            skip(what, why);
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
