//! One log: samples in, files out, whatever the disk does.
//!
//! ```text
//! sample ─▶ rows gathered in memory ─▶ file ─▶ full: closed, the next is created
//!                    ▲                  │
//!                    └── pause, retry ◀─┴─ trouble: an error, or too little room on the disk
//! ```
//!
//! * Rows are handed over every [`FLUSH_PERIOD`], or earlier in blocks; what a file took is not written again.
//! * After an error the file is closed, and the rows that it did not take wait for the next one. New files are tried
//!   for ever, with the pauses of [`Backoff`].
//! * While the disk is nearly full nothing is written, and the file stays open.
//! * What no longer fits into memory meanwhile is lost and counted: each sample is in a file or in the counts.
//!
//! It knows no clock and no thread. All it does to files goes through a [`Store`], each call of which may block.

use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use ipc_types::payload::DspTelemetry;
use ipc_types::{MonotonicNs, RobotId};

use super::backoff::Backoff;
use super::file_name::Series;
use super::gathered::Gathered;
use super::open_file::OpenFile;
use super::retention::Retention;
use super::store::Store;
use super::tsv::Table;
use super::{Limits, LogEvent, Written};
use crate::config::LogConfig;
use crate::group::GroupSet;
use crate::tally::Tally;

/// How long a row may wait in memory. Half of the second that a kill may cost, so that a late wake-up stays within it.
pub const FLUSH_PERIOD: Duration = Duration::from_millis(500);

/// Gathered bytes that are handed over before their time: rows of all groups are about 400 bytes, so this is more than
/// a flush period's worth at 300 samples a second. Faster telemetry is written in more blocks.
pub const BLOCK_BYTES: usize = 64 * 1024;

/// How often losses are told while they go on.
pub const LOSS_REPORT_PERIOD: Duration = Duration::from_secs(60);

/// A log of one robot.
pub struct LogWriter<S: Store> {
    label: String,
    directory: PathBuf,
    groups: GroupSet,
    limits: Limits,
    table: Table,
    store: S,
    retention: Retention,
    gathered: Gathered,
    file: Option<OpenFile<S::File>>,
    trouble: Option<Trouble>,
    backoff: Backoff,
    written: Written,
    lost: Tally,
    /// Groups whose absence was told.
    missing: GroupSet,
    /// Drained by the caller after each call: at most a handful.
    events: Vec<LogEvent>,
}

/// Why nothing can be written at the moment.
struct Trouble {
    is_low_space: bool,
    next_try: MonotonicNs,
    /// Rows that had been lost when it began.
    lost_before: u64,
}

/// Why an attempt ended early.
enum Problem {
    /// The operating system refused something about this file or directory.
    Failed(PathBuf, io::Error),
    /// Too little room is left, bytes.
    LowSpace(u64),
}

impl<S: Store> LogWriter<S> {
    /// The log of `config`, with `limits` in the place of its own, of `robot` in `store`. Nothing is created before
    /// [`start`](Self::start).
    pub fn new(config: &LogConfig, limits: Limits, robot: RobotId, store: S) -> LogWriter<S> {
        LogWriter {
            label: super::label(config, robot),
            directory: config.directory.clone(),
            groups: config.groups,
            limits,
            table: Table::new(config.groups),
            store,
            retention: Retention::new(Series::new(robot, config.name.clone())),
            gathered: Gathered::default(),
            file: None,
            trouble: None,
            backoff: Backoff::default(),
            written: Written::default(),
            lost: Tally::every(LOSS_REPORT_PERIOD),
            missing: GroupSet::default(),
            events: Vec::new(),
        }
    }

    /// Mends the last file of the process before this one, and creates the first of its own.
    pub fn start(&mut self, now: MonotonicNs) {
        self.mend_newest();
        self.attempt(now);
    }

    /// Takes a sample.
    pub fn record(&mut self, sample: &DspTelemetry, now: MonotonicNs) {
        let missing = self.groups.without(GroupSet(sample.valid_groups));
        let untold = missing.without(self.missing);
        if !untold.is_empty() {
            self.missing = self.missing.union(untold);
            self.events.push(LogEvent::GroupsMissing {
                log: self.label.clone(),
                groups: untold,
            });
        }
        let table = &self.table;
        if !self.gathered.push(now, |text| table.row(sample, text)) {
            self.lost.add(1);
        }
        if self.trouble.is_none() && self.gathered.bytes() >= BLOCK_BYTES {
            self.attempt(now);
        }
    }

    /// When [`on_time`](Self::on_time) wants to be called next; nothing means not before the next sample.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let sync_at = self.file.as_ref().and_then(OpenFile::sync_at);
        [self.attempt_at(), sync_at, self.lost.deadline()]
            .into_iter()
            .flatten()
            .min()
    }

    /// Does what is due at `now`.
    pub fn on_time(&mut self, now: MonotonicNs) {
        if self.attempt_at().is_some_and(|at| at <= now) {
            self.attempt(now);
        }
        let sync_at = self.file.as_ref().and_then(OpenFile::sync_at);
        if sync_at.is_some_and(|at| at <= now) {
            self.sync(now);
        }
        if let Some(lost) = self.lost.due(now) {
            self.events.push(LogEvent::RowsLost {
                log: self.label.clone(),
                lost,
                lost_in_all: self.lost.total(),
            });
        }
    }

    /// Writes what waits, even if the last attempt was only just now, and closes the file; the last thing to do.
    pub fn finish(&mut self, now: MonotonicNs) -> Written {
        if !self.gathered.is_empty() {
            self.attempt(now);
        }
        if let Some(file) = self.file.take()
            && let Err(problem) = self.close(file)
        {
            self.fall(problem, now);
        }
        self.lost.add(self.gathered.clear());
        Written {
            lost: self.lost.total(),
            ..self.written
        }
    }

    /// What happened since the last call.
    pub fn take_events(&mut self) -> Vec<LogEvent> {
        std::mem::take(&mut self.events)
    }

    /// Cuts off the piece of a row that a kill or a power cut has left at the end of the newest file. Each start does so,
    /// so that older ones are in order. If it cannot be done, nothing is lost: a line without its end is no row.
    fn mend_newest(&mut self) {
        let newest = self.retention.newest(&mut self.store, &self.directory);
        if let Some(file) = newest
            && let Ok(bytes @ 1..) = self.store.mend(&file)
        {
            self.events.push(LogEvent::Mended { file, bytes });
        }
    }

    /// When rows are to be written, or writing is to be tried again.
    fn attempt_at(&self) -> Option<MonotonicNs> {
        match &self.trouble {
            Some(trouble) => Some(trouble.next_try),
            None => self.gathered.since().map(|since| since + FLUSH_PERIOD),
        }
    }

    /// Writes all that waits, and takes note of how that went.
    fn attempt(&mut self, now: MonotonicNs) {
        match self.write_out(now) {
            Ok(()) => {
                if let Some(trouble) = self.trouble.take() {
                    self.backoff.over(now);
                    self.events.push(LogEvent::Resumed {
                        log: self.label.clone(),
                        lost: self.lost.total() - trouble.lost_before,
                    });
                }
            }
            Err(problem) => self.fall(problem, now),
        }
    }

    /// Takes note that something failed at `now`, and tells it unless it is known.
    fn fall(&mut self, problem: Problem, now: MonotonicNs) {
        let is_low_space = matches!(problem, Problem::LowSpace(_));
        let next_try = now + self.backoff.failed(now);
        let known = self.trouble.as_ref();
        let is_known = known.is_some_and(|known| known.is_low_space == is_low_space);
        let lost_before = known.map_or(self.lost.total(), |known| known.lost_before);
        self.trouble = Some(Trouble {
            is_low_space,
            next_try,
            lost_before,
        });
        if !is_known {
            self.events.push(match problem {
                Problem::Failed(file, error) => LogEvent::Failed { file, error },
                Problem::LowSpace(free_bytes) => LogEvent::Paused {
                    log: self.label.clone(),
                    free_bytes,
                    min_free_bytes: self.limits.min_free_bytes,
                },
            });
        }
    }

    /// Writes all that waits, into as many files as it takes. There is a file afterwards, even if nothing waits.
    fn write_out(&mut self, now: MonotonicNs) -> Result<(), Problem> {
        if self.file.is_none() {
            let prepared = self.store.prepare(&self.directory);
            prepared.map_err(|error| self.in_directory(error))?;
        }
        self.check_free_space()?;
        loop {
            let mut file = match self.file.take() {
                Some(file) => file,
                None => self.create()?,
            };
            let mut rows = self.gathered.fitting(file.room(self.limits.max_file_bytes));
            if rows.is_empty() && file.is_empty() {
                // A limit that is too small for one row must not stop the log.
                rows = self.gathered.oldest();
            }
            if rows.is_empty() {
                if self.gathered.is_empty() {
                    self.file = Some(file);
                    return Ok(());
                }
                self.close(file)?;
                continue;
            }
            let (taken, result) = file.append(rows, now);
            self.written.rows += self.gathered.forget(taken);
            if let Err(error) = result {
                let problem = Problem::Failed(file.path().clone(), error);
                self.give_up(file);
                return Err(problem);
            }
            self.file = Some(file);
        }
    }

    /// Whether the disk has as much room as must be left. To go on after a pause takes an eighth more, so that other
    /// writers who come and go at the limit do not make the log do so too.
    fn check_free_space(&mut self) -> Result<(), Problem> {
        let floor = self.limits.min_free_bytes;
        let pausing = matches!(&self.trouble, Some(trouble) if trouble.is_low_space);
        let needed = if pausing {
            floor.saturating_add(floor / 8)
        } else {
            floor
        };
        if needed == 0 {
            return Ok(());
        }
        match self.store.free_bytes(&self.directory) {
            Ok(free) if free < needed => Err(Problem::LowSpace(free)),
            // If the system does not say, writing will show.
            Ok(_) | Err(_) => Ok(()),
        }
    }

    /// The next file, with its first line.
    fn create(&mut self) -> Result<OpenFile<S::File>, Problem> {
        let Limits {
            max_file_bytes,
            max_total_bytes,
            ..
        } = self.limits;
        let (retention, store) = (&mut self.retention, &mut self.store);
        let room = retention.make_room(store, &self.directory, max_file_bytes, max_total_bytes);
        for (file, bytes) in room.removed {
            self.events.push(LogEvent::Removed { file, bytes });
        }
        if let Some(error) = room.error {
            return Err(self.in_directory(error));
        }

        let stem = self.retention.series().stem(self.store.utc());
        let created = self.store.create(&self.directory, &stem);
        let (path, file) = created.map_err(|error| self.in_directory(error))?;
        let mut header = Vec::new();
        self.table.header(&mut header);
        match OpenFile::begin(path.clone(), file, &header) {
            Ok(file) => {
                self.retention.created(&path);
                self.written.files += 1;
                let groups = self.groups;
                self.events.push(LogEvent::Opened { file: path, groups });
                Ok(file)
            }
            Err(error) => {
                self.discard(&path);
                Err(Problem::Failed(path, error))
            }
        }
    }

    /// Forces rows onto the disk; a file of which that fails is of no more use.
    fn sync(&mut self, now: MonotonicNs) {
        let Some(mut file) = self.file.take() else {
            return;
        };
        match file.sync() {
            Ok(()) => self.file = Some(file),
            Err(error) => {
                self.written.unsure += file.unsure();
                self.fall(Problem::Failed(file.path().clone(), error), now);
            }
        }
    }

    /// Closes a file with all its rows on the disk.
    fn close(&mut self, mut file: OpenFile<S::File>) -> Result<(), Problem> {
        file.sync().map_err(|error| {
            self.written.unsure += file.unsure();
            Problem::Failed(file.path().clone(), error)
        })
    }

    /// Closes a file that did not take rows: what it has is kept, if there is something.
    fn give_up(&mut self, file: OpenFile<S::File>) {
        if file.is_empty() {
            self.written.files -= 1;
            let path = file.path().clone();
            drop(file);
            self.discard(&path);
            // A file that came and went within one attempt is nothing to tell.
            self.events
                .retain(|event| !matches!(event, LogEvent::Opened { file, .. } if *file == path));
        } else {
            // That something is wrong is known. What did not get onto the disk is counted.
            let _ = self.close(file);
        }
    }

    /// Removes a file without a row. A disk that does not even do that keeps an empty file, which counts like others
    /// when room is made.
    fn discard(&mut self, file: &Path) {
        let _ = self.store.remove(file);
    }

    fn in_directory(&self, error: io::Error) -> Problem {
        Problem::Failed(self.directory.clone(), error)
    }
}
