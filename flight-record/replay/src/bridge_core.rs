//! [`BridgeCore`]: the bridge's core, driven by its journal.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};

use bridge::journal::{Decoder, Entry, Input, Output, Snapshot};
use bridge::outputs::{Notice, Outputs};
use bridge::{BridgeConfig, RequestKey};
use ipc_types::payload::{
    BridgeJournal, DspTelemetry, LastMinute, LinkHealth, ModuleState, MovementState,
    RefusedCounters, RequestReport,
};
use ipc_types::{MonotonicNs, Topic};
use module_kit::journal::bytes::Malformed;

use crate::difference::{Values, of_bytes, of_structs, presence};
use crate::tally::Tally;
use crate::track::Driven;

/// Where bytes to the DSP are recorded, and where reports go.
const SENT: &str = "serial/sent";
const REPORTS: &str = "requests";

/// See the module's documentation.
pub struct BridgeCore {
    decoder: Decoder,
    /// The core from its snapshot on; nothing before the first one, and after a loss.
    snapshot: Option<Snapshot>,
    /// The configuration to replay with.
    against: Option<BridgeConfig>,
    /// What the core said to the last input, and how much of it was compared.
    said: Said,
    compared: usize,
    /// The last input's outputs differ: the rest of them is not compared.
    is_differing: bool,
    /// The last state of the recording.
    state: ModuleState,
    at: MonotonicNs,
}

impl fmt::Debug for BridgeCore {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BridgeCore").finish_non_exhaustive()
    }
}

/// Outputs of one input.
#[derive(Default)]
struct Said(Vec<Word>);

// A sample is most of what comes; a box would allocate for each.
#[allow(clippy::large_enum_variant)]
enum Word {
    Telemetry(DspTelemetry),
    State(ModuleState),
    Report(RequestKey, RequestReport),
    Sent(Vec<u8>),
}

impl Word {
    /// Where it is published.
    fn topic(&self) -> &'static str {
        match self {
            Word::Telemetry(_) => DspTelemetry::KEY,
            Word::State(_) => ModuleState::KEY,
            Word::Report(..) => REPORTS,
            Word::Sent(_) => SENT,
        }
    }

    /// What it is.
    fn what(&self) -> String {
        match self {
            Word::Telemetry(_) => "a sample".to_owned(),
            Word::State(_) => "a state".to_owned(),
            Word::Report(_, report) => what_report(report),
            Word::Sent(bytes) => format!("{} bytes", bytes.len()),
        }
    }
}

impl Outputs for Said {
    fn telemetry(&mut self, fill: impl FnOnce(&mut DspTelemetry)) {
        let mut sample = DspTelemetry::default();
        fill(&mut sample);
        sample.sequence = 0;
        sample.epoch_ns = 0;
        self.0.push(Word::Telemetry(sample));
    }

    fn state(&mut self, state: &ModuleState) {
        self.0.push(Word::State(ModuleState {
            sequence: 0,
            epoch_ns: 0,
            published_ns: 0,
            ..*state
        }));
    }

    fn report(&mut self, to: RequestKey, report: &RequestReport) {
        self.0.push(Word::Report(to, *report));
    }

    fn notice(&mut self, _notice: &Notice) {}
}

impl BridgeCore {
    pub fn new(against: Option<BridgeConfig>) -> BridgeCore {
        BridgeCore {
            decoder: Decoder::new(),
            snapshot: None,
            against,
            said: Said::default(),
            compared: 0,
            is_differing: false,
            state: ModuleState::default(),
            at: MonotonicNs(0),
        }
    }

    fn snapshot(&mut self, at: MonotonicNs, bytes: &[u8], tally: &mut Tally) {
        self.finish_input(tally);
        self.at = at;
        // With another configuration it goes its own way.
        let is_own = self.against.is_none();
        let replayed =
            self.snapshot
                .as_ref()
                .filter(|_| is_own)
                .map(|Snapshot { config, bridge }| {
                    Snapshot::take(bridge, config, &Snapshot::text_of(config))
                });
        tally.snapshot(at, BridgeJournal::KEY, bytes, replayed.as_deref());
        if self.snapshot.is_some() && !is_own {
            return tally.reach(at);
        }
        // A snapshot from a stranger may be a core that cannot be.
        let restored = catch_unwind(AssertUnwindSafe(|| {
            let snapshot = Snapshot::restore(bytes).ok()?;
            match &self.against {
                Some(config) => snapshot.against(config).ok(),
                None => Some(snapshot),
            }
        }));
        self.snapshot = restored.ok().flatten();
        tally.restored(at, self.snapshot.is_some());
    }

    fn input(&mut self, at: MonotonicNs, input: Input<'_>, tally: &mut Tally) {
        self.finish_input(tally);
        self.at = at;
        let Some(Snapshot { bridge, .. }) = &mut self.snapshot else {
            return;
        };
        tally.verdict.inputs += 1;
        tally.reach(at);
        let said = &mut self.said;
        let applied = catch_unwind(AssertUnwindSafe(|| {
            if let Input::Transmitted(count) = input {
                let unsent = bridge.unsent();
                said.0
                    .push(Word::Sent(unsent[..count.min(unsent.len())].to_vec()));
            }
            bridge.apply(at, input, said);
        }));
        if applied.is_err() {
            let values = presence("an answer", "a panic of the core");
            tally.differs(at, BridgeJournal::KEY, values);
            self.drop_core(tally);
        }
    }

    fn output(&mut self, output: &Output<'_>, tally: &mut Tally) {
        if self.snapshot.is_none() || self.is_differing {
            return;
        }
        let said = self.said.0.get(self.compared);
        self.compared += 1;
        let (topic, values) = match (output, said) {
            (Output::Telemetry(recorded), Some(Word::Telemetry(replayed))) => {
                (DspTelemetry::KEY, of_structs(recorded, replayed))
            }
            (Output::State(recorded), Some(Word::State(replayed))) => {
                (ModuleState::KEY, of_structs(recorded, replayed))
            }
            (Output::Report(to, recorded), Some(Word::Report(key, replayed))) => {
                let values = of_structs(recorded, replayed);
                (REPORTS, values.or_else(|| of_keys(*to, *key)))
            }
            (Output::Sent(recorded), Some(Word::Sent(replayed))) => {
                (SENT, of_bytes(recorded, replayed))
            }
            (Output::State(recorded), None) => {
                (ModuleState::KEY, Some(of_changes(recorded, &self.state)))
            }
            (recorded, said) => {
                let (topic, what) = topic_of(recorded);
                let replayed = said.map_or("nothing".to_owned(), Word::what);
                (topic, Some(presence(&what, &replayed)))
            }
        };
        if let Output::State(state) = output {
            self.state = *state;
        }
        let verdict = &mut tally.verdict;
        match (values, output) {
            (Some(values), _) => {
                self.is_differing = true;
                tally.differs(self.at, topic, values);
            }
            (None, Output::Telemetry(_)) => verdict.samples += 1,
            (None, Output::State(_)) => verdict.states += 1,
            (None, Output::Report(..)) => verdict.reports += 1,
            (None, Output::Sent(bytes)) => verdict.bytes_sent += bytes.len() as u64,
        }
    }

    /// All outputs of the last input were read: whatever else the core said is not in the recording.
    fn finish_input(&mut self, tally: &mut Tally) {
        if self.snapshot.is_some()
            && !self.is_differing
            && let Some(word) = self.said.0.get(self.compared)
        {
            let values = match word {
                Word::State(replayed) => of_changes(&self.state, replayed),
                word => presence("nothing", &word.what()),
            };
            tally.differs(self.at, word.topic(), values);
        }
        self.said.0.clear();
        self.compared = 0;
        self.is_differing = false;
    }

    fn drop_core(&mut self, tally: &mut Tally) {
        self.said.0.clear();
        self.compared = 0;
        self.snapshot = None;
        tally.end();
    }
}

impl Driven for BridgeCore {
    fn stop(&mut self, tally: &mut Tally) {
        // Outputs of the last input may be among what is missing.
        self.is_differing = true;
        self.finish_input(tally);
        self.drop_core(tally);
    }

    fn take(&mut self, record: &[u8], tally: &mut Tally) -> Result<(), Malformed> {
        let record = self.decoder.decode(record)?;
        match record.entry {
            Entry::Snapshot(bytes) => self.snapshot(record.at, &bytes, tally),
            Entry::Input(input) => self.input(record.at, input, tally),
            Entry::Output(output) => self.output(&output, tally),
        }
        Ok(())
    }
}

fn topic_of(output: &Output<'_>) -> (&'static str, String) {
    match output {
        Output::Telemetry(_) => (DspTelemetry::KEY, "a sample".to_owned()),
        Output::State(_) => (ModuleState::KEY, "a state".to_owned()),
        Output::Report(_, report) => (REPORTS, what_report(report)),
        Output::Sent(bytes) => (SENT, format!("{} bytes", bytes.len())),
    }
}

fn what_report(report: &RequestReport) -> String {
    let stage = report.stage().map_or("unknown stage", |stage| stage.name());
    let reason = report.reason().map_or("unknown", |reason| reason.name());
    format!("the report {stage} ({reason}) for {}", report.request_id)
}

/// Why one side published a state and the other did not: the first field that differs and makes a state be published at once.
fn of_changes(recorded: &ModuleState, replayed: &ModuleState) -> Values {
    // The counters of the link wait for the next state. What is left of it are its states.
    let quiet = |state: &ModuleState| ModuleState {
        link: LinkHealth {
            state: state.link.state,
            dsp_path: state.link.dsp_path,
            dsp_boots: state.link.dsp_boots,
            port_openings: state.link.port_openings,
            ..LinkHealth::default()
        },
        refused: RefusedCounters::default(),
        last_minute: LastMinute::default(),
        ground_altitude_m: 0.0,
        ground_valid: 0,
        movement: MovementState {
            distance_to_go_m: 0.0,
            ..state.movement
        },
        ..*state
    };
    of_structs(&quiet(recorded), &quiet(replayed))
        .or_else(|| of_structs(recorded, replayed))
        .unwrap_or_else(|| presence("a state", "nothing"))
}

fn of_keys(recorded: RequestKey, replayed: RequestKey) -> Option<Values> {
    (recorded != replayed).then(|| Values {
        field: "receiver".to_owned(),
        recorded: format!("{recorded:?}"),
        replayed: format!("{replayed:?}"),
    })
}
