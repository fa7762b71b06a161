//! A live consumer, and what it saw beside what a reader finds in a file.

use std::collections::BTreeMap;
use std::thread::{self, JoinHandle};

use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use ipc_types::{DynamicSubscriber, Schema, Source, Waiter, Wake, dynamic};
use ril_tests::TestDomain;
use ril_tests::process::WAIT_LIMIT;
use ril_tests::readers::Reader;
use ril_tests::readers::expected::{Expected, Line, Read, fields_of, text};

/// A topic of a module that nothing here was built with.
pub const STRANGER_KEY: &str = "battery_watch/battery";

/// What the stranger's samples are filled with; the last one has another filling.
pub const FILLING: u8 = 0x41;
pub const LAST_FILLING: u8 = 0x42;

/// Keys of the topics that the consumer reads, and their names in a file.
const TOPICS: [(&str, &str); 5] = [
    ("dsp_telemetry", "/robot1/dsp/telemetry"),
    ("hero_telemetry", "/robot1/hero/telemetry"),
    ("module_state", "/robot1/bridge/state"),
    ("status/state", "/robot1/status/state"),
    (STRANGER_KEY, "/robot1/battery_watch/battery"),
];

/// A consumer on a thread of its own, which keeps all that it gets.
pub struct Consumer(JoinHandle<Seen>);

/// What a consumer saw of a topic: fields by `epoch_ns` and `sequence`.
#[derive(Default)]
struct Topic {
    samples: BTreeMap<(u64, u64), Vec<String>>,
    lost: u64,
}

/// What a consumer saw, by topic.
pub struct Seen(BTreeMap<&'static str, Topic>);

impl Consumer {
    /// Returns when it is subscribed.
    pub fn start(domain: &TestDomain) -> Consumer {
        let ipc = domain.join("consumer");
        let schema = |key: &str| match key {
            "dsp_telemetry" => Schema::of::<DspTelemetry>(),
            "hero_telemetry" => Schema::of::<HeroTelemetry>(),
            "module_state" => Schema::of::<ModuleState>(),
            key => dynamic::schema_of(&ipc, key).unwrap(),
        };
        let open = |(key, topic): (&str, _)| {
            (
                DynamicSubscriber::open(&ipc, key, &schema(key)).unwrap(),
                topic,
                Topic::default(),
            )
        };
        let mut topics = TOPICS.map(open);
        Consumer(thread::spawn(move || {
            let waiter = Waiter::new();
            while !drain(&mut topics) {
                let mut sources = topics
                    .each_mut()
                    .map(|(port, ..)| ((), port as &mut dyn Source));
                let wake = waiter.wait(&mut sources, Some(WAIT_LIMIT)).unwrap();
                assert_ne!(wake, Wake::TimedOut, "the last sample did not come");
            }
            Seen(topics.map(|(_, topic, seen)| (topic, seen)).into())
        }))
    }

    /// What it saw up to the stranger's last sample.
    pub fn end(self) -> Seen {
        self.0.join().unwrap()
    }
}

/// Takes all samples that are there; whether the stranger's last one was among them.
fn drain(topics: &mut [(DynamicSubscriber, &'static str, Topic); 5]) -> bool {
    let mut is_last = false;
    for (port, _, seen) in topics {
        let schema = port.schema().clone();
        let is_stranger = port.key() == STRANGER_KEY;
        let taken = port.drain(|sample| {
            let [sequence, epoch_ns] =
                [0, 8].map(|at| u64::from_le_bytes(sample[at..at + 8].try_into().unwrap()));
            seen.samples
                .insert((epoch_ns, sequence), fields_of(&schema, sample));
            is_last |= is_stranger && sample.last() == Some(&LAST_FILLING);
        });
        taken.unwrap();
        seen.lost = port.losses().lost;
    }
    is_last
}

/// `epoch_ns` and `sequence` of a message.
fn key(line: &Line) -> (u64, u64) {
    let number = |name: &str| {
        let mut values = line
            .fields
            .iter()
            .filter_map(|field| field.strip_prefix(name));
        values.next().unwrap().parse().unwrap()
    };
    (number("epoch_ns="), number("sequence="))
}

/// Samples of `topic` that did not come to the recorder, by the events in the file: a machine that stands still costs
/// some.
fn missed(read: &Read, topic: &str) -> u64 {
    let events = read.messages.get("/robot1/recording/events");
    let events = events.into_iter().flatten();
    let is_gap = |line: &&Line| {
        let has =
            |name: &str, value: &str| line.fields.contains(&format!("{name}={}", text(value)));
        has("kind", "gap") && has("topic", topic)
    };
    let count = |line: &Line| {
        let mut counts = line
            .fields
            .iter()
            .filter_map(|field| field.strip_prefix("count="));
        counts.next().unwrap().parse::<u64>().unwrap()
    };
    events.filter(is_gap).map(count).sum()
}

impl Seen {
    /// Each sample that the consumer saw while the recorder ran is in the file as it was, or its loss is; and it saw
    /// each sample of that time that is in the file, but those that it knows to have lost.
    #[track_caller]
    pub fn assert_recorded(&self, read: &Read, reader: &Reader) {
        for (topic, seen) in &self.0 {
            let lines = read
                .messages
                .get(*topic)
                .unwrap_or_else(|| panic!("{reader}: no {topic}"));
            let recorded: BTreeMap<_, _> = lines.iter().map(|line| (key(line), line)).collect();
            assert_eq!(recorded.len(), lines.len(), "{reader}: {topic} twice");
            let (first, _) = recorded.first_key_value().unwrap();
            let (mut compared, mut missing) = (0, Vec::new());
            for (key, fields) in seen.samples.range(first..) {
                let Some(line) = recorded.get(key) else {
                    missing.push(key);
                    continue;
                };
                assert_eq!(&line.fields, fields, "{reader}: {key:?} of {topic}");
                compared += 1;
            }
            let missed = missed(read, topic);
            assert!(
                missing.len() as u64 <= missed,
                "{reader}: {missing:?} of {topic} were seen and are not in the file, which misses {missed}"
            );
            assert!(compared > 0, "{reader}: nothing of {topic} was seen");
            let (first, last) = (
                seen.samples.first_key_value().unwrap().0,
                seen.samples.last_key_value().unwrap().0,
            );
            let in_file = recorded.range(first..=last).count() as u64;
            assert!(
                in_file <= compared + seen.lost,
                "{reader}: {in_file} of {topic}, {compared} seen, {} lost",
                seen.lost
            );
        }
    }

    /// A file that ends early has what the finished one has, without a hole that it does not say.
    #[track_caller]
    pub fn assert_without_hole(&self, read: &Read, all: &Expected, reader: &Reader) {
        for topic in self.0.keys() {
            let lines = &read
                .messages
                .get(*topic)
                .unwrap_or_else(|| panic!("{reader}: no {topic}"))[..];
            let all: BTreeMap<_, _> = all.0[*topic]
                .iter()
                .map(|line| (key(line), &line.fields))
                .collect();
            let holes: u64 = lines
                .windows(2)
                .map(|pair| [&pair[0], &pair[1]].map(key))
                .filter(|[before, next]| before.0 == next.0)
                .map(|[before, next]| next.1 - before.1 - 1)
                .sum();
            let missed = missed(read, topic);
            assert!(
                holes <= missed,
                "{reader}: {holes} of {topic} are missing, and events say {missed}"
            );
            let compared = lines
                .iter()
                .filter_map(|line| Some((all.get(&key(line))?, &line.fields)));
            compared.for_each(|(all, fields)| assert_eq!(fields, *all, "{reader}: {topic}"));
        }
    }
}
