//! What relays say to one another, and how it is written: a version, then the message as `postcard` has it.
//!
//! `docs/network.md` shows the same for other languages. A station asks for the description of a [`Service`] in [`Part`]s, one after the
//! other, because a slow link has no room for a schema of 256 KiB at once. Every message fits into [`MAX_BYTES`], and bytes of any kind are read
//! without a panic: what is no message is an error that the receiver counts.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::orders::message::Answer;

/// Version of all messages. A relay ignores those of another version, and says so once.
pub const VERSION: u8 = 3;

/// Longest message, bytes: an [`Order`](crate::orders::message::Order).
pub const MAX_BYTES: usize = MAX_ORDER_BYTES;

/// Longest [`Ask`], bytes: the version, two tags, four numbers of at most ten bytes.
pub const MAX_ASK_BYTES: usize = 64;

/// Longest [`Reply`], bytes: a [`Part`], of which a key has 64 bytes and all numbers, tags and lengths 26. An answer has 200.
pub const MAX_REPLY_BYTES: usize = PART_BYTES + 128;

/// Longest request that is carried, bytes. The longest of the robot's own has 1 kB.
pub const MAX_REQUEST_BYTES: usize = 16 * 1024;

/// Longest order, bytes: a request, and eight numbers of at most ten bytes.
pub const MAX_ORDER_BYTES: usize = MAX_REQUEST_BYTES + 96;

/// Bytes of a schema in one part. With the rest of its message (at most 90 bytes), its key expression (at most 55) and Zenoh's
/// headers it fits into a batch of 4,352 bytes, so that the loss of one datagram loses one part.
pub const PART_BYTES: usize = 4096;

/// Most services of a robot: three of its own, and some of each of some twenty modules.
pub const MAX_SERVICES: u16 = 128;

/// A service of the robot, as a station knows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Service {
    /// Last part of its name, such as `hero_telemetry`.
    pub key: String,
    /// Whether it takes requests; else it is a topic.
    pub takes_requests: bool,
    /// Text of the schema of its samples, or of its requests.
    pub schema: String,
}

/// A part of the description of a service.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Part {
    /// Instance of the robot's relay.
    pub robot_instance: u64,
    /// Index of the service in that instance.
    pub index: u16,
    /// See [`Service::key`].
    pub key: String,
    /// See [`Service::takes_requests`].
    pub takes_requests: bool,
    /// Length of the whole schema, bytes.
    pub schema_bytes: u32,
    /// Where in the schema this part begins, bytes.
    pub from: u32,
    /// The part, at most [`PART_BYTES`] bytes.
    pub bytes: Vec<u8>,
}

impl Service {
    /// The part of the description that begins at the byte `from` of the schema. `None` if the schema has no such byte. An empty
    /// schema has one part.
    pub fn part(&self, robot_instance: u64, index: u16, from: u32) -> Option<Part> {
        let schema = self.schema.as_bytes();
        let rest = schema.get(usize::try_from(from).ok()?..)?;
        if rest.is_empty() && from > 0 {
            return None;
        }
        Some(Part {
            robot_instance,
            index,
            key: self.key.clone(),
            takes_requests: self.takes_requests,
            schema_bytes: u32::try_from(schema.len()).ok()?,
            from,
            bytes: rest[..rest.len().min(PART_BYTES)].to_vec(),
        })
    }
}

/// From a station to a robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Ask {
    /// How is the link, and what is the time? Sent all the time; a robot knows by it that the station is there.
    Ping(Ping),
    /// What is the service of this index? The part of the answer is asked for that begins there.
    Describe {
        /// Instance of the robot's relay.
        robot_instance: u64,
        /// Which of its services.
        index: u16,
        /// Where in its schema the part begins, bytes.
        from: u32,
    },
}

/// See [`Ask::Ping`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Ping {
    /// Instance of the station's relay: a number drawn when it began.
    pub station_instance: u64,
    /// When it was sent, by the station's monotonic clock, ns.
    pub sent_ns: u64,
    /// How long the station has been suspended since its boot, ns.
    pub suspended_ns: u64,
    /// Whether the robot is to send the latest sample of each topic again, because the station may have none.
    pub wants_latest: bool,
    /// By how much longer the last exchange took than the quickest one of late, or is overdue, ms: what waits on the way.
    pub late_ms: u32,
}

/// From a robot to one station.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Reply {
    /// The answer to a ping.
    Pong(Pong),
    /// The answer to [`Ask::Describe`].
    Part(Part),
    /// What became of a request.
    Answer(Answer),
    /// The request came with a session that the robot does not know.
    UnknownSession(u64),
}

/// See [`Reply::Pong`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pong {
    /// Instance of the robot's relay.
    pub robot_instance: u64,
    /// The ping's `station_instance`.
    pub station_instance: u64,
    /// The ping's `sent_ns`.
    pub ping_sent_ns: u64,
    /// The ping's `suspended_ns`.
    pub ping_suspended_ns: u64,
    /// When the ping came, by the robot's monotonic clock, ns.
    pub received_ns: u64,
    /// When this was sent, by the robot's monotonic clock, ns.
    pub sent_ns: u64,
    /// How long the robot has been suspended since its boot, ns.
    pub suspended_ns: u64,
    /// For the requests of this instance of the station; [`NOT_PERMITTED`](crate::orders::message::NOT_PERMITTED) or
    /// [`NO_PLACE`](crate::orders::message::NO_PLACE) if it has none.
    pub session: u64,
    /// How many services the robot's relay carries. They only become more in one instance.
    pub services: u16,
}

/// What goes with each sample of a topic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SampleHeader {
    /// Instance of the robot's relay.
    pub robot_instance: u64,
    /// Counts the samples of this topic that the robot's relay has sent, from 1. A sample that is sent again keeps its number.
    pub number: u64,
    /// Samples of this topic that the robot's relay has left out so far, because of the configured rate.
    pub left_out: u64,
    /// Samples of this topic that the robot's relay has lost so far, because it did not read them in time.
    pub lost: u64,
}

/// Bytes that are no message.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoMessage {
    /// There are too many, or none.
    #[error("it has {0} bytes; a message has 1 to {MAX_BYTES}")]
    Length(usize),
    /// Another relay's version.
    #[error(
        "it has version {0}, this relay speaks version {VERSION}: install the same version on both machines"
    )]
    Version(u8),
    /// They mean nothing.
    #[error("it cannot be read ({0})")]
    Contents(postcard::Error),
}

/// How many messages could not be read. Logged at the first, and each time that the count has doubled.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unreadable(u64);

impl Unreadable {
    /// One more, under this key.
    pub fn note(&mut self, key: &str, error: &NoMessage) {
        self.0 += 1;
        if self.0.is_power_of_two() {
            tracing::warn!(key, %error, count = self.0, "unreadable messages have come");
        }
    }
}

/// Writes a message.
///
/// # Panics
///
/// Never: memory is the only thing that writing needs.
pub fn encode(message: &impl Serialize) -> Vec<u8> {
    postcard::to_extend(message, vec![VERSION]).expect("a vector takes what is written")
}

/// Reads a message.
///
/// # Errors
///
/// See [`NoMessage`].
pub fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, NoMessage> {
    if bytes.len() > MAX_BYTES {
        return Err(NoMessage::Length(bytes.len()));
    }
    match bytes.split_first() {
        None => Err(NoMessage::Length(0)),
        Some((&VERSION, message)) => match postcard::take_from_bytes(message) {
            Ok((message, [])) => Ok(message),
            Ok(_) => Err(NoMessage::Contents(
                postcard::Error::DeserializeUnexpectedEnd,
            )),
            Err(error) => Err(NoMessage::Contents(error)),
        },
        Some((&version, _)) => Err(NoMessage::Version(version)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_is_no_part_behind_the_end() {
        let service = Service {
            key: "a/b".to_owned(),
            takes_requests: false,
            schema: "x".repeat(PART_BYTES),
        };
        for from in [PART_BYTES as u32, PART_BYTES as u32 + 1, u32::MAX] {
            assert_eq!(service.part(1, 2, from), None, "{from}");
        }
    }
}
