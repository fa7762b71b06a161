//! [`PlayableFlight`]: what a recording has to play.

use std::collections::HashMap;
use std::path::Path;

use ipc_types::schema::CDR_HEADER;
use ipc_types::service::is_key;
use ipc_types::{MonotonicNs, RobotId, Schema, ServiceId};

use super::timeline::FlightNs;
use crate::notes::FILE_METADATA;
use crate::read::store::room_for;
use crate::read::{ReadError, RecordFile, RecordSource, RecordedMessage, messages, summary_of};
use crate::settings::Anchor;

/// Type of the messages that say which requests came, and what became of them. They are no samples.
pub const REQUEST_EVENT: &str = "hero_msgs/msg/RequestEvent";

/// Ends the keys of input journals. They are for verification and hold inputs of the processes themselves: no consumer
/// of a robot reads them, so they are not played.
const JOURNAL: &str = "/journal";

/// By how much a moment in a sample may be later than the message's time in the file. The recorder takes one of the
/// sample's moments as the message's time, and the others are within the same pass of the publisher.
const MAX_AHEAD_NS: u64 = 1_000_000_000;

/// A recording that can be played, in memory.
#[derive(Debug)]
pub struct PlayableFlight {
    /// All that is played, one after the other.
    bytes: Vec<u8>,
    robot: RobotId,
    topics: Vec<PlayedTopic>,
    /// In the order of their times.
    entries: Vec<IndexEntry>,
    left_out: Vec<LeftOut>,
    errors: Vec<ReadError>,
}

/// A topic that is played.
#[derive(Debug)]
pub struct PlayedTopic {
    /// Name in the file, such as `/robot1/dsp/telemetry`.
    pub topic: String,
    /// Key of the service, such as `dsp_telemetry`.
    pub key: String,
    /// Text of the schema.
    pub schema_text: String,
    /// Size of a sample, bytes.
    pub size: usize,
    /// Offsets of the moments in a sample, bytes.
    pub moments: Vec<usize>,
    /// The latest time of a message so far: a topic's order is that of the file.
    latest: FlightNs,
}

/// A topic of the file that is not played.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftOut {
    /// Name in the file.
    pub topic: String,
    /// Why.
    pub reason: String,
}

/// What a message is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlayedContent<'a> {
    /// A sample of the topic with this index, as it lay in shared memory.
    Sample(usize, &'a [u8]),
    /// A [`REQUEST_EVENT`] in CDR, with its header.
    Request(&'a [u8]),
}

/// Why a recording cannot be played.
#[derive(Debug, thiserror::Error)]
pub enum FlightError {
    /// The file cannot be read.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// It is no recording.
    #[error("{0}")]
    Read(ReadError),
    /// It has no sample of a robot's topic.
    #[error("there is no sample of a robot's topic in it")]
    NoSamples,
}

#[derive(Clone, Copy, Debug)]
struct IndexEntry {
    at: FlightNs,
    /// Index of the topic; `None` of a request.
    topic: Option<u16>,
    start: usize,
    len: usize,
}

impl PlayableFlight {
    /// Reads a file.
    ///
    /// # Errors
    /// See [`FlightError`]. A damaged file is played without what is damaged; [`PlayableFlight::errors`] has the
    /// reasons.
    pub fn open(path: &Path) -> Result<PlayableFlight, FlightError> {
        PlayableFlight::new(&RecordFile::open(path)?)
    }

    /// Reads a recording, of robot N what lies below `/robotN/`; when there are several robots, of that of the first
    /// sample.
    ///
    /// # Errors
    /// As [`PlayableFlight::open`].
    pub fn new<'a>(source: impl Into<RecordSource<'a>>) -> Result<PlayableFlight, FlightError> {
        let source = source.into();
        let mut reader = MessageReader::new(&source)?;
        for message in messages(source) {
            match message {
                Ok(message) => reader.take(&message),
                Err(ReadError::NotMcap) => return Err(FlightError::Read(ReadError::NotMcap)),
                Err(error) => reader.errors.push(error),
            }
        }
        let MessageReader {
            bytes,
            robot,
            topics,
            mut entries,
            left_out,
            errors,
            ..
        } = reader;
        let has_samples = entries.iter().any(|entry| entry.topic.is_some());
        let Some(robot) = robot.filter(|_| has_samples) else {
            let unsupported = errors.into_iter().find(ReadError::is_unsupported);
            return Err(unsupported.map_or(FlightError::NoSamples, FlightError::Read));
        };
        // Of equal times, the file's order.
        entries.sort_by_key(|entry| entry.at);
        Ok(PlayableFlight {
            bytes,
            robot,
            topics,
            entries,
            left_out,
            errors,
        })
    }

    /// The robot that was recorded.
    pub fn robot(&self) -> RobotId {
        self.robot
    }

    /// The topics that are played.
    pub fn topics(&self) -> &[PlayedTopic] {
        &self.topics
    }

    /// Topics that are not played, and why. Those that the recorder made itself, such as positions for viewers, are not
    /// named.
    pub fn left_out(&self) -> &[LeftOut] {
        &self.left_out
    }

    /// What is damaged in the file.
    pub fn errors(&self) -> &[ReadError] {
        &self.errors
    }

    /// How many messages there are to play, at least one.
    pub fn messages(&self) -> usize {
        self.entries.len()
    }

    /// When the message with this index was published.
    pub fn at(&self, index: usize) -> Option<FlightNs> {
        self.entries.get(index).map(|entry| entry.at)
    }

    /// The message with this index.
    pub fn content(&self, index: usize) -> Option<PlayedContent<'_>> {
        let entry = self.entries.get(index)?;
        let data = self.bytes.get(entry.start..entry.start + entry.len)?;
        Some(match entry.topic {
            Some(topic) => PlayedContent::Sample(usize::from(topic), data),
            None => PlayedContent::Request(data),
        })
    }

    /// How many messages are before `at`.
    pub(super) fn before(&self, at: FlightNs) -> usize {
        self.entries.partition_point(|entry| entry.at < at)
    }

    /// The last sample of each topic among the first `count` messages, in their order.
    pub(super) fn latest_before(&self, count: usize) -> Vec<usize> {
        let mut found = vec![None; self.topics.len()];
        let mut missing = found.len();
        for index in (0..count).rev() {
            if missing == 0 {
                break;
            }
            let topic = self.entries[index].topic.map(usize::from);
            if let Some(place @ None) = topic.and_then(|topic| found.get_mut(topic)) {
                *place = Some(index);
                missing -= 1;
            }
        }
        let mut found: Vec<usize> = found.into_iter().flatten().collect();
        found.sort_unstable();
        found
    }
}

/// Reads the messages of a file.
struct MessageReader {
    bytes: Vec<u8>,
    anchor: Option<Anchor>,
    robot: Option<RobotId>,
    topics: Vec<PlayedTopic>,
    /// What became of each topic: its index, or `None` if it is not played.
    known: HashMap<String, (Option<u16>, String)>,
    entries: Vec<IndexEntry>,
    left_out: Vec<LeftOut>,
    errors: Vec<ReadError>,
}

impl MessageReader {
    /// # Errors
    /// What is played may have no room in memory.
    fn new(source: &RecordSource<'_>) -> Result<MessageReader, std::io::Error> {
        Ok(MessageReader {
            bytes: room_for(source.len())?,
            anchor: anchor_of(source.clone()),
            robot: None,
            topics: Vec::new(),
            known: HashMap::new(),
            entries: Vec::new(),
            left_out: Vec::new(),
            errors: Vec::new(),
        })
    }

    fn take(&mut self, message: &RecordedMessage) {
        if message.schema_name() == REQUEST_EVENT {
            // Without an anchor, and before the first sample, its moment is not known.
            if let Some(anchor) = self.anchor {
                let at = flight_ns(anchor, message.log_time_ns);
                self.push(at, None, message.data());
            }
            return;
        }
        let Some(index) = self.topic(message) else {
            return;
        };
        let topic = &self.topics[usize::from(index)];
        let sample = message.data().strip_prefix(&CDR_HEADER);
        let Some(sample) = sample.filter(|sample| sample.len() == topic.size) else {
            return;
        };
        let newest = latest(sample, &topic.moments, u64::MAX);
        // In a file without an anchor: the sample was published at the latest moment in it.
        let anchor = *self.anchor.get_or_insert(Anchor {
            monotonic: MonotonicNs(newest.unwrap_or(message.publish_time_ns)),
            unix_ns: message.publish_time_ns,
        });
        let logged = flight_ns(anchor, message.log_time_ns).0;
        let within = logged.saturating_add(MAX_AHEAD_NS);
        let published = latest(sample, &topic.moments, within).map_or(logged, |at| at.max(logged));
        let topic = &mut self.topics[usize::from(index)];
        topic.latest = topic.latest.max(FlightNs(published));
        let at = topic.latest;
        self.push(at, Some(index), sample);
    }

    fn push(&mut self, at: FlightNs, topic: Option<u16>, data: &[u8]) {
        let start = self.bytes.len();
        self.bytes.extend_from_slice(data);
        self.entries.push(IndexEntry {
            at,
            topic,
            start,
            len: data.len(),
        });
    }

    /// The index of the message's topic; `None` if it is not played.
    fn topic(&mut self, message: &RecordedMessage) -> Option<u16> {
        if let Some((index, text)) = self.known.get(message.topic()) {
            // After a change of its layout, a topic is another one, which a robot cannot have at the same time.
            return index.filter(|_| text == message.schema_text());
        }
        let index = self.new_topic(message);
        let known = (index, message.schema_text().to_owned());
        self.known.insert(message.topic().to_owned(), known);
        index
    }

    fn new_topic(&mut self, message: &RecordedMessage) -> Option<u16> {
        let (robot, key) = key_of(message.topic())?;
        if key.ends_with(JOURNAL) {
            return None;
        }
        // What the recorder made itself has types that are none of the contract's.
        let schema = Schema::parse(message.schema_text()).ok()?;
        let is_sample = ["sequence", "epoch_ns"].map(|field| schema.number(field).is_some());
        if is_sample != [true, true] {
            return None;
        }
        let reason = match self.robot {
            Some(first) if first != robot => Some("it is another robot's".to_owned()),
            _ if u16::try_from(self.topics.len()).is_err() => Some("too many topics".to_owned()),
            _ => None,
        };
        if let Some(reason) = reason {
            self.left_out.push(LeftOut {
                topic: message.topic().to_owned(),
                reason,
            });
            return None;
        }
        self.robot = Some(robot);
        self.topics.push(PlayedTopic {
            topic: message.topic().to_owned(),
            key: key.to_owned(),
            schema_text: message.schema_text().to_owned(),
            size: schema.size(),
            moments: schema.moments(),
            latest: FlightNs(0),
        });
        u16::try_from(self.topics.len() - 1).ok()
    }
}

/// The latest of the moments in a sample that is not after `bound`; `None` if there is none.
pub(super) fn latest(sample: &[u8], moments: &[usize], bound: u64) -> Option<u64> {
    let words = moments.iter().filter_map(|offset| {
        let word = sample.get(*offset..)?.first_chunk()?;
        Some(u64::from_le_bytes(*word))
    });
    words
        .filter(|moment| *moment != 0 && *moment <= bound)
        .max()
}

/// A Unix time of the file by the monotonic clock of then.
pub(super) fn flight_ns(anchor: Anchor, unix_ns: u64) -> FlightNs {
    let ahead_ns = i128::from(unix_ns) - i128::from(anchor.unix_ns);
    let at_ns = i128::from(anchor.monotonic.0) + ahead_ns;
    FlightNs(u64::try_from(at_ns.max(0)).unwrap_or(u64::MAX))
}

/// The moment by both clocks that the file's metadata has.
pub fn anchor_of<'a>(source: impl Into<RecordSource<'a>>) -> Option<Anchor> {
    let metadata = summary_of(source).ok()?.metadata;
    let (_, entries) = metadata.iter().find(|(name, _)| name == FILE_METADATA)?;
    let number = |key| entries.get(key)?.parse().ok();
    Some(Anchor {
        monotonic: MonotonicNs(number("anchor_monotonic_ns")?),
        unix_ns: number("anchor_unix_ns")?,
    })
}

/// The robot and the key of the service that was recorded as `topic`: of `/robot7/dsp/telemetry` 7 and `dsp_telemetry`.
/// `None` if it is no name of a robot's topic.
pub fn key_of(topic: &str) -> Option<(RobotId, &str)> {
    let (number, name) = topic.strip_prefix("/robot")?.split_once('/')?;
    let robot = RobotId::new(number.parse().ok()?)?;
    let key = match name {
        "dsp/telemetry" => ServiceId::DspTelemetry.key(),
        "hero/telemetry" => ServiceId::HeroTelemetry.key(),
        "bridge/state" => ServiceId::ModuleState.key(),
        _ => name,
    };
    is_key(key).then_some((robot, key))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_are_services_of_a_robot() {
        for (topic, expected) in [
            ("/robot7/dsp/telemetry", Some((7, "dsp_telemetry"))),
            ("/robot1/hero/telemetry", Some((1, "hero_telemetry"))),
            ("/robot1/bridge/state", Some((1, "module_state"))),
            ("/robot2/status/state", Some((2, "status/state"))),
            ("/robot0/status/state", None),
            ("/robot1/Bad Name", None),
            ("/robot1", None),
            ("/tf", None),
            ("", None),
        ] {
            let found = key_of(topic).map(|(robot, key)| (robot.get(), key));
            assert_eq!(found, expected, "{topic}");
        }
    }
}
