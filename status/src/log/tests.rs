//! A log over a file system that fails as it is told to, in virtual time.

mod faults;
mod files;
mod floor;

use std::time::Duration;

use ipc_types::{MonotonicNs, RobotId, TelemetryGroup as Group};

use super::tsv::Table;
use super::{Limits, LogEvent, LogWriter, Written};
use crate::config::LogConfig;
use crate::group::GroupSet;
use crate::test_samples::sample;
use crate::test_store::MemoryStore;

const START: MonotonicNs = MonotonicNs(1_000_000_000);

/// Between two samples.
const SAMPLE_PERIOD: Duration = Duration::from_millis(20);

const UNLIMITED: Limits = Limits {
    max_file_bytes: 1 << 40,
    max_total_bytes: 1 << 42,
    min_free_bytes: 0,
};

fn config(name: &str, groups: &[Group]) -> LogConfig {
    LogConfig {
        name: name.parse().unwrap(),
        groups: groups.iter().copied().collect(),
        ..LogConfig::default()
    }
}

/// A log at work, with its disk and its time.
struct Flight {
    log: LogWriter<MemoryStore>,
    disk: MemoryStore,
    now: MonotonicNs,
    /// Samples so far.
    samples: u64,
    /// What was told, in words.
    told: Vec<String>,
}

impl Flight {
    /// A log of everything on `disk`.
    fn begin(disk: MemoryStore, limits: Limits) -> Flight {
        Flight::of(&Group::ALL, disk, limits)
    }

    /// A log with short rows on `disk`, for tests with many of them.
    fn short(disk: MemoryStore, limits: Limits) -> Flight {
        Flight::of(&[Group::Time], disk, limits)
    }

    fn of(groups: &[Group], disk: MemoryStore, limits: Limits) -> Flight {
        let config = config("", groups);
        let log = LogWriter::new(&config, limits, RobotId::DEFAULT, disk.clone());
        let mut flight = Flight {
            log,
            disk,
            now: START,
            samples: 0,
            told: Vec::new(),
        };
        flight.log.start(START);
        flight.hear();
        flight
    }

    /// Records `count` samples, each in its time.
    fn fly(&mut self, count: u64) {
        for _ in 0..count {
            self.wait(SAMPLE_PERIOD);
            self.samples += 1;
            self.log.record(&sample(1, self.samples), self.now);
            self.log.on_time(self.now);
            self.hear();
        }
    }

    /// Lets time pass, waking the log as often as it wishes.
    fn wait(&mut self, time: Duration) {
        let end = self.now + time;
        while let Some(deadline) = self.log.deadline().filter(|deadline| *deadline <= end) {
            assert!(self.told.len() < 10_000, "it never rests");
            self.now = self.now.max(deadline);
            self.log.on_time(self.now);
            let next = self.log.deadline();
            assert!(next.is_none_or(|next| next > self.now), "{next:?}");
            self.hear();
        }
        self.now = end;
    }

    /// Sets the wall clock forward.
    fn pass_seconds(&mut self, seconds: u64) {
        self.disk.0.borrow_mut().unix_s += seconds;
    }

    fn land(&mut self) -> Written {
        let written = self.log.finish(self.now);
        self.hear();
        assert_eq!(written.rows + written.lost, self.samples, "{written:?}");
        written
    }

    fn hear(&mut self) {
        let events = self.log.take_events();
        self.told.extend(events.iter().map(words));
    }

    /// What was told since the last call.
    fn told(&mut self) -> Vec<String> {
        std::mem::take(&mut self.told)
    }
}

fn words(event: &LogEvent) -> String {
    match event {
        LogEvent::Opened { .. } => "opened".to_owned(),
        LogEvent::Removed { .. } => "removed".to_owned(),
        LogEvent::Mended { bytes, .. } => format!("mended {bytes}"),
        LogEvent::GroupsMissing { groups, .. } => format!("missing {groups}"),
        LogEvent::Failed { error, .. } => match error.kind() {
            std::io::ErrorKind::StorageFull => "full".to_owned(),
            _ => "failed".to_owned(),
        },
        LogEvent::Paused { .. } => "paused".to_owned(),
        LogEvent::Resumed { lost, .. } => format!("resumed, {lost} lost"),
        LogEvent::RowsLost { .. } => "rows lost".to_owned(),
        LogEvent::QueueFull { .. } => "queue full".to_owned(),
    }
}

/// The first line of a log of `groups`.
fn header(groups: &[Group]) -> String {
    let mut text = Vec::new();
    Table::new(groups.iter().copied().collect()).header(&mut text);
    String::from_utf8(text).unwrap()
}

/// The numbers of the samples in `text`, which must be one first line and whole rows.
fn sequences(text: &str) -> Vec<u64> {
    assert!(text.ends_with('\n'), "half a row");
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
