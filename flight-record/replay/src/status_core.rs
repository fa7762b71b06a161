//! [`StatusCore`]: status' core, driven by its journal.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};

use ipc_types::module::State;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, StatusJournal};
use ipc_types::{MonotonicNs, StateOf, StatusModule, Topic};
use module_kit::journal::bytes::Malformed;
use status::config::Config;
use status::journal::{Decoder, Entry, Input, Output, Snapshot};

use crate::difference::{of_structs, presence};
use crate::tally::Tally;
use crate::track::Driven;

/// Where the state is published.
const STATE: &str = <StateOf<StatusModule> as Topic>::KEY;

/// See the module's documentation.
pub struct StatusCore {
    decoder: Decoder,
    /// The core from its snapshot on; nothing before the first one, and after a loss.
    snapshot: Option<Snapshot>,
    /// The configuration to replay with.
    against: Option<Config>,
    /// The sample that was translated last.
    dsp: DspTelemetry,
    /// What the core gave to the last input, and is not compared yet.
    said: Option<Output>,
    at: MonotonicNs,
}

impl fmt::Debug for StatusCore {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("StatusCore").finish_non_exhaustive()
    }
}

impl StatusCore {
    pub fn new(against: Option<Config>) -> StatusCore {
        StatusCore {
            decoder: Decoder::new(),
            snapshot: None,
            against,
            dsp: DspTelemetry::default(),
            said: None,
            at: MonotonicNs(0),
        }
    }

    fn snapshot(&mut self, at: MonotonicNs, bytes: &[u8], tally: &mut Tally) {
        self.finish_input(tally);
        self.at = at;
        // With another configuration it goes its own way.
        let is_own = self.against.is_none();
        let replayed = self
            .snapshot
            .as_ref()
            .filter(|_| is_own)
            .map(|Snapshot { config, status }| Snapshot::take(status, &Snapshot::text_of(config)));
        tally.snapshot(at, StatusJournal::KEY, bytes, replayed.as_deref());
        if self.snapshot.is_some() && !is_own {
            return tally.reach(at);
        }
        // A snapshot from a stranger may be a core that cannot be.
        let restored = catch_unwind(AssertUnwindSafe(|| {
            let snapshot = Snapshot::restore(bytes).ok()?;
            Some(match &self.against {
                Some(config) => snapshot.against(config),
                None => snapshot,
            })
        }));
        self.snapshot = restored.ok().flatten();
        tally.restored(at, self.snapshot.is_some());
    }

    fn input(&mut self, at: MonotonicNs, input: &Input, tally: &mut Tally) {
        self.finish_input(tally);
        self.at = at;
        let Some(Snapshot { status, .. }) = &mut self.snapshot else {
            return;
        };
        tally.verdict.inputs += 1;
        tally.reach(at);
        let (said, dsp) = (&mut self.said, &mut self.dsp);
        let applied = catch_unwind(AssertUnwindSafe(|| match *input {
            Input::Translate(sample) => {
                *dsp = sample;
                let hero = HeroTelemetry {
                    sequence: 0,
                    epoch_ns: 0,
                    ..status.translate(dsp, at)
                };
                *said = Some(Output::Telemetry(hero));
            }
            Input::Record(is_published) => {
                let outcome = match is_published {
                    true => Ok(()),
                    false => Err(String::new()),
                };
                status.record(outcome, at);
            }
            Input::Step(counts) => {
                status.count(counts, at);
                status.on_time(at);
            }
            Input::State { always } => {
                if status.take_state_changed() || always {
                    *said = Some(Output::State(status.state()));
                }
            }
        }));
        status.take_events();
        if applied.is_err() {
            tally.differs(
                at,
                StatusJournal::KEY,
                presence("an answer", "a panic of the core"),
            );
            self.drop_core(tally);
        }
    }

    fn output(&mut self, output: &Output, tally: &mut Tally) {
        if self.snapshot.is_none() {
            return;
        }
        let (topic, values) = match (output, self.said.take()) {
            (Output::Telemetry(recorded), Some(Output::Telemetry(replayed))) => {
                (HeroTelemetry::KEY, of_structs(recorded, &replayed))
            }
            (Output::State(recorded), Some(Output::State(replayed))) => {
                (STATE, of_structs(recorded, &replayed))
            }
            (recorded, said) => {
                let (topic, what) = topic_of(recorded);
                let replayed = said.map_or("nothing", |said| topic_of(&said).1);
                (topic, Some(presence(what, replayed)))
            }
        };
        match (values, output) {
            (Some(values), _) => tally.differs(self.at, topic, values),
            (None, Output::Telemetry(_)) => tally.verdict.samples += 1,
            (None, Output::State(_)) => tally.verdict.states += 1,
        }
    }

    /// All outputs of the last input were read: whatever else the core said is not in the recording.
    fn finish_input(&mut self, tally: &mut Tally) {
        if let Some(said) = self.said.take() {
            let (topic, what) = topic_of(&said);
            tally.differs(self.at, topic, presence("nothing", what));
        }
    }

    fn drop_core(&mut self, tally: &mut Tally) {
        self.said = None;
        self.snapshot = None;
        tally.end();
    }
}

impl Driven for StatusCore {
    fn stop(&mut self, tally: &mut Tally) {
        // Outputs of the last input may be among what is missing.
        self.drop_core(tally);
    }

    fn take(&mut self, record: &[u8], tally: &mut Tally) -> Result<(), Malformed> {
        let record = self.decoder.decode(record)?;
        match record.entry {
            Entry::Snapshot(bytes) => self.snapshot(record.at, &bytes, tally),
            Entry::Input(input) => self.input(record.at, &input, tally),
            Entry::Output(output) => self.output(&output, tally),
        }
        Ok(())
    }
}

fn topic_of(output: &Output) -> (&'static str, &'static str) {
    match output {
        Output::Telemetry(_) => (HeroTelemetry::KEY, "a sample"),
        Output::State(State { .. }) => (STATE, "a state"),
    }
}
