//! `kill -9` of the recorder at random moments, over and over: does every reader open every file, is there a hole, and how old is
//! what a file lacks?
//!
//! The files stay as they were at the kill until there are [`BATCH`]. Then each reader opens them all with one process, and they go.

use std::collections::{BTreeMap, VecDeque};
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;

use dsp_sim::random::Random;
use ipc_types::payload::{DspTelemetry, SharedStruct};
use ipc_types::schema::CDR_HEADER;
use ipc_types::{MonotonicNs, Subscriber};
use recording::play::anchor_of;
use recording::read::{self, Bytes};
use ril_tests::Process;
use ril_tests::process::Signal;

use crate::crew::{Site, end, start_chain_at};
use crate::opened::{Killed, Opened};
use crate::readers::Reader;
use crate::spread::Spread;
use crate::sums::Sums;

/// What the record promises: everything older than this is in the file.
pub const PROMISE: Duration = Duration::from_millis(500);

/// Longest time that a recorder works before it is killed: several times that between two writes, so that every phase is met.
const WORK: Duration = Duration::from_millis(1500);

/// Recorders at a time. Each has a folder of its own.
const TOGETHER: u32 = 4;

/// Files that wait for the readers at most: some 50 MB.
const BATCH: usize = 100;

/// The raw telemetry, of which a [`Witness`] knows what was published.
const TELEMETRY: &str = "/robot1/dsp/telemetry";

/// Topics that never rest. The last two reach the recorder within the journal of the bridge.
const STEADY: [&str; 6] = [
    TELEMETRY,
    "/robot1/hero/telemetry",
    "/robot1/bridge/journal",
    "/robot1/status/journal",
    "/robot1/serial/received",
    "/robot1/serial/sent",
];

/// Samples that are remembered: at 200 a second, more than a recorder lives.
const REMEMBERED: usize = 4000;

/// What to do.
#[derive(Clone, Debug)]
pub struct Plan {
    /// How often.
    pub kills: u32,
    /// Seed of the moments.
    pub seed: u64,
    /// Simulated seconds for one of the host: 50 samples for each.
    pub speed: u32,
    /// What opens the files.
    pub readers: Vec<Reader>,
    /// Where the files go, to be opened with other programs; nowhere when absent.
    pub keep: Option<PathBuf>,
}

/// What came of it.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// How often.
    pub kills: u32,
    /// Of those, before the recorder had written anything.
    pub empty: u32,
    /// How old the oldest sample that a file lacked was at the moment of the kill.
    pub lacking: Spread,
    /// How old the last message of a topic that never rests was at the moment of the kill: all that is missing was younger.
    pub last: BTreeMap<&'static str, Spread>,
    /// Messages in all files.
    pub messages: u64,
    /// Files that our own reader could not read, or that had a hole that they said nothing about.
    pub broken: Vec<String>,
    /// What the readers of others found.
    pub opened: Vec<Opened>,
}

impl Outcome {
    /// Whether every file was readable and nothing older than [`PROMISE`] was missing.
    pub fn is_kept(&self) -> bool {
        self.is_whole() && self.lacking.iter().all(|age| age <= PROMISE)
    }

    /// Whether every file was readable for every reader, without a hole that it says nothing about.
    pub fn is_whole(&self) -> bool {
        self.broken.is_empty() && self.opened.iter().all(Opened::is_whole)
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "| kills | oldest sample missing | messages | files |\n|---|---|---|---|"
        )?;
        writeln!(
            f,
            "| {}, {} of them before the first sample | {} | {} | {} broken |",
            self.kills,
            self.empty,
            self.lacking,
            self.messages,
            self.broken.len()
        )?;
        for broken in &self.broken {
            writeln!(f, "{broken}")?;
        }
        writeln!(f, "\n| topic | age of the last message |\n|---|---|")?;
        for (topic, last) in &self.last {
            writeln!(f, "| {topic} | {last} |")?;
        }
        write!(
            f,
            "\n| reader | files opened | messages | files as our own reader |\n|---|---|---|---|"
        )?;
        self.opened
            .iter()
            .try_for_each(|opened| write!(f, "\n{opened}"))
    }
}

/// Kills as planned, or until `goes_on` says no.
///
/// # Panics
///
/// When a recorder does not come up, or a process of the robot or a reader fails.
pub fn run(site: &Site, plan: &Plan, goes_on: &dyn Fn() -> bool) -> Outcome {
    let mut chance = Random::new(plan.seed, 0);
    let mut outcome = Outcome {
        opened: Opened::by(&plan.readers),
        ..Outcome::default()
    };
    let [sim, bridge, status] = start_chain_at(site, plan.speed);
    let mut witness = Witness::new(site);
    let files = site.path("killed");
    fs::create_dir(&files).expect("a folder of this program");
    let mut batch = Vec::new();
    while outcome.kills < plan.kills && goes_on() {
        let count = TOGETHER.min(plan.kills - outcome.kills);
        let mut recorders = Vec::new();
        for index in 0..count {
            recorders.push(Recorder::start(site, outcome.kills + index));
            witness.listen();
        }
        for recorder in recorders {
            // The moment is what is tried here, not something that is waited for.
            thread::sleep(WORK.mul_f64(chance.uniform() / f64::from(TOGETHER)));
            let folder = recorder.folder.clone();
            let killed = recorder.kill();
            witness.listen();
            outcome.kills += 1;
            let file = files.join(format!("{}.mcap", outcome.kills));
            if take_only_file(&folder, &file) {
                batch.push(outcome.judge(file, killed, &witness));
            } else {
                let none = format!("{}: there is not one file", folder.display());
                outcome.broken.push(none);
            }
        }
        if batch.len() >= BATCH {
            outcome.open(&mut batch, plan);
        }
    }
    outcome.open(&mut batch, plan);
    for process in [bridge, status, sim] {
        end(process);
    }
    outcome
}

/// A recorder that will be killed.
struct Recorder {
    process: Process,
    folder: PathBuf,
}

impl Recorder {
    fn start(site: &Site, index: u32) -> Recorder {
        let name = format!("record-{index}");
        let mut process = site.start(&format!("record --min-free 0 --output {name}"));
        process.wait_for_text("recording file=");
        Recorder {
            process,
            folder: site.path(&name),
        }
    }

    /// Says when it was killed.
    fn kill(mut self) -> MonotonicNs {
        let now = MonotonicNs::now();
        self.process.signal(Signal::KILL);
        self.process.wait_exit();
        now
    }
}

/// A consumer that remembers what was published last.
struct Witness {
    telemetry: Subscriber<DspTelemetry>,
    samples: VecDeque<(u64, MonotonicNs)>,
}

impl Witness {
    fn new(site: &Site) -> Witness {
        let ipc = site.domain.join("witness");
        Witness {
            telemetry: ipc.subscriber().expect("a subscriber"),
            samples: VecDeque::new(),
        }
    }

    fn listen(&mut self) {
        let samples = &mut self.samples;
        let drained = self.telemetry.drain(|sample| {
            samples.push_back((sample.sequence, sample.received()));
            if samples.len() > REMEMBERED {
                samples.pop_front();
            }
        });
        drained.expect("a bridge that can be reached");
    }

    /// How old the first sample after `sequence` was at `moment`; nothing when it came later. When this process missed that sample
    /// itself, the one before it counts, which was older.
    fn age_after(&self, sequence: u64, moment: MonotonicNs) -> Duration {
        let next = self
            .samples
            .partition_point(|(number, _)| *number <= sequence);
        let Some((number, received)) = self.samples.get(next) else {
            return Duration::ZERO;
        };
        let before = self.samples.get(next.wrapping_sub(1));
        let received = match before {
            Some((_, before)) if *number != sequence + 1 => before,
            _ => received,
        };
        moment.since(*received)
    }
}

impl Outcome {
    /// Looks at the file of a recorder that was killed at this moment.
    fn judge(&mut self, path: PathBuf, killed: MonotonicNs, witness: &Witness) -> Killed {
        let bytes = Bytes::open(&path).expect("a file that can be read");
        let sums = Sums::of(&bytes);
        self.messages += sums.messages();
        let hole = hole(&bytes);
        if let Some(reason) = sums.error.as_ref().or(hole.as_ref()) {
            self.broken.push(format!("{}: {reason}", path.display()));
        }
        match last_sample(&bytes) {
            Some(last) => self.lacking.push(witness.age_after(last, killed)),
            None => self.empty += 1,
        }
        for (topic, last) in last_messages(&bytes) {
            let spread = self.last.entry(topic).or_default();
            spread.push(killed.since(last));
        }
        Killed { path, sums }
    }

    /// Opens the files with all readers, and removes or keeps them.
    fn open(&mut self, batch: &mut Vec<Killed>, plan: &Plan) {
        if batch.is_empty() {
            return;
        }
        for opened in &mut self.opened {
            opened.open(batch);
        }
        for Killed { path, .. } in batch.drain(..) {
            if let Some(keep) = &plan.keep {
                let name = path.file_name().expect("a file");
                fs::copy(&path, keep.join(name)).expect("a folder for the files");
            }
            fs::remove_file(path).expect("a file of this program");
        }
    }
}

/// The number of the last sample of raw telemetry.
fn last_sample(bytes: &[u8]) -> Option<u64> {
    let messages = read::messages(bytes).filter_map(Result::ok);
    let last = messages
        .filter(|message| message.topic == TELEMETRY)
        .last()?;
    let sample = DspTelemetry::from_bytes(&last.data[CDR_HEADER.len()..])?;
    Some(sample.sequence)
}

/// When the last message of each topic that never rests was published, of those that have one.
fn last_messages(bytes: &[u8]) -> BTreeMap<&'static str, MonotonicNs> {
    let Some(anchor) = anchor_of(bytes) else {
        return BTreeMap::new();
    };
    let mut last = BTreeMap::new();
    for message in read::messages(bytes).filter_map(Result::ok) {
        if let Some(topic) = STEADY.into_iter().find(|topic| *topic == message.topic) {
            let since_anchor = message.publish_time_ns.wrapping_sub(anchor.unix_ns);
            let at = MonotonicNs(anchor.monotonic.0.wrapping_add(since_anchor));
            last.insert(topic, at);
        }
    }
    last
}

/// A hole that the file does not tell of.
fn hole(bytes: &[u8]) -> Option<String> {
    let check = read::check(bytes);
    check.topics.iter().find_map(|(name, topic)| {
        let told = check.events.iter().filter(|event| event.topic == *name);
        let told: u64 = told.map(|event| event.count).sum();
        let lacks = format!("{name} lacks {} and tells of {told}", topic.missing);
        (topic.missing > told).then_some(lacks)
    })
}

/// Moves the only file of a recorder; says whether there was one.
fn take_only_file(folder: &Path, to: &Path) -> bool {
    let files = fs::read_dir(folder).map(|files| files.map(|file| file.expect("an entry").path()));
    let files: Vec<_> = files.into_iter().flatten().collect();
    let is_one = files.len() == 1;
    if let [file] = &files[..] {
        fs::rename(file, to).expect("folders of this program");
    }
    let _ = fs::remove_dir_all(folder);
    is_one
}
