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
