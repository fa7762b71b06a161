//! The core of status as a [`Core`].

use std::collections::VecDeque;

use ipc_types::payload::{HeroTelemetry, StatusJournal};
use ipc_types::{MonotonicNs, StateOf, StatusModule, Topic};
use module_kit::journal::{JournalWriter, snapshot};
use serde::{Deserialize, Serialize};
use status::config::Config;
use status::journal::Snapshot;
use status::{Input, Output};

use crate::difference::of_structs;
use crate::kept::{Beginning, SampleTaken, Streams};
use crate::track::{Compared, Core};
use crate::verdict::JournalVerdict;

/// An input of status in a kept flight.
#[derive(Serialize, Deserialize)]
#[allow(clippy::large_enum_variant)]
pub enum KeptInput {
    /// A sample that the bridge of the same flight made.
    Taken(SampleTaken),
    /// Any other input, kept whole.
    Other(Input),
}

impl Core for Snapshot {
    type Config = Config;
    type Input<'a> = Input;
    type Kept<'a> = KeptInput;
    type Output<'a> = Output;
    const JOURNAL: &'static str = StatusJournal::KEY;
    const TOPICS: &'static [&'static str] =
        &[HeroTelemetry::KEY, <StateOf<StatusModule> as Topic>::KEY];

    fn restore(snapshot: &[u8], against: Option<&Config>) -> Option<Snapshot> {
        let snapshot = Snapshot::restore(snapshot).ok()?;
        Some(match against {
            Some(config) => snapshot.against(config),
            None => snapshot,
        })
    }

    fn beginning(snapshot: &[u8]) -> Beginning<'_> {
        let restored = Snapshot::restore(snapshot).ok();
        let fresh = restored.and_then(|restored| {
            Some(Beginning::Fresh(
                restored.began()?,
                Snapshot::text_of(&restored.config).into(),
            ))
        });
        fresh.unwrap_or(Beginning::Snapshot(snapshot))
    }

    fn fresh(began: MonotonicNs, config: &str, against: Option<&Config>) -> Option<Snapshot> {
        let own = snapshot::config_of(config).ok()?;
        Some(Snapshot::fresh(against.unwrap_or(&own), began))
    }

    fn keep(at: MonotonicNs, input: Input, streams: &mut Streams, writer: &mut JournalWriter) {
        let taken = match &input {
            Input::Sample(sample) => streams.find(sample),
            _ => None,
        };
        let kept = taken.map_or(KeptInput::Other(input), KeptInput::Taken);
        writer.input(at, &kept);
    }

    fn apply_kept(
        &mut self,
        at: MonotonicNs,
        kept: KeptInput,
        streams: &mut Streams,
        said: &mut VecDeque<Output>,
    ) -> bool {
        let input = match kept {
            KeptInput::Taken(taken) => streams.take_sample(taken).map(Input::Sample),
            KeptInput::Other(input) => Some(input),
        };
        let is_there = input.is_some();
        if let Some(input) = input {
            self.apply(at, input, said);
        }
        is_there
    }

    fn snapshot(&self) -> Vec<u8> {
        Snapshot::take(&self.status, &Snapshot::text_of(&self.config))
    }

    fn apply(&mut self, at: MonotonicNs, input: Input, said: &mut VecDeque<Output>) {
        said.extend(self.status.apply(at, input));
        self.status.take_events();
    }

    fn describe(output: &Output) -> (&'static str, String) {
        match output {
            Output::Telemetry(_) => (HeroTelemetry::KEY, "a sample".to_owned()),
            Output::State(_) => (<StateOf<StatusModule> as Topic>::KEY, "a state".to_owned()),
        }
    }

    fn compare(&mut self, recorded: Option<&Output>, replayed: Option<&Output>) -> Compared {
        match (recorded, replayed) {
            (Some(Output::Telemetry(recorded)), Some(Output::Telemetry(replayed))) => {
                of_structs(recorded, replayed).into()
            }
            (Some(Output::State(recorded)), Some(Output::State(replayed))) => {
                of_structs(recorded, replayed).into()
            }
            _ => Compared::OneSided,
        }
    }

    fn count(output: &Output, verdict: &mut JournalVerdict) {
        match output {
            Output::Telemetry(sample) => verdict.count_sample(sample.received_ns),
            Output::State(_) => verdict.states += 1,
        }
    }
}
