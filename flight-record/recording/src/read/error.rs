//! What is wrong with a file.

/// What is wrong with a file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReadError {
    /// The bytes do not begin as an MCAP file does.
    #[error("this is not an MCAP file: it does not begin with the format's mark")]
    NotMcap,
    /// A chunk is compressed.
    #[error(
        "a chunk is compressed with `{0}`, which is not supported; `mcap decompress` makes a file that is"
    )]
    Compressed(String),
    /// Nothing is damaged, but the file was not finished: its recorder was killed, or is still recording.
    #[error("the file was not finished: it has no summary")]
    Unfinished,
    /// The file ends within a record: the rest was never written.
    #[error("the file ends in the middle of a record at byte {at}")]
    Truncated {
        /// Offset of the record, bytes.
        at: u64,
    },
    /// Bytes that cannot be.
    #[error("the file is damaged at byte {at}: {reason}")]
    Damaged {
        /// Offset of the record or chunk, bytes.
        at: u64,
        /// What cannot be.
        reason: &'static str,
    },
    /// The file could not be read or written.
    #[error("{0}")]
    Io(String),
}

impl ReadError {
    pub(super) fn damaged(at: usize, reason: &'static str) -> ReadError {
        let at = at as u64;
        ReadError::Damaged { at, reason }
    }
}

impl From<std::io::Error> for ReadError {
    fn from(error: std::io::Error) -> ReadError {
        ReadError::Io(error.to_string())
    }
}
