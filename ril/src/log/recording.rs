//! The formats of log files, and what all of them can do.

use std::io::BufRead;

use status::log::read::LogReader;
pub use status::log::read::{Damage, Entry, ReadError, Row};

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

    /// The next row, or what is damaged in its place; nothing when there is no more (yet).
    ///
    /// # Errors
    ///
    /// As [`Recording::begin`].
    fn next(&mut self) -> Result<Option<Entry<'_>>, ReadError>;

    /// Bytes at the end of the file that are no whole row (yet).
    fn unfinished_bytes(&self) -> usize;

    /// Lines, or whatever the format's entries are, that were read.
    fn lines(&self) -> u64;
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

    fn lines(&self) -> u64 {
        LogReader::lines(self)
    }
}

/// A format of log files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// The tab-separated values that status writes.
    Tsv,
}

/// How an MCAP file begins.
const MCAP: &[u8] = b"\x89MCAP";

impl Format {
    /// The format of a file that begins with `beginning`, or why there is none that can be read.
    ///
    /// # Errors
    ///
    /// The reason, as the end of a sentence.
    pub fn of(beginning: &[u8]) -> Result<Format, &'static str> {
        if beginning.starts_with(MCAP) {
            return Err("it is an MCAP file, which this version does not read");
        }
        // The first line says more; an empty file may be a log to which nothing was written yet.
        Ok(Format::Tsv)
    }

    /// A reader of this format.
    pub fn read<'a>(self, input: impl BufRead + 'a) -> Box<dyn Recording + 'a> {
        match self {
            Format::Tsv => Box::new(LogReader::new(input)),
        }
    }
}
