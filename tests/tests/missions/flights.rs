//! The library of kept flights, `tests/flights`: every file must verify bit for bit, whichever change is made to the
//! bridge or to status. `ril replay FILE --keep tests/flights` adds a flight. After a change that is meant,
//!
//! ```sh
//! RIL_WRITE_FLIGHTS=1 cargo test -p ril-tests --test main flights::
//! ```
//!
//! flies those of the simulator again, with their faults, and gives the inputs of all others to the changed cores. When
//! an input has another form, nobody reads the others any more: a new recording (`ril demo --folder FOLDER`) takes the
//! place of each.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use dsp_sim::helicopter::Phase;
use ipc_types::Topic;
use ipc_types::code::Functionality;
use ipc_types::payload::{BridgeJournal, SharedStruct, StatusJournal};
use replay::{Comparison, Keeper, Verifier, renew};

use crate::missions::config::WorldConfig;
use crate::missions::operator::{Step, bring_home, fly_through_trouble, point};
use crate::missions::world::{Trouble, World};

/// Largest file of the library, bytes: it lies in the repository.
const MAX_LEN: usize = 250_000;

/// Most bytes of a file for each second of its flight.
const MAX_RATE: f64 = 10_000.0;

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

/// The journals as a kept flight.
fn file(bridge: &[BridgeJournal], status: &[StatusJournal]) -> Vec<u8> {
    let mut keeper = Keeper::default();
    for piece in bridge {
        keeper.take(BridgeJournal::KEY, piece.bytes());
    }
    for piece in status {
        keeper.take(StatusJournal::KEY, piece.bytes());
    }
    let kept = keeper.finish().expect("a journal");
    assert!(kept.is_from_the_start);
    kept.file
}

/// Drives the cores with a kept flight.
#[track_caller]
fn verify(verifier: Verifier, file: &[u8]) -> Comparison {
    let mut verifier = verifier;
    verifier.take_kept(file).expect("a kept flight");
    verifier.finish()
}

/// The files of the library, in alphabetical order.
fn files() -> Vec<PathBuf> {
    let entries = fs::read_dir(library()).expect("the library");
    let mut files: Vec<PathBuf> = entries
        .map(|entry| entry.expect("an entry").path())
        .collect();
    files.sort();
    files
}

/// Flies the simulated flights again; the others keep their inputs.
fn write_library() {
    fs::create_dir_all(library()).expect("the library");
    let mut others = files();
    for (name, config, planned) in flights() {
        let path = library().join(format!("{name}.kept"));
        others.retain(|other| *other != path);
        fs::write(path, fly(&config, planned)).expect("a file");
    }
    for path in others {
        let kept = fs::read(&path).expect("a file");
        fs::write(path, renew(&kept).expect("a kept flight")).expect("a file");
    }
}

/// How long the cores were driven, s.
fn length(verdict: &Comparison) -> f64 {
    let spans = verdict.bridge.spans.iter();
    spans
        .map(|span| span.to.since(span.from).as_secs_f64())
        .sum()
}

#[test]
fn every_flight_of_the_library_is_verified_bit_for_bit() {
    if std::env::var_os("RIL_WRITE_FLIGHTS").is_some() {
        write_library();
    }
    let files = files();
    assert!(files.len() > flights().len(), "{files:?}");
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
        let (len, seconds) = (file.len(), length(&verdict));
        println!("{name}: {len} bytes, {:.0} a second", len as f64 / seconds);
        assert!(
            len <= MAX_LEN && len as f64 <= MAX_RATE * seconds,
            "{name} has {len} bytes for {seconds:.1} s: keep shorter flights"
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
