//! What goes to the disk's thread at its start, and what comes back of each action.

use std::path::PathBuf;

use recording::DiskError;
use status::log::config::Limits;
use status::log::file_name::Series;

/// What the thread did, in its order, for the operator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Note {
    /// A file was created.
    Opened(PathBuf),
    /// An old file was removed to make room for the next.
    Removed {
        /// The file.
        file: PathBuf,
        /// How long it was, bytes.
        bytes: u64,
    },
    /// A file was closed.
    Closed(ClosedFile),
    /// A file without a message was closed, and removed.
    NothingCame(PathBuf),
}

/// A file to which nothing will be written any more.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ClosedFile {
    /// Where it is.
    pub path: PathBuf,
    /// Whether it is complete.
    pub is_whole: bool,
    /// Messages in it, the recording's own events not counted.
    pub messages: u64,
    /// How long it is.
    pub bytes: u64,
}

/// How an action went.
pub(super) struct Outcome {
    /// The answer for the recorder.
    pub result: Result<(), DiskError>,
    /// What the operator should know.
    pub notes: Vec<Note>,
}

/// Where the files go, and how much they may take.
#[derive(Clone, Debug)]
pub(super) struct Place {
    /// The folder.
    pub folder: PathBuf,
    /// Which files in it are the recording's.
    pub series: Series,
    /// How much they may take.
    pub limits: Limits,
}
