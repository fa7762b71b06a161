//! Logs of chosen groups of the telemetry, several at once, each on its own.
//!
//! A log that fails stops and says so once; it never disturbs another log or the telemetry. Nothing is created for a
//! log without groups, and no row is written before the first sample.
//!
//! Rows are handed to the operating system within a second, so that a kill of the process costs no more. They are not
//! forced onto the disk, which would make telemetry wait for it: a power cut may cost what the system had not written.

pub mod fields;
pub mod file_name;
pub mod store;
mod tsv;

use std::io;
use std::path::PathBuf;
use std::time::Duration;

use ipc_types::payload::DspTelemetry;
use ipc_types::{MonotonicNs, RobotId};

use crate::config::LogConfig;
use crate::group::GroupSet;
use file_name::Utc;
use store::Store;
use tsv::TsvLog;

/// How long a row may wait in memory. Half of the second that a kill may cost, so that a late wake-up stays within it.
pub const FLUSH_PERIOD: Duration = Duration::from_millis(500);

/// Something that the operator should know about a log. Each happens at most once for a log, missing groups once for
/// each group.
#[derive(Debug)]
pub enum LogEvent {
    /// The file was created.
    Opened {
        /// The file.
        file: PathBuf,
        /// What is logged.
        groups: GroupSet,
    },
    /// A sample came without groups that the log should have; their cells are empty.
    GroupsMissing {
        /// The file.
        file: PathBuf,
        /// The groups.
        groups: GroupSet,
    },
    /// The log has ended early.
    Failed {
        /// The file, or the directory if the file could not be created.
        file: PathBuf,
        /// Rows that the file holds.
        rows: u64,
        /// Why.
        error: io::Error,
    },
}

/// What became of a log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogSummary {
    /// The file.
    pub file: PathBuf,
    /// Rows in it.
    pub rows: u64,
    /// Whether it ended early.
    pub failed: bool,
}

/// All logs of the process.
#[derive(Default)]
pub struct Logs {
    logs: Vec<Log>,
    /// When the oldest row that is not yet in a file was recorded.
    pending_since: Option<MonotonicNs>,
}

/// One log.
struct Log {
    file: PathBuf,
    /// Groups whose absence was told.
    missing: GroupSet,
    state: LogState,
}

enum LogState {
    Open(Box<TsvLog>),
    Failed { rows: u64 },
}

impl Logs {
    /// Creates the files of all logs that have groups, named by robot and time.
    ///
    /// A log that cannot be created is reported and left out.
    pub fn open(
        configs: &[LogConfig],
        robot: RobotId,
        at: Utc,
        store: &mut dyn Store,
    ) -> (Logs, Vec<LogEvent>) {
        let mut logs = Logs::default();
        let mut events = Vec::new();
        for config in configs.iter().filter(|config| !config.groups.is_empty()) {
            let (log, event) = Log::open(config, robot, at, store);
            logs.logs.push(log);
            events.push(event);
        }
        (logs, events)
    }

    /// Adds a row to every log.
    pub fn record(&mut self, sample: &DspTelemetry, now: MonotonicNs) -> Vec<LogEvent> {
        let mut events = Vec::new();
        for log in &mut self.logs {
            events.extend(log.missing_groups(sample));
            events.extend(log.attempt(|rows| rows.record(sample)));
        }
        self.pending_since = self.pending_since.filter(|_| self.is_pending());
        if self.is_pending() {
            self.pending_since.get_or_insert(now);
        }
        events
    }

    /// When [`flush`](Self::flush) is due.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.pending_since.map(|since| since + FLUSH_PERIOD)
    }

    /// Writes what waits in memory, if it is due at `now`.
    pub fn flush_if_due(&mut self, now: MonotonicNs) -> Vec<LogEvent> {
        match self.deadline() {
            Some(deadline) if deadline <= now => self.flush(),
            _ => Vec::new(),
        }
    }

    /// Writes what waits in memory.
    pub fn flush(&mut self) -> Vec<LogEvent> {
        self.pending_since = None;
        let logs = self.logs.iter_mut();
        logs.filter_map(|log| log.attempt(|rows| rows.flush()))
            .collect()
    }

    /// What the files hold.
    pub fn summaries(&self) -> impl Iterator<Item = LogSummary> {
        self.logs.iter().map(|log| LogSummary {
            file: log.file.clone(),
            rows: log.rows(),
            failed: matches!(log.state, LogState::Failed { .. }),
        })
    }

    fn is_pending(&self) -> bool {
        self.logs
            .iter()
            .any(|log| matches!(&log.state, LogState::Open(rows) if rows.is_pending()))
    }
}

impl Log {
    fn open(config: &LogConfig, robot: RobotId, at: Utc, store: &mut dyn Store) -> (Log, LogEvent) {
        let groups = config.groups;
        let stem = file_name::stem(robot, at, config.name.as_str());
        // Until there is a file, the directory is what the operator must look at.
        let mut file = config.directory.clone();
        let opened = store
            .create(&config.directory, &stem)
            .and_then(|(path, sink)| {
                file = path;
                TsvLog::new(groups, sink)
            })
            .map(Box::new);
        let (state, event) = match opened {
            Ok(rows) => {
                let file = file.clone();
                (LogState::Open(rows), LogEvent::Opened { file, groups })
            }
            Err(error) => {
                let file = file.clone();
                let event = LogEvent::Failed {
                    file,
                    rows: 0,
                    error,
                };
                (LogState::Failed { rows: 0 }, event)
            }
        };
        let log = Log {
            file,
            missing: GroupSet::default(),
            state,
        };
        (log, event)
    }

    /// The groups that are missing from `sample` and were not told before.
    fn missing_groups(&mut self, sample: &DspTelemetry) -> Option<LogEvent> {
        let LogState::Open(rows) = &self.state else {
            return None;
        };
        let valid = GroupSet(sample.valid_groups);
        let groups = rows.groups().without(valid).without(self.missing);
        self.missing = self.missing.union(groups);
        (!groups.is_empty()).then(|| LogEvent::GroupsMissing {
            file: self.file.clone(),
            groups,
        })
    }

    /// Lets an open log `act`; closes it when that fails.
    fn attempt(&mut self, act: impl FnOnce(&mut TsvLog) -> io::Result<()>) -> Option<LogEvent> {
        let LogState::Open(rows) = &mut self.state else {
            return None;
        };
        let error = act(rows).err()?;
        let rows = rows.written();
        self.state = LogState::Failed { rows };
        Some(LogEvent::Failed {
            file: self.file.clone(),
            rows,
            error,
        })
    }

    fn rows(&self) -> u64 {
        match &self.state {
            LogState::Open(rows) => rows.written(),
            LogState::Failed { rows } => *rows,
        }
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::TelemetryGroup as Group;

    use super::*;
    use crate::test_samples::{MemoryStore, full_sample, sample};

    const START: MonotonicNs = MonotonicNs(1_000_000_000);

    fn config(name: &str, directory: &str, groups: &[Group]) -> LogConfig {
        LogConfig {
            name: name.parse().unwrap(),
            directory: directory.into(),
            groups: groups.iter().copied().collect(),
        }
    }

    fn open(configs: &[LogConfig]) -> (Logs, Vec<LogEvent>, MemoryStore) {
        let mut store = MemoryStore::default();
        let at = Utc::from_unix(1_156_797_566);
        let (logs, events) = Logs::open(configs, RobotId::DEFAULT, at, &mut store);
        (logs, events, store)
    }

    #[test]
    fn nothing_is_created_when_no_group_is_chosen() {
        let (mut logs, events, store) = open(&[config("", "log", &[])]);
        assert!(events.is_empty() && store.files.borrow().is_empty());
        assert!(logs.record(&full_sample(), START).is_empty());
        assert_eq!((logs.deadline(), logs.summaries().count()), (None, 0));
    }

    #[test]
    fn several_logs_have_their_own_files_and_fields() {
        let (mut logs, events, store) = open(&[
            config("", "log", &[Group::Time]),
            config("imu", "elsewhere", &[Group::Attitude, Group::AngularRate]),
        ]);
        let files = [
            "log/hero(1)_28_08_06-20_39_26.tsv",
            "elsewhere/hero(1)_28_08_06-20_39_26_imu.tsv",
        ];
        for (event, expected) in events.iter().zip(files) {
            assert!(
                matches!(event, LogEvent::Opened { file, .. } if file.to_str() == Some(expected))
            );
        }
        assert!(
            store.file(0).text().ends_with("dsp_time_ms\n"),
            "the first line alone"
        );
        for sequence in 1..=3 {
            assert!(logs.record(&sample(1, sequence), START).is_empty());
        }
        assert!(logs.flush().is_empty());
        let columns = |index| {
            let text = store.file(index).text();
            let columns = text.lines().map(|line| line.split('\t').count());
            columns.collect::<Vec<_>>()
        };
        assert_eq!((columns(0), columns(1)), (vec![4; 4], vec![9; 4]));
        let rows: Vec<_> = logs.summaries().map(|summary| summary.rows).collect();
        assert_eq!(rows, [3, 3]);
    }

    #[test]
    fn missing_groups_are_told_once_each() {
        let groups = [Group::Time, Group::Sonar, Group::Barometer];
        let (mut logs, _, _) = open(&[config("", "log", &groups)]);
        let mut told = |valid: GroupSet| {
            let mut sample = full_sample();
            sample.valid_groups = valid.0;
            let events = logs.record(&sample, START);
            let groups = events.iter().map(|event| match event {
                LogEvent::GroupsMissing { groups, .. } => groups.to_string(),
                other => panic!("{other:?}"),
            });
            groups.collect::<Vec<_>>()
        };
        let without = |groups: &[Group]| GroupSet::ALL.without(groups.iter().copied().collect());
        assert!(told(GroupSet::ALL).is_empty());
        // A group that the log does not have is nothing to tell.
        assert!(told(without(&[Group::Xy])).is_empty());
        assert_eq!(told(without(&[Group::Sonar])), ["sonar"]);
        assert!(told(without(&[Group::Sonar])).is_empty());
        let both = [Group::Sonar, Group::Barometer];
        assert_eq!(told(without(&both)), ["barometer"]);
        assert!(told(GroupSet::ALL).is_empty());
        assert!(told(without(&both)).is_empty());
    }

    #[test]
    fn rows_are_flushed_by_a_deadline_after_the_oldest() {
        let (mut logs, _, store) = open(&[config("", "log", &[Group::Time])]);
        assert_eq!(logs.deadline(), None, "nothing waits");
        let rows = || store.file(0).text().lines().count() - 1;
        logs.record(&sample(1, 1), START);
        let later = START + Duration::from_millis(400);
        logs.record(&sample(1, 2), later);
        let deadline = START + FLUSH_PERIOD;
        assert_eq!(logs.deadline(), Some(deadline));
        logs.flush_if_due(later);
        assert_eq!(rows(), 0);
        logs.flush_if_due(deadline);
        assert_eq!((rows(), logs.deadline()), (2, None));
        logs.record(&sample(1, 3), deadline);
        assert_eq!(logs.deadline(), Some(deadline + FLUSH_PERIOD));
    }

    #[test]
    fn a_failing_log_stops_alone_with_one_error() {
        let (mut logs, _, store) = open(&[
            config("a", "log", &[Group::Time]),
            config("b", "log", &[Group::Time]),
        ]);
        logs.record(&sample(1, 1), START);
        assert!(logs.flush().is_empty());
        store.file(0).fail();
        logs.record(&sample(1, 2), START);
        let events = logs.flush();
        assert!(
            matches!(&events[..], [LogEvent::Failed { file, rows: 1, error }]
                if file.ends_with("hero(1)_28_08_06-20_39_26_a.tsv")
                    && error.kind() == io::ErrorKind::StorageFull),
            "{events:?}"
        );
        // The disk has room again; the log stays closed, the other goes on.
        store.file(0).recover();
        assert!(logs.record(&sample(1, 3), START).is_empty());
        assert!(logs.flush().is_empty());
        assert_eq!(store.file(0).text().lines().count(), 2);
        assert_eq!(store.file(1).text().lines().count(), 4);
        let ends: Vec<_> = logs.summaries().map(|log| (log.rows, log.failed)).collect();
        assert_eq!(ends, [(1, true), (3, false)]);
    }

    #[test]
    fn a_log_that_cannot_be_created_is_told_and_left_out() {
        let (mut logs, events, store) = open(&[
            config("", "forbidden", &[Group::Time]),
            config("", "log", &[Group::Time]),
        ]);
        assert!(matches!(
            &events[..],
            [LogEvent::Failed { file, .. }, LogEvent::Opened { .. }] if file.to_str() == Some("forbidden")
        ));
        assert!(logs.record(&full_sample(), START).is_empty());
        logs.flush();
        assert_eq!(store.file(0).text().lines().count(), 2);
    }
}
