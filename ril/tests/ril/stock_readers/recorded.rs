//! A flight with the real processes, recorded by `ril record`: every field of every message is what a live consumer
//! saw.

use std::path::{Path, PathBuf};

use ipc_types::DynamicPublisher;
use ril_tests::Sandbox;
use ril_tests::process::Signal;
use ril_tests::readers::Reader;
use ril_tests::readers::expected::{Expected, Line, Read};
use ril_tests::readers::readers_or_skip;
use ril_tests::sandbox::records_in;
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
        assert_viewers_see_the_flight(read, reader);
        assert_profiles(read);
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
        for order in ["start", "takeoff --altitude 5", "goto +8,+3"] {
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
    let mut files = records_in(folder);
    assert_eq!(files.len(), 1, "{files:?}");
    files.remove(0)
}

/// Names of the messages for viewers.
const OF_VIEWERS: [(&str, &str); 7] = [
    ("/robot1/fix", "altitude"),
    ("/robot1/pose", "pose.position.z"),
    ("/tf", "transforms[0].transform.translation.z"),
    ("/robot1/imu/data", "linear_acceleration.z"),
    ("/robot1/battery_state", "voltage"),
    ("/robot1/planned_path", "poses[0].pose.position.z"),
    ("/robot1/flown_path", "poses[0].pose.position.z"),
];

/// The number of this name in a message; `None` if it has none.
fn value(line: &Line, name: &str) -> Option<f64> {
    let fields = line.fields.iter();
    let mut values = fields.filter_map(|field| field.strip_prefix(name)?.strip_prefix('='));
    let bits = u64::from_str_radix(values.next()?, 16).expect("a float");
    Some(f64::from_bits(bits))
}

/// What is made for viewers says what the telemetry of the same time says.
#[track_caller]
fn assert_viewers_see_the_flight(read: &Read, reader: &Reader) {
    let values = |topic: &str, name: &str| -> Vec<f64> {
        let lines = read.messages.get(topic).into_iter().flatten();
        lines.filter_map(|line| value(line, name)).collect()
    };
    for (topic, name) in OF_VIEWERS {
        assert!(!values(topic, name).is_empty(), "{reader}: {topic}");
    }
    let telemetry = values("/robot1/hero/telemetry", "geodetic.altitude_m");
    for (topic, name) in &OF_VIEWERS[..3] {
        let altitudes = values(topic, name);
        let are_of_telemetry = altitudes
            .iter()
            .all(|altitude| telemetry.contains(altitude));
        assert!(are_of_telemetry, "{reader}: {topic}");
        let flew = altitudes
            .iter()
            .any(|altitude| *altitude > altitudes[0] + 4.0);
        assert!(flew, "{reader}: {topic}");
    }
    // The simulated fix is one of RTK.
    let errors = values("/robot1/fix", "position_covariance[8]");
    assert!(errors.contains(&0.04_f64.powi(2)), "{reader}: {errors:?}");
    // The plan was flown to its end, and the track came by where it was to lead.
    let planned = &read.messages["/robot1/planned_path"];
    assert_eq!(value(planned.last().unwrap(), OF_VIEWERS[5].1), None);
    let place = |line: &Line, index: usize| {
        ["x", "y", "z"].map(|axis| value(line, &format!("poses[{index}].pose.position.{axis}")))
    };
    let [Some(x), Some(y), Some(z)] = place(&planned[0], 0) else {
        panic!("{reader}: {:?}", planned[0]);
    };
    let flown = read.messages["/robot1/flown_path"].last().unwrap();
    let track = (0..).map_while(|index| {
        let [x, y, z] = place(flown, index);
        Some([x?, y?, z?])
    });
    let nearest = track
        .map(|at| (at[0] - x).hypot(at[1] - y).hypot(at[2] - z))
        .fold(f64::INFINITY, f64::min);
    assert!(nearest < 3.0, "{reader}: {nearest} m from {x} {y} {z}");
}

/// What a reader says of quality of service, if it says anything: reliability, durability, depth.
#[track_caller]
fn assert_profiles(read: &Read) {
    if read.profiles.is_empty() {
        return;
    }
    for (topic, expected) in [
        ("/robot1/hero/telemetry", [2, 2, 5]),
        ("/robot1/bridge/state", [1, 2, 10]),
        ("/robot1/recording/events", [1, 2, 10]),
        ("/robot1/fix", [2, 2, 5]),
        ("/robot1/log", [1, 2, 10]),
        ("/robot1/flown_path", [1, 1, 1]),
        ("/tf", [1, 2, 100]),
    ] {
        assert_eq!(read.profiles.get(topic), Some(&vec![expected]), "{topic}");
    }
}
