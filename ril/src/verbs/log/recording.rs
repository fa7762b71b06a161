//! The formats of log files, and what all of them can do: [`Format`] is the one place to add another. The rows of status are read by
//! the crate `status`, the records of `ril record` here.

use std::io::{self, BufRead};
use std::path::{Path, PathBuf};

use ipc_types::MonotonicNs;
use ipc_types::payload::{DspTelemetry, SharedStruct};
use ipc_types::schema::CDR_HEADER;
use recording::read::{self, Bytes, Message};
use status::log::clock::ClockAnchor;
use status::log::groups::LogGroups;
pub use status::log::read::{Damage, Entry, ReadError, Row};
use status::log::read::{DamageReason, LogReader};
use status::log::tsv::Table;

/// A log file that is read entry by entry.
pub trait Recording {
    /// Reads what stands before the first row, and says whether it is there.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or is none of this format.
    fn begin(&mut self) -> Result<bool, ReadError>;

    /// The names of the columns; empty before [`Recording::begin`].
    fn columns(&self) -> &[String];

    /// The next row, or what is damaged in its place; `None` if there is no more (yet).
    ///
    /// # Errors
    ///
    /// As [`Recording::begin`].
    fn next(&mut self) -> Result<Option<Entry<'_>>, ReadError>;

    /// Looks for what was written since the last look, where [`Recording::next`] does not see it by itself.
    ///
    /// # Errors
    ///
    /// As [`Recording::begin`].
    fn refresh(&mut self) -> Result<(), ReadError> {
        Ok(())
    }

    /// Bytes at the end of the file that are no whole row (yet).
    fn unfinished_bytes(&self) -> usize;
}

impl<R: BufRead> Recording for LogReader<R> {
    fn begin(&mut self) -> Result<bool, ReadError> {
        LogReader::begin(self)
    }

    fn columns(&self) -> &[String] {
        LogReader::columns(self)
    }

    fn next(&mut self) -> Result<Option<Entry<'_>>, ReadError> {
        LogReader::next(self)
    }

    fn unfinished_bytes(&self) -> usize {
        LogReader::unfinished_bytes(self)
    }
}

/// A format of log files: the one place to add another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// The tab-separated values that status writes.
    Tsv,
    /// The flight records of `ril record`.
    Mcap,
}

/// How an MCAP file begins.
const MCAP: &[u8] = b"\x89MCAP";

impl Format {
    /// The format of a file that begins with `beginning`.
    pub fn of(beginning: &[u8]) -> Format {
        match beginning.starts_with(MCAP) {
            true => Format::Mcap,
            // The first line says more; an empty file may be a log to which nothing was written yet.
            false => Format::Tsv,
        }
    }
}

/// End of the name of the topic with the raw telemetry; the robot's number stands before it.
const TOPIC: &str = "/dsp/telemetry";

/// What was found in the file, in its order.
enum Found {
    /// A sample: its time in UTC, and where it begins in the file.
    Sample { unix_ns: u64, at: usize },
    /// Something that cannot be read.
    Damaged(String),
}

/// Reads a record. See the module's documentation.
pub struct McapReader {
    path: PathBuf,
    bytes: Bytes,
    table: Table,
    columns: Vec<String>,
    /// `None` before [`Recording::begin`].
    found: Option<Vec<Found>>,
    next: usize,
    unfinished_bytes: usize,
    /// The row that was given last.
    line: String,
}

impl McapReader {
    /// A reader of the file at `path`. No message is read yet.
    ///
    /// # Errors
    ///
    /// It cannot be read.
    pub fn open(path: &Path) -> io::Result<McapReader> {
        let table = Table::new(LogGroups::ALL).with_utc(true);
        let mut names = Vec::new();
        table.header(&mut names);
        let names = String::from_utf8_lossy(&names);
        let columns = names.trim_end().split('\t').map(str::to_owned).collect();
        Ok(McapReader {
            path: path.to_owned(),
            bytes: Bytes::open(path)?,
            table,
            columns,
            found: None,
            next: 0,
            unfinished_bytes: 0,
            line: String::new(),
        })
    }

    /// The same without all but the last `rows` rows, and what is damaged among them.
    ///
    /// # Errors
    ///
    /// As [`Recording::begin`].
    pub fn last(mut self, rows: usize) -> Result<McapReader, ReadError> {
        self.begin()?;
        let found = self.found.as_deref().unwrap_or_default();
        let samples = found.iter().enumerate().rev().filter_map(|(index, found)| {
            let is_sample = matches!(found, Found::Sample { .. });
            is_sample.then_some(index)
        });
        self.next = match rows.checked_sub(1) {
            None => found.len(),
            Some(others) => samples.take(others + 1).last().unwrap_or_default(),
        };
        Ok(self)
    }

    fn scan(&mut self) -> Result<Vec<Found>, ReadError> {
        let bytes: &[u8] = &self.bytes;
        let mut found = Vec::new();
        for message in read::messages(bytes) {
            match message {
                Ok(message) => found.extend(sample(bytes, &message)),
                Err(read::ReadError::NotMcap) => {
                    return Err(ReadError::NoLog(read::ReadError::NotMcap.to_string()));
                }
                Err(read::ReadError::Truncated { at }) => {
                    let at = usize::try_from(at).unwrap_or(bytes.len());
                    self.unfinished_bytes = bytes.len().saturating_sub(at);
                }
                Err(error) => found.push(Found::Damaged(error.to_string())),
            }
        }
        Ok(found)
    }
}

/// Where the sample lies in the file; `None` if the message is another one.
fn sample(bytes: &[u8], message: &Message<'_>) -> Option<Found> {
    let is_sample = message.topic.ends_with(TOPIC)
        && message.data.len() == CDR_HEADER.len() + size_of::<DspTelemetry>();
    let unix_ns = message.publish_time_ns;
    // A message is a piece of the file.
    let at = (message.data.as_ptr() as usize).checked_sub(bytes.as_ptr() as usize)?;
    is_sample.then_some(Found::Sample {
        unix_ns,
        at: at + CDR_HEADER.len(),
    })
}

impl Recording for McapReader {
    fn begin(&mut self) -> Result<bool, ReadError> {
        if self.found.is_none() {
            self.unfinished_bytes = 0;
            self.found = Some(self.scan()?);
        }
        Ok(true)
    }

    fn columns(&self) -> &[String] {
        match self.found {
            Some(_) => &self.columns,
            None => &[],
        }
    }

    fn next(&mut self) -> Result<Option<Entry<'_>>, ReadError> {
        self.begin()?;
        let found = self.found.as_deref().unwrap_or_default();
        let Some(next) = found.get(self.next) else {
            return Ok(None);
        };
        self.next += 1;
        let (unix_ns, at) = match next {
            Found::Sample { unix_ns, at } => (*unix_ns, *at),
            Found::Damaged(reason) => {
                return Ok(Some(Entry::Damaged(Damage {
                    line: self.next as u64,
                    reason: DamageReason::Bytes(reason.clone()),
                })));
            }
        };
        let payload = self.bytes.get(at..at + size_of::<DspTelemetry>());
        let Some(sample) = payload.and_then(DspTelemetry::from_bytes) else {
            return Ok(None);
        };
        self.table.set_clock(ClockAnchor {
            unix_ns,
            monotonic: MonotonicNs(sample.received_ns),
        });
        let mut line = std::mem::take(&mut self.line).into_bytes();
        line.clear();
        self.table.row(&sample, &mut line);
        // Without the end of the line.
        line.pop();
        self.line = String::from_utf8(line).unwrap_or_default();
        let row = Row::of_sample(&sample, Some(unix_ns), &self.line);
        Ok(Some(Entry::Row(row)))
    }

    fn refresh(&mut self) -> Result<(), ReadError> {
        self.found = None;
        // The former bytes go first: the file never lies in memory twice.
        self.bytes = Bytes::default();
        self.bytes = Bytes::open(&self.path)?;
        self.begin().map(drop)
    }

    fn unfinished_bytes(&self) -> usize {
        self.unfinished_bytes
    }
}
