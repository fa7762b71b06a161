//! Recordings made for tests: topics with a number and a moment.

use ipc_types::schema::CDR_HEADER;
use ipc_types::{MonotonicNs, RobotId};
use recording::play::PlayableFlight;
use recording::{Anchor, Channel, ChannelId, FlightInfo, Recorder, Settings};

/// Unix time minus monotonic time.
pub const UNIX_NS: u64 = 1_700_000_000_000_000_000;

/// When recordings begin, ms.
pub const START_MS: u64 = 5_000;

/// A sample: a count, the publisher's start, a moment and a number.
pub const SCHEMA: &str = "\
# A value.
#
# Layout: test.Value.v1

uint64 sequence
uint64 epoch_ns
uint64 measured_ns
uint64 value
";

/// Makes a recording.
pub struct Made {
    recorder: Recorder,
    now: MonotonicNs,
}

impl Made {
    pub fn new() -> Made {
        let now = MonotonicNs(START_MS * 1_000_000);
        let anchor = Anchor {
            monotonic: now,
            unix_ns: UNIX_NS + now.0,
        };
        let info = FlightInfo {
            robot: RobotId::new(7).expect("a number"),
            metadata: Vec::new(),
            attachments: Vec::new(),
        };
        Made {
            recorder: Recorder::new(Settings::default(), info, anchor),
            now,
        }
    }

    pub fn channel(&mut self, topic: &str, name: &str, schema_text: &str) -> ChannelId {
        let channel = Channel {
            topic: topic.to_owned(),
            schema_name: name.to_owned(),
            schema_text: schema_text.to_owned(),
            metadata: Default::default(),
        };
        self.recorder.channel(channel).expect("room")
    }

    pub fn values(&mut self, topic: &str) -> ChannelId {
        self.channel(topic, "test_msgs/msg/Value", SCHEMA)
    }

    /// A sample that was measured at `measured_ms`, at `ms` after the beginning.
    pub fn value(&mut self, channel: ChannelId, ms: u64, measured_ms: u64, value: u64) {
        let measured_ns = match measured_ms {
            0 => 0,
            ms => (START_MS + ms) * 1_000_000,
        };
        let sample = [value, 1, measured_ns, value].map(u64::to_le_bytes);
        let message = [&CDR_HEADER[..], &sample.concat()].concat();
        self.message(channel, ms, &message);
    }

    pub fn message(&mut self, channel: ChannelId, ms: u64, message: &[u8]) {
        self.now = MonotonicNs((START_MS + ms) * 1_000_000);
        self.recorder.add(self.now, channel, self.now, 0, message);
    }

    pub fn file(mut self) -> Vec<u8> {
        let mut file = Vec::new();
        self.recorder.end(self.now);
        while let Some(action) = self.recorder.next() {
            action.apply_to(&mut file);
            self.recorder.done(self.now, Ok(()));
        }
        file
    }

    pub fn flight(self) -> PlayableFlight {
        flight_of(&self.file()).expect("a flight")
    }
}

/// The flight in a file with these bytes.
pub fn flight_of(bytes: &[u8]) -> Result<PlayableFlight, recording::play::FlightError> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("flight.mcap");
    std::fs::write(&path, bytes).expect("a file");
    PlayableFlight::open(&path)
}
