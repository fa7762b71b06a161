//! [`Track`]: one journal on its way from pieces to a verdict. It drives a [`Core`] and compares what that says.

use std::collections::VecDeque;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};

use ipc_types::{JournalPiece, MonotonicNs};
use module_kit::journal::{Entry, JournalReader, JournalWriter};
use serde::{Deserialize, Serialize};

use crate::difference::{Values, presence};
use crate::kept::{Beginning, Digest, Streams};
use crate::tally::Tally;
use crate::verdict::JournalVerdict;

/// A core that its journal can drive.
pub trait Core: Sized {
    /// What it can be replayed with instead of its own configuration.
    type Config;
    /// What it is given.
    type Input<'a>: Deserialize<'a> + Serialize;
    /// An input as a kept flight has it.
    type Kept<'a>: Deserialize<'a> + Serialize;
    /// What it says.
    type Output<'a>: Deserialize<'a> + Serialize;
    /// The topic of the journal.
    const JOURNAL: &'static str;
    /// Where its outputs are published, by their variant.
    const TOPICS: &'static [&'static str];

    /// The core of a snapshot, with another configuration if one is given; `None` if it is no snapshot of this version.
    fn restore(snapshot: &[u8], against: Option<&Self::Config>) -> Option<Self>;

    /// How a kept flight begins with this snapshot.
    fn beginning(snapshot: &[u8]) -> Beginning<'_>;

    /// The core that begins so, with another configuration if one is given; `None` if it is none of this version.
    fn fresh(began: MonotonicNs, config: &str, against: Option<&Self::Config>) -> Option<Self>;

    /// The core of a [`Beginning`] in postcard's format.
    fn begin(beginning: &[u8], against: Option<&Self::Config>) -> Option<Self> {
        match postcard::from_bytes(beginning).ok()? {
            Beginning::Fresh(began, config) => Self::fresh(began, &config, against),
            Beginning::Snapshot(snapshot) => Self::restore(snapshot, against),
        }
    }

    /// Writes an input into a kept flight. What it refers to goes to `streams`.
    fn keep(
        at: MonotonicNs,
        input: Self::Input<'_>,
        streams: &mut Streams,
        writer: &mut JournalWriter,
    );

    /// Gives the core an input that was kept; false if `streams` have not what it refers to.
    fn apply_kept(
        &mut self,
        at: MonotonicNs,
        kept: Self::Kept<'_>,
        streams: &mut Streams,
        said: &mut VecDeque<Self::Output<'static>>,
    ) -> bool;

    /// Notes what inputs of another journal refer to.
    fn note(_said: &Self::Output<'_>, _streams: &mut Streams) {}

    /// The bytes of the core.
    fn snapshot(&self) -> Vec<u8>;

    /// Gives the core an input. What it says goes to `said`.
    fn apply(
        &mut self,
        at: MonotonicNs,
        input: Self::Input<'_>,
        said: &mut VecDeque<Self::Output<'static>>,
    );

    /// The topic on which an output would have been published, and what it is.
    fn describe(output: &Self::Output<'_>) -> (&'static str, String);

    /// The first difference between two outputs of one kind; `None` if they are the same. Without `recorded` it was
    /// said by the core alone, without `replayed` by the recording alone; with neither kind in common the caller says
    /// so.
    fn compare(
        &mut self,
        recorded: Option<&Self::Output<'_>>,
        replayed: Option<&Self::Output<'static>>,
    ) -> Compared;

    /// Counts an output that is the same.
    fn count(output: &Self::Output<'_>, verdict: &mut JournalVerdict);
}

/// What came of a comparison.
pub enum Compared {
    /// Bit for bit.
    Same,
    /// These values differ.
    Differ(Values),
    /// One side said something that the other did not.
    OneSided,
}

impl From<Option<Values>> for Compared {
    fn from(values: Option<Values>) -> Compared {
        values.map_or(Compared::Same, Compared::Differ)
    }
}

/// One journal.
pub struct Track<C: Core> {
    reader: JournalReader,
    drive: Drive<C>,
}

/// The core of a journal and what it said.
struct Drive<C: Core> {
    against: Option<C::Config>,
    /// The core from its snapshot on; `None` before the first one and after a loss.
    core: Option<C>,
    /// What the core said to the last input and was not compared yet.
    said: VecDeque<C::Output<'static>>,
    /// The last input's outputs differ: the rest of them is not compared.
    is_differing: bool,
    at: MonotonicNs,
    tally: Tally,
}

impl<C: Core> fmt::Debug for Track<C> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Track").finish_non_exhaustive()
    }
}

impl<C: Core> Track<C> {
    pub fn new(against: Option<C::Config>) -> Track<C> {
        Track {
            reader: JournalReader::new(),
            drive: Drive {
                against,
                core: None,
                said: VecDeque::new(),
                is_differing: false,
                at: MonotonicNs(0),
                tally: Tally::default(),
            },
        }
    }

    /// See [`JournalVerdict::since`].
    pub fn since(&mut self, first: MonotonicNs) {
        self.drive.tally.verdict.since = first;
    }

    /// Takes the next sample of the topic.
    pub fn take<P: JournalPiece>(&mut self, piece: &P) {
        let Track { reader, drive } = self;
        drive.tally.verdict.pieces += 1;
        drive.tally.verdict.bytes += piece.bytes_of_journal().len() as u64;
        if let Some(cause) = reader.take(piece) {
            drive.stop();
            drive.tally.broken(cause);
        }
        loop {
            let record = match reader.next::<C::Input<'_>, C::Output<'_>>() {
                Ok(None) => return,
                Ok(Some(record)) => record,
                Err(_malformed) => {
                    drive.tally.verdict.damaged += 1;
                    return drive.stop();
                }
            };
            match record.entry {
                Entry::Snapshot(bytes) => drive.snapshot(record.at, bytes),
                Entry::Input(input) => drive.input(record.at, input),
                Entry::Output(output) => drive.output(&output),
                // Nothing that is published follows from it.
                Entry::Line(_) => {}
            }
        }
    }

    /// Takes the whole journal of a kept flight.
    pub fn take_kept(&mut self, journal: Vec<u8>, streams: &mut Streams) {
        if journal.is_empty() {
            return;
        }
        let drive = &mut self.drive;
        drive.tally.verdict.pieces += 1;
        drive.tally.verdict.bytes += journal.len() as u64;
        let mut reader = JournalReader::of(journal);
        loop {
            match reader.next::<C::Kept<'_>, Digest>() {
                Ok(Some(record)) => match record.entry {
                    Entry::Snapshot(beginning) => drive.begin(record.at, beginning),
                    Entry::Input(kept) => drive.kept(record.at, kept, streams),
                    Entry::Output(digest) => drive.digest(digest, streams),
                    Entry::Line(_) => {}
                },
                Ok(None) => return,
                Err(_malformed) => {
                    drive.tally.verdict.damaged += 1;
                    return drive.stop();
                }
            }
        }
    }

    pub fn finish(self) -> JournalVerdict {
        let Track { reader, mut drive } = self;
        drive.stop();
        drive.tally.verdict.pieces_lost = reader.lost();
        drive.tally.verdict
    }
}

impl<C: Core> Drive<C> {
    /// The records before do not go on: outputs of the last input may be among what is missing.
    fn stop(&mut self) {
        self.said.clear();
        self.core = None;
        self.tally.end();
    }

    fn snapshot(&mut self, at: MonotonicNs, bytes: &[u8]) {
        self.finish_input();
        self.at = at;
        // With another configuration the core goes its own way.
        let is_own = self.against.is_none();
        let replayed = self.core.as_ref().filter(|_| is_own).map(Core::snapshot);
        self.tally
            .snapshot(at, C::JOURNAL, bytes, replayed.as_deref());
        if self.core.is_some() && !is_own {
            return self.tally.reach(at);
        }
        self.restore(at, |against| C::restore(bytes, against));
    }

    /// A kept flight begins, or goes on with another process.
    fn begin(&mut self, at: MonotonicNs, beginning: &[u8]) {
        self.stop();
        self.is_differing = false;
        self.at = at;
        self.tally.verdict.snapshots += 1;
        self.restore(at, |against| C::begin(beginning, against));
    }

    fn restore(&mut self, at: MonotonicNs, make: impl FnOnce(Option<&C::Config>) -> Option<C>) {
        // What comes from a stranger may be a core that cannot be.
        let made = catch_unwind(AssertUnwindSafe(|| make(self.against.as_ref())));
        self.core = made.ok().flatten();
        self.tally.restored(at, self.core.is_some());
    }

    fn input(&mut self, at: MonotonicNs, input: C::Input<'_>) {
        self.drive(at, |core, said| {
            core.apply(at, input, said);
            true
        });
    }

    /// Lets the core take an input; `apply` says whether it could.
    fn drive(
        &mut self,
        at: MonotonicNs,
        apply: impl FnOnce(&mut C, &mut VecDeque<C::Output<'static>>) -> bool,
    ) {
        self.finish_input();
        self.at = at;
        let Some(core) = &mut self.core else {
            return;
        };
        self.tally.verdict.inputs += 1;
        self.tally.reach(at);
        let said = &mut self.said;
        let values = match catch_unwind(AssertUnwindSafe(|| apply(core, said))) {
            Ok(true) => return,
            Ok(false) => presence("an input", "nothing that it refers to"),
            Err(_panic) => presence("an answer", "a panic of the core"),
        };
        self.tally.differs(at, C::JOURNAL, values);
        self.stop();
    }

    /// An input of a kept flight.
    fn kept(&mut self, at: MonotonicNs, kept: C::Kept<'_>, streams: &mut Streams) {
        self.drive(at, |core, said| core.apply_kept(at, kept, streams, said));
    }

    fn output(&mut self, recorded: &C::Output<'_>) {
        if !self.is_differing {
            let replayed = self.said.pop_front();
            self.compare(Some(recorded), replayed.as_ref());
        }
    }

    /// What a kept flight has of an output. Only what was recorded is noted: before a loss that may be less than what
    /// was said.
    fn digest(&mut self, recorded: Digest, streams: &mut Streams) {
        let replayed = self.said.pop_front();
        if let Some(output) = &replayed {
            C::note(output, streams);
        }
        if self.is_differing || self.core.is_none() {
            return;
        }
        let of_replayed = replayed.as_ref().map(Digest::of);
        if of_replayed == Some(recorded) {
            return self.compare(replayed.as_ref(), replayed.as_ref());
        }
        let topic = C::TOPICS.get(usize::from(recorded.variant));
        let text = |digest: Digest| format!("{:08x}", u32::from_le_bytes(digest.crc));
        let values = match replayed.as_ref().zip(of_replayed) {
            Some((output, digest)) if digest.variant == recorded.variant => Values {
                field: "digest".to_owned(),
                recorded: text(recorded),
                replayed: format!("{} ({})", text(digest), C::describe(output).1),
            },
            Some((output, _)) => presence("something else", &C::describe(output).1),
            None => presence("something", "nothing"),
        };
        self.is_differing = true;
        let topic = topic.copied().unwrap_or(C::JOURNAL);
        self.tally.differs(self.at, topic, values);
    }

    /// All outputs of the last input were read: what else the core said is not in the recording.
    fn finish_input(&mut self) {
        if !self.is_differing
            && let Some(replayed) = self.said.pop_front()
        {
            self.compare(None, Some(&replayed));
        }
        self.said.clear();
        self.is_differing = false;
    }

    fn compare(&mut self, recorded: Option<&C::Output<'_>>, replayed: Option<&C::Output<'static>>) {
        let Some(core) = &mut self.core else {
            return;
        };
        let values = match core.compare(recorded, replayed) {
            Compared::Same => {
                if let Some(output) = recorded {
                    C::count(output, &mut self.tally.verdict);
                }
                return;
            }
            Compared::Differ(values) => values,
            Compared::OneSided => {
                let nothing = || "nothing".to_owned();
                let recorded = recorded.map_or_else(nothing, |output| C::describe(output).1);
                let replayed = replayed.map_or_else(nothing, |output| C::describe(output).1);
                presence(&recorded, &replayed)
            }
        };
        let topic = match (recorded, replayed) {
            (Some(output), _) => C::describe(output).0,
            (None, Some(output)) => C::describe(output).0,
            (None, None) => return,
        };
        self.is_differing = recorded.is_some();
        self.tally.differs(self.at, topic, values);
    }
}
