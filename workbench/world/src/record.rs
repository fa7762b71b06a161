//! The recorder of a robot: its core, the subscriber before it, and a disk that fails.

use std::collections::{BTreeSet, VecDeque};

use ipc_types::payload::{HeroTelemetry, SharedStruct};
use ipc_types::schema::CDR_HEADER;
use ipc_types::{MonotonicNs, RobotId, Schema};
use recording::{
    Anchor, Channel, ChannelId, DiskError, DiskErrorKind, FileAction, FlightInfo, Recorder,
    Settings, read,
};

use crate::beliefs::Truth;
use crate::life::{Life, MS, QUEUE};
use crate::plant::Plant;

/// Unix time at the monotonic time 0.
const UNIX_NS: u64 = 1_700_000_000_000_000_000;
/// After a disk that has failed, another file is begun within this.
const RECOVERY_MS: u64 = 6_000;
/// A kill costs no message that is older than this: the flush, and a disk that answers once in a step.
const COST_MS: u64 = 300;

/// What one process has recorded.
#[derive(Default)]
struct Taken {
    files: Vec<Vec<u8>>,
    /// Sequences that its subscriber has given it, and when by the host's clock, ms.
    given: Vec<(u64, u64)>,
}

/// A robot's recorder.
pub struct Record {
    pub life: Life,
    plant: Plant,
    recorder: Recorder,
    channel: ChannelId,
    queue: VecDeque<HeroTelemetry>,
    taken: Taken,
    outstanding: Option<FileAction>,
    pub disk_fails_until: u64,
    /// The disk has failed in this life.
    has_failed: bool,
}

fn anchor(now: MonotonicNs) -> Anchor {
    Anchor {
        monotonic: now,
        unix_ns: UNIX_NS + now.0,
    }
}

impl Record {
    pub fn new(plant: Plant, now: MonotonicNs) -> Record {
        let info = FlightInfo {
            robot: RobotId::DEFAULT,
            metadata: Vec::new(),
            attachments: Vec::new(),
        };
        let mut recorder = Recorder::new(Settings::default(), info, anchor(now));
        let channel = recorder.channel(Channel {
            topic: "/robot1/hero_telemetry".to_owned(),
            schema_name: "hero_msgs/msg/HeroTelemetry".to_owned(),
            schema_text: Schema::of::<HeroTelemetry>().type_name().to_owned(),
            metadata: [].into(),
        });
        Record {
            life: Life::default(),
            plant,
            recorder,
            channel: channel.expect("room for a topic"),
            queue: VecDeque::new(),
            taken: Taken::default(),
            outstanding: None,
            disk_fails_until: 0,
            has_failed: false,
        }
    }

    /// A sample is published.
    pub fn sample(&mut self, hero: &HeroTelemetry) {
        if self.queue.len() == QUEUE {
            self.queue.pop_front();
        }
        self.queue.push_back(*hero);
    }

    /// It is awake: takes what is there, and one answer of the disk.
    pub fn step(&mut self, now: MonotonicNs, now_ms: u64) {
        for hero in self.queue.drain(..) {
            self.taken.given.push((hero.sequence, now.0 / MS));
            let mut told = hero;
            match self.plant {
                Plant::RecordMisses if hero.sequence.is_multiple_of(50) => continue,
                Plant::RecordChanges if hero.sequence.is_multiple_of(50) => told.flying ^= 1,
                _ => {}
            }
            let cdr = [&CDR_HEADER[..], told.bytes()].concat();
            let at = MonotonicNs(hero.received_ns);
            let (sequence, channel) = (hero.sequence as u32, self.channel);
            self.recorder.add(now, channel, at, sequence, &cdr);
            if self.plant == Plant::RecordsTwice && hero.sequence.is_multiple_of(50) {
                self.recorder.add(now, channel, at, sequence, &cdr);
            }
        }
        if self.recorder.deadline().is_some_and(|due| due <= now) {
            self.recorder.wake(now, anchor(now));
        }
        self.settle(now, now_ms);
    }

    fn settle(&mut self, now: MonotonicNs, now_ms: u64) {
        if let Some(action) = self.outstanding.take() {
            let result = self.perform(&action, now_ms);
            self.recorder.done(now, result);
        }
        self.outstanding = self.recorder.next();
    }

    fn perform(&mut self, action: &FileAction, now_ms: u64) -> Result<(), DiskError> {
        if self.disk_fails_until > now_ms {
            self.has_failed = true;
            return Err(DiskError {
                kind: DiskErrorKind::Failed,
                text: "the disk of the world fails".to_owned(),
            });
        }
        match action {
            FileAction::Open { .. } => self.taken.files.push(Vec::new()),
            FileAction::Write { .. }
                if self.plant == Plant::DiskLies && now_ms.is_multiple_of(70) => {}
            action => {
                if let Some(file) = self.taken.files.last_mut() {
                    action.apply_to(file);
                }
            }
        }
        Ok(())
    }

    /// It is killed: what it has not written is gone.
    ///
    /// # Errors
    /// What the files say is not what was published.
    pub fn dies(&mut self, truth: &Truth, (now, now_ms): (MonotonicNs, u64)) -> Result<(), String> {
        let fresh = Record::new(self.plant, now);
        let former = std::mem::replace(self, fresh);
        self.disk_fails_until = former.disk_fails_until;
        let is_calm = former.disk_fails_until + RECOVERY_MS < now_ms
            && former.life.stalls_until + COST_MS < now_ms;
        let until_ms = if is_calm { now.0 / MS - COST_MS } else { 0 };
        former.judge(truth, until_ms)
    }

    /// It ends in order, and every message that it was given is in its files, or counted as dropped.
    ///
    /// # Errors
    /// What the files say is not what was published.
    pub fn ends(mut self, truth: &Truth, (now, now_ms): (MonotonicNs, u64)) -> Result<(), String> {
        self.disk_fails_until = 0;
        self.step(now, now_ms);
        self.recorder.end(now);
        for _ in 0..200 {
            self.settle(now, now_ms);
        }
        let totals = self.recorder.totals();
        if !self.recorder.is_ended() || totals.added != totals.written + totals.dropped {
            return Err(format!("the recorder does not end: {totals:?}"));
        }
        let until_ms = if totals.dropped == 0 { u64::MAX } else { 0 };
        self.judge(truth, until_ms)
    }

    /// The files have what was published, once and in order, and all that was given until this moment.
    fn judge(self, truth: &Truth, until_ms: u64) -> Result<(), String> {
        let mut found = BTreeSet::new();
        let mut last = 0;
        for file in &self.taken.files {
            // A file that was cut off ends with an error.
            for message in read::messages(&file[..]).map_while(Result::ok) {
                let Some(bytes) = message.data().strip_prefix(&CDR_HEADER) else {
                    continue;
                };
                let Some(hero) = HeroTelemetry::from_bytes(bytes) else {
                    continue;
                };
                let number = hero.sequence;
                if truth.hero(number) != Some(&hero) {
                    return Err(format!(
                        "the record has a sample {number} that nobody published"
                    ));
                }
                if number <= last && !self.has_failed {
                    return Err(format!(
                        "the record has sample {number} after sample {last}"
                    ));
                }
                last = number;
                found.insert(number);
            }
        }
        let given = self.taken.given.iter();
        let mut due = given.filter(|(_, at_ms)| *at_ms <= until_ms);
        match due.find(|(number, _)| !found.contains(number)) {
            Some((number, _)) => Err(format!("the record lacks sample {number}")),
            None => Ok(()),
        }
    }
}
