//! What a recorder wants done with files, and how that went.

/// What is to be done with files next. Actions are done in the order in which they are given, one at a time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FileAction {
    /// Create a new, empty file, without replacing another one. The following actions are about it.
    Open {
        /// Number of the file within the recording, from 0. The same number comes again when its creation failed.
        index: u32,
    },
    /// Write the parts in their order, one right after the other (each by `pwrite`, as often as it takes).
    ///
    /// The order keeps the file readable at any moment in between. A part may lie beyond the file's end: what is
    /// between stays a hole, which takes no room on the disk, until it is written.
    Write {
        /// What to write where; never empty. Together at most about a megabyte and the longest message; at a file's
        /// beginning, its attachments, and at its end, the index of its chunks.
        parts: Vec<Part>,
    },
    /// Make the file `len` bytes long: behind the end of a finished file is room that it did not need.
    Truncate {
        /// Bytes that stay.
        len: u64,
    },
    /// Force what was written onto the disk (`fdatasync`).
    Sync,
    /// Close the file. A file without messages may be removed.
    Close {
        /// Whether the file is whole, with a summary. Otherwise something failed; a reader still finds all that was
        /// flushed.
        is_whole: bool,
        /// Messages in the file, events of the recording not counted.
        messages: u64,
    },
}

impl FileAction {
    /// Carries the action out on a file that is a vector: for small files that are made at once, and for tests.
    pub fn apply_to(&self, file: &mut Vec<u8>) {
        match self {
            FileAction::Write { parts } => parts.iter().for_each(|part| part.write_to(file)),
            FileAction::Truncate { len } => file.truncate(*len as usize),
            FileAction::Open { .. } | FileAction::Sync | FileAction::Close { .. } => {}
        }
    }
}

/// Bytes that belong at a place in the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Offset from the file's beginning, bytes.
    pub at: u64,
    /// The bytes; never empty.
    pub bytes: Vec<u8>,
}

impl Part {
    /// Writes it into a file that is a vector; what is between is filled with zeros.
    pub fn write_to(&self, file: &mut Vec<u8>) {
        let at = self.at as usize;
        let end = at + self.bytes.len();
        file.resize(file.len().max(end), 0);
        file[at..end].copy_from_slice(&self.bytes);
    }
}

/// Why an action failed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{text}")]
pub struct DiskError {
    /// What follows from it.
    pub kind: DiskErrorKind,
    /// The reason in words, for the event in the next file.
    pub text: String,
}

/// What follows from a [`DiskError`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DiskErrorKind {
    /// Nothing was tried, because the disk is nearly full. The file stays open; the same action comes again after 5 s.
    LowSpace,
    /// The file is of no more use. It is closed; another one is begun after 5 s, with the messages that the failed one
    /// lacks.
    Failed,
}
