//! How a package is built, and what it brings beside the binary: completion in real shells, the manual, units and
//! configuration.
//!
//! Whether the package can be installed, flown with and purged is checked by `package/check`, which needs root.

mod build;
mod completion;
mod manual;
mod units;
mod upgrade;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A path of the repository.
fn repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

/// Says that something is not tested, past the test harness, which would hide it.
fn skipped(why: &str) {
    let _ = writeln!(std::io::stderr(), "SKIPPED: {why}");
}

/// Whether this machine has a program; when not, that is said, because something is then not tested.
fn has(program: &str, not_tested: &str) -> bool {
    let found = Command::new(program)
        .arg("--version")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    if found.is_err() {
        skipped(&format!("this machine has no {program}: {not_tested}"));
    }
    found.is_ok()
}
