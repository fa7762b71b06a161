//! What the journal of a mission finds out: a changed constant, a changed byte, a loss; and what hostile bytes do not
//! do.

use std::sync::LazyLock;
use std::time::{Duration, Instant};

use bridge::BridgeConfig;
use ipc_types::payload::{BridgeJournal, HeroTelemetry, SharedStruct, StatusJournal};
use ipc_types::{MonotonicNs, Topic};
use proptest::prelude::*;
use replay::{Comparison, JournalVerdict, Keeper, Kept, Verifier, renew};
use status::config::Config;

use crate::missions::config::WorldConfig;
use crate::missions::operator::{Step, fly, triangle};
use crate::missions::world::World;

/// The journals of a whole mission with wind: a path of three legs, and some time at rest, so that several snapshots
/// lie in them.
struct Mission {
    bridge: Vec<BridgeJournal>,
    status: Vec<StatusJournal>,
    time: Duration,
}

/// With the defaults. It is flown once, for all tests.
static MISSION: LazyLock<Mission> = LazyLock::new(|| Mission::fly(&WorldConfig::new()));

impl Mission {
    fn fly(config: &WorldConfig) -> Mission {
        let mut world = World::new(&config.clone().wind(3.0, 200.0, 1.0));
        world.keep_journals();
        let steps = [
            Step::Start,
            Step::TakeOff(10.0),
            Step::Path(triangle()),
            Step::Land,
            Step::Wait(Duration::from_secs(15)),
            Step::Stop,
        ];
        fly(&mut world, &steps);
        world.finish();
        let (bridge, status) = world.journals();
        let time = world.now();
        Mission {
            bridge,
            status,
            time,
        }
    }
}

fn verify_with(verifier: Verifier, pieces: &[BridgeJournal]) -> JournalVerdict {
    let mut verifier = verifier;
    for piece in pieces {
        verifier.take(BridgeJournal::KEY, piece.bytes());
    }
    verifier.finish().bridge
}

fn verify(pieces: &[BridgeJournal]) -> JournalVerdict {
    verify_with(Verifier::new(), pieces)
}

#[test]
fn a_mission_is_verified_in_one_span_with_all_that_was_said() {
    let mission = &*MISSION;
    let begin = Instant::now();
    let verdict = verify(&mission.bridge);
    let took = begin.elapsed();
    assert!(verdict.is_verified(), "{verdict:?}");
    assert_eq!((verdict.spans.len(), verdict.break_count), (1, 0));
    assert!(verdict.snapshots > 3, "{verdict:?}");
    assert!(verdict.samples > 1000 && verdict.bytes_sent > 100);
    assert!(verdict.states >= mission.time.as_secs(), "one each second");
    assert!(verdict.reports > 10, "{verdict:?}");
    let mut verifier = Verifier::new();
    for piece in &mission.status {
        verifier.take(StatusJournal::KEY, piece.bytes());
    }
    let verdict_of_status = verifier.finish();
    assert!(verdict_of_status.is_verified(), "{verdict_of_status:?}");
    assert_eq!(verdict_of_status.status.samples, verdict.samples);
    // Without limits: figures for people (`--nocapture`).
    let seconds = mission.time.as_secs_f64();
    let bytes = |bytes: u64| bytes as f64 / seconds;
    println!(
        "{seconds:.0} s of flight: journal of the bridge {:.0} bytes/s, of status {:.0} bytes/s; the bridge verified at {:.0} times real time",
        bytes(verdict.bytes),
        bytes(verdict_of_status.status.bytes),
        seconds / took.as_secs_f64(),
    );
}

/// A recorder that joins late gets the whole journal, and samples from then on.
#[test]
fn samples_of_before_the_recording_are_counted_apart() {
    let mission = &*MISSION;
    let span = verify(&mission.bridge).spans[0];
    let middle = MonotonicNs(span.from.0 / 2 + span.to.0 / 2);
    let mut verifier = Verifier::new().since([middle, span.to + Duration::from_secs(1)]);
    for piece in &mission.bridge {
        verifier.take(BridgeJournal::KEY, piece.bytes());
    }
    for piece in &mission.status {
        verifier.take(StatusJournal::KEY, piece.bytes());
    }
    let both = verifier.finish();
    let (bridge, status) = (&both.bridge, &both.status);
    let share = bridge.samples_before as f64 / bridge.samples as f64;
    assert!((0.4..0.6).contains(&share), "{share}");
    assert_eq!(
        (status.samples_before, status.samples),
        (bridge.samples, bridge.samples)
    );
}

#[test]
fn a_changed_constant_is_caught_with_the_first_field_that_differs() {
    let mission = &*MISSION;
    let original = {
        let mut config = WorldConfig::new().bridge;
        config.movement.time_limit_s = 60.0;
        config
    };
    let against = |change: &dyn Fn(&mut BridgeConfig)| {
        let mut config = original.clone();
        change(&mut config);
        verify_with(Verifier::new().against(config), &mission.bridge)
    };
    let same = against(&|_| {});
    assert!(same.is_verified(), "{same:?}");

    // A narrower box around waypoints: they are reached later.
    let narrow = against(&|config| config.arrival.altitude_m = 0.05);
    let first = narrow.difference().expect("a difference");
    assert!(
        first.topic == "module_state" || first.topic == "requests",
        "{first}"
    );
    assert!(
        first.field.contains("waypoints_reached") || first.field == "presence",
        "{first}"
    );

    // A limit of the battery that is above what it has.
    let low = against(&|config| config.safety.battery_v.warn = Some(99.0));
    let first = low.difference().expect("a difference");
    assert_eq!(
        (first.topic.as_str(), first.field.as_str()),
        ("module_state", "safety.amount")
    );
    assert_eq!(first.recorded, "0");

    // Another mask of status groups: other bytes to the DSP, from the first command on.
    let mask = against(&|config| config.status.groups.truncate(15));
    let first = mask.difference().expect("a difference");
    assert_eq!(first.topic, "serial/sent", "{first}");
    assert!(
        first.at.0 > 0 && first.recorded != first.replayed,
        "{first}"
    );
}

#[test]
fn a_changed_constant_of_status_is_caught_as_well() {
    let mission = &*MISSION;
    let mut config = Config::default();
    config.calibration.barometer.zero_adc += 1.0;
    let mut verifier = Verifier::new().against_status(config);
    for piece in &mission.status {
        verifier.take(StatusJournal::KEY, piece.bytes());
    }
    let verdict = verifier.finish();
    let first = verdict.difference().expect("a difference");
    assert_eq!(first.topic, HeroTelemetry::KEY);
    assert_eq!(first.field, "barometer_altitude_m");
}

#[test]
fn a_changed_byte_of_the_journal_is_caught() {
    let mission = &*MISSION;
    let count = mission.bridge.len();
    let (mut caught, mut named, mut tried) = (0, 0, 0);
    for index in (1..count - 4).step_by(23) {
        let mut pieces = mission.bridge.clone();
        let at = pieces[index].length as usize / 2;
        pieces[index].data[at] ^= 0x11;
        let verdict = verify(&pieces);
        tried += 1;
        caught += u32::from(!verdict.is_verified());
        named += u32::from(verdict.difference().is_some_and(|first| {
            first.field != "presence" && first.recorded != first.replayed && first.at.0 > 0
        }));
    }
    // A byte that says nothing of the flight, such as a sender's process, changes nothing.
    assert!(caught * 10 >= tried * 9, "{caught} of {tried}");
    assert!(named > 0, "{named} of {tried}");
}

#[test]
fn a_journal_with_losses_is_verified_up_to_each_and_again_from_the_next_snapshot() {
    let mission = &*MISSION;
    let begins: Vec<_> = (0..mission.bridge.len())
        .filter(|index| mission.bridge[*index].begins == 1)
        .collect();
    let is_lost = |index: usize| {
        let after = |snapshot: usize, pieces| (begins[snapshot] + 2..).take(pieces);
        after(1, 1).any(|lost| lost == index) || after(2, 3).any(|lost| lost == index)
    };
    let pieces: Vec<_> = mission
        .bridge
        .iter()
        .enumerate()
        .filter(|(index, _)| !is_lost(*index))
        .map(|(_, piece)| *piece)
        .collect();
    let verdict = verify(&pieces);
    assert!(verdict.is_verified(), "{verdict:?}");
    assert_eq!((verdict.pieces_lost, verdict.break_count), (4, 2));
    assert_eq!(verdict.spans.len(), 3);
    let in_order = verdict
        .spans
        .windows(2)
        .all(|spans| spans[0].to < spans[1].from);
    assert!(in_order, "{verdict:?}");

    // A recorder that comes late begins with the next snapshot.
    let late = verify(&mission.bridge[begins[0] + 1..]);
    assert!(late.is_verified(), "{late:?}");
    assert!(late.spans[0].from > verdict.spans[0].from);
}

fn keep<'a>(pieces: impl IntoIterator<Item = &'a BridgeJournal>, status: &[StatusJournal]) -> Kept {
    let mut keeper = Keeper::default();
    for piece in status {
        keeper.take(StatusJournal::KEY, piece.bytes());
    }
    for piece in pieces {
        keeper.take(BridgeJournal::KEY, piece.bytes());
    }
    keeper.finish().expect("a journal")
}

fn verify_kept(verifier: Verifier, kept: &Kept) -> Comparison {
    let mut verifier = verifier;
    verifier.take_kept(&kept.file).expect("a kept flight");
    verifier.finish()
}

#[test]
fn a_kept_flight_says_as_much_as_its_journals_and_in_which_output_a_change_is() {
    let mission = &*MISSION;
    let kept = keep(&mission.bridge, &mission.status);
    assert!(kept.is_from_the_start);
    let [of_kept, of_journal] = [
        verify_kept(Verifier::new(), &kept).bridge,
        verify(&mission.bridge),
    ];
    assert!(of_kept.is_verified(), "{of_kept:?}");
    let figures =
        |of: &JournalVerdict| (of.inputs, of.samples, of.states, of.reports, of.bytes_sent);
    assert_eq!(figures(&of_kept), figures(&of_journal));

    let mut config = WorldConfig::new().bridge;
    config.movement.time_limit_s = 60.0;
    let same = verify_kept(Verifier::new().against(config.clone()), &kept);
    assert!(same.is_verified(), "{same:?}");
    config.safety.battery_v.warn = Some(99.0);
    let low = verify_kept(Verifier::new().against(config), &kept);
    let first = low.difference().expect("a difference");
    assert_eq!(first.topic, "module_state", "{first}");

    let mut config = Config::default();
    config.calibration.barometer.zero_adc += 1.0;
    let other = verify_kept(Verifier::new().against_status(config), &kept);
    let first = other.difference().expect("a difference");
    assert_eq!(
        (first.topic.as_str(), first.field.as_str()),
        (HeroTelemetry::KEY, "digest")
    );

    // What this version says to the same inputs is what was kept.
    assert_eq!(renew(&kept.file), Ok(kept.file.clone()));
}

#[test]
fn a_kept_flight_begins_with_a_snapshot_where_its_recording_does() {
    let mission = &*MISSION;
    let late = keep(&mission.bridge[1..], &[]);
    assert!(!late.is_from_the_start);
    let verdict = verify_kept(Verifier::new(), &late).bridge;
    assert!(
        verdict.is_verified() && verdict.samples > 100,
        "{verdict:?}"
    );
}

#[test]
fn a_kept_flight_goes_on_after_a_loss_wherever_it_is() {
    let mission = &*MISSION;
    let last_snapshot = mission.bridge.iter().rposition(|piece| piece.begins == 1);
    // What is lost begins between an input and what was said to it, too.
    for lost in (1..last_snapshot.expect("snapshots")).step_by(5) {
        let pieces = mission.bridge.iter().enumerate();
        let lossy = keep(
            pieces.filter_map(|(index, piece)| (index != lost).then_some(piece)),
            &mission.status,
        );
        assert!(!lossy.is_from_the_start);
        let verdict = verify_kept(Verifier::new(), &lossy);
        assert!(verdict.is_verified(), "without {lost}: {verdict:?}");
        assert_eq!(verdict.bridge.spans.len(), 2);
        assert_eq!(renew(&lossy.file), Ok(lossy.file.clone()), "{lost}");
    }
}

#[test]
fn hostile_bytes_in_a_journal_end_in_a_verdict() {
    let mission = &*MISSION;
    let count = mission.bridge.len();
    let mut runner = proptest::test_runner::TestRunner::new(ProptestConfig::with_cases(24));
    let damage = prop::collection::vec(
        (
            0..count,
            0..4056usize,
            prop::collection::vec(any::<u8>(), 1..40),
        ),
        1..20,
    );
    // A core that cannot be may panic; the verifier says so.
    let run = runner.run(&damage, |damage| {
        let mut pieces = mission.bridge.clone();
        for (index, at, bytes) in damage {
            let end = (at + bytes.len()).min(pieces[index].data.len());
            pieces[index].data[at..end].copy_from_slice(&bytes[..end - at]);
        }
        let verdict = verify(&pieces);
        prop_assert!(verdict.differences.len() <= replay::MAX_LISTED);
        Ok(())
    });
    run.unwrap();
}
