//! Reads a log again, row by row: the other side of [`tsv`](super::tsv).
//!
//! [`LogReader`] takes any text, whatever wrote it and whatever became of it since. It never panics on a file, keeps no
//! more than one line of it, and says of each line that is no row what is wrong with it. A file may be read while it is
//! written: at the end of what is there [`LogReader::next`] gives nothing, and more when there is more.
//!
//! ```
//! use status::log::read::{LogEntry, LogReader};
//!
//! let text = "flying\tsequence\treceived_ns\tgps_quality\n1\t7\t5000\t4\n1\t8\tx\t4\n1\t9";
//! let mut log = LogReader::new(text.as_bytes());
//! let Some(LogEntry::Row(row)) = log.next()? else { panic!() };
//! assert_eq!((row.sample.sequence, row.sample.gps_quality), (7, 4));
//! let Some(LogEntry::Damaged(damage)) = log.next()? else { panic!() };
//! assert_eq!(damage.to_string(), "line 3: `received_ns` is no number: x");
//! assert!(log.next()?.is_none());
//! assert_eq!(log.unfinished_bytes(), 3);
//! # Ok::<(), status::log::read::LogReadError>(())
//! ```

#[cfg(test)]
mod tests;

use std::collections::BTreeSet;
use std::fmt;
use std::io::{self, BufRead};

use ipc_types::TelemetryGroup;
use ipc_types::payload::DspTelemetry;

use super::clock::IsoTime;
use super::tsv::Column;
use crate::fields;

/// Longest line, bytes. A row has at most 50 cells of at most 24 bytes, so 1.2 kB; the names of the columns make 0.8
/// kB. What is longer is no line of a log: it is passed over and reported as damaged.
pub const MAX_LINE_BYTES: usize = 8192;

/// Longest piece of a file that a message repeats, characters: it stays readable on a terminal.
const MAX_EXCERPT_CHARS: usize = 40;

/// Why a file cannot be read, or not any further.
#[derive(Debug, thiserror::Error)]
pub enum LogReadError {
    /// The operating system says so.
    #[error("it cannot be read")]
    Unreadable(#[from] io::Error),
    /// Its first line is not that of a log.
    #[error("it is no log of the RIL: {0}")]
    NoLog(String),
}

/// A line after the first.
#[derive(Clone, Debug, PartialEq)]
pub enum LogEntry<'a> {
    /// A row.
    Row(Row<'a>),
    /// A line that is no row.
    Damaged(Damage),
}

/// A row: the values of one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row<'a> {
    /// The sample, as far as the log has its columns: a group is valid if all of its cells hold a number.
    pub sample: &'a DspTelemetry,
    /// When the bridge received it, in ns since 1970, UTC; `None` if the log has no such column.
    pub unix_ns: Option<u64>,
    line: &'a str,
}

impl<'a> Row<'a> {
    /// The row of a sample that does not come from a text, such as one of a flight record: `line` has its cells, in the
    /// order of the columns and divided by tabs.
    pub fn of_sample(sample: &'a DspTelemetry, unix_ns: Option<u64>, line: &'a str) -> Row<'a> {
        Row {
            sample,
            unix_ns,
            line,
        }
    }

    /// The cells in the order of the columns; those of groups that were not transmitted are empty.
    pub fn cells(&self) -> impl Iterator<Item = &'a str> + use<'a> {
        self.line.split('\t')
    }
}

/// A line that is no row, and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// The line, counted from 1.
    pub line: u64,
    /// What is wrong with it.
    pub reason: DamageReason,
}

/// What is wrong with a line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DamageReason {
    /// It is longer than [`MAX_LINE_BYTES`].
    TooLong,
    /// It is no text.
    NoText,
    /// It has another number of cells than the log has columns.
    Cells {
        /// Cells in the line.
        found: usize,
        /// Columns of the log.
        expected: usize,
    },
    /// A cell does not hold what its column says.
    Value {
        /// Name of the column.
        column: String,
        /// What it should be.
        expected: &'static str,
        /// The cell, shortened.
        found: String,
    },
    /// Bytes of a file whose parts are no lines.
    Bytes(String),
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.reason {
            DamageReason::Bytes(reason) => f.write_str(reason),
            reason => write!(f, "line {}: {reason}", self.line),
        }
    }
}

impl fmt::Display for DamageReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            DamageReason::TooLong => write!(f, "longer than {MAX_LINE_BYTES} bytes"),
            DamageReason::NoText => f.write_str("no text"),
            DamageReason::Cells { found, expected } => {
                write!(f, "{found} cells where the log has {expected} columns")
            }
            DamageReason::Value {
                column,
                expected,
                found,
            } => write!(f, "`{column}` is no {expected}: {found}"),
            DamageReason::Bytes(reason) => f.write_str(reason),
        }
    }
}

/// The columns of a log.
struct Columns {
    names: Vec<String>,
    /// What they hold, beside the names; `None` for a number of a later version.
    columns: Vec<Option<Column>>,
}

/// Reads a log row by row, and says of each line that is no row what is wrong with it.
pub struct LogReader<R> {
    input: R,
    /// Nothing before the first line was read.
    columns: Option<Columns>,
    /// The line that is being read; the line that an entry shows.
    line: Vec<u8>,
    /// Whether `line` is complete, and belongs to an entry that was given.
    is_given: bool,
    /// Whether the rest of a line that is too long is being passed over.
    is_too_long: bool,
    lines: u64,
    /// The one that an entry shows.
    sample: DspTelemetry,
}

impl<R: BufRead> LogReader<R> {
    /// A reader of `input`. Nothing is read yet.
    pub fn new(input: R) -> LogReader<R> {
        LogReader {
            input,
            columns: None,
            line: Vec::new(),
            is_given: false,
            is_too_long: false,
            lines: 0,
            sample: DspTelemetry::default(),
        }
    }

    /// The names of the columns; empty before the first line was read, which [`LogReader::begin`] does.
    pub fn columns(&self) -> &[String] {
        self.columns.as_ref().map_or(&[], |columns| &columns.names)
    }

    /// Reads the first line, and says whether it is there.
    ///
    /// # Errors
    ///
    /// The input cannot be read, or its first line is not that of a log.
    pub fn begin(&mut self) -> Result<bool, LogReadError> {
        if self.columns.is_none() && self.read_line()? {
            self.is_given = true;
            self.columns = Some(self.header().map_err(LogReadError::NoLog)?);
        }
        Ok(self.columns.is_some())
    }

    /// The next line after the first; `None` if there is no whole line (yet).
    ///
    /// # Errors
    ///
    /// The input cannot be read, or its first line is not that of a log.
    #[expect(clippy::should_implement_trait, reason = "it lends its line")]
    pub fn next(&mut self) -> Result<Option<LogEntry<'_>>, LogReadError> {
        if !self.begin()? || !self.read_line()? {
            return Ok(None);
        }
        self.is_given = true;
        let Some(columns) = &self.columns else {
            return Ok(None);
        };
        let row = match self.is_too_long {
            true => Err(DamageReason::TooLong),
            false => row(columns, &self.line, &mut self.sample),
        };
        let line = self.lines;
        Ok(Some(row.map_or_else(
            |reason| LogEntry::Damaged(Damage { line, reason }),
            LogEntry::Row,
        )))
    }

    /// How long the line without an end is that the input ends with, bytes: what a kill or a power cut left, or a row
    /// that is being written.
    pub fn unfinished_bytes(&self) -> usize {
        match self.is_given {
            true => 0,
            false => self.line.len(),
        }
    }

    /// How many lines were read, the first included.
    pub fn lines(&self) -> u64 {
        self.lines
    }

    /// Reads on to the end of a line, and says whether it is there.
    fn read_line(&mut self) -> io::Result<bool> {
        if self.is_given {
            self.line.clear();
            self.is_given = false;
            self.is_too_long = false;
        }
        loop {
            let bytes = match self.input.fill_buf() {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                bytes => bytes?,
            };
            if bytes.is_empty() {
                return Ok(false);
            }
            let end = bytes.iter().position(|byte| *byte == b'\n');
            let piece = &bytes[..end.unwrap_or(bytes.len())];
            let room = MAX_LINE_BYTES - self.line.len();
            self.is_too_long |= piece.len() > room;
            self.line.extend_from_slice(&piece[..piece.len().min(room)]);
            let used = piece.len() + usize::from(end.is_some());
            self.input.consume(used);
            if end.is_some() {
                self.lines += 1;
                self.strip_line();
                return Ok(true);
            }
        }
    }

    /// Removes what an editor on Windows adds to a line: a byte order mark of the first, a carriage return at the end.
    fn strip_line(&mut self) {
        if self.line.ends_with(b"\r") {
            self.line.pop();
        }
        if self.lines == 1 && self.line.starts_with(b"\xef\xbb\xbf") {
            self.line.drain(..3);
        }
    }

    /// The columns that the first line names, or why it names none.
    fn header(&self) -> Result<Columns, String> {
        if self.is_too_long {
            return Err(format!(
                "its first line is longer than {MAX_LINE_BYTES} bytes"
            ));
        }
        let text =
            str::from_utf8(&self.line).map_err(|_| "its first line is no text".to_owned())?;
        let names: Vec<String> = text.split('\t').map(str::to_owned).collect();
        let always: Vec<&str> = fields::ALWAYS.iter().map(|field| field.name).collect();
        if names.len() < always.len() || names[..always.len()] != always {
            return Err(format!(
                "its first line begins with {}, not with {}",
                excerpt(text),
                always.join(", ")
            ));
        }
        let unique: BTreeSet<&String> = names.iter().collect();
        let is_plain = |name: &String| {
            !name.is_empty()
                && name
                    .bytes()
                    .all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_')
        };
        if unique.len() < names.len() || !names.iter().all(is_plain) {
            return Err("its first line names a column twice, or one by no name of a field".into());
        }
        let columns = names.iter().map(|name| Column::of_name(name)).collect();
        Ok(Columns { names, columns })
    }
}

/// What `line` says, with its sample in `sample`; or what is wrong with it.
fn row<'a>(
    columns: &Columns,
    line: &'a [u8],
    sample: &'a mut DspTelemetry,
) -> Result<Row<'a>, DamageReason> {
    let line = str::from_utf8(line).map_err(|_| DamageReason::NoText)?;
    let expected = columns.names.len();
    let found = line.split('\t').count();
    if found != expected {
        return Err(DamageReason::Cells { found, expected });
    }
    let wrong = |index: usize, expected, cell| DamageReason::Value {
        column: columns.names[index].clone(),
        expected,
        found: excerpt(cell),
    };
    *sample = DspTelemetry::default();
    let mut unix_ns = None;
    let (mut there, mut missing) = (0, 0);
    for (index, (cell, column)) in line.split('\t').zip(&columns.columns).enumerate() {
        let is_always = index < fields::ALWAYS.len();
        let is_read = match column {
            Some(Column::Utc) => {
                let time = IsoTime::parse(cell);
                let time = time.ok_or_else(|| wrong(index, "time in UTC", cell))?;
                unix_ns = Some(time.unix_ns());
                true
            }
            Some(Column::Field(group, field)) => {
                let is_read = field.read(cell, sample);
                let bit = group.map_or(0, TelemetryGroup::bit);
                match is_read && field.value(sample).number().is_finite() {
                    true => there |= bit,
                    false => missing |= bit,
                }
                is_read
            }
            None => false,
        };
        // A number that the field cannot hold is none of this version.
        let is_none = || !is_always && (cell.is_empty() || cell.parse::<f64>().is_ok());
        if !is_read && !is_none() {
            return Err(wrong(index, "number", cell));
        }
    }
    sample.valid_groups = there & !missing;
    if sample.flying > 1 {
        return Err(wrong(0, "0 or 1", &sample.flying.to_string()));
    }
    Ok(Row {
        sample,
        unix_ns,
        line,
    })
}

/// The beginning of `text`, of which no character commands a terminal.
fn excerpt(text: &str) -> String {
    let start: String = text.chars().take(MAX_EXCERPT_CHARS).collect();
    let dots = if start.len() < text.len() { "…" } else { "" };
    format!("{}{dots}", start.escape_debug())
}
