//! A flight with the real processes, recorded by `ril record`: every field of every message is what a live consumer saw.

use std::path::{Path, PathBuf};

use ipc_types::DynamicPublisher;
use ril_tests::Sandbox;
use ril_tests::process::Signal;
use ril_tests::readers::Reader;
use ril_tests::readers::expected::{Expected, Line, Read};
use ril_tests::readers::readers_or_skip;
use ril_tests::stranger::STRANGER;

use super::consumer::{Consumer, FILLING, LAST_FILLING, STRANGER_KEY, Seen};
use super::documents::Programs;

/// Simulated seconds for one of the host: the flight takes a few seconds.
const SPEED: u32 = 10;

#[test]
fn a_recorded_flight_is_read_by_all_as_a_live_consumer_saw_it() {
    let readers = readers_or_skip("a recorded flight");
    if readers.is_empty() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let flight = Flight::record(folder.path());
    let reads: Vec<Read> = readers
        .iter()
        .map(|reader| read_one(reader, &flight.finished))
        .collect();
    let programs = Programs::with(&flight.finished);
    // A reader that gives all there is comes first: `mcap` in Python, or else one of JavaScript.
    let all = Expected(reads[0].messages.clone());
    for (reader, read) in readers.iter().zip(&reads) {
        assert_eq!(read.error, None, "{reader}");
        all.assert_all_in(read, &reader.to_string());
        flight.seen.assert_recorded(read, reader);
        assert_fix_is_of_telemetry(read, reader);
        if reader.is_first_of_its_language() {
            programs.run(reader);
        }
    }
    for reader in readers.iter().filter(|reader| reader.reads_unfinished()) {
        let read = read_one(reader, &flight.killed);
        assert!(
            read.error.is_none() || reader.goes_on_behind_the_end(),
            "{reader}: {read:?}"
        );
        flight.seen.assert_without_hole(&read, &all, reader);
    }
}

#[track_caller]
fn read_one(reader: &Reader, file: &Path) -> Read {
    reader.read(&[file]).remove(0)
}

/// A flight, recorded twice.
struct Flight {
    /// By a recorder that ended in order.
    finished: PathBuf,
    /// By a recorder that was killed in the flight.
    killed: PathBuf,
    seen: Seen,
}

impl Flight {
    fn record(folder: &Path) -> Flight {
        let rig = Sandbox::of(env!("CARGO_BIN_EXE_ril"));
        let ipc = rig.domain.join("battery-watch");
        let mut stranger = DynamicPublisher::open(&ipc, STRANGER_KEY, STRANGER).unwrap();
        stranger
            .publish(|sample| sample[16..].fill(FILLING))
            .unwrap();
        let robot = rig.start_robot(1, SPEED);
        let [finishing, mut killed] = ["finished", "killed"].map(|name| {
            let output = folder.join(name);
            let output = output.display();
            let mut recorder = rig.start(&format!("record --min-free 0 --output {output}"));
            recorder.wait_for_text("recording file=");
            recorder
        });
        let consumer = Consumer::start(&rig.domain);
        for order in ["start", "takeoff --altitude 5"] {
            stranger
                .publish(|sample| sample[16..].fill(FILLING))
                .unwrap();
            rig.run(order, 0);
        }
        killed.signal(Signal::KILL);
        for order in ["land", "stop"] {
            stranger
                .publish(|sample| sample[16..].fill(FILLING))
                .unwrap();
            rig.run(order, 0);
        }
        stranger
            .publish(|sample| sample[16..].fill(LAST_FILLING))
            .unwrap();
        let seen = consumer.end();
        finishing.end();
        killed.wait_exit();
        robot.end();
        drop((stranger, ipc));
        rig.domain.sweep();
        Flight {
            finished: only_file(&folder.join("finished")),
            killed: only_file(&folder.join("killed")),
            seen,
        }
    }
}

#[track_caller]
fn only_file(folder: &Path) -> PathBuf {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    assert_eq!(files.len(), 1, "{files:?}");
    files.remove(0)
}

/// The position for viewers is that of the telemetry of the same time.
#[track_caller]
fn assert_fix_is_of_telemetry(read: &Read, reader: &Reader) {
    let value = |line: &Line, name: &str| {
        let mut values = line
            .fields
            .iter()
            .filter_map(|field| field.strip_prefix(name));
        f64::from_bits(u64::from_str_radix(values.next().unwrap(), 16).unwrap())
    };
    let altitudes = |topic: &str, name| -> Vec<f64> {
        read.messages[topic]
            .iter()
            .map(|line| value(line, name))
            .collect()
    };
    let fixes = altitudes("/robot1/fix", "altitude=");
    let telemetry = altitudes("/robot1/hero/telemetry", "geodetic.altitude_m=");
    assert!(!fixes.is_empty());
    assert!(
        fixes.iter().all(|altitude| telemetry.contains(altitude)),
        "{reader}"
    );
    assert!(
        fixes.iter().any(|altitude| *altitude > fixes[0] + 4.0),
        "{reader}: it flew"
    );
}
