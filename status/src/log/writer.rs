//! One log: samples in, files out, whatever the disk does.
//!
//! ```text
//! queue ─▶ batch ─▶ rows ─▶ file ─▶ full: closed, the next is created
//!   ▲                        │
//!   └── retry, no samples ◀──┴─ trouble: an error, or too little room on the disk
//! ```
//!
//! * A batch is written every [`FLUSH_PERIOD`], or earlier when it has [`BATCH_ROWS`].
//! * After an error the file is closed; its rows that the file did not take stay in the batch. A new file is tried
//!   every [`RETRY_PERIOD`], for ever. While the disk is nearly full nothing is written, and the file stays open.
//! * Meanwhile the writer takes no samples: they wait in the queue, which is the one bound and counts what it refuses.
//!
//! Rows of which the file took only a part are truncated, so that a file ends with a whole row even when the disk was
//! full in the middle of one.
//!
//! It knows no clock and no thread. All it does to files goes through a [`Store`], each call of which may block.

use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use ipc_types::payload::DspTelemetry;
use ipc_types::{MonotonicNs, RobotId};

use super::config::{LogConfig, LogLimits};
use super::event::{LogEvent, Written};
use super::file_name::Series;
use super::groups::LogGroups;
use super::retention::Retention;
use super::store::{LogFile, Store};
use super::tsv::{Table, count_rows, whole_rows};
use crate::group::GroupSet;

/// How long a row may wait in memory. Half of the second that a kill may cost, so that a late wake-up stays within it.
pub const FLUSH_PERIOD: Duration = Duration::from_millis(500);

/// Rows that are written at once at most: more than a flush period's worth up to 256 samples a second. Faster telemetry
/// is written more often. Even with the longest numbers they are less than the smallest `max_file_mib`.
pub const BATCH_ROWS: usize = 128;

/// Between two attempts to write after a failure. The queue holds four times as much, so that short trouble costs no
/// row; trouble that comes and goes is reported, and starts a file, no more often than this.
pub const RETRY_PERIOD: Duration = Duration::from_secs(5);

/// A log of one robot.
pub struct LogWriter<S: Store> {
    label: String,
    directory: PathBuf,
    groups: LogGroups,
    limits: LogLimits,
    table: Table,
    store: S,
    retention: Retention,
    batch: Batch,
    file: Option<OpenFile<S::File>>,
    trouble: Option<WriteTrouble>,
    written: Written,
    /// Groups whose absence was reported.
    missing: GroupSet,
    /// Drained by the caller after each call: at most a handful.
    events: Vec<LogEvent>,
}

/// Samples that no file has taken yet.
#[derive(Default)]
struct Batch {
    samples: Vec<DspTelemetry>,
    /// When the oldest of them came.
    since: Option<MonotonicNs>,
    /// The samples as rows; filled when they are written.
    rows: Vec<u8>,
}

/// Why nothing can be written at the moment.
struct WriteTrouble {
    is_low_space: bool,
    next_try: MonotonicNs,
}

/// What an attempt gives; the error is the event to report, unless it is known.
type Attempt<T> = Result<T, LogEvent>;

impl<S: Store> LogWriter<S> {
    /// The log of `config`, with `limits` in the place of its own, of `robot` in `store`. Nothing is created before
    /// [`start`](Self::start).
    pub fn new(config: &LogConfig, limits: LogLimits, robot: RobotId, store: S) -> LogWriter<S> {
        let series = Series::new(robot, config);
        LogWriter {
            label: series.label(&config.directory),
            directory: config.directory.clone(),
            groups: config.groups,
            limits,
            table: Table::new(config.groups).with_utc(config.utc),
            store,
            retention: Retention::new(series),
            batch: Batch::default(),
            file: None,
            trouble: None,
            written: Written::default(),
            missing: GroupSet::default(),
            events: Vec::new(),
        }
    }

    /// Truncates a partial row of the process before this one, and creates the first file.
    pub fn start(&mut self, now: MonotonicNs) {
        self.truncate_newest();
        self.attempt(now);
    }

    /// Whether the next sample may be taken out of the queue. Not while nothing can be written.
    pub fn takes_samples(&self) -> bool {
        self.trouble.is_none()
    }

    /// Takes a sample; must be called only while the writer [`takes_samples`](Self::takes_samples).
    pub fn record(&mut self, sample: &DspTelemetry, now: MonotonicNs) {
        let missing = self.groups.telemetry.without(GroupSet(sample.valid_groups));
        let unreported = missing.without(self.missing);
        if !unreported.is_empty() {
            self.missing = self.missing.union(unreported);
            self.events.push(LogEvent::GroupsMissing {
                log: self.label.clone(),
                groups: unreported,
            });
        }
        self.batch.samples.push(*sample);
        self.batch.since.get_or_insert(now);
        if self.batch.samples.len() >= BATCH_ROWS {
            self.attempt(now);
        }
    }

    /// When [`on_time`](Self::on_time) wants to be called next; nothing means not before the next sample.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        [self.attempt_at(), self.sync_at()]
            .into_iter()
            .flatten()
            .min()
    }

    /// Does what is due at `now`.
    pub fn on_time(&mut self, now: MonotonicNs) {
        if self.attempt_at().is_some_and(|at| at <= now) {
            self.attempt(now);
        }
        if self.sync_at().is_some_and(|at| at <= now) {
            self.sync(now);
        }
    }

    /// Writes the batch and the `waiting` samples, even if the last attempt failed only just now, and closes the file;
    /// the last thing to do. What cannot be written now is lost.
    pub fn finish(
        &mut self,
        waiting: impl Iterator<Item = DspTelemetry>,
        now: MonotonicNs,
    ) -> Written {
        let mut waiting = waiting.peekable();
        let has_samples = !self.batch.samples.is_empty() || waiting.peek().is_some();
        if self.trouble.is_some() && has_samples {
            self.attempt(now);
        }
        while self.trouble.is_none()
            && let Some(sample) = waiting.next()
        {
            self.record(&sample, now);
        }
        if self.trouble.is_none() && !self.batch.samples.is_empty() {
            self.attempt(now);
        }
        self.sync(now);
        self.file = None;
        self.written
    }

    /// What happened since the last call.
    pub fn take_events(&mut self) -> Vec<LogEvent> {
        std::mem::take(&mut self.events)
    }

    /// Truncates the partial row that a kill or a power cut has left at the end of the newest file. Each start does so,
    /// therefore older files are in order. A failure costs nothing: a line without its end is no row.
    fn truncate_newest(&mut self) {
        let newest = self.retention.newest(&mut self.store, &self.directory);
        if let Some(file) = newest
            && let Ok(bytes @ 1..) = self.store.truncate_partial_row(&file)
        {
            self.events
                .push(LogEvent::PartialRowTruncated { file, bytes });
        }
    }

    /// When the batch is to be written, or writing is to be retried.
    fn attempt_at(&self) -> Option<MonotonicNs> {
        match &self.trouble {
            Some(trouble) => Some(trouble.next_try),
            None => self.batch.since.map(|since| since + FLUSH_PERIOD),
        }
    }

    fn sync_at(&self) -> Option<MonotonicNs> {
        self.file.as_ref().and_then(OpenFile::sync_at)
    }

    /// Writes the batch, and takes note of how that went.
    fn attempt(&mut self, now: MonotonicNs) {
        match self.write_batch(now) {
            Ok(()) if self.trouble.take().is_some() => self.events.push(LogEvent::Resumed {
                log: self.label.clone(),
            }),
            Ok(()) => {}
            Err(problem) => self.fail(problem, now),
        }
    }

    /// Takes note of `problem` at `now`; reports it unless the same trouble is already known.
    fn fail(&mut self, problem: LogEvent, now: MonotonicNs) {
        let is_low_space = matches!(problem, LogEvent::Paused { .. });
        let known = self.trouble.replace(WriteTrouble {
            is_low_space,
            next_try: now + RETRY_PERIOD,
        });
        if known.is_none_or(|known| known.is_low_space != is_low_space) {
            self.events.push(problem);
        }
    }

    /// Writes the batch into the open file, or into the next one if there is none or it is full. There is a file
    /// afterwards, even if the batch is empty.
    fn write_batch(&mut self, now: MonotonicNs) -> Attempt<()> {
        if self.file.is_none() {
            let prepared = self.store.prepare(&self.directory);
            prepared.map_err(|error| self.in_directory(error))?;
        }
        self.check_free_space()?;
        let mut file = match self.file.take() {
            Some(file) => file,
            None => self.create()?,
        };
        self.batch.format(&self.table);
        let bytes = file.bytes() + self.batch.rows.len() as u64;
        // A limit that is too small for one batch must not stop the log.
        if bytes > self.limits.max_file_bytes && file.has_rows() {
            // A closed file has all its rows on the disk.
            self.sync_file(&mut file)?;
            file = self.create()?;
            // Each file has a clock of its own.
            self.batch.format(&self.table);
        }
        let (rows, result) = file.append(&self.batch.rows, now);
        self.written.rows += rows as u64;
        self.batch.forget(rows);
        match result {
            Ok(()) => {
                self.file = Some(file);
                Ok(())
            }
            Err(error) => {
                let problem = failed(file.path(), error);
                self.give_up(file);
                Err(problem)
            }
        }
    }

    /// Whether the disk has as much room as must be left.
    fn check_free_space(&mut self) -> Attempt<()> {
        let pausing = matches!(&self.trouble, Some(trouble) if trouble.is_low_space);
        let needed = self.limits.needed_bytes(pausing);
        if needed == 0 {
            return Ok(());
        }
        match self.store.free_bytes(&self.directory) {
            Ok(free_bytes) if free_bytes < needed => Err(LogEvent::Paused {
                log: self.label.clone(),
                free_bytes,
                min_free_bytes: self.limits.min_free_bytes,
            }),
            // If the system does not say, writing will show.
            Ok(_) | Err(_) => Ok(()),
        }
    }

    /// The next file, with its first line.
    fn create(&mut self) -> Attempt<OpenFile<S::File>> {
        let LogLimits {
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

        let clock = self.store.clock();
        self.table.set_clock(clock);
        let series = self.retention.series();
        let (stem, kind) = (series.stem(clock.utc()), series.kind());
        let created = self.store.create(&self.directory, &stem, kind);
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
                Err(failed(&path, error))
            }
        }
    }

    /// Forces rows onto the disk; a file of which that fails is of no more use.
    fn sync(&mut self, now: MonotonicNs) {
        if let Some(mut file) = self.file.take() {
            match self.sync_file(&mut file) {
                Ok(()) => self.file = Some(file),
                Err(problem) => self.fail(problem, now),
            }
        }
    }

    fn sync_file(&mut self, file: &mut OpenFile<S::File>) -> Attempt<()> {
        file.sync().map_err(|error| {
            self.written.unsynced += file.unsynced();
            failed(file.path(), error)
        })
    }

    /// Closes a file that did not take rows; removes it if it has none.
    fn give_up(&mut self, mut file: OpenFile<S::File>) {
        if file.has_rows() {
            // The problem is known already. Rows that did not get onto the disk are counted.
            let _ = self.sync_file(&mut file);
            return;
        }
        self.written.files -= 1;
        let path = file.path().to_owned();
        drop(file);
        self.discard(&path);
        // A file that came and went within one attempt is nothing to report.
        self.events
            .retain(|event| !matches!(event, LogEvent::Opened { file, .. } if *file == path));
    }

    /// Removes a file without a row. A disk that refuses even that keeps an empty file, which counts like others when
    /// room is made.
    fn discard(&mut self, file: &Path) {
        let _ = self.store.remove(file);
    }

    fn in_directory(&self, error: io::Error) -> LogEvent {
        failed(&self.directory, error)
    }
}

/// The event that something about `file` failed.
fn failed(file: &Path, error: io::Error) -> LogEvent {
    LogEvent::Failed {
        file: file.to_owned(),
        error,
    }
}

impl Batch {
    fn format(&mut self, table: &Table) {
        self.rows.clear();
        for sample in &self.samples {
            table.row(sample, &mut self.rows);
        }
    }

    /// Forgets the oldest `rows`. The others do not count as younger than before: they would only wait longer.
    fn forget(&mut self, rows: usize) {
        self.samples.drain(..rows);
        if self.samples.is_empty() {
            self.since = None;
        }
    }
}

/// How long rows may be known to the operating system alone. A power cut costs no more than this and what
/// [`FLUSH_PERIOD`] allows. Common file systems write their journals as often by
/// themselves, so that it wears a memory card hardly more than no forcing at all.
pub const SYNC_PERIOD: Duration = Duration::from_secs(5);

/// A file that takes rows.
struct OpenFile<F> {
    path: PathBuf,
    file: F,
    /// Its length.
    bytes: u64,
    has_rows: bool,
    /// Rows that were not yet forced onto the disk.
    unsynced: u64,
    /// When those are to be forced onto the disk.
    sync_at: Option<MonotonicNs>,
}

impl<F: LogFile> OpenFile<F> {
    /// The new and empty `file` at `path` with its first line.
    ///
    /// # Errors
    /// The line was not taken, or a part of it; the file is of no use.
    fn begin(path: PathBuf, mut file: F, header: &[u8]) -> io::Result<OpenFile<F>> {
        write_counted(&mut file, header).1?;
        Ok(OpenFile {
            path,
            file,
            bytes: header.len() as u64,
            has_rows: false,
            unsynced: 0,
            sync_at: None,
        })
    }

    /// Where it is.
    fn path(&self) -> &Path {
        &self.path
    }

    /// Its length, bytes.
    fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Whether it has rows besides the first line.
    fn has_rows(&self) -> bool {
        self.has_rows
    }

    /// Rows that may not be on the disk yet.
    fn unsynced(&self) -> u64 {
        self.unsynced
    }

    /// Appends `rows` at `now`; gives how many of them the file took whole. After an error it must not be used for more
    /// than [`sync`](Self::sync).
    fn append(&mut self, rows: &[u8], now: MonotonicNs) -> (usize, io::Result<()>) {
        let (taken, result) = write_counted(&mut self.file, rows);
        let whole = whole_rows(&rows[..taken]);
        let count = count_rows(&rows[..whole]);
        self.bytes += whole as u64;
        self.unsynced += count as u64;
        if whole < taken {
            // A full disk can still truncate. If this fails the disk is broken, which `result` says already.
            let _ = self.file.truncate(self.bytes);
        }
        if count > 0 {
            self.has_rows = true;
            self.sync_at.get_or_insert(now + SYNC_PERIOD);
        }
        (count, result)
    }

    /// When [`sync`](Self::sync) is due.
    fn sync_at(&self) -> Option<MonotonicNs> {
        self.sync_at
    }

    /// Forces the rows onto the disk.
    ///
    /// # Errors
    /// Those that are [`unsynced`](Self::unsynced) may be lost. A retry would not help: the system forgets what it
    /// could not write.
    fn sync(&mut self) -> io::Result<()> {
        if self.unsynced > 0 {
            self.file.sync()?;
        }
        self.unsynced = 0;
        self.sync_at = None;
        Ok(())
    }
}

/// Writes `bytes`; gives how many of them were taken.
fn write_counted(file: &mut impl LogFile, bytes: &[u8]) -> (usize, io::Result<()>) {
    let mut taken = 0;
    while taken < bytes.len() {
        match file.write(&bytes[taken..]) {
            Ok(0) => return (taken, Err(io::ErrorKind::WriteZero.into())),
            Ok(count) => taken += count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return (taken, Err(error)),
        }
    }
    (taken, Ok(()))
}
