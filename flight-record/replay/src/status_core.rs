//! The core of status as a [`Core`].

use std::collections::VecDeque;

use ipc_types::payload::{HeroTelemetry, StatusJournal};
use ipc_types::{MonotonicNs, StateOf, StatusModule, Topic};
use status::config::Config;
use status::journal::Snapshot;
use status::{Input, Output};

use crate::difference::of_structs;
use crate::track::{Compared, Core};
use crate::verdict::JournalVerdict;

impl Core for Snapshot {
    type Config = Config;
    type Input<'a> = Input;
    type Output<'a> = Output;
    const JOURNAL: &'static str = StatusJournal::KEY;

    fn restore(snapshot: &[u8], against: Option<&Config>) -> Option<Snapshot> {
        let snapshot = Snapshot::restore(snapshot).ok()?;
        Some(match against {
            Some(config) => snapshot.against(config),
            None => snapshot,
        })
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
            Output::Telemetry(_) => verdict.samples += 1,
            Output::State(_) => verdict.states += 1,
        }
    }
}
