//! [`Reporter`]: what `ril record` prints: each file when it is complete, and what went wrong with the disk.

use std::time::Duration;

use ipc_types::{MonotonicNs, RobotId};
use operator::render::json_line;
use operator::render::words::{count, shell_word};
use recording::{DiskError, DiskErrorKind, Totals};
use runtime::output::standard_output;
use serde::Serialize;
use status::rate_limited::RateLimitedCounter;

use super::disk::{ClosedFile, Note};
use super::topics::TopicCounts;

/// How often lost messages are reported while they go on.
const LOSS_REPORT_PERIOD: Duration = Duration::from_secs(60);

/// A file that is complete, for programs.
#[derive(Serialize)]
struct FileObject {
    schema: &'static str,
    robot: u32,
    file: String,
    /// Whether it has its end and its summary.
    whole: bool,
    messages: u64,
    size_bytes: u64,
}

/// A recording that has ended, for programs.
#[derive(Serialize)]
struct EndObject {
    schema: &'static str,
    robot: u32,
    files: u32,
    /// Messages that the disk has.
    messages: u64,
    /// Messages that the disk did not take.
    dropped: u64,
    /// Samples that did not come to the recorder.
    lost: u64,
    topics: Vec<TopicObject>,
}

#[derive(Serialize)]
struct TopicObject {
    topic: String,
    received: u64,
    lost: u64,
    publisher_restarts: u64,
}

/// Prints each file when it is complete, and what went wrong with the disk.
pub(crate) struct Reporter {
    robot: RobotId,
    is_json: bool,
    dropped: RateLimitedCounter,
    /// What is wrong with the disk; reported once until it is over.
    trouble: Option<DiskErrorKind>,
}

impl Reporter {
    /// Prints about `robot`, as objects if it `is_json`.
    pub fn new(robot: RobotId, is_json: bool) -> Reporter {
        Reporter {
            robot,
            is_json,
            dropped: RateLimitedCounter::every(LOSS_REPORT_PERIOD),
            trouble: None,
        }
    }

    /// What the disk's thread did.
    pub fn notes(&mut self, notes: Vec<Note>) {
        for note in notes {
            match note {
                Note::Opened(file) => tracing::info!(file = %file.display(), "recording"),
                Note::Removed { file, bytes } => {
                    tracing::info!(file = %file.display(), bytes, "old recording removed to make room (--max-total)");
                }
                Note::NothingCame(file) => {
                    tracing::info!(file = %file.display(), "nothing came: the file was removed");
                }
                Note::Closed(file) => self.closed(&file),
            }
        }
    }

    fn closed(&self, file: &ClosedFile) {
        let name = file.path.display().to_string();
        if self.is_json {
            print(&FileObject {
                schema: "ril.RecordedFile.v1",
                robot: self.robot.get(),
                file: name,
                whole: file.is_whole,
                messages: file.messages,
                size_bytes: file.bytes,
            });
        } else {
            let size = file.bytes as f64 / 1e6;
            let messages = count(file.messages, "message");
            let how = match file.is_whole {
                true => String::new(),
                false => format!(
                    ", cut off; `ril log recover {}` makes a whole file",
                    shell_word(&name)
                ),
            };
            standard_output().put(format!("{name}: {messages}, {size:.1} MB{how}\n"));
        }
    }

    /// The disk did not take something.
    pub fn trouble(&mut self, error: &DiskError) {
        if self.trouble.replace(error.kind) == Some(error.kind) {
            return;
        }
        match error.kind {
            DiskErrorKind::LowSpace => tracing::warn!(
                %error,
                "the disk is nearly full: the recording pauses, and goes on when there is room"
            ),
            DiskErrorKind::Failed => tracing::warn!(
                %error,
                "the recording cannot be written: make room or give permission; it tries again"
            ),
        }
    }

    /// The disk took something.
    pub fn works(&mut self) {
        if self.trouble.take().is_some() {
            tracing::info!("the recording is written again");
        }
    }

    /// The recorder has dropped so many messages since its start.
    pub fn dropped(&mut self, total: u64, now: MonotonicNs) {
        self.dropped.set(total);
        if let Some(lost) = self.dropped.due(now) {
            tracing::warn!(
                lost,
                total,
                "messages are lost: the disk is slow, or cannot be written"
            );
        }
    }

    /// When [`dropped`](Reporter::dropped) has something to report.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.dropped.deadline()
    }

    /// The end of the recording.
    pub fn end(&self, totals: &Totals, counts: impl Iterator<Item = TopicCounts>) {
        let topics: Vec<TopicObject> = counts
            .map(|TopicCounts { topic, losses }| TopicObject {
                topic,
                received: losses.received,
                lost: losses.lost,
                publisher_restarts: losses.publisher_restarts,
            })
            .collect();
        let lost = (topics.iter().map(|topic| topic.lost)).fold(0, u64::saturating_add);
        let end = EndObject {
            schema: "ril.Record.v1",
            robot: self.robot.get(),
            files: totals.files,
            messages: totals.written,
            dropped: totals.dropped,
            lost,
            topics,
        };
        if self.is_json {
            print(&end);
        }
        tracing::info!(
            files = end.files,
            messages = end.messages,
            dropped = end.dropped,
            lost = end.lost,
            topics = end.topics.len(),
            "ended"
        );
    }
}

/// Prints an object on a line. Standard output may be closed or not read: the flight is recorded nevertheless.
fn print(object: &impl Serialize) {
    let _ = json_line(&mut standard_output(), object);
}
