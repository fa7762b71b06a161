//! [`Message`]: a message of a file.

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
