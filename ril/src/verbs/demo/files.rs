//! What a flight leaves in its folder: its log and its record, as far as they are evidence; and the judgement with it.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use ipc_types::{RobotId, Topic};
use recording::topic_of;
use runtime::finding::Finding;
use serde::Deserialize;
use status::log::file_name::{FileKind, recognize};

use super::checks::{Evidence, RecordEvidence, judge};
use super::script::SCRIPT;
use super::seen::Flown;

/// The files of a flight; `None` where there is none.
pub(super) struct FlightFiles {
    /// The newest log in its folder.
    pub log: Option<PathBuf>,
    /// The newest record there.
    pub record: Option<PathBuf>,
}

impl FlightFiles {
    /// Looks for them.
    pub fn find(folder: &Path) -> FlightFiles {
        FlightFiles {
            log: newest(folder, FileKind::Tsv),
            record: newest(folder, FileKind::Mcap),
        }
    }
}

fn newest(folder: &Path, kind: FileKind) -> Option<PathBuf> {
    fs::read_dir(folder)
        .ok()?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| {
            let name = path.file_name().and_then(|name| recognize(name.to_str()?));
            name.is_some_and(|(series, _)| series.kind() == kind)
        })
        .max_by_key(|path| {
            fs::metadata(path)
                .and_then(|metadata| metadata.modified())
                .ok()
        })
}

/// Judges a flight of `robot` with its files. So many processes were started, and so many files and segments are left
/// in shared memory.
pub(super) fn judge_flight(
    flown: &Flown,
    robot: RobotId,
    files: &FlightFiles,
    processes: usize,
    residue: usize,
) -> Vec<Finding> {
    judge(&Evidence {
        orders: SCRIPT.len(),
        orders_done: flown.orders_done,
        order_failed: flown.order_failed.as_deref(),
        seen: &flown.seen,
        log_rows: files.log.as_deref().and_then(rows),
        record: files
            .record
            .as_deref()
            .and_then(|file| recorded(file, robot)),
        exits: &flown.exits,
        processes,
        residue,
    })
}

/// Rows of a log without its first line.
fn rows(log: &Path) -> Option<u64> {
    let text = fs::read_to_string(log).ok()?;
    u64::try_from(text.lines().count()).ok()?.checked_sub(1)
}

/// What the demonstration needs of `ril log check --json`.
#[derive(Deserialize)]
struct LogCheck {
    complete: bool,
    unexplained: u64,
    topics: BTreeMap<String, RecordedTopic>,
    events: Vec<RecordingEvent>,
}

#[derive(Deserialize)]
struct RecordedTopic {
    messages: u64,
}

#[derive(Deserialize)]
struct RecordingEvent {
    kind: String,
    topic: String,
    count: u64,
}

/// What `ril log check` says of the flight record of the robot.
fn recorded(file: &Path, robot: RobotId) -> Option<RecordEvidence> {
    let mut command = Command::new(std::env::current_exe().ok()?);
    command.args(["log", "check", "--json"]).arg(file);
    let output = command.output().ok()?.stdout;
    // A failure is an object of its own behind it.
    let mut objects = serde_json::Deserializer::from_slice(&output).into_iter();
    let check: LogCheck = objects.next()?.ok()?;
    let keys = [DspTelemetry::KEY, HeroTelemetry::KEY, ModuleState::KEY];
    let topics = keys.map(|key| topic_of(robot, key));
    let events = check.events.iter().filter(|event| {
        ["gap", "loss", "late"].contains(&event.kind.as_str()) && topics.contains(&event.topic)
    });
    let messages = |topic: &String| check.topics.get(topic).map_or(0, |topic| topic.messages);
    Some(RecordEvidence {
        is_in_order: check.complete && check.unexplained == 0,
        messages: topics.each_ref().map(messages),
        reported_missing: events.map(|event| event.count).sum(),
    })
}
