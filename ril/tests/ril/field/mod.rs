//! The field computer: no clock, nothing but RAM disks that may be written, and a card that is full.

mod card;
mod clock;
mod places;

use std::path::Path;
use std::process::Command;

use ril_tests::Sandbox;
use serde_json::Value;

use crate::common::json;

/// What `ril log check` says of a record.
#[track_caller]
fn check(rig: &Sandbox, record: &Path) -> Value {
    let finished = rig.finish(&format!("log check --json {}", record.display()));
    json(&finished.stdout[0])
}

/// The kinds of the events of a record.
fn kinds(checked: &Value) -> Vec<&str> {
    let events = checked["events"].as_array().expect("a list of events");
    events
        .iter()
        .filter_map(|event| event["kind"].as_str())
        .collect()
}

/// The files of this kind in a folder, in the order of their names.
fn files(folder: &Path, extension: &str) -> Vec<std::path::PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let mut files: Vec<_> = entries
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|found| found == extension))
        .collect();
    files.sort();
    files
}

/// The beginning of a command line that gives the program a mount namespace of its own; who is not root becomes root of
/// a user namespace for that. `None` when the kernel forbids it, which is said.
fn own_mounts(what: &str) -> Option<[&'static str; 2]> {
    let flags = match rustix::process::geteuid().is_root() {
        true => "-m",
        false => "-rm",
    };
    let words = ["unshare", flags];
    let script = "mount -t tmpfs tmpfs /mnt && mount -o remount,bind,ro /mnt";
    let tried = Command::new(words[0])
        .args([words[1], "sh", "-c", script])
        .output();
    match tried {
        Ok(output) if output.status.success() => Some(words),
        refused => {
            ril_tests::languages::skip(what, &format!("no mounts of its own: {refused:?}"));
            None
        }
    }
}
