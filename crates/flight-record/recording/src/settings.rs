//! What a recorder is given at its start: how often it writes, when it begins another file, and what each file says of
//! the flight.

use std::collections::BTreeMap;
use std::time::Duration;

use ipc_types::{MonotonicNs, RobotId};

/// A moment by both clocks. Each file has one, taken when it was begun, and every time in the file is reckoned from it:
/// a step of the wall clock moves no message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Anchor {
    /// The moment by the host's monotonic clock.
    pub monotonic: MonotonicNs,
    /// What the wall clock showed then: Unix time, ns.
    pub unix_ns: u64,
}

impl Anchor {
    /// The Unix time of `at`, ns; at the ends of the range when it lies beyond.
    pub fn unix_ns_of(self, at: MonotonicNs) -> u64 {
        let later_ns = at.0.saturating_sub(self.monotonic.0);
        let earlier_ns = self.monotonic.0.saturating_sub(at.0);
        self.unix_ns
            .saturating_add(later_ns)
            .saturating_sub(earlier_ns)
    }
}

/// How often a recorder writes, when it begins another file, and how much waits in memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settings {
    /// How long a message waits in memory before it is given to the disk.
    pub flush: Duration,
    /// How long a message that was given to the disk waits before it is forced onto it.
    pub sync: Duration,
    /// Another file is begun when the present one covers this span; never by time when absent.
    pub split_duration: Option<Duration>,
    /// Another file is begun when the present one has as many bytes; never by size when absent.
    pub split_bytes: Option<u64>,
    /// Bytes of messages that wait in memory. At the bound new messages are dropped and counted, until a quarter of it
    /// is free.
    pub queue_bytes: usize,
}

impl Default for Settings {
    /// Flush after 0.2 s, sync after 4 s, one file, 16 MiB in memory. The bytes of the serial line have waited for up
    /// to 0.2 s in a piece of a journal before; a kill must not cost more than 0.5 s of them.
    fn default() -> Settings {
        Settings {
            flush: Duration::from_millis(200),
            sync: Duration::from_secs(4),
            split_duration: None,
            split_bytes: None,
            queue_bytes: 16 << 20,
        }
    }
}

/// What every file of a flight says of it. What becomes known while a file is written stands in it once more, under the
/// same name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FlightInfo {
    /// The robot; its events lie in `/robotN/recording/events`.
    pub robot: RobotId,
    /// Records of metadata: name, and texts by key. The recorder adds `ril.file`, which has the anchor and the file's
    /// index.
    pub metadata: Vec<(String, BTreeMap<String, String>)>,
    /// Files that lie within each file of the recording, such as the configuration.
    pub attachments: Vec<Attachment>,
}

impl FlightInfo {
    /// Nothing is known of the flight of `robot`.
    pub(crate) fn of_nothing(robot: RobotId) -> FlightInfo {
        FlightInfo {
            robot,
            metadata: Vec::new(),
            attachments: Vec::new(),
        }
    }

    /// What it says that `before` did not.
    pub(crate) fn since(&self, before: &FlightInfo) -> FlightInfo {
        let metadata = self.metadata.iter();
        let attachments = self.attachments.iter();
        FlightInfo {
            robot: self.robot,
            metadata: metadata
                .filter(|record| !before.metadata.contains(record))
                .cloned()
                .collect(),
            attachments: attachments
                .filter(|file| !before.attachments.contains(file))
                .cloned()
                .collect(),
        }
    }
}

/// A file within a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Attachment {
    /// Name, such as `bridge.toml`.
    pub name: String,
    /// Media type, such as `application/toml`.
    pub media_type: String,
    /// Its bytes.
    pub data: Vec<u8>,
}

/// A topic of a recording.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Channel {
    /// Name of the topic, such as `/robot1/dsp_telemetry`.
    pub topic: String,
    /// Name of the message type, such as `hero_msgs/msg/DspTelemetry`.
    pub schema_name: String,
    /// The message definition with all that it needs, in the encoding `ros2msg`.
    pub schema_text: String,
    /// What else is known of the topic.
    pub metadata: BTreeMap<String, String>,
}

/// A [`Channel`] that was announced to a recorder. Good for that recorder alone, in all of its files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ChannelId(pub(crate) u16);
