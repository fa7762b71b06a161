//! [`Publications`]: what a robot's relay publishes for ROS 2, a pure value.
//!
//! The relay adds each topic that it carries, and hands on each sample that it sends. Where publications are declared
//! and samples are put is a [`Way`], which is given from outside.

use std::collections::{BTreeMap, BTreeSet};

use ipc_types::payload::{HeroTelemetry, Number, SharedStruct};
use ipc_types::{MonotonicNs, RobotId, Schema, Topic as _};
use ros_messages::{Qos, StandardMessage, UnixOffset, message};

use super::graph::{ATTACHMENT_LEN, Gid, Node, Publication, RosSession, attachment};
use crate::request::word;

/// A way out for the samples of one publication.
pub trait Way {
    /// Whether samples can go out. It may be declared in the background.
    fn is_open(&self) -> bool;

    /// Sends a sample. It may be lost.
    fn send(&self, payload: Vec<u8>, attachment: [u8; ATTACHMENT_LEN]);
}

/// The publications of one robot.
///
/// There are never more of them than topics that the relay carries, and the four standard messages.
#[derive(Debug)]
pub struct Publications<W> {
    robot: RobotId,
    session: RosSession,
    node: Node,
    has_standard: bool,
    /// By key.
    topics: BTreeMap<String, RosTopic<W>>,
    standard: BTreeMap<StandardMessage, RosPublication<W>>,
    /// Standard messages whose names are those of topics that the relay carries.
    taken: BTreeSet<StandardMessage>,
}

/// A topic that the relay carries.
#[derive(Debug)]
struct RosTopic<W> {
    publisher: RosPublication<W>,
    source_time: SourceTime,
}

/// One publication, and how many samples went out.
#[derive(Debug)]
struct RosPublication<W> {
    way: W,
    gid: Gid,
    sent: i64,
}

impl<W: Way> Publications<W> {
    /// No topics yet. `has_standard` says whether standard messages are made of `hero_telemetry`.
    pub fn new(mut session: RosSession, robot: RobotId, has_standard: bool) -> Publications<W> {
        Publications {
            node: session.node(robot),
            robot,
            session,
            has_standard,
            topics: BTreeMap::new(),
            standard: BTreeMap::new(),
            taken: BTreeSet::new(),
        }
    }

    /// The node, whose token is to be declared before any publication.
    pub fn node(&self) -> &Node {
        &self.node
    }

    /// The relay carries a topic from now on, instead of a former one with the same key. `open` is called for each
    /// publication that this needs; ways that are not needed any more are dropped. Returns the standard message that is
    /// left out from now on, because the topic has its name.
    pub fn add(
        &mut self,
        key: &str,
        schema: &Schema,
        mut open: impl FnMut(&Publication) -> W,
    ) -> Option<StandardMessage> {
        let qos = Qos::of_key(key);
        let publication = self.session.publish(&self.node, key, schema, qos);
        let mut left_out = None;
        if let Some(standard) = StandardMessage::of_key(key) {
            let is_first = self.taken.insert(standard);
            left_out = (self.has_standard && is_first).then_some(standard);
            self.standard.remove(&standard);
        }
        let topic = RosTopic {
            publisher: RosPublication::new(&publication, &mut open),
            source_time: SourceTime::of(schema),
        };
        self.topics.insert(key.to_owned(), topic);
        if key == HeroTelemetry::KEY {
            self.follow_telemetry(schema, open);
        }
        left_out
    }

    /// Standard messages can be made of the struct that this program was built with, and of no other.
    fn follow_telemetry(&mut self, schema: &Schema, mut open: impl FnMut(&Publication) -> W) {
        if schema.layout_hash() != Schema::of::<HeroTelemetry>().layout_hash() {
            return self.standard.clear();
        }
        for standard in StandardMessage::ALL {
            let is_free = !self.taken.contains(&standard) && !self.standard.contains_key(&standard);
            if self.has_standard && is_free {
                let publication = self.session.publish_standard(&self.node, standard);
                let publisher = RosPublication::new(&publication, &mut open);
                self.standard.insert(standard, publisher);
            }
        }
    }

    /// The relay sends a sample of the topic `key`. Each publication whose way is not open yet leaves it out.
    pub fn send(&mut self, key: &str, sample: &[u8], now: MonotonicNs, offset: UnixOffset) {
        let Some(topic) = self.topics.get_mut(key) else {
            return;
        };
        let unix_ns = offset.unix_ns(topic.source_time.of_sample(sample, now));
        topic.publisher.send(unix_ns, || Some(message(sample)));
        if key != HeroTelemetry::KEY || self.standard.is_empty() {
            return;
        }
        let Some(telemetry) = HeroTelemetry::from_bytes(sample) else {
            return;
        };
        for (standard, publisher) in &mut self.standard {
            publisher.send(unix_ns, || standard.write(&telemetry, self.robot, offset));
        }
    }
}

impl<W: Way> RosPublication<W> {
    fn new(
        publication: &Publication,
        open: &mut impl FnMut(&Publication) -> W,
    ) -> RosPublication<W> {
        RosPublication {
            way: open(publication),
            gid: publication.gid,
            sent: 0,
        }
    }

    fn send(&mut self, unix_ns: i64, message: impl FnOnce() -> Option<Vec<u8>>) {
        if !self.way.is_open() {
            return;
        }
        if let Some(message) = message() {
            self.sent += 1;
            let attachment = attachment(self.sent, unix_ns, &self.gid);
            self.way.send(message, attachment);
        }
    }
}

/// Fields that say when a sample was published, the better one first: when it was, and when the data came that it is
/// made of.
const TIME_FIELDS: [&str; 2] = ["published_ns", "received_ns"];

/// Where a topic's samples say when they were published.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct SourceTime {
    offsets: [Option<usize>; TIME_FIELDS.len()],
}

impl SourceTime {
    /// Of the samples that `schema` describes.
    fn of(schema: &Schema) -> SourceTime {
        SourceTime {
            offsets: TIME_FIELDS.map(|field| schema.offset_of(field, Number::U64)),
        }
    }

    /// When `sample` was published; `now` when it does not say so, or names a moment that is still to come.
    fn of_sample(self, sample: &[u8], now: MonotonicNs) -> MonotonicNs {
        let moment = |offset: usize| {
            let moment = MonotonicNs(word(sample, offset)?);
            (moment.0 != 0 && moment <= now).then_some(moment)
        };
        let moments = self.offsets.into_iter().flatten();
        moments.filter_map(moment).next().unwrap_or(now)
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;
    use std::rc::Rc;

    use ipc_types::TelemetryGroup;
    use ipc_types::payload::{DspTelemetry, ModuleState};

    use super::*;

    const NOW: MonotonicNs = MonotonicNs(5_000_000_000);
    const OFFSET: UnixOffset = UnixOffset(1_700_000_000_000_000_000);

    /// What was sent: topic, sequence, Unix time in ns.
    type Sent = Rc<RefCell<Vec<(String, i64, i64)>>>;

    #[derive(Debug)]
    struct Recorder {
        topic: String,
        is_open: bool,
        sent: Sent,
        closed: Rc<RefCell<Vec<String>>>,
    }

    impl Drop for Recorder {
        fn drop(&mut self) {
            self.closed.borrow_mut().push(self.topic.clone());
        }
    }

    impl Way for Recorder {
        fn is_open(&self) -> bool {
            self.is_open
        }

        fn send(&self, payload: Vec<u8>, attachment: [u8; ATTACHMENT_LEN]) {
            assert_eq!(payload[..4], [0, 1, 0, 0]);
            let number =
                |from: usize| i64::from_le_bytes(*attachment[from..].first_chunk().unwrap());
            let sample = (self.topic.clone(), number(0), number(8));
            self.sent.borrow_mut().push(sample);
        }
    }

    /// A robot's topics, and what goes out.
    struct Harness {
        topics: Publications<Recorder>,
        sent: Sent,
        closed: Rc<RefCell<Vec<String>>>,
        are_open: bool,
    }

    impl Harness {
        fn new(has_standard: bool) -> Harness {
            let session = RosSession::new(0, "a1");
            Harness {
                topics: Publications::new(session, RobotId::DEFAULT, has_standard),
                sent: Sent::default(),
                closed: Rc::default(),
                are_open: true,
            }
        }

        /// The topics that are published from now on, those that are not any more, and the standard message that is
        /// left out.
        fn add(
            &mut self,
            key: &str,
            schema: &Schema,
        ) -> (Vec<String>, Vec<String>, Option<StandardMessage>) {
            let mut opened = Vec::new();
            let left_out = self.topics.add(key, schema, |publication| {
                opened.push(publication.topic.clone());
                Recorder {
                    topic: publication.topic.clone(),
                    is_open: self.are_open,
                    sent: Rc::clone(&self.sent),
                    closed: Rc::clone(&self.closed),
                }
            });
            (opened, self.closed.take(), left_out)
        }

        fn send(&mut self, key: &str, sample: &[u8]) -> Vec<(String, i64, i64)> {
            self.topics.send(key, sample, NOW, OFFSET);
            self.sent.take()
        }
    }

    fn telemetry_schema() -> Schema {
        Schema::of::<HeroTelemetry>()
    }

    fn other_schema() -> Schema {
        Schema::parse("# Layout: imu.Data.v1\n\nuint64 sequence\nuint64 epoch_ns\n").unwrap()
    }

    #[test]
    fn telemetry_brings_the_standard_messages_with_it() {
        let mut harness = Harness::new(true);
        let (opened, closed, left_out) = harness.add("hero_telemetry", &telemetry_schema());
        let expected = [
            "hero_telemetry",
            "fix",
            "imu/data",
            "battery_state",
            "velocity",
        ];
        assert_eq!(opened, expected.map(|name| format!("/hero1/{name}")));
        assert_eq!((closed, left_out), (vec![], None));
        let (opened, ..) = Harness::new(false).add("hero_telemetry", &telemetry_schema());
        assert_eq!(opened, ["/hero1/hero_telemetry"]);
        let (opened, ..) = Harness::new(true).add("module_state", &Schema::of::<ModuleState>());
        assert_eq!(opened, ["/hero1/module_state"]);
    }

    #[test]
    fn each_publication_counts_what_it_sent_and_says_when_the_sample_was_published() {
        let mut harness = Harness::new(true);
        harness.add("hero_telemetry", &telemetry_schema());
        let mut telemetry = HeroTelemetry {
            published_ns: 3_000_000_000,
            ..HeroTelemetry::ZERO
        };
        let without_groups = harness.send("hero_telemetry", telemetry.bytes());
        let time = OFFSET.0 + 3_000_000_000;
        let own = "/hero1/hero_telemetry".to_owned();
        assert_eq!(without_groups, [(own.clone(), 1, time)]);
        telemetry.valid_groups = u32::from(TelemetryGroup::Supply.bit());
        let with_supply = harness.send("hero_telemetry", telemetry.bytes());
        let battery = "/hero1/battery_state".to_owned();
        assert_eq!(with_supply, [(own, 2, time), (battery, 1, time)]);
        assert_eq!(harness.send("not_relayed", telemetry.bytes()), []);
    }

    #[test]
    fn a_sample_is_left_out_uncounted_while_its_publication_is_not_declared() {
        let mut harness = Harness::new(true);
        harness.are_open = false;
        harness.add("hero_telemetry", &telemetry_schema());
        let sample = HeroTelemetry::ZERO;
        assert_eq!(harness.send("hero_telemetry", sample.bytes()), []);
        let topic = harness.topics.topics.get_mut("hero_telemetry").unwrap();
        topic.publisher.way.is_open = true;
        let sent = harness.send("hero_telemetry", sample.bytes());
        let expected = ("/hero1/hero_telemetry".to_owned(), 1, OFFSET.unix_ns(NOW));
        assert_eq!(sent, [expected]);
    }

    #[test]
    fn a_topic_that_comes_later_takes_its_name_from_the_standard_message() {
        let mut harness = Harness::new(true);
        harness.add("hero_telemetry", &telemetry_schema());
        let (opened, closed, left_out) = harness.add("imu/data", &other_schema());
        assert_eq!((opened, closed), (names(["imu/data"]), names(["imu/data"])));
        assert_eq!(left_out, Some(StandardMessage::Imu));
        let (.., left_out) = harness.add("imu/data", &other_schema());
        assert_eq!(left_out, None, "it is said once");
    }

    #[test]
    fn a_topic_that_was_there_before_keeps_its_name() {
        let mut harness = Harness::new(true);
        let (.., left_out) = harness.add("imu/data", &other_schema());
        assert_eq!(left_out, Some(StandardMessage::Imu));
        let (opened, ..) = harness.add("hero_telemetry", &telemetry_schema());
        assert!(!opened.contains(&"/hero1/imu/data".to_owned()));
        let (.., left_out) = Harness::new(false).add("imu/data", &other_schema());
        assert_eq!(left_out, None, "there are no standard messages");
    }

    #[test]
    fn a_topic_whose_struct_has_changed_replaces_the_former_one() {
        let mut harness = Harness::new(true);
        harness.add("hero_telemetry", &telemetry_schema());
        let (opened, closed, _) = harness.add("hero_telemetry", &telemetry_schema());
        let own = names(["hero_telemetry"]);
        assert_eq!(
            (opened, closed),
            (own.clone(), own.clone()),
            "only its text"
        );
        let (opened, closed, _) = harness.add("hero_telemetry", &other_schema());
        let all = names([
            "hero_telemetry",
            "fix",
            "imu/data",
            "battery_state",
            "velocity",
        ]);
        assert_eq!((opened, closed), (own, all));
        assert_eq!(
            harness
                .send("hero_telemetry", HeroTelemetry::ZERO.bytes())
                .len(),
            1
        );
    }

    fn names<const N: usize>(keys: [&str; N]) -> Vec<String> {
        keys.map(|key| format!("/hero1/{key}")).to_vec()
    }

    const SOON: MonotonicNs = MonotonicNs(1000);

    fn of_telemetry(received_ns: u64, published_ns: u64) -> u64 {
        let sample = HeroTelemetry {
            received_ns,
            published_ns,
            ..HeroTelemetry::ZERO
        };
        let source_time = SourceTime::of(&Schema::of::<HeroTelemetry>());
        source_time.of_sample(sample.bytes(), SOON).0
    }

    #[test]
    fn publishing_comes_before_receiving_and_receiving_before_now() {
        assert_eq!(of_telemetry(700, 800), 800);
        assert_eq!(of_telemetry(700, 0), 700);
        assert_eq!(of_telemetry(0, 0), SOON.0);
        let sample = DspTelemetry {
            received_ns: 600,
            ..DspTelemetry::ZERO
        };
        let source_time = SourceTime::of(&Schema::of::<DspTelemetry>());
        assert_eq!(source_time.of_sample(sample.bytes(), SOON).0, 600);
    }

    #[test]
    fn a_moment_that_is_still_to_come_is_none() {
        assert_eq!(of_telemetry(700, SOON.0 + 1), 700);
        assert_eq!(of_telemetry(u64::MAX, u64::MAX), SOON.0);
    }

    #[test]
    fn other_fields_of_these_names_and_short_samples_mean_now() {
        let text = "# Layout: a.B.v1\n\nuint64 sequence\nuint64 epoch_ns\nint64 published_ns\nuint64[2] received_ns\n";
        let schema = Schema::parse(text).unwrap();
        let source_time = SourceTime::of(&schema);
        assert_eq!(source_time, SourceTime::default());
        assert_eq!(source_time.of_sample(&[1; 40], SOON), SOON);
        let source_time = SourceTime::of(&Schema::of::<HeroTelemetry>());
        assert_eq!(source_time.of_sample(&[1; 20], SOON), SOON);
    }
}
