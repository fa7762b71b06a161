//! Logs of chosen groups of the telemetry, several at once, each on its own.
//!
//! ```text
//! telemetry ─▶ Logs ─▶ bounded queue ─▶ LogWriter ─▶ Store
//!   never waits        of each log       of each log, in a thread of its own
//! ```
//!
//! Telemetry comes first: [`Logs`] gives each sample to the queue of each log, and if there is no room counts it and
//! goes on. A [`LogWriter`] takes the samples out and may wait for its disk as long as that likes. So no log can disturb
//! another one or the telemetry, neither by an error nor by a disk that hangs. Nothing is created for a log without
//! groups, and no row is written before the first sample.
//!
//! What can be lost, and how it is known:
//!
//! * A kill of the process costs the rows of the last second: they are handed to the operating system every
//!   [`FLUSH_PERIOD`](writer::FLUSH_PERIOD). A piece of a row that it leaves is cut off at the next start.
//! * A power cut costs those of the last [`SYNC_PERIOD`](open_file::SYNC_PERIOD) too: so often they are forced onto the
//!   disk, and whenever a file is closed. More often would be a write of the disk's journal each time, which wears
//!   memory cards; never would leave it to the system, and errors that a disk reports only then would go unnoticed.
//! * An error, a full disk: rows wait in memory for as long as there is room, then the newest are lost and counted.
//! * A disk that hangs: samples wait in the queue for as long as there is room, then the newest are lost and counted.

pub mod backoff;
pub mod fields;
pub mod file_name;
pub mod gathered;
pub mod open_file;
pub mod queue;
pub mod retention;
pub mod store;
pub mod tsv;
pub mod writer;

#[cfg(test)]
mod tests;

use std::io;
use std::path::PathBuf;

use ipc_types::RobotId;

use crate::config::LogConfig;
use crate::group::GroupSet;
use file_name::Series;

pub use queue::Logs;
pub use writer::LogWriter;

/// What a log may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// No file becomes longer, bytes.
    pub max_file_bytes: u64,
    /// All files of the log together take no more, bytes.
    pub max_total_bytes: u64,
    /// If less is free on the disk, nothing is written, bytes.
    pub min_free_bytes: u64,
}

/// Something that the operator should know about a log.
#[derive(Debug)]
pub enum LogEvent {
    /// A file was created: the first, the next after a full one, or a new one after an error.
    Opened {
        /// The file.
        file: PathBuf,
        /// What is logged.
        groups: GroupSet,
    },
    /// An old file was removed to make room for the next.
    Removed {
        /// The file.
        file: PathBuf,
        /// How long it was, bytes.
        bytes: u64,
    },
    /// A kill or a power cut had left a piece of a row at the end of an earlier file; it was cut off.
    Mended {
        /// The file.
        file: PathBuf,
        /// How long the piece was, bytes.
        bytes: u64,
    },
    /// Samples come without groups that the log should have; their cells are empty. Once for each group.
    GroupsMissing {
        /// The log.
        log: String,
        /// The groups.
        groups: GroupSet,
    },
    /// Nothing can be written because of an error; it is being tried again. Once until [`Resumed`](Self::Resumed).
    Failed {
        /// The file, or the directory if it is about no one file.
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
        /// How many rows were lost meanwhile.
        lost: u64,
    },
    /// Rows were lost since the last such event, while nothing could be written.
    RowsLost {
        /// The log.
        log: String,
        /// How many since the last such event.
        lost: u64,
        /// How many in all.
        lost_in_all: u64,
    },
    /// Rows were lost since the last such event because the disk does not keep up, or hangs.
    QueueFull {
        /// The log.
        log: String,
        /// How many since the last such event.
        lost: u64,
        /// How many in all.
        lost_in_all: u64,
    },
}

/// What a [`LogWriter`] made of the samples that it took: each is a row in a file, or lost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Written {
    /// Files that were created.
    pub files: u64,
    /// Rows that files took.
    pub rows: u64,
    /// Of those, how many the system could not force onto the disk: they may be there or not.
    pub unsure: u64,
    /// Rows that no file took.
    pub lost: u64,
}

/// What became of a log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogSummary {
    /// Directory and pattern of the files.
    pub log: String,
    /// Samples that its queue took.
    pub taken: u64,
    /// Samples for which its queue had no room.
    pub dropped: u64,
    /// What became of those that were taken; unknown if the disk hangs to the very end.
    pub written: Option<Written>,
}

/// What a log is called in messages that are about no one file.
pub fn label(config: &LogConfig, robot: RobotId) -> String {
    let pattern = Series::new(robot, config.name.clone()).pattern();
    config.directory.join(pattern).display().to_string()
}
