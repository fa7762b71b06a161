//! What relays say to one another, and how it is written: a version, then the message as `postcard` has it.
//!
//! `docs/network.md` shows the same for other languages. A station asks for a [`ServicesPage`] of descriptions in
//! [`Part`]s, one after the other, because a slow link has no room for a schema of 256 KiB at once. Every message fits
//! into [`MAX_BYTES`], and bytes of any kind are read without a panic: what is no message is an error that the receiver
//! counts.

use std::time::Duration;

use ipc_types::schema::MAX_TEXT_LEN;
use miniz_oxide::deflate::compress_to_vec_zlib;
use miniz_oxide::inflate::decompress_to_vec_zlib_with_limit;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::orders::message::Answer;

/// Version of all messages. A relay ignores those of another version, and says so once.
pub const VERSION: u8 = 4;

/// Longest message, bytes: an [`Order`](crate::orders::message::Order).
pub const MAX_BYTES: usize = MAX_ORDER_BYTES;

/// Longest [`Ask`], bytes: the version, two tags, four numbers of at most ten bytes.
pub const MAX_ASK_BYTES: usize = 64;

/// Longest [`Reply`], bytes: a [`Part`], of which all numbers, tags and lengths have 30. An answer has 200.
pub const MAX_REPLY_BYTES: usize = PART_BYTES + 128;

/// Longest request that is carried, bytes. The longest of the robot's own has 1 kB.
pub const MAX_REQUEST_BYTES: usize = 16 * 1024;

/// Longest order, bytes: a request, and eight numbers of at most ten bytes.
pub const MAX_ORDER_BYTES: usize = MAX_REQUEST_BYTES + 96;

/// Bytes of a page in one part. With the rest of its message (at most 30 bytes), its key expression (at most 55) and
/// Zenoh's headers it fits into a batch of 4,352 bytes, so that the loss of one datagram loses one part.
pub const PART_BYTES: usize = 4096;

/// Most services of a robot: three of its own, and some of each of some twenty modules. It has as many pages at most.
pub const MAX_SERVICES: u16 = 128;

/// Longest [`ServicesPage`] before it is packed, bytes: the two longest schemas that there may be.
pub const MAX_PAGE_TEXT: usize = 2 * MAX_TEXT_LEN;

/// Longest packed [`ServicesPage`]: what cannot be made shorter becomes longer by 5 bytes of each 32 KiB, 6 bytes, and
/// what is begun of each.
const MAX_PAGE_BYTES: usize = MAX_PAGE_TEXT + MAX_PAGE_TEXT / 4096 + 64;

/// How hard a page is packed, of ten. It is done once, when its services are new.
const PACKING: u8 = 9;

/// A service of the robot, as a station knows it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Service {
    /// Last part of its name, such as `hero_telemetry`.
    pub key: String,
    /// Whether it takes requests; else it is a topic.
    pub takes_requests: bool,
    /// Text of the schema of its samples, or of its requests.
    pub schema: String,
}

/// Services of the robot, packed: those that its relay has found together. Of similar texts hardly more than one is
/// left, and over a narrow or far link a station needs few questions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServicesPage(Vec<u8>);

impl ServicesPage {
    /// Packs all of `services`, as few to a page as make each short enough, and in their order.
    pub fn of(services: &[Service]) -> Vec<ServicesPage> {
        let written = |services: &[Service]| {
            postcard::to_extend(services, Vec::new()).expect("a vector takes what is written")
        };
        let text = written(services);
        if text.len() > MAX_PAGE_TEXT && services.len() > 1 {
            let (first, rest) = services.split_at(services.len() / 2);
            return [ServicesPage::of(first), ServicesPage::of(rest)].concat();
        }
        match services.is_empty() {
            true => Vec::new(),
            false => vec![ServicesPage(compress_to_vec_zlib(&text, PACKING))],
        }
    }

    /// The part that begins at the byte `from`. `None` if there is no such byte.
    pub fn part(&self, robot_instance: u64, index: u16, from: u32) -> Option<Part> {
        let rest = self.0.get(usize::try_from(from).ok()?..)?;
        (!rest.is_empty()).then(|| Part {
            robot_instance,
            index,
            page_bytes: self.0.len() as u32,
            from,
            bytes: rest[..rest.len().min(PART_BYTES)].to_vec(),
        })
    }

    /// Whether a page may have so many bytes.
    pub fn may_have(bytes: u32) -> bool {
        usize::try_from(bytes).is_ok_and(|bytes| (1..=MAX_PAGE_BYTES).contains(&bytes))
    }

    /// The services of a page whose bytes have come. `None` if they are none, or more or longer than a page has.
    pub fn unpack(bytes: &[u8]) -> Option<Vec<Service>> {
        let text = decompress_to_vec_zlib_with_limit(bytes, MAX_PAGE_TEXT).ok()?;
        let services: Vec<Service> = postcard::from_bytes(&text).ok()?;
        let has_bounds = services.len() <= usize::from(MAX_SERVICES)
            && services.iter().all(|one| one.schema.len() <= MAX_TEXT_LEN);
        has_bounds.then_some(services)
    }
}

/// A part of a [`ServicesPage`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Part {
    /// Instance of the robot's relay.
    pub robot_instance: u64,
    /// Index of the page in that instance.
    pub index: u16,
    /// Length of the whole page, bytes.
    pub page_bytes: u32,
    /// Where in the page this part begins, bytes.
    pub from: u32,
    /// The part, at most [`PART_BYTES`] bytes.
    pub bytes: Vec<u8>,
}

/// From a station to a robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Ask {
    /// How is the link, and what is the time? Sent all the time; a robot knows by it that the station is there.
    Ping(Ping),
    /// What has the page of this index? The part of it is asked for that begins there.
    Describe {
        /// Instance of the robot's relay.
        robot_instance: u64,
        /// Which of its pages.
        index: u16,
        /// Where in the page the part begins, bytes.
        from: u32,
    },
}

/// How often a station asks the robot for its time. A loss is noticed after some of these, and the clocks need no more.
pub const PING_PERIOD: Duration = Duration::from_millis(500);

/// A station's question for the robot's time, sent as [`Ask::Ping`].
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
    /// Whether the station has had all descriptions once. Before, samples are of no use to it.
    pub has_all: bool,
    /// By how much longer the last exchange took than the quickest one of late, or is overdue, ms: what waits on the
    /// way. `None` if it does not know.
    pub late_ms: Option<u32>,
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

/// The robot's answer to a [`Ping`], sent as [`Reply::Pong`].
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
    /// How many pages describe the services that the robot's relay carries. They only become more in one instance.
    pub pages: u16,
}

/// What goes with each sample of a topic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SampleHeader {
    /// Instance of the robot's relay.
    pub robot_instance: u64,
    /// Counts the samples of this topic that the robot's relay has sent, from 1. A sample that is sent again keeps its
    /// number.
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
    /// The message has the version of another relay.
    #[error(
        "it has version {0}, this relay speaks version {VERSION}: install the same version on both machines"
    )]
    Version(u8),
    /// The bytes mean nothing.
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

    fn service(key: &str, schema: String) -> Service {
        Service {
            key: key.to_owned(),
            takes_requests: false,
            schema,
        }
    }

    #[test]
    fn services_are_packed_together_and_come_out_of_their_parts_as_they_were() {
        let layout = |of: &str| format!("# {of}\n{}", "float64 latitude_deg  # north\n".repeat(90));
        let services: Vec<_> = ["a", "b/c", "d"]
            .map(|key| service(key, layout(key)))
            .into();
        let pages = ServicesPage::of(&services);
        assert_eq!(pages.len(), 1);
        let page = &pages[0];
        assert!(page.0.len() < 300, "{} of 8 kB", page.0.len());
        assert_eq!(ServicesPage::unpack(&page.0), Some(services));
        let part = page.part(1, 0, 20).unwrap();
        assert_eq!((part.from, &part.bytes[..]), (20, &page.0[20..]));
        for from in [page.0.len() as u32, u32::MAX] {
            assert_eq!(page.part(1, 0, from), None, "{from}");
        }
        assert!(ServicesPage::of(&[]).is_empty());
    }

    #[test]
    fn services_that_are_long_together_take_several_pages_of_which_none_is_too_long() {
        let mut random = fastrand::Rng::with_seed(1);
        let mut text = || -> String { (0..MAX_TEXT_LEN).map(|_| random.alphanumeric()).collect() };
        let services: Vec<_> = ["a", "b", "c"].map(|key| service(key, text())).into();
        let pages = ServicesPage::of(&services);
        assert_eq!(pages.len(), 3);
        let unpacked = pages.iter().flat_map(|page| {
            assert!(ServicesPage::may_have(page.0.len() as u32));
            ServicesPage::unpack(&page.0).expect("a page")
        });
        assert_eq!(unpacked.collect::<Vec<_>>(), services);
    }

    #[test]
    fn bytes_that_are_no_page_are_refused_and_none_is_unpacked_without_a_bound() {
        let bomb = compress_to_vec_zlib(&vec![0; 10 * MAX_PAGE_TEXT], PACKING);
        let many = vec![service("a", String::new()); usize::from(MAX_SERVICES) + 1];
        let long = [service("a", "x".repeat(MAX_TEXT_LEN + 1))];
        let (many, long) = (&ServicesPage::of(&many)[0].0, &ServicesPage::of(&long)[0].0);
        for bytes in [&bomb, many, long, &vec![], &vec![0; 50]] {
            assert_eq!(ServicesPage::unpack(bytes), None);
        }
        assert!(!ServicesPage::may_have(0) && !ServicesPage::may_have(u32::MAX));
    }
}
