//! A topic of a stranger's module, and the recorder of it.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::Instant;

use ipc_types::schema::CDR_HEADER;
use ipc_types::{DynamicPublisher, Ipc, MonotonicNs};
use recording::EventKind;
use recording::read::{self, RecordCheck, RecordFile, RecordedMessage};
use ril_tests::process::WAIT_LIMIT;
use ril_tests::sandbox::records_in;
use ril_tests::{Process, Sandbox};

/// Name of the topic in a file.
pub const TOPIC: &str = "/robot1/stranger/counts";

const SCHEMA: &str = "# Layout: stranger.Counts.v1\n\nuint64 sequence\nuint64 epoch_ns\nuint64 published_ns\nuint64[64] filling\n";

/// Publishes samples that count up.
pub struct Feed {
    publisher: DynamicPublisher,
    _ipc: Ipc,
}

impl Feed {
    pub fn new(rig: &Sandbox) -> Feed {
        let ipc = rig.domain.join("stranger");
        Feed {
            publisher: DynamicPublisher::open(&ipc, "stranger/counts", SCHEMA).unwrap(),
            _ipc: ipc,
        }
    }

    /// Publishes a sample, and returns its number.
    pub fn publish(&mut self) -> u64 {
        let now = MonotonicNs::now();
        let published = self.publisher.publish(|sample| {
            sample[16..24].copy_from_slice(&now.0.to_le_bytes());
            sample[24..].fill(7);
        });
        published.unwrap()
    }
}

/// Starts `ril record` with its files in the folder `record`, and waits until it records the topic.
pub fn record(rig: &Sandbox, options: &str) -> Process {
    record_by(rig, rig.start(&words(options)))
}

/// As [`record`], of a process that was started otherwise.
pub fn record_by(_rig: &Sandbox, mut process: Process) -> Process {
    process.wait_for_text("recorded topic=\"/robot1/stranger/counts\"");
    process
}

/// The command line of a recorder.
pub fn words(options: &str) -> String {
    let min_free = match options.contains("--min-free") {
        true => "",
        false => "--min-free 0",
    };
    format!("record --output record {min_free} {options}")
}

/// The files of the recorder, the oldest first.
pub fn files(rig: &Sandbox) -> Vec<PathBuf> {
    let mut files = records_in(&rig.folder().join("record"));
    files.sort_by_key(|file| {
        let name = file.file_name().unwrap().to_str().unwrap();
        status::log::file_name::recognize(name).unwrap().1
    });
    files
}

/// The only file of the recorder.
#[track_caller]
pub fn only_file(rig: &Sandbox) -> PathBuf {
    let mut files = files(rig);
    assert_eq!(files.len(), 1, "{files:?}");
    files.remove(0)
}

/// Waits until the sample of this number is in a file.
pub fn until_recorded(rig: &Sandbox, number: u64) {
    let begun = Instant::now();
    while !files(rig).iter().any(|file| has(file, number)) {
        assert!(begun.elapsed() < WAIT_LIMIT, "{number} is in no file");
        std::thread::yield_now();
    }
}

/// Waits until the record has samples of so many publishers of a topic, one after the other.
pub fn until_publishers(rig: &Sandbox, topic: &str, publishers: usize) {
    let begun = Instant::now();
    let found = || {
        let files = files(rig).into_iter();
        let records = files.filter_map(|file| RecordFile::open(&file).ok());
        let mut epochs = BTreeSet::new();
        for record in records {
            let messages = read::messages(&record).filter_map(Result::ok);
            for message in messages.filter(|message| message.topic() == topic) {
                let payload = &message.data()[CDR_HEADER.len()..];
                epochs.insert(u64::from_le_bytes(payload[8..16].try_into().unwrap()));
            }
        }
        epochs.len()
    };
    while found() < publishers {
        assert!(
            begun.elapsed() < WAIT_LIMIT,
            "{topic}: fewer than {publishers}"
        );
        std::thread::yield_now();
    }
}

/// Whether the sample of this number is in the file, which may be empty yet, or be gone.
pub fn has(file: &Path, number: u64) -> bool {
    let Ok(bytes) = RecordFile::open(file) else {
        return false;
    };
    let mut messages = read::messages(&bytes).filter_map(Result::ok);
    messages.any(|message| message.topic() == TOPIC && sample(&message).0 == number)
}

/// What was recorded of a topic: numbers and samples without the header of CDR.
pub fn samples(file: &Path, topic: &str) -> Vec<(u64, Vec<u8>)> {
    let bytes = RecordFile::open(file).unwrap();
    let messages = read::messages(&bytes).map(Result::unwrap);
    let of_topic = messages.filter(|message| message.topic() == topic);
    of_topic.map(|message| sample(&message)).collect()
}

fn sample(message: &RecordedMessage) -> (u64, Vec<u8>) {
    let payload = &message.data()[CDR_HEADER.len()..];
    let sequence = u64::from_le_bytes(payload[..8].try_into().unwrap());
    assert_eq!(sequence as u32, message.sequence);
    (sequence, payload.to_vec())
}

/// No message lies in the file before the time that it has itself.
#[track_caller]
pub fn assert_in_time(file: &Path) {
    let bytes = RecordFile::open(file).unwrap();
    let mut messages = 0;
    for message in read::messages(&bytes).map(Result::unwrap) {
        let (logged, published) = (message.log_time_ns, message.publish_time_ns);
        assert!(
            logged >= published,
            "{} {}: {logged} {published}",
            message.topic(),
            message.sequence
        );
        messages += 1;
    }
    assert!(messages > 0);
}

/// Missing samples of a topic by the numbers of those that are there; they must be in order.
#[track_caller]
pub fn missing(samples: &[(u64, Vec<u8>)]) -> u64 {
    let pairs = samples.windows(2);
    pairs
        .map(|pair| {
            let (one, next) = (pair[0].0, pair[1].0);
            assert!(one < next, "{one} before {next}");
            next - one - 1
        })
        .sum()
}

/// How many messages the events of a file say are missing, by kind.
pub fn told(check: &RecordCheck, topic: &str) -> BTreeMap<EventKind, u64> {
    let mut told = BTreeMap::new();
    for event in check.events.iter().filter(|event| event.topic == topic) {
        *told.entry(event.kind).or_default() += event.count;
    }
    told
}

pub fn check(file: &Path) -> RecordCheck {
    read::check(&RecordFile::open(file).unwrap())
}

/// What the process has printed so far.
pub fn lines(process: &mut Process) -> Vec<String> {
    process
        .lines()
        .iter()
        .map(|line| line.text.clone())
        .collect()
}
