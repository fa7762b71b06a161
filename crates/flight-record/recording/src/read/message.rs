//! What reading gives: a [`RecordedMessage`], or a [`ReadError`].

use std::ops::Range;
use std::sync::Arc;

use super::record::{ChannelFacts, MAX_EXPANDED_BYTES};

/// A message of a recording. It shares its chunk, which stays in memory as long as one of its messages.
#[derive(Clone, Debug)]
pub struct RecordedMessage {
    /// Unix time by which it lies in the file, ns. It never goes back within a file of ours.
    pub log_time_ns: u64,
    /// Unix time of the time in the message, ns: `log_time_ns`, or earlier when the message reached the recorder late.
    pub publish_time_ns: u64,
    /// The sequence number, of which only the lowest 32 bits are in the file.
    pub sequence: u32,
    pub(super) channel: Arc<ChannelFacts>,
    pub(super) records: Arc<Vec<u8>>,
    /// Where the message lies in `records`.
    pub(super) place: Range<usize>,
}

impl RecordedMessage {
    /// Name of the topic, such as `/robot1/dsp/telemetry`.
    pub fn topic(&self) -> &str {
        &self.channel.topic
    }

    /// Name of the message type, such as `hero_msgs/msg/DspTelemetry`.
    pub fn schema_name(&self) -> &str {
        &self.channel.schema.name
    }

    /// The message definition with all that it needs, in the encoding `ros2msg`.
    pub fn schema_text(&self) -> &str {
        std::str::from_utf8(&self.channel.schema.data).unwrap_or_default()
    }

    /// The message in CDR, with its header of four bytes.
    pub fn data(&self) -> &[u8] {
        &self.records[self.place.clone()]
    }
}

/// What is wrong with a file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReadError {
    /// The bytes do not begin as an MCAP file does.
    #[error("this is not an MCAP file: it does not begin with the format's mark")]
    NotMcap,
    /// A chunk is compressed in a way that is not supported, with this name.
    #[error("chunks are compressed with {0:?}, which is not supported: only `zstd` and `lz4` are")]
    Compressed(String),
    /// A compressed chunk would expand to more than is supported.
    #[error(
        "a compressed chunk of {bytes} bytes is not supported: at most {} bytes are",
        MAX_EXPANDED_BYTES
    )]
    TooLong {
        /// What it says that it expands to, bytes.
        bytes: u64,
    },
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

/// Errors of a file that are listed at most.
const MAX_LISTED: usize = 1000;

impl ReadError {
    /// Whether nothing is wrong with the file, but a part of it is not read.
    pub fn is_unsupported(&self) -> bool {
        matches!(self, ReadError::Compressed(_) | ReadError::TooLong { .. })
    }

    /// Lists this error of a file; what is not supported is listed once.
    pub(super) fn list(self, errors: &mut Vec<ReadError>) {
        let is_new = || !(self.is_unsupported() && errors.contains(&self));
        if errors.len() < MAX_LISTED && is_new() {
            errors.push(self);
        }
    }

    /// Whether a file with these errors also has to be called unfinished when it is: damage explains that already.
    pub(super) fn leave_room_for_unfinished(errors: &[ReadError]) -> bool {
        errors.iter().all(ReadError::is_unsupported)
    }

    pub(super) fn damaged(at: u64, reason: &'static str) -> ReadError {
        ReadError::Damaged { at, reason }
    }
}

impl From<std::io::Error> for ReadError {
    fn from(error: std::io::Error) -> ReadError {
        ReadError::Io(error.to_string())
    }
}
