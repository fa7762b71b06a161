use std::borrow::Cow;
use std::time::Duration;

use ipc_types::code::{ControlCommand, Reason, Stage};
use ipc_types::payload::{BridgeJournal, ModuleControl, MovementData, ParameterRequest};
use ipc_types::{JournalPiece, MonotonicNs, Topic};
use module_kit::journal::{Entry, JournalReader};
use proptest::prelude::*;

use super::*;
use crate::{Sender, SenderClock};

const START: MonotonicNs = MonotonicNs(86_400_000_000_000);

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

/// All that a core knows, but for the moment of its last input.
fn known(bridge: &Bridge) -> String {
    let all = format!("{bridge:?}");
    let (known, _clock) = all.split_once("clock: CoreClock").unwrap();
    known.to_owned()
}

#[test]
fn a_core_from_a_snapshot_is_the_same_bit_for_bit_and_goes_on_as_the_other() {
    let config = config();
    let mut bridge = Bridge::new(&config);
    let mut now = START;
    bridge.apply(now, Input::PortOpened(Default::default()), &mut ());
    let text = Snapshot::text_of(&config);
    for step in 0..50 {
        let snapshot = Snapshot::take(&bridge, &config, &text);
        let mut other = Snapshot::restore(&snapshot).unwrap().bridge;
        assert_eq!(Snapshot::take(&other, &config, &text), snapshot);
        // With what no snapshot has, because the configuration says it. Later the decoder has bytes that count no more.
        if step == 0 {
            assert_eq!(known(&other), known(&bridge));
        }
        now = now + Duration::from_millis(70);
        for bridge in [&mut bridge, &mut other] {
            bridge.apply(now, Input::Advance, &mut ());
            let count = bridge.transmit(now).len();
            let taken = Input::Transmitted(count.saturating_sub(step % 3));
            bridge.apply(now, taken, &mut ());
            bridge.apply(now, Input::Received(&[0x80 + step as u8, 1, 2]), &mut ());
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
    let reload = Input::NewFence {
        key,
        sender: Sender::default(),
        request,
        fence: Ok(fence.clone()),
    };
    bridge.apply(START, reload, &mut ());
    let snapshot = Snapshot::take(&bridge, &config, &Snapshot::text_of(&config));
    let restored = Snapshot::restore(&snapshot).unwrap();
    assert_eq!(*restored.bridge.fence(), fence);
    assert_eq!(restored.config.fence, config.fence);
    // What was read at run time stays, whatever another configuration says.
    let other = restored.against(&self::config()).unwrap();
    assert_eq!(*other.bridge.fence(), fence);
}

#[test]
fn another_configuration_holds_unless_its_parameters_were_set_at_run_time() {
    let (old, mut new) = (BridgeConfig::default(), config());
    // What was read from the line stays of the profile that the DSP spoke.
    new.link.profile = old.link.profile;
    let text = Snapshot::text_of(&old);
    // With what another configuration says, they are others than this one's: as if they were set at run time.
    for (begun_with, has_new) in [
        (&old, true),
        (&parse("[parameters]\ncruise_speed_mps = 4.5"), false),
    ] {
        let snapshot = Snapshot::take(&Bridge::new(begun_with), &old, &text);
        let against = Snapshot::restore(&snapshot).unwrap().against(&new).unwrap();
        assert_eq!(against.config, new);
        let expected = BridgeConfig {
            parameters: if has_new { &new } else { begun_with }.parameters.clone(),
            ..new.clone()
        };
        assert_eq!(known(&against.bridge).contains("4.5"), !has_new);
        let mut fresh = Snapshot::restore(&Snapshot::take(
            &Bridge::new(&expected),
            &new,
            &Snapshot::text_of(&new),
        ));
        assert_eq!(
            known(&against.bridge),
            known(&fresh.as_mut().unwrap().bridge)
        );
    }
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
    let sender = Sender {
        process: Some(4711),
        session: Some(300),
        clock: SenderClock::Unknown,
    };
    let key = RequestKey::Movement(u64::MAX);
    let request = ModuleControl {
        issued_ns: START.0,
        ..ModuleControl::new(7, ControlCommand::ReloadFence)
    };
    vec![
        Input::PortOpened(Default::default()),
        Input::PortClosed,
        Input::Received(b""),
        Input::Received(b"bytes"),
        Input::Control {
            key: RequestKey::Control(3),
            sender: Sender::default(),
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
        Input::ProcessEnded(300),
        Input::Suspended(u64::MAX),
        Input::LeaseRenewed(START),
    ]
}

fn outputs() -> Vec<Output<'static>> {
    let state = ModuleState {
        status: 3,
        ..ModuleState::default()
    };
    let report = RequestReport::new(Stage::Done, Reason::None);
    vec![
        Output::Telemetry(DspTelemetry {
            dsp_time_ms: 7,
            ..DspTelemetry::default()
        }),
        Output::State(state),
        Output::Report(RequestKey::Control(1), report),
        Output::Sent(Cow::Borrowed(b"frame")),
    ]
}

#[test]
fn what_is_written_is_read_again() {
    let mut writer = JournalWriter::new(BridgeJournal::ROOM);
    writer.start();
    writer.snapshot(START, &[1, 0, 0, 0, 2]);
    // Forth and back: a clock may have been read before the last one.
    let at = |index: usize| MonotonicNs(START.0 + 1000 * (index as u64 % 3));
    // Once: requests have the time at which they were made.
    let inputs = inputs();
    for (index, input) in inputs.iter().enumerate() {
        writer.input(at(index), input);
    }
    outputs().iter().for_each(|output| writer.output(output));

    let mut reader = JournalReader::new();
    for (piece, sequence) in writer.take_all().zip(1..) {
        let mut sample = BridgeJournal::default();
        sample.fill(0, piece.begins, piece.beginnings, &piece.bytes);
        sample.stamp(sequence, 1);
        assert_eq!(reader.take(&sample), None);
    }
    let mut expect = |at, entry| {
        let record: Option<Record<'_>> = reader.next().unwrap();
        assert_eq!(record, Some(Record { at, entry }));
    };
    expect(START, Entry::Snapshot(&[1, 0, 0, 0, 2]));
    let count = inputs.len();
    for (index, input) in inputs.into_iter().enumerate() {
        expect(at(index), Entry::Input(input));
    }
    for output in outputs() {
        expect(at(count - 1), Entry::Output(output));
    }
}

/// What a whole flight has of the journal is verified by the missions; here, what the wrapper must not record.
#[test]
fn what_did_nothing_is_not_recorded_and_what_a_publisher_fills_in_is_left_out() {
    let mut writer = JournalWriter::new(BridgeJournal::ROOM);
    writer.start();
    let mut bridge = Journaled::new(&BridgeConfig::default(), writer);
    assert!(bridge.transmit(START).is_empty() && !bridge.take_discard_unsent(START));
    bridge.apply(START, Input::PortOpened(Default::default()), &mut ());
    let mut said = Vec::new();
    AsValues(|output: Output<'_>| said.push(format!("{output:?}"))).state(&ModuleState {
        sequence: 9,
        epoch_ns: 9,
        published_ns: 9,
        ..ModuleState::default()
    });
    assert_eq!(
        said,
        [format!("{:?}", Output::State(ModuleState::default()))]
    );

    let mut reader = JournalReader::new();
    for (piece, sequence) in bridge.writer().take_all().zip(1..) {
        let mut sample = BridgeJournal::default();
        sample.fill(0, piece.begins, piece.beginnings, &piece.bytes);
        sample.stamp(sequence, 1);
        reader.take(&sample);
    }
    let mut kinds = Vec::new();
    while let Some(record) = reader.next::<Input<'_>, Output<'_>>().unwrap() {
        kinds.push(match record.entry {
            Entry::Input(input) => format!("{input:?}"),
            Entry::Output(Output::State(_)) => "state".to_owned(),
            Entry::Snapshot(_) => "snapshot".to_owned(),
            entry => panic!("{entry:?}"),
        });
    }
    assert_eq!(
        kinds,
        [
            "snapshot",
            "PortOpened(Line { byte: 0ns, adapter: 0ns })",
            "state"
        ]
    );
}

proptest! {
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
