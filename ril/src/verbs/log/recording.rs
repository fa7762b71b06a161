//! The formats of log files, and what all of them can do: [`LogFormat`] is the one place to add another. The rows of
//! status are read by the crate `status`, the records of `ril record` here.

use std::collections::VecDeque;
use std::io::{self, BufRead};
use std::path::Path;

use ipc_types::MonotonicNs;
use ipc_types::payload::{DspTelemetry, SharedStruct};
use ipc_types::schema::CDR_HEADER;
use recording::read::{self, Messages, RecordFile, RecordSource, RecordedMessage};
use status::log::clock::ClockAnchor;
use status::log::groups::LogGroups;
pub use status::log::read::{Damage, LogEntry, LogReadError, Row};
use status::log::read::{DamageReason, LogReader};
use status::log::tsv::Table;

/// A log file that is read entry by entry.
pub trait Recording {
    /// Reads what stands before the first row, and says whether it is there.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or is none of this format.
    fn begin(&mut self) -> Result<bool, LogReadError>;

    /// The names of the columns; empty before [`Recording::begin`].
    fn columns(&self) -> &[String];

    /// The next row, or what is damaged in its place; `None` if there is no more (yet).
    ///
    /// # Errors
    ///
    /// As [`Recording::begin`].
    fn next(&mut self) -> Result<Option<LogEntry<'_>>, LogReadError>;

    /// Looks for what was written since the last look, where [`Recording::next`] does not see it by itself.
    ///
    /// # Errors
    ///
    /// As [`Recording::begin`].
    fn refresh(&mut self) -> Result<(), LogReadError> {
        Ok(())
    }

    /// Bytes at the end of the file that are no whole row (yet).
    fn unfinished_bytes(&self) -> usize;
}

impl<R: BufRead> Recording for LogReader<R> {
    fn begin(&mut self) -> Result<bool, LogReadError> {
        LogReader::begin(self)
    }

    fn columns(&self) -> &[String] {
        LogReader::columns(self)
    }

    fn next(&mut self) -> Result<Option<LogEntry<'_>>, LogReadError> {
        LogReader::next(self)
    }

    fn unfinished_bytes(&self) -> usize {
        LogReader::unfinished_bytes(self)
    }
}

/// A format of log files: the one place to add another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogFormat {
    /// The tab-separated values that status writes.
    Tsv,
    /// The flight records of `ril record`.
    Mcap,
}

/// How an MCAP file begins.
const MCAP: &[u8] = b"\x89MCAP";

impl LogFormat {
    /// The format of the file at `path` that begins with `beginning`. A record whose beginning is damaged is one by its
    /// name.
    pub fn of(path: &Path, beginning: &[u8]) -> LogFormat {
        let is_named = || {
            path.extension()
                .is_some_and(|extension| extension == "mcap")
        };
        match beginning.starts_with(MCAP) || (!beginning.is_empty() && is_named()) {
            true => LogFormat::Mcap,
            // The first line says more; an empty file may be a log to which nothing was written yet.
            false => LogFormat::Tsv,
        }
    }
}

/// End of the name of the topic with the raw telemetry; the robot's number stands before it.
const TOPIC: &str = "/dsp/telemetry";

/// Reads the telemetry of a flight record (MCAP) row by row.
pub struct McapReader {
    messages: Messages<'static>,
    table: Table,
    columns: Vec<String>,
    /// Rows that were read ahead, and what is damaged among them.
    ahead: VecDeque<ReadItem>,
    entries: u64,
    unfinished_bytes: usize,
    /// The row that was given last, and its sample.
    line: String,
    sample: Box<DspTelemetry>,
}

/// What was found in the file, in its order.
enum ReadItem {
    /// A sample, and its time in UTC.
    Sample(u64, Box<DspTelemetry>),
    /// Something that cannot be read.
    Damaged(String),
}

impl McapReader {
    /// A reader of the file at `path` whose rows have the columns of these groups, and whole samples. No message is
    /// read yet.
    ///
    /// # Errors
    ///
    /// It cannot be read.
    pub fn open(path: &Path, groups: LogGroups) -> io::Result<McapReader> {
        let table = Table::new(groups).with_utc(true);
        let mut names = Vec::new();
        table.header(&mut names);
        let names = String::from_utf8_lossy(&names);
        let columns = names.trim_end().split('\t').map(str::to_owned).collect();
        Ok(McapReader {
            messages: read::messages(RecordSource::File(RecordFile::open(path)?)),
            table,
            columns,
            ahead: VecDeque::new(),
            entries: 0,
            unfinished_bytes: 0,
            line: String::new(),
            sample: Box::default(),
        })
    }

    /// Keeps only the last `rows` rows, and what is damaged among them.
    ///
    /// # Errors
    ///
    /// As [`Recording::begin`].
    pub fn last(mut self, rows: usize) -> Result<McapReader, LogReadError> {
        let (mut ahead, mut samples) = (VecDeque::new(), 0);
        while let Some(found) = self.found()? {
            samples += usize::from(matches!(found, ReadItem::Sample(..)));
            ahead.push_back(found);
            while samples > rows {
                let gone = ahead.pop_front();
                samples -= usize::from(matches!(gone, Some(ReadItem::Sample(..))));
            }
        }
        self.ahead = ahead;
        Ok(self)
    }

    /// The next sample, or what is damaged in its place; `None` at the end.
    fn found(&mut self) -> Result<Option<ReadItem>, LogReadError> {
        if let Some(found) = self.ahead.pop_front() {
            return Ok(Some(found));
        }
        for message in self.messages.by_ref() {
            match message {
                Ok(message) => {
                    if let Some(sample) = sample(&message) {
                        return Ok(Some(ReadItem::Sample(
                            message.publish_time_ns,
                            Box::new(sample),
                        )));
                    }
                }
                Err(read::ReadError::NotMcap) => {
                    return Err(LogReadError::NoLog(read::ReadError::NotMcap.to_string()));
                }
                // What follows is counted at the end.
                Err(read::ReadError::Truncated { .. }) => {}
                Err(error) => return Ok(Some(ReadItem::Damaged(error.to_string()))),
            }
        }
        let behind = self.messages.bytes_behind();
        self.unfinished_bytes = usize::try_from(behind).unwrap_or(usize::MAX);
        Ok(None)
    }
}

/// The sample; `None` if the message is another one.
fn sample(message: &RecordedMessage) -> Option<DspTelemetry> {
    let is_sample = message.topic().ends_with(TOPIC);
    DspTelemetry::from_bytes(message.data().get(CDR_HEADER.len()..)?).filter(|_| is_sample)
}

impl Recording for McapReader {
    fn begin(&mut self) -> Result<bool, LogReadError> {
        if self.entries == 0 && self.ahead.is_empty() {
            let first = self.found()?;
            self.ahead.extend(first);
        }
        Ok(true)
    }

    fn columns(&self) -> &[String] {
        &self.columns
    }

    fn next(&mut self) -> Result<Option<LogEntry<'_>>, LogReadError> {
        let Some(found) = self.found()? else {
            return Ok(None);
        };
        self.entries += 1;
        let (unix_ns, sample) = match found {
            ReadItem::Sample(unix_ns, sample) => (unix_ns, sample),
            ReadItem::Damaged(reason) => {
                return Ok(Some(LogEntry::Damaged(Damage {
                    line: self.entries,
                    reason: DamageReason::Bytes(reason),
                })));
            }
        };
        self.table.set_clock(ClockAnchor {
            unix_ns,
            monotonic: MonotonicNs(sample.received_ns),
        });
        self.sample = sample;
        let mut line = std::mem::take(&mut self.line).into_bytes();
        line.clear();
        self.table.row(&self.sample, &mut line);
        // Without the end of the line.
        line.pop();
        self.line = String::from_utf8(line).unwrap_or_default();
        let row = Row::of_sample(&self.sample, Some(unix_ns), &self.line);
        Ok(Some(LogEntry::Row(row)))
    }

    fn refresh(&mut self) -> Result<(), LogReadError> {
        self.messages.refresh().map_err(LogReadError::Unreadable)
    }

    fn unfinished_bytes(&self) -> usize {
        self.unfinished_bytes
    }
}
