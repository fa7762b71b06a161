//! What the operator should know about a log, while it is written and at its end.

use std::io;
use std::path::PathBuf;

use super::groups::LogGroups;
use crate::group::GroupSet;

/// Something that the operator should know about a log.
#[derive(Debug)]
pub enum LogEvent {
    /// A file was created: the first, the next after a full one, or a new one after an error.
    Opened {
        /// The file.
        file: PathBuf,
        /// What is logged.
        groups: LogGroups,
    },
    /// An old file was removed to make room for the next.
    Removed {
        /// The file.
        file: PathBuf,
        /// How long it was, bytes.
        bytes: u64,
    },
    /// A kill or a power cut had left a partial row at the end of an earlier file; it was truncated.
    PartialRowTruncated {
        /// The file.
        file: PathBuf,
        /// How long the partial row was, bytes.
        bytes: u64,
    },
    /// Samples come without groups that the log should have; their cells are empty. Once for each group.
    GroupsMissing {
        /// The log.
        log: String,
        /// The groups.
        groups: GroupSet,
    },
    /// Nothing can be written because of an error; the writer retries. Once until [`Resumed`](Self::Resumed).
    Failed {
        /// The file, or the directory if the error is about no single file.
        file: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// Nothing is written because the disk is nearly full. Once until [`Resumed`](Self::Resumed).
    Paused {
        /// The log.
        log: String,
        /// What is free, bytes.
        free_bytes: u64,
        /// What must be left free, bytes.
        min_free_bytes: u64,
    },
    /// Rows are written again.
    Resumed {
        /// The log.
        log: String,
    },
    /// The queue was full: the disk is slow or hangs, or nothing can be written. At onset and once a minute.
    RowsLost {
        /// The log.
        log: String,
        /// How many since the last such event.
        lost: u64,
        /// How many since the start.
        total: u64,
    },
    /// The log's thread is gone: it could not be started, or it panicked. Once.
    ThreadFailed {
        /// The log.
        log: String,
    },
}

/// What a writer made of the samples that it took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Written {
    /// Files that were created.
    pub files: u64,
    /// Rows in them.
    pub rows: u64,
    /// Of those, how many the system could not force onto the disk: they may be there or not.
    pub unsynced: u64,
}

/// How the writer of a log ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WriterEnd {
    /// In order.
    Finished(Written),
    /// Not yet: the disk does not answer.
    DiskHangs,
    /// Its thread could not be started, or it panicked.
    ThreadFailed,
}

/// What became of a log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogSummary {
    /// Directory and pattern of the files.
    pub log: String,
    /// Samples that were published while the log was open.
    pub offered: u64,
    /// Samples that the log's queue refused.
    pub refused: u64,
    /// What became of the samples that the queue took.
    pub end: WriterEnd,
}

impl LogSummary {
    /// How many samples are in no file. Exact after an orderly end; otherwise those that are lost for sure.
    pub fn lost(&self) -> u64 {
        match self.end {
            WriterEnd::Finished(written) => self.offered.saturating_sub(written.rows),
            WriterEnd::DiskHangs | WriterEnd::ThreadFailed => self.refused,
        }
    }
}
