//! What reading gives: a [`Message`], or a [`ReadError`].

/// A message of a recording, where it lies in the file's bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Message<'a> {
    /// Name of the topic, such as `/robot1/dsp_telemetry`.
    pub topic: &'a str,
    /// Name of the message type, such as `hero_msgs/msg/DspTelemetry`.
    pub schema_name: &'a str,
    /// The message definition with all that it needs, in the encoding `ros2msg`.
    pub schema_text: &'a str,
    /// Unix time by which it lies in the file, ns. It never goes back within a file of ours.
    pub log_time_ns: u64,
    /// Unix time of the time in the message, ns: `log_time_ns`, or earlier when the message reached the recorder late.
    pub publish_time_ns: u64,
    /// The sequence number, of which only the lowest 32 bits are in the file.
    pub sequence: u32,
    /// The message in CDR, with its header of four bytes.
    pub data: &'a [u8],
}

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
