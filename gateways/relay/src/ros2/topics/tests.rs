use std::cell::RefCell;
use std::rc::Rc;

use ipc_types::TelemetryGroup;
use ipc_types::payload::ModuleState;

use super::*;

const NOW: MonotonicNs = MonotonicNs(5_000_000_000);
const OFFSET: UnixOffset = UnixOffset(1_700_000_000_000_000_000);

/// What was sent: topic, sequence, Unix time in ns.
type Sent = Rc<RefCell<Vec<(String, i64, i64)>>>;

#[derive(Clone, Debug)]
struct Recorder {
    topic: String,
    is_open: bool,
    sent: Sent,
}

impl Way for Recorder {
    fn is_open(&self) -> bool {
        self.is_open
    }

    fn send(&self, payload: Vec<u8>, attachment: [u8; ATTACHMENT_LEN]) {
        assert_eq!(payload[..4], [0, 1, 0, 0]);
        let number = |from: usize| i64::from_le_bytes(*attachment[from..].first_chunk().unwrap());
        let sample = (self.topic.clone(), number(0), number(8));
        self.sent.borrow_mut().push(sample);
    }
}

/// A robot's topics, and what goes out.
struct Harness {
    topics: Topics<Recorder>,
    sent: Sent,
    are_open: bool,
}

impl Harness {
    fn new(has_standard: bool) -> Harness {
        let session = Session::new(0, "a1").unwrap();
        Harness {
            topics: Topics::new(session, RobotId::DEFAULT, has_standard),
            sent: Sent::default(),
            are_open: true,
        }
    }

    /// The topics that are published from now on, those that are not any more, and the standard message that is left out.
    fn add(
        &mut self,
        key: &str,
        schema: &Schema,
    ) -> (Vec<String>, Vec<String>, Option<StandardMessage>) {
        let mut opened = Vec::new();
        let change = self.topics.add(key, schema, |publication| {
            opened.push(publication.topic.clone());
            Recorder {
                topic: publication.topic.clone(),
                is_open: self.are_open,
                sent: Rc::clone(&self.sent),
            }
        });
        let change = change.unwrap();
        let closed = change.closed.into_iter().map(|way| way.topic);
        (opened, closed.collect(), change.left_out)
    }

    fn send(&mut self, key: &str, sample: &[u8]) -> Vec<(String, i64, i64)> {
        self.topics.send(key, sample, NOW, OFFSET);
        self.sent.take()
    }
}

fn telemetry_schema() -> Schema {
    Schema::of::<HeroTelemetry>()
}

fn stranger() -> Schema {
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
    let (opened, closed, left_out) = harness.add("imu/data", &stranger());
    assert_eq!((opened, closed), (names(["imu/data"]), names(["imu/data"])));
    assert_eq!(left_out, Some(StandardMessage::Imu));
    let (.., left_out) = harness.add("imu/data", &stranger());
    assert_eq!(left_out, None, "it is said once");
}

#[test]
fn a_topic_that_was_there_before_keeps_its_name() {
    let mut harness = Harness::new(true);
    let (.., left_out) = harness.add("imu/data", &stranger());
    assert_eq!(left_out, Some(StandardMessage::Imu));
    let (opened, ..) = harness.add("hero_telemetry", &telemetry_schema());
    assert!(!opened.contains(&"/hero1/imu/data".to_owned()));
    let (.., left_out) = Harness::new(false).add("imu/data", &stranger());
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
    let (opened, closed, _) = harness.add("hero_telemetry", &stranger());
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

#[test]
fn a_name_that_ros_2_cannot_have_changes_nothing() {
    let mut harness = Harness::new(true);
    let added = harness
        .topics
        .add("no key", &stranger(), |_| unreachable!());
    assert_eq!(added.map(|_| ()), Err(NameError::Key("no key".to_owned())));
}

fn names<const N: usize>(keys: [&str; N]) -> Vec<String> {
    keys.map(|key| format!("/hero1/{key}")).to_vec()
}
