//! The library of recorded flights, `tests/flights`: every file must verify bit for bit, whichever change is made to the bridge or to
//! status. `ril replay FILE --keep tests/flights` adds a flight. Those that are there were flown by the simulator, with faults:
//!
//! ```sh
//! RIL_WRITE_FLIGHTS=1 cargo test -p ril-tests --test main flights::
//! ```
//!
//! flies them again. That is right after a change that is meant, and when the format of snapshots has changed: the inputs of a
//! recording can be read by the version that made it.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use dsp_sim::helicopter::Phase;
use ipc_types::code::Functionality;
use ipc_types::payload::{BridgeJournal, SharedStruct, StatusJournal};
use ipc_types::schema::{CDR_HEADER, text};
use ipc_types::{JournalPiece, MonotonicNs, RobotId};
use recording::play::key_of;
use recording::read::messages;
use recording::{Anchor, Channel, ChannelId, FlightInfo, Recorder, Settings};
use replay::{Comparison, Verifier};

use crate::missions::config::WorldConfig;
use crate::missions::operator::{Step, bring_home, fly_through_trouble, point};
use crate::missions::world::{Trouble, World};

/// Largest file of the library, bytes: it lies in the repository.
const MAX_LEN: u64 = 350_000;

/// Unix time of the simulator's zero, ns.
const UNIX_NS: u64 = 1_767_225_600_000_000_000;

fn library() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("flights")
}

/// The flights of the simulator: name, world, and the trouble with its moment.
fn flights() -> Vec<(&'static str, WorldConfig, Option<Planned>)> {
    let plain = || WorldConfig::new().wind(3.0, 200.0, 1.0);
    let lossy = || plain().loses_only();
    let on_path: When =
        |world| world.witness.state.functionality() == Some(Functionality::FollowingPath);
    let climbing: When = |world| world.simulator.helicopter().phase() == Phase::TakingOff;
    let ms = Duration::from_millis;
    vec![
        ("wind", plain(), None),
        (
            "dsp-reboots-on-path",
            lossy(),
            Some((on_path, Trouble::Reboot)),
        ),
        (
            "port-gone-on-path",
            lossy(),
            Some((on_path, Trouble::PortGone(ms(700)))),
        ),
        (
            "bridge-killed-in-take-off",
            lossy(),
            Some((climbing, Trouble::BridgeDies(ms(300)))),
        ),
        (
            "noise-on-path",
            plain().unsound().seed(4),
            Some((on_path, Trouble::Noise(ms(1500)))),
        ),
        (
            "extended-noise",
            plain().extended().unsound(),
            Some((climbing, Trouble::Noise(ms(800)))),
        ),
    ]
}

type When = fn(&World) -> bool;
type Planned = (When, Trouble);

/// A short mission, through the trouble, and home.
fn fly(config: &WorldConfig, planned: Option<Planned>) -> Vec<u8> {
    let mut world = World::new(config);
    world.keep_journals();
    if let Some((when, trouble)) = planned {
        world.plan(trouble, when);
    }
    let path = vec![point(2.0, 0.0, 2.0)];
    let steps = [
        Step::Start,
        Step::TakeOff(2.0),
        Step::Path(path),
        Step::Land,
    ];
    fly_through_trouble(&mut world, &steps);
    bring_home(&mut world);
    world.finish();
    let (bridge, status) = world.journals();
    file(&bridge, &status)
}

/// The journals as a recording.
fn file(bridge: &[BridgeJournal], status: &[StatusJournal]) -> Vec<u8> {
    let mut pieces: Vec<(u64, usize, &[u8])> = Vec::new();
    pieces.extend(
        bridge
            .iter()
            .map(|piece| (piece.published_ns, 0, piece.bytes())),
    );
    pieces.extend(
        status
            .iter()
            .map(|piece| (piece.published_ns, 1, piece.bytes())),
    );
    pieces.sort_by_key(|(published_ns, ..)| *published_ns);
    let anchor = Anchor {
        monotonic: MonotonicNs(0),
        unix_ns: UNIX_NS,
    };
    let info = FlightInfo {
        robot: RobotId::DEFAULT,
        metadata: Vec::new(),
        attachments: Vec::new(),
    };
    let mut recorder = Recorder::new(Settings::default(), info, anchor);
    let channels = [
        channel::<BridgeJournal>(&mut recorder),
        channel::<StatusJournal>(&mut recorder),
    ];
    let mut now = MonotonicNs(0);
    for (published_ns, channel, sample) in pieces {
        now = MonotonicNs(published_ns);
        let sequence = u32::from_le_bytes(*sample.first_chunk().expect("a number"));
        let message = [&CDR_HEADER[..], sample].concat();
        recorder.add(now, channels[channel], now, sequence, &message);
    }
    recorder.end(now);
    let mut file = Vec::new();
    while let Some(action) = recorder.next() {
        action.apply_to(&mut file);
        recorder.done(now, Ok(()));
    }
    file
}

fn channel<P: JournalPiece>(recorder: &mut Recorder) -> ChannelId {
    let channel = Channel {
        topic: format!("/robot1/{}", P::KEY),
        schema_name: P::LAYOUT.ros_resource_name(),
        schema_text: text(P::LAYOUT),
        metadata: Default::default(),
    };
    recorder.channel(channel).expect("room")
}

/// Drives the cores with the journals in a file.
fn verify(verifier: Verifier, file: &[u8]) -> Comparison {
    let mut verifier = verifier;
    for message in messages(file) {
        let message = message.expect("a whole file");
        let key = key_of(message.topic()).map(|(_, key)| key);
        if let Some((key, sample)) = key.zip(message.data().strip_prefix(&CDR_HEADER)) {
            verifier.take(key, sample);
        }
    }
    verifier.finish()
}

/// The files of the library, in alphabetical order.
fn files() -> Vec<PathBuf> {
    let entries = fs::read_dir(library()).expect("the library");
    let mut files: Vec<PathBuf> = entries
        .map(|entry| entry.expect("an entry").path())
        .collect();
    files.retain(|path| {
        path.extension()
            .is_some_and(|extension| extension == "mcap")
    });
    files.sort();
    files
}

#[test]
fn every_flight_of_the_library_is_verified_bit_for_bit() {
    if std::env::var_os("RIL_WRITE_FLIGHTS").is_some() {
        fs::create_dir_all(library()).expect("the library");
        for (name, config, planned) in flights() {
            let path = library().join(format!("{name}.mcap"));
            fs::write(path, fly(&config, planned)).expect("a file");
        }
    }
    let files = files();
    assert!(files.len() >= 5, "{files:?}");
    for path in files {
        let file = fs::read(&path).expect("a file");
        let name = path.display();
        let verdict = verify(Verifier::new(), &file);
        if let Some(difference) = verdict.difference() {
            panic!(
                "{name}: {difference}; the top of tests/missions/flights.rs says what to do if that is meant"
            );
        }
        assert!(verdict.is_verified(), "{name}: {verdict:?}");
        let len = file.len() as u64;
        assert!(
            len <= MAX_LEN,
            "{name} has {len} bytes: keep shorter flights"
        );
    }
}

#[test]
fn a_changed_constant_of_the_bridge_is_caught_by_the_library() {
    for path in files() {
        let file = fs::read(&path).expect("a file");
        let mut config = WorldConfig::new().bridge;
        config.status.groups.truncate(15);
        let verdict = verify(Verifier::new().against(config), &file);
        let first = verdict
            .difference()
            .unwrap_or_else(|| panic!("{}", path.display()));
        assert!(first.recorded != first.replayed, "{first}");
    }
}
