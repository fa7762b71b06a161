//! `kill -9` of the recorder at random moments, over and over: does every reader open every file, is there a hole, and
//! how old is what a file lacks?
//!
//! The files stay as they were at the kill until there is a batch. Then each reader opens all of it with one process,
//! and they go.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use ipc_types::payload::{DspTelemetry, SharedStruct};
use ipc_types::schema::CDR_HEADER;
use ipc_types::{MonotonicNs, RobotId};
use recording::play::anchor_of;
use recording::read::{self, RecordFile};
use ril_tests::Process;
use ril_tests::languages::target_folder;
use ril_tests::readers::{Reader, readers_or_skip, sums::Sums};
use ril_tests::sandbox::records_in;

use crate::listener::{Heard, Listener};
use crate::site::{Site, kill, pass};
use measure::{Outcome, Times};

/// What the record promises: everything older than this is in the file.
const PROMISE: Duration = Duration::from_millis(500);

/// Longest time that a recorder works before it is killed: several times that between two writes, so that every phase
/// is met.
const WORK: Duration = Duration::from_millis(1500);

/// Recorders at a time. Each has a folder of its own.
const TOGETHER: u32 = 4;

/// Files that wait for the readers at most: some 50 MB.
const BATCH: usize = 100;

/// The raw telemetry, of which a [`Witness`] knows what was published.
const TELEMETRY: &str = "/robot1/dsp/telemetry";

/// Topics that never rest. The last two reach the recorder within the journal of the bridge.
const STEADY: [&str; 4] = [
    TELEMETRY,
    "/robot1/hero/telemetry",
    "/robot1/bridge/journal",
    "/robot1/status/journal",
];

/// Samples that are remembered: at 200 a second, more than a recorder lives.
const REMEMBERED: usize = 4000;

/// A file as it was at the kill, and what our own reader found in it.
struct Killed {
    path: PathBuf,
    sums: Sums,
}

/// Kills recorders as planned.
pub fn run(site: &Site) {
    let plan = &site.plan;
    let kills = plan.count(1000);
    let mut chance = site.chance(0);
    let mut found = Found::by(&readers_or_skip("files of killed recorders"));
    let chain = site.start_chain(plan.speed);
    let mut witness = Witness::new(site);
    let files = site.path("killed");
    fs::create_dir(&files).expect("a folder of this program");
    let mut batch = Vec::new();
    while found.kills < kills && site.goes_on() {
        let count = TOGETHER.min(kills - found.kills);
        let recorders = (found.kills..found.kills + count).map(|index| start_recorder(site, index));
        for (mut recorder, folder) in recorders.collect::<Vec<_>>() {
            pass(&mut chance, WORK / TOGETHER);
            let killed = MonotonicNs::now();
            kill(&mut recorder);
            witness.listen();
            found.kills += 1;
            let file = files.join(format!("{}.mcap", found.kills));
            if take_only_file(&folder, &file) {
                batch.push(found.judge(file, killed, &witness));
            } else {
                let none = format!("{}: there is not one file", folder.display());
                found.faults.push(none);
            }
        }
        if batch.len() >= BATCH {
            found.open(&mut batch, plan.keep.as_deref());
        }
    }
    found.open(&mut batch, plan.keep.as_deref());
    witness.telemetry.end();
    site.end(chain, true);
    site.show(found.outcome(plan.is_short));
}

/// Starts a recorder that will be killed, in a folder of its own.
fn start_recorder(site: &Site, index: u32) -> (Process, PathBuf) {
    let name = format!("record-{index}");
    let mut process = site.start(&format!("record --min-free 0 --output {name}"));
    process.wait_for_text("recording file=");
    (process, site.path(&name))
}

/// A consumer that remembers what was published last.
struct Witness {
    telemetry: Listener<(u64, MonotonicNs)>,
    samples: Vec<Heard<(u64, MonotonicNs)>>,
}

impl Witness {
    fn new(site: &Site) -> Witness {
        let number = |sample: &DspTelemetry| (sample.sequence, sample.received());
        Witness {
            telemetry: Listener::start(&site.domain, RobotId::DEFAULT, number),
            samples: Vec::new(),
        }
    }

    fn listen(&mut self) {
        self.samples
            .extend(self.telemetry.until(MonotonicNs::now()));
        let old = self.samples.len().saturating_sub(REMEMBERED);
        self.samples.drain(..old);
    }

    /// How old the first sample after `sequence` was at `moment`; zero when it came later. When this process missed
    /// that sample itself, the one before it counts, which was older.
    fn age_after(&self, sequence: u64, moment: MonotonicNs) -> Duration {
        let is_before = |heard: &Heard<(u64, MonotonicNs)>| heard.kept.0 <= sequence;
        let next = self.samples.partition_point(is_before);
        let Some((number, received)) = self.samples.get(next).map(|heard| heard.kept) else {
            return Duration::ZERO;
        };
        let before = self.samples.get(next.wrapping_sub(1));
        let received = match before {
            Some(before) if number != sequence + 1 => before.kept.1,
            _ => received,
        };
        moment.since(received)
    }
}

/// What came of the kills so far.
#[derive(Default)]
struct Found {
    kills: u32,
    /// Of those, before the recorder had written anything.
    empty: u32,
    /// How old the oldest sample that a file lacked was at the moment of the kill.
    lacking: Times,
    /// How old the last message of a topic that never rests was at the moment of the kill: all that is missing was
    /// younger.
    last: BTreeMap<&'static str, Times>,
    /// Messages in all files.
    messages: u64,
    /// Files that a reader refused or found other messages in than ours, or that had a hole that they said nothing
    /// about.
    faults: Vec<String>,
    /// The readers that others wrote and that open unfinished files: files without a complaint, messages in all files,
    /// and files in which it found exactly what our own reader found: each message of each topic, with its time and its
    /// data.
    readers: Vec<(Reader, [u64; 3])>,
}

impl Found {
    fn by(readers: &[Reader]) -> Found {
        let readers = readers.iter().cloned();
        let readers = readers.filter(|reader| reader.is_of_others() && reader.reads_unfinished());
        Found {
            readers: readers.map(|reader| (reader, [0; 3])).collect(),
            ..Found::default()
        }
    }

    /// Looks at the file of a recorder that was killed at this moment.
    fn judge(&mut self, path: PathBuf, killed: MonotonicNs, witness: &Witness) -> Killed {
        let file = RecordFile::open(&path).expect("a file that can be read");
        let sums = Sums::of(&file);
        self.messages += sums.messages();
        let hole = hole(&file);
        if let Some(reason) = sums.error.as_ref().or(hole.as_ref()) {
            self.faults.push(format!("{}: {reason}", path.display()));
        }
        match last_sample(&file) {
            Some(last) => self.lacking.push(witness.age_after(last, killed)),
            None => self.empty += 1,
        }
        for (topic, last) in last_messages(&file) {
            let times = self.last.entry(topic).or_default();
            times.push(killed.since(last));
        }
        Killed { path, sums }
    }

    /// Opens the files with all readers, each with one process, and removes or keeps them.
    fn open(&mut self, batch: &mut Vec<Killed>, kept: Option<&Path>) {
        if batch.is_empty() {
            return;
        }
        let paths: Vec<&Path> = batch.iter().map(|file| file.path.as_path()).collect();
        for (reader, [opened, messages, agreeing]) in &mut self.readers {
            for (file, found) in batch.iter().zip(reader.sums(&paths)) {
                let agrees = found.topics == file.sums.topics;
                *messages += found.messages();
                *agreeing += u64::from(agrees);
                *opened += u64::from(found.error.is_none());
                let complaint = match &found.error {
                    None if agrees => continue,
                    None => "it found other messages",
                    Some(error) => error,
                };
                let copied = copy(&file.path, &target_folder().join("tmp/refused-recordings"));
                let fault = format!("{}: {reader}: {complaint}", copied.display());
                self.faults.push(fault);
            }
        }
        for Killed { path, .. } in batch.drain(..) {
            if let Some(folder) = kept {
                copy(&path, folder);
            }
            fs::remove_file(path).expect("a file of this program");
        }
    }

    fn outcome(self, is_short: bool) -> Outcome {
        let mut outcome = Outcome::default();
        outcome.cell("kills", self.kills);
        outcome.cell("of them before the first sample", self.empty);
        outcome.cell("messages", self.messages);
        for (topic, last) in &self.last {
            outcome.note(format!("age of the last message of {topic}: {last}"));
        }
        for (reader, [opened, messages, agreeing]) in &self.readers {
            outcome.note(format!(
                "{reader}: {opened} files opened, {messages} messages, {agreeing} files as our own reader"
            ));
        }
        outcome.require(self.faults.is_empty(), self.faults.join("\n"));
        let is_kept = is_short || self.lacking.worst() <= PROMISE;
        outcome.require(is_kept, format!("older than {PROMISE:?} and missing"));
        outcome.cell("oldest sample missing", self.lacking);
        outcome
    }
}

/// Copies a file to where it stays.
fn copy(file: &Path, folder: &Path) -> PathBuf {
    fs::create_dir_all(folder).expect("a folder for the files");
    let copy = folder.join(file.file_name().expect("a file"));
    fs::copy(file, &copy).expect("a copy");
    copy
}

/// The number of the last sample of raw telemetry.
fn last_sample(file: &RecordFile) -> Option<u64> {
    let messages = read::messages(file).filter_map(Result::ok);
    let last = messages
        .filter(|message| message.topic() == TELEMETRY)
        .last()?;
    let sample = DspTelemetry::from_bytes(&last.data()[CDR_HEADER.len()..])?;
    Some(sample.sequence)
}

/// When the last message of each topic that never rests was published, of those that have one.
fn last_messages(file: &RecordFile) -> BTreeMap<&'static str, MonotonicNs> {
    let Some(anchor) = anchor_of(file) else {
        return BTreeMap::new();
    };
    let mut last = BTreeMap::new();
    for message in read::messages(file).filter_map(Result::ok) {
        if let Some(topic) = STEADY.into_iter().find(|topic| *topic == message.topic()) {
            let since_anchor = message.publish_time_ns.wrapping_sub(anchor.unix_ns);
            let at = MonotonicNs(anchor.monotonic.0.wrapping_add(since_anchor));
            last.insert(topic, at);
        }
    }
    last
}

/// A hole that the file does not report.
fn hole(file: &RecordFile) -> Option<String> {
    let check = read::check(file);
    check.topics.iter().find_map(|(name, topic)| {
        let reported = check.events.iter().filter(|event| event.topic == *name);
        let reported: u64 = reported.map(|event| event.count).sum();
        let lacks = format!("{name} lacks {} and reports {reported}", topic.missing);
        (topic.missing > reported).then_some(lacks)
    })
}

/// Moves the only file of a recorder; says whether there was one.
fn take_only_file(folder: &Path, to: &Path) -> bool {
    let files = records_in(folder);
    let is_one = files.len() == 1;
    if let [file] = &files[..] {
        fs::rename(file, to).expect("folders of this program");
    }
    let _ = fs::remove_dir_all(folder);
    is_one
}
