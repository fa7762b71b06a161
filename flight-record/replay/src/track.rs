//! [`Track`]: one journal on its way from pieces to a verdict. It drives a [`Core`] and compares what that says.

use std::collections::VecDeque;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};

use ipc_types::{JournalPiece, MonotonicNs};
use module_kit::journal::{Entry, Reader};
use serde::Deserialize;

use crate::difference::{Values, presence};
use crate::tally::Tally;
use crate::verdict::JournalVerdict;

/// A core that its journal can drive.
pub trait Core: Sized {
    /// What it can be replayed with instead of its own configuration.
    type Config;
    /// What it is given.
    type Input<'a>: Deserialize<'a>;
    /// What it says.
    type Output<'a>: Deserialize<'a>;
    /// The topic of the journal.
    const JOURNAL: &'static str;

    /// The core of a snapshot, with another configuration if one is given; `None` if it is no snapshot of this version.
    fn restore(snapshot: &[u8], against: Option<&Self::Config>) -> Option<Self>;

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

    /// The first difference between two outputs of one kind; `None` if they are the same. Without `recorded` it was said by the core
    /// alone, without `replayed` by the recording alone; with neither kind in common the caller says so.
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
    reader: Reader,
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
            reader: Reader::new(),
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
        // A snapshot from a stranger may be a core that cannot be.
        let restored = catch_unwind(AssertUnwindSafe(|| {
            C::restore(bytes, self.against.as_ref())
        }));
        self.core = restored.ok().flatten();
        self.tally.restored(at, self.core.is_some());
    }

    fn input(&mut self, at: MonotonicNs, input: C::Input<'_>) {
        self.finish_input();
        self.at = at;
        let Some(core) = &mut self.core else {
            return;
        };
        self.tally.verdict.inputs += 1;
        self.tally.reach(at);
        let said = &mut self.said;
        if catch_unwind(AssertUnwindSafe(|| core.apply(at, input, said))).is_err() {
            let values = presence("an answer", "a panic of the core");
            self.tally.differs(at, C::JOURNAL, values);
            self.stop();
        }
    }

    fn output(&mut self, recorded: &C::Output<'_>) {
        if !self.is_differing {
            let replayed = self.said.pop_front();
            self.compare(Some(recorded), replayed.as_ref());
        }
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
