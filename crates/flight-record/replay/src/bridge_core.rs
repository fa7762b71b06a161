//! The bridge's core as a [`Core`].

use std::borrow::Cow;
use std::collections::VecDeque;

use bridge::journal::Snapshot;
use bridge::outputs::AsValues;
use bridge::{BridgeConfig, Input, Output, RequestKey};
use ipc_types::payload::{
    BridgeJournal, DspTelemetry, LastMinute, LinkHealth, ModuleState, MovementState,
    RefusedCounters, RequestReport,
};
use ipc_types::{MonotonicNs, Topic};
use module_kit::journal::{JournalWriter, snapshot};
use serde::{Deserialize, Serialize};

use crate::difference::{Values, of_bytes, of_structs};
use crate::kept::{Beginning, Streams};
use crate::track::{Compared, Core};
use crate::verdict::JournalVerdict;

/// A bridge, and the last state of the recording.
pub struct BridgeCore {
    snapshot: Snapshot,
    state: ModuleState,
}

impl BridgeCore {
    fn of(snapshot: Snapshot) -> BridgeCore {
        let state = *snapshot.bridge.state();
        BridgeCore { snapshot, state }
    }
}

/// An input of the bridge in a kept flight.
#[derive(Serialize, Deserialize)]
pub enum KeptInput<'a> {
    /// So many of the bytes of the line.
    Received(usize),
    /// Any other input, kept whole.
    Other(#[serde(borrow)] Input<'a>),
}

impl Core for BridgeCore {
    type Config = BridgeConfig;
    type Input<'a> = Input<'a>;
    type Kept<'a> = KeptInput<'a>;
    type Output<'a> = Output<'a>;
    const JOURNAL: &'static str = BridgeJournal::KEY;
    const TOPICS: &'static [&'static str] = &[
        DspTelemetry::KEY,
        ModuleState::KEY,
        "requests",
        "serial/sent",
    ];

    fn restore(snapshot: &[u8], against: Option<&BridgeConfig>) -> Option<BridgeCore> {
        let snapshot = Snapshot::restore(snapshot).ok()?;
        let snapshot = match against {
            Some(config) => snapshot.against(config).ok()?,
            None => snapshot,
        };
        Some(BridgeCore::of(snapshot))
    }

    fn beginning(snapshot: &[u8]) -> Beginning<'_> {
        match Snapshot::restore(snapshot) {
            Ok(restored) if restored.is_fresh() => {
                // A bridge begins at no moment: it has not looked at the clock.
                let config = Snapshot::text_of(&restored.config);
                Beginning::Fresh(MonotonicNs(0), config.into())
            }
            _ => Beginning::Snapshot(snapshot),
        }
    }

    fn fresh(_: MonotonicNs, config: &str, against: Option<&BridgeConfig>) -> Option<BridgeCore> {
        let own = snapshot::config_of(config).ok()?;
        Some(BridgeCore::of(Snapshot::fresh(against.unwrap_or(&own))))
    }

    fn keep(at: MonotonicNs, input: Input<'_>, streams: &mut Streams, writer: &mut JournalWriter) {
        let kept = match input {
            Input::Received(bytes) => {
                streams.receive(bytes);
                KeptInput::Received(bytes.len())
            }
            other => KeptInput::Other(other),
        };
        writer.input(at, &kept);
    }

    fn apply_kept(
        &mut self,
        at: MonotonicNs,
        kept: KeptInput<'_>,
        streams: &mut Streams,
        said: &mut VecDeque<Output<'static>>,
    ) -> bool {
        let input = match kept {
            KeptInput::Received(len) => streams.take_received(len).map(Input::Received),
            KeptInput::Other(input) => Some(input),
        };
        let is_there = input.is_some();
        if let Some(input) = input {
            self.apply(at, input, said);
        }
        is_there
    }

    fn note(said: &Output<'_>, streams: &mut Streams) {
        if let Output::Telemetry(sample) = said {
            streams.made(sample);
        }
    }

    fn snapshot(&self) -> Vec<u8> {
        let Snapshot { config, bridge } = &self.snapshot;
        Snapshot::take(bridge, config, &Snapshot::text_of(config))
    }

    fn apply(&mut self, at: MonotonicNs, input: Input<'_>, said: &mut VecDeque<Output<'static>>) {
        let mut out = AsValues(|output: Output<'_>| {
            said.push_back(match output {
                Output::Telemetry(sample) => Output::Telemetry(sample),
                Output::State(state) => Output::State(state),
                Output::Report(to, report) => Output::Report(to, report),
                Output::Sent(bytes) => Output::Sent(Cow::Owned(bytes.into_owned())),
            });
        });
        self.snapshot.bridge.apply(at, input, &mut out);
    }

    fn describe(output: &Output<'_>) -> (&'static str, String) {
        match output {
            Output::Telemetry(_) => (DspTelemetry::KEY, "a sample".to_owned()),
            Output::State(_) => (ModuleState::KEY, "a state".to_owned()),
            Output::Report(_, report) => ("requests", describe_report(report)),
            Output::Sent(bytes) => ("serial/sent", format!("{} bytes", bytes.len())),
        }
    }

    fn compare(
        &mut self,
        recorded: Option<&Output<'_>>,
        replayed: Option<&Output<'static>>,
    ) -> Compared {
        let last = self.state;
        if let Some(Output::State(state)) = recorded {
            self.state = *state;
        }
        match (recorded, replayed) {
            (Some(Output::Telemetry(recorded)), Some(Output::Telemetry(replayed))) => {
                of_structs(recorded, replayed).into()
            }
            (Some(Output::State(recorded)), Some(Output::State(replayed))) => {
                of_structs(recorded, replayed).into()
            }
            (Some(Output::Report(to, recorded)), Some(Output::Report(key, replayed))) => {
                let values = of_structs(recorded, replayed);
                values.or_else(|| of_keys(*to, *key)).into()
            }
            (Some(Output::Sent(recorded)), Some(Output::Sent(replayed))) => {
                of_bytes(recorded, replayed).into()
            }
            (Some(Output::State(recorded)), None) => of_changes(recorded, &last),
            (None, Some(Output::State(replayed))) => of_changes(&last, replayed),
            _ => Compared::OneSided,
        }
    }

    fn count(output: &Output<'_>, verdict: &mut JournalVerdict) {
        match output {
            Output::Telemetry(sample) => verdict.count_sample(sample.received_ns),
            Output::State(_) => verdict.states += 1,
            Output::Report(..) => verdict.reports += 1,
            Output::Sent(bytes) => verdict.bytes_sent += bytes.len() as u64,
        }
    }
}

fn describe_report(report: &RequestReport) -> String {
    let stage = report.stage().map_or("unknown stage", |stage| stage.name());
    let reason = report.reason().map_or("unknown", |reason| reason.name());
    format!("the report {stage} ({reason}) for {}", report.request_id)
}

/// Why one side published a state and the other did not: the first field that differs and makes a state be published at
/// once.
fn of_changes(recorded: &ModuleState, replayed: &ModuleState) -> Compared {
    // The counters of the link wait for the next state. What is left of it are its states.
    let quiet = |state: &ModuleState| ModuleState {
        sequence: 0,
        epoch_ns: 0,
        published_ns: 0,
        link: LinkHealth {
            state: state.link.state,
            dsp_path: state.link.dsp_path,
            dsp_boots: state.link.dsp_boots,
            port_openings: state.link.port_openings,
            ..LinkHealth::default()
        },
        refused: RefusedCounters::default(),
        last_minute: LastMinute::default(),
        home_latitude_deg: 0.0,
        home_longitude_deg: 0.0,
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
        .map_or(Compared::OneSided, Compared::Differ)
}

fn of_keys(recorded: RequestKey, replayed: RequestKey) -> Option<Values> {
    (recorded != replayed).then(|| Values {
        field: "receiver".to_owned(),
        recorded: format!("{recorded:?}"),
        replayed: format!("{replayed:?}"),
    })
}
