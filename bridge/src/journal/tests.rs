use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{ControlCommand, Reason};
use ipc_types::payload::{
    DspTelemetry, ModuleControl, ModuleState, MovementData, ParameterRequest, RequestReport,
    SharedStruct,
};
use module_kit::journal::LOG_LINE;
use module_kit::journal::bytes::Malformed;
use proptest::prelude::*;

use super::{Decoder, Encoder, Entry, Input, Kind, Output, Record, Snapshot};
use crate::config::BridgeConfig;
use crate::core::Bridge;
use crate::flight::request::RequestKey;
use crate::outputs::{Notice, Outputs};
use crate::safety::fence::Fence;
use crate::snapshot::NotASnapshot;

const START: MonotonicNs = MonotonicNs(86_400_000_000_000);

/// A consumer that takes note of nothing.
struct Unheard;

impl Outputs for Unheard {
    fn telemetry(&mut self, _fill: impl FnOnce(&mut DspTelemetry)) {}
    fn state(&mut self, _state: &ModuleState) {}
    fn report(&mut self, _to: RequestKey, _report: &RequestReport) {}
    fn notice(&mut self, _notice: &Notice) {}
}

fn parse(text: &str) -> BridgeConfig {
    runtime::config::parse(text, "a test").unwrap()
}

/// A configuration in which every kind of value has another than its default.
fn config() -> BridgeConfig {
    parse(
        "[link]\nprofile = 'extended'\npc_timeout_ms = 3000\n\
         [status]\ngroups = ['time', 'geographic', 'supply']\ncoherence = 'confirmed'\n\
         [arrival]\nlatitude_deg = 2.5e-5\n\
         [trajectory]\nkind = 'divide_legs'\nspacing_m = 12.3\n\
         [movement]\nmin_altitude_m = -12.25\n\
         [safety]\nfence_breach = 'land'\nbattery_v = { warn = 24.1, land = 21.0 }\n\
         [errors]\nhero_dsp_fatal = [8]\n\
         [parameters]\ncruise_speed_mps = 3.3\nstatus_period_ms = 50\n\
         [fence]\nceiling_m = 120.1\n\
         [[fence.area]]\nname = 'field'\nkind = 'inclusion'\ncentre = [37.1, -6.2]\nradius_m = 250.5\nfloor_m = -1.0\n\
         [[fence.area]]\nname = 'hangar'\nkind = 'exclusion'\n\
         polygon = [[37.1, -6.2], [37.1, -6.1999], [37.1001, -6.2], [37.1, -6.2]]\n",
    )
}

#[test]
fn a_configuration_comes_back_as_it_was() {
    for config in [BridgeConfig::default(), config()] {
        let text = Snapshot::text_of(&config);
        let again = parse(&text);
        assert_eq!(again, config, "{text}");
        assert_eq!(Snapshot::text_of(&again), text);
    }
}

#[test]
fn a_core_from_a_snapshot_is_the_same_bit_for_bit_and_goes_on_as_the_other() {
    let config = config();
    let mut bridge = Bridge::new(&config);
    let mut now = START;
    bridge.port_opened(now, &mut Unheard);
    let text = Snapshot::text_of(&config);
    for step in 0..50 {
        let snapshot = Snapshot::take(&bridge, &config, &text);
        let mut other = Snapshot::restore(&snapshot).unwrap().bridge;
        assert_eq!(Snapshot::take(&other, &config, &text), snapshot);
        now = now + Duration::from_millis(70);
        for bridge in [&mut bridge, &mut other] {
            bridge.advance(now, &mut Unheard);
            let count = bridge.transmit(now).len();
            bridge.transmitted(count.saturating_sub(step % 3));
            bridge.receive(now, &[0x80 + step as u8, 1, 2], &mut Unheard);
        }
        let after = Snapshot::take(&other, &config, &text);
        assert_eq!(Snapshot::take(&bridge, &config, &text), after);
    }
}

#[test]
fn a_fence_that_was_read_again_is_of_the_snapshot() {
    let config = BridgeConfig::default();
    let mut bridge = Bridge::new(&config);
    let request = ModuleControl {
        issued_ns: START.0,
        ..ModuleControl::new(7, ControlCommand::ReloadFence)
    };
    let key = RequestKey::Control(1);
    let fence: Fence = runtime::config::parse("ceiling_m = 50.0", "a test").unwrap();
    bridge.new_fence(START, key, &request, Ok(fence.clone()), &mut Unheard);
    let snapshot = Snapshot::take(&bridge, &config, &Snapshot::text_of(&config));
    let restored = Snapshot::restore(&snapshot).unwrap();
    assert_eq!(*restored.bridge.fence(), fence);
    assert_eq!(restored.config.fence, config.fence);
    // What was read at run time stays, whatever another configuration says.
    let other = restored.against(&self::config()).unwrap();
    assert_eq!(*other.bridge.fence(), fence);
}

#[test]
fn what_is_no_snapshot_is_refused() {
    let config = BridgeConfig::default();
    let text = Snapshot::text_of(&config);
    let snapshot = Snapshot::take(&Bridge::new(&config), &config, &text);
    let cut = &snapshot[..snapshot.len() - 1];
    let mut longer = snapshot.clone();
    longer.push(0);
    let mut other_version = snapshot.clone();
    other_version[0] += 1;
    for bytes in [cut, &longer, &other_version, &[]] {
        assert_eq!(Snapshot::restore(bytes).err(), Some(NotASnapshot));
    }
}

fn inputs() -> Vec<Input<'static>> {
    let sender = Some(4711);
    let key = RequestKey::Movement(u64::MAX);
    let request = ModuleControl {
        issued_ns: START.0,
        ..ModuleControl::new(7, ControlCommand::ReloadFence)
    };
    vec![
        Input::PortOpened,
        Input::PortClosed,
        Input::Received(b""),
        Input::Received(b"bytes"),
        Input::Control {
            key: RequestKey::Control(3),
            sender: None,
            request,
        },
        Input::NewFence {
            key,
            sender,
            request,
            fence: Ok(config().fence),
        },
        Input::NewFence {
            key,
            sender,
            request,
            fence: Err(Reason::InvalidFence),
        },
        Input::Movement {
            key,
            sender,
            request: MovementData::land(9),
        },
        Input::Parameter {
            key: RequestKey::Parameter(0),
            sender,
            request: ParameterRequest {
                request_id: 5,
                value: f64::MIN_POSITIVE,
                ..ParameterRequest::default()
            },
        },
        Input::SenderGone(key),
        Input::Advance,
        Input::WindDown,
        Input::Close,
        Input::Transmit,
        Input::Transmitted(300),
        Input::DiscardUnsent,
    ]
}

#[test]
fn what_is_written_is_read_again() {
    let (mut encoder, mut decoder) = (Encoder::new(), Decoder::new());
    let mut bytes = Vec::new();
    encoder.snapshot(START, &[1, 0, 0, 0, 2], &mut bytes);
    let entry = Entry::Snapshot(vec![1, 0, 0, 0, 2]);
    assert_eq!(decoder.decode(&bytes), Ok(Record { at: START, entry }));
    for (index, input) in inputs().into_iter().enumerate() {
        // Forth and back: a clock may have been read before the last one.
        let at = MonotonicNs(START.0 + 1000 * (index as u64 % 3));
        bytes.clear();
        encoder.input(at, &input, &mut bytes);
        assert_eq!(Kind::of(bytes[0]), Some(input.kind()));
        let entry = Entry::Input(input);
        assert_eq!(decoder.decode(&bytes), Ok(Record { at, entry }));
    }
    let mut sample = DspTelemetry {
        sequence: 9,
        epoch_ns: 9,
        dsp_time_ms: 7,
        ..DspTelemetry::default()
    };
    for time_ms in [7, 27] {
        sample.dsp_time_ms = time_ms;
        bytes.clear();
        encoder.telemetry(&sample, &mut bytes);
        let published = DspTelemetry {
            sequence: 0,
            epoch_ns: 0,
            ..sample
        };
        let entry = Entry::Output(Output::Telemetry(published));
        assert_eq!(decoder.decode(&bytes).unwrap().entry, entry);
    }
    assert!(bytes.len() < 8, "one number has changed: {bytes:?}");
    let state = ModuleState {
        status: 3,
        ..ModuleState::default()
    };
    bytes.clear();
    encoder.state(&state, &mut bytes);
    let entry = Entry::Output(Output::State(state));
    assert_eq!(decoder.decode(&bytes).unwrap().entry, entry);
    let report = RequestReport::new(ipc_types::code::Stage::Done, Reason::None);
    bytes.clear();
    encoder.report(RequestKey::Control(1), &report, &mut bytes);
    let entry = Entry::Output(Output::Report(RequestKey::Control(1), report));
    assert_eq!(decoder.decode(&bytes).unwrap().entry, entry);
    bytes.clear();
    encoder.sent(b"frame", &mut bytes);
    let entry = Entry::Output(Output::Sent(b"frame"));
    assert_eq!(decoder.decode(&bytes).unwrap().entry, entry);
}

#[test]
fn a_record_that_is_too_short_or_too_long_is_none() {
    let mut decoder = Decoder::new();
    for input in inputs() {
        let mut bytes = Vec::new();
        Encoder::new().input(START, &input, &mut bytes);
        let takes_all = matches!(input, Input::Received(_));
        if !takes_all {
            assert_eq!(decoder.decode(&bytes[..bytes.len() - 1]), Err(Malformed));
            bytes.push(0);
            assert_eq!(decoder.decode(&bytes), Err(Malformed), "{input:?}");
        }
    }
    assert_eq!(decoder.decode(&[]), Err(Malformed));
    assert_eq!(decoder.decode(&[0x7F]), Err(Malformed));
}

proptest! {
    #[test]
    fn no_bytes_make_the_decoder_panic(
        records in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..80), 0..16),
        kind in prop::sample::select(Kind::ALL.to_vec()),
    ) {
        let mut decoder = Decoder::new();
        for mut record in records {
            let _ = decoder.decode(&record);
            record.insert(0, kind as u8);
            let _ = decoder.decode(&record);
        }
    }

    #[test]
    fn no_damage_makes_a_snapshot_panic(at in 0usize..4000, byte: u8, cut in 0usize..4000) {
        let config = config();
        let text = Snapshot::text_of(&config);
        let mut snapshot = Snapshot::take(&Bridge::new(&config), &config, &text);
        let at = at % snapshot.len();
        snapshot[at] = byte;
        let _ = Snapshot::restore(&snapshot);
        snapshot.truncate(cut);
        let _ = Snapshot::restore(&snapshot);
    }
}

#[test]
fn kinds_have_their_own_bytes() {
    for kind in Kind::ALL {
        assert_eq!(Kind::of(kind as u8), Some(kind));
    }
    assert_eq!(DspTelemetry::LAYOUT.fields[0].name, "sequence");
}

#[test]
fn no_kind_of_ours_is_a_line_of_the_log() {
    assert_eq!(Kind::of(LOG_LINE), None);
}
