//! `kill -9` of the recorder at random moments, over and over: does every file open, without a hole, and how old is the oldest sample
//! that it lacks?

use std::collections::VecDeque;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;

use dsp_sim::random::Random;
use ipc_types::payload::{DspTelemetry, SharedStruct};
use ipc_types::schema::CDR_HEADER;
use ipc_types::{MonotonicNs, Subscriber};
use recording::read::{self, Bytes};
use ril_tests::Process;
use ril_tests::process::Signal;

use crate::crew::{Site, end, start_chain};
use crate::spread::Spread;

/// What the record promises: everything older than this is in the file.
pub const PROMISE: Duration = Duration::from_millis(500);

/// Longest time that a recorder works before it is killed: several times that between two writes, so that every phase is met.
const WORK: Duration = Duration::from_millis(1500);

/// Recorders at a time. Each has a folder of its own.
const TOGETHER: u32 = 4;

/// Samples that are remembered: at 200 a second, more than a recorder lives.
const REMEMBERED: usize = 4000;

/// What to do.
#[derive(Clone, Debug)]
pub struct Plan {
    /// How often.
    pub kills: u32,
    /// Seed of the moments.
    pub seed: u64,
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
    /// Messages in all files.
    pub messages: u64,
    /// Files that could not be read, or had a hole that they said nothing about.
    pub broken: Vec<String>,
}

impl Outcome {
    /// Whether every file was readable and nothing older than [`PROMISE`] was missing.
    pub fn is_kept(&self) -> bool {
        self.is_whole() && self.lacking.iter().all(|age| age <= PROMISE)
    }

    /// Whether every file was readable, without a hole that it says nothing about.
    pub fn is_whole(&self) -> bool {
        self.broken.is_empty()
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "| {}, {} of them before the first sample | {} | {} | {} broken |",
            self.kills,
            self.empty,
            self.lacking,
            self.messages,
            self.broken.len()
        )?;
        for broken in &self.broken {
            write!(f, "\n{broken}")?;
        }
        Ok(())
    }
}

/// Kills as planned, or until `goes_on` says no.
///
/// # Panics
///
/// When a recorder does not come up, or a process of the robot ends.
pub fn run(site: &Site, plan: &Plan, goes_on: &dyn Fn() -> bool) -> Outcome {
    let mut chance = Random::new(plan.seed, 0);
    let mut outcome = Outcome::default();
    let [sim, bridge, status] = start_chain(site);
    let mut witness = Witness::new(site);
    while outcome.kills < plan.kills && goes_on() {
        let count = TOGETHER.min(plan.kills - outcome.kills);
        let recorders: Vec<_> = (0..count)
            .map(|index| Recorder::start(site, outcome.kills + index))
            .collect();
        for recorder in recorders {
            // The moment is what is tried here, not something that is waited for.
            thread::sleep(WORK.mul_f64(chance.uniform() / f64::from(TOGETHER)));
            let folder = recorder.folder.clone();
            let killed = recorder.kill();
            witness.listen();
            outcome.kills += 1;
            outcome.judge(&folder, killed, &witness);
            match &plan.keep {
                Some(keep) => keep_files(&folder, keep, outcome.kills),
                None => fs::remove_dir_all(&folder).expect("a folder of this program"),
            }
        }
    }
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

    /// How old the first sample after `sequence` was at `moment`; nothing when it came later.
    fn age_after(&self, sequence: u64, moment: MonotonicNs) -> Duration {
        let mut after = self.samples.iter().filter(|(number, _)| *number > sequence);
        let first = after.next();
        first.map_or(Duration::ZERO, |(_, received)| moment.since(*received))
    }
}

impl Outcome {
    fn judge(&mut self, folder: &Path, killed: MonotonicNs, witness: &Witness) {
        let file = fs::read_dir(folder).ok().and_then(|mut files| files.next());
        let Some(Ok(file)) = file else {
            self.broken
                .push(format!("{}: there is no file", folder.display()));
            return;
        };
        let bytes = Bytes::open(&file.path()).expect("a file that can be read");
        match last_sample(&bytes) {
            Ok((last, messages)) => {
                self.messages += messages;
                match last {
                    Some(last) => self.lacking.push(witness.age_after(last, killed)),
                    None => self.empty += 1,
                }
            }
            Err(reason) => self
                .broken
                .push(format!("{}: {reason}", file.path().display())),
        }
    }
}

/// The number of the last sample of raw telemetry, and how many messages there are; or what is wrong.
fn last_sample(bytes: &[u8]) -> Result<(Option<u64>, u64), String> {
    let mut last = None;
    let mut count = 0;
    let check = read::check(bytes);
    for message in read::messages(bytes) {
        let message = match message {
            Ok(message) => message,
            // What was being written.
            Err(read::ReadError::Truncated { .. }) => break,
            Err(error) => return Err(error.to_string()),
        };
        count += 1;
        if message.topic == "/robot1/dsp/telemetry" {
            let sample = DspTelemetry::from_bytes(&message.data[CDR_HEADER.len()..]);
            last = sample.map(|sample| sample.sequence);
        }
    }
    for (name, topic) in &check.topics {
        let told = check.events.iter().filter(|event| event.topic == *name);
        let told: u64 = told.map(|event| event.count).sum();
        if topic.missing > told {
            return Err(format!(
                "{name} lacks {} and tells of {told}",
                topic.missing
            ));
        }
    }
    Ok((last, count))
}

fn keep_files(from: &Path, to: &Path, number: u32) {
    for file in fs::read_dir(from).expect("a folder of this program") {
        let target = to.join(format!("{number}.mcap"));
        fs::copy(file.expect("an entry").path(), target).expect("a folder for the files");
    }
    fs::remove_dir_all(from).expect("a folder of this program");
}
