//! A log behind its queue, over a file system that fails as a test asks for, in virtual time.

mod faults;
mod files;

use std::time::Duration;

use ipc_types::{MonotonicNs, RobotId, TelemetryGroup as Group};

use super::Logs;
use super::config::{LogConfig, LogLimits};
use super::event::{LogEvent, LogSummary, WriterEnd, Written};
use super::queue::QueueReader;
use super::tsv::Table;
use super::writer::LogWriter;
use crate::group::GroupSet;
use crate::test_samples::sample;
use crate::test_store::MemoryStore;

const START: MonotonicNs = MonotonicNs(1_000_000_000);

/// Between two samples.
const SAMPLE_PERIOD: Duration = Duration::from_millis(20);

const UNLIMITED: LogLimits = LogLimits {
    max_file_bytes: 1 << 40,
    max_total_bytes: 1 << 42,
    min_free_bytes: 0,
};

fn config(name: &str, groups: &[Group]) -> LogConfig {
    LogConfig {
        name: name.parse().unwrap(),
        groups: GroupSet::from_iter(groups.iter().copied()).into(),
        ..LogConfig::default()
    }
}

/// A log at work behind its queue, with its disk and its time.
struct Harness {
    logs: Logs,
    reader: QueueReader,
    log: LogWriter<MemoryStore>,
    disk: MemoryStore,
    now: MonotonicNs,
    /// Samples so far.
    samples: u64,
    /// What was reported, in words.
    reported: Vec<String>,
}

impl Harness {
    /// A log of everything on `disk`.
    fn begin(disk: MemoryStore, limits: LogLimits) -> Harness {
        Harness::of(&Group::ALL, disk, limits)
    }

    /// A log with short rows on `disk`, for tests with many of them.
    fn short(disk: MemoryStore, limits: LogLimits) -> Harness {
        Harness::of(&[Group::Time], disk, limits)
    }

    fn of(groups: &[Group], disk: MemoryStore, limits: LogLimits) -> Harness {
        Harness::with(&config("", groups), disk, limits)
    }

    fn with(config: &LogConfig, disk: MemoryStore, limits: LogLimits) -> Harness {
        let mut logs = Logs::default();
        let reader = logs.add("log".to_owned());
        let log = LogWriter::new(config, limits, RobotId::DEFAULT, disk.clone());
        disk.0.borrow_mut().monotonic = START;
        let mut harness = Harness {
            logs,
            reader,
            log,
            disk,
            now: START,
            samples: 0,
            reported: Vec::new(),
        };
        harness.log.start(START);
        harness.take_reports();
        harness
    }

    /// Records `count` samples, each in its time.
    fn record(&mut self, count: u64) {
        for _ in 0..count {
            self.wait(SAMPLE_PERIOD);
            self.samples += 1;
            let mut sample = sample(1, self.samples);
            sample.received_ns = self.now.0;
            self.logs.record(&sample);
            self.work();
        }
    }

    /// Lets time pass, waking the log as often as it wishes.
    fn wait(&mut self, time: Duration) {
        let end = self.now + time;
        while let Some(deadline) = self.log.deadline().filter(|deadline| *deadline <= end) {
            assert!(self.reported.len() < 10_000, "it never rests");
            self.set_now(self.now.max(deadline));
            self.work();
            let next = self.log.deadline();
            assert!(next.is_none_or(|next| next > self.now), "{next:?}");
        }
        self.set_now(end);
    }

    fn set_now(&mut self, now: MonotonicNs) {
        self.now = now;
        self.disk.0.borrow_mut().monotonic = now;
    }

    /// What both threads do at this moment.
    fn work(&mut self) {
        self.log.on_time(self.now);
        while self.log.takes_samples()
            && let Ok(sample) = self.reader.wait(true, Some(Duration::ZERO))
        {
            self.log.record(&sample, self.now);
        }
        self.take_reports();
    }

    /// Sets the wall clock forward.
    fn pass_seconds(&mut self, seconds: u64) {
        self.disk.0.borrow_mut().unix_s += seconds;
    }

    /// Ends the log. Every sample is a row in a file, or lost.
    fn finish(&mut self) -> Outcome {
        self.logs.close();
        let written = self.log.finish(self.reader.waiting(), self.now);
        self.take_reports();
        let summary = LogSummary {
            end: WriterEnd::Finished(written),
            ..self.logs.summaries().next().unwrap()
        };
        assert_eq!(summary.offered, self.samples);
        Outcome {
            written,
            lost: summary.lost(),
        }
    }

    fn take_reports(&mut self) {
        let mut events = self.log.take_events();
        events.extend(self.logs.on_time(self.now));
        self.reported.extend(events.iter().map(words));
    }

    /// What was reported since the last call.
    fn reported(&mut self) -> Vec<String> {
        std::mem::take(&mut self.reported)
    }
}

/// What became of a log.
#[derive(Debug, PartialEq)]
struct Outcome {
    written: Written,
    lost: u64,
}

fn words(event: &LogEvent) -> String {
    match event {
        LogEvent::Opened { .. } => "opened".to_owned(),
        LogEvent::Removed { .. } => "removed".to_owned(),
        LogEvent::PartialRowTruncated { bytes, .. } => format!("truncated {bytes}"),
        LogEvent::GroupsMissing { groups, .. } => format!("missing {groups}"),
        LogEvent::Failed { error, .. } => match error.kind() {
            std::io::ErrorKind::StorageFull => "full".to_owned(),
            _ => "failed".to_owned(),
        },
        LogEvent::Paused { .. } => "paused".to_owned(),
        LogEvent::Resumed { .. } => "resumed".to_owned(),
        LogEvent::RowsLost { .. } => "rows lost".to_owned(),
        LogEvent::ThreadFailed { .. } => "thread failed".to_owned(),
    }
}

/// The first line of a log of `groups`.
fn header(groups: &[Group]) -> String {
    let mut text = Vec::new();
    Table::new(GroupSet::from_iter(groups.iter().copied())).header(&mut text);
    String::from_utf8(text).unwrap()
}

/// The numbers of the samples in `text`, which must be one first line and whole rows.
fn sequences(text: &str) -> Vec<u64> {
    assert!(text.ends_with('\n'), "a partial row");
    let mut lines = text.lines();
    let names: Vec<_> = lines.next().unwrap().split('\t').collect();
    assert_eq!(names[..3], ["flying", "sequence", "received_ns"]);
    lines
        .map(|row| {
            let cells: Vec<_> = row.split('\t').collect();
            assert_eq!(cells.len(), names.len(), "{row:?}");
            cells[1].parse().unwrap()
        })
        .collect()
}

/// The numbers of the samples in all files together, in the order in which the files were created.
fn all_sequences(disk: &MemoryStore) -> Vec<u64> {
    let texts = disk.0.borrow().texts();
    texts.iter().flat_map(|text| sequences(text)).collect()
}

/// First and last of each run of numbers of which none is missing, none is there twice and none is in a wrong place.
fn runs(sequences: &[u64]) -> Vec<(u64, u64)> {
    let runs = sequences.chunk_by(|last, next| *next == last + 1);
    runs.map(|run| (run[0], run[run.len() - 1])).collect()
}
