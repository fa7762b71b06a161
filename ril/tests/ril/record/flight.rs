//! A flight with the real processes: the record has every topic, as a consumer saw it.

use ril_tests::Sandbox;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use ipc_types::{RobotId, Subscriber, Topic};
use recording::read::{RecordFile, summary_of};
use ril_tests::process::Signal;

use super::feed::{assert_in_time, check, files, only_file, samples, words};
use crate::common::{end, end_all, json, sandbox};

/// A consumer that keeps all that it gets.
struct Consumer<T: Topic> {
    subscriber: Subscriber<T>,
    seen: Vec<(u64, Vec<u8>)>,
}

impl<T: Topic> Consumer<T> {
    fn new(rig: &Sandbox) -> Consumer<T> {
        let ipc = rig.domain.join_as(RobotId::DEFAULT, "consumer");
        Consumer {
            subscriber: ipc.subscriber().unwrap(),
            seen: Vec::new(),
        }
    }

    fn drain(&mut self) {
        let seen = &mut self.seen;
        let keep = |sample: &T| seen.push((sample.sequence(), sample.bytes().to_vec()));
        self.subscriber.drain(keep).unwrap();
    }

    /// Each sample that came is in the record as it was.
    #[track_caller]
    fn compare(&mut self, recorded: &[(u64, Vec<u8>)]) {
        self.drain();
        assert!(!self.seen.is_empty());
        // The consumer may have come earlier than the recorder, which may have missed what it says that it has.
        let recorded: BTreeMap<u64, &Vec<u8>> = recorded
            .iter()
            .map(|(sequence, bytes)| (*sequence, bytes))
            .collect();
        let (first, _) = recorded.first_key_value().unwrap();
        let mut compared = 0;
        for (sequence, bytes) in self.seen.iter().filter(|(sequence, _)| sequence >= first) {
            if let Some(found) = recorded.get(sequence) {
                assert_eq!(*found, bytes, "{sequence}");
                compared += 1;
            }
        }
        assert!(compared > 0);
    }
}

/// The processes began after the recorder: the file says which they were, and what they were configured with.
fn assert_processes_are_known(file: &Path, pids: [(&str, u32); 2]) {
    let summary = summary_of(&RecordFile::open(file).unwrap()).unwrap();
    // The last one of a name holds.
    let metadata: BTreeMap<_, _> = summary.metadata.iter().cloned().collect();
    let flight = &metadata["ril.flight"];
    for (process, pid) in pids {
        let key = format!("pid.{process}");
        assert_eq!(flight.get(&key), Some(&pid.to_string()), "{flight:#?}");
    }
    let command = &flight["command.bridge"];
    assert!(command.contains("--port dsp-1"), "{command}");
    assert!(metadata["ril.layouts"].contains_key("/robot1/hero/telemetry"));
    let bridge = summary
        .attachments
        .iter()
        .find(|file| file.name == "bridge.toml");
    let text = String::from_utf8_lossy(&bridge.unwrap().data);
    assert!(text.contains("pc_timeout_ms = 60000"), "{text}");
}

#[test]
fn the_record_has_what_the_bridge_runs_with_and_not_what_its_file_says_later() {
    let rig = sandbox();
    let sim = rig.sim(1, "--speed 5");
    let bridge = rig.bridge(1);
    rig.watch(1).until_ready();
    rig.write("patient.toml", "[safety.battery_v]\nwarn = 11.0\n");
    let mut recorder = rig.start(&words(""));
    recorder.wait_for_text("recorded topic=\"/robot1/bridge/configuration\"");
    rig.run("start", 0);
    end_all([bridge, sim, recorder]);
    let summary = summary_of(&RecordFile::open(&only_file(&rig)).unwrap()).unwrap();
    let file = |name: &str| {
        let files = &summary.attachments;
        let file = files.iter().rfind(|file| file.name == name).unwrap();
        String::from_utf8_lossy(&file.data).into_owned()
    };
    let running = file("bridge.running.toml");
    assert!(running.contains("pc_timeout_ms = 60000"), "{running}");
    let port = running.lines().find(|line| line.starts_with("port = "));
    assert!(
        port.is_some_and(|line| line.ends_with("# --port")),
        "{running}"
    );
    assert!(!running.contains("warn = 11.0"), "{running}");
    assert!(file("bridge.toml").contains("warn = 11.0"));
}

#[test]
fn each_file_of_a_recording_is_verified_without_the_one_before() {
    let rig = sandbox();
    let sim = rig.sim(1, "");
    let status = rig.status(1);
    let bridge = rig.bridge(1);
    rig.watch(1).until_ready();
    let mut recorder = rig.start(&words("--split 2s"));
    for _ in 0..4 {
        recorder.wait_for_text("recording file=");
    }
    end_all([bridge, status, sim, recorder]);
    for file in &files(&rig)[..3] {
        let verified = rig.run(&format!("replay {} --verify --json", file.display()), 0);
        let verified = json(&verified.stdout[0]);
        for journal in ["bridge", "status"] {
            let count = |name: &str| verified[journal][name].as_u64().unwrap();
            assert!(
                count("snapshots") > 0 && count("samples") > 0,
                "{verified:#}"
            );
        }
    }
}

#[test]
fn a_flight_is_recorded_as_a_consumer_saw_it() {
    let rig = sandbox();
    let mut recorder = rig.start(&words("--flights --json"));
    recorder.wait_for_text("recording file=");
    let mut dsp = Consumer::<DspTelemetry>::new(&rig);
    let mut hero = Consumer::<HeroTelemetry>::new(&rig);
    let mut state = Consumer::<ModuleState>::new(&rig);
    let sim = rig.sim(1, "--speed 5");
    let status = rig.status(1);
    let bridge = rig.bridge(1);
    let pids = [("bridge", bridge.id()), ("status", status.id())];
    rig.watch(1).until_ready();
    // What was ordered before is not in the record.
    recorder.wait_for_text("recorded topic=\"/robot1/bridge/journal\"");
    for order in ["start", "takeoff --altitude 5", "land", "stop"] {
        rig.run(order, 0);
        dsp.drain();
        hero.drain();
        state.drain();
    }
    end(bridge, Signal::TERM);
    end(status, Signal::TERM);
    end(sim, Signal::TERM);
    recorder.signal(Signal::TERM);
    let finished = recorder.exits(0);
    let objects: Vec<_> = finished.stdout.iter().map(|line| json(line)).collect();
    let (last, closed) = objects.split_last().unwrap();
    assert_eq!(last["schema"], "ril.Record.v1");
    assert_eq!(last["dropped"], 0);
    assert_eq!(closed.len(), files(&rig).len());
    assert!(
        closed.iter().all(|file| file["whole"] == true),
        "{closed:?}"
    );

    let file = only_file(&rig);
    dsp.compare(&samples(&file, "/robot1/dsp/telemetry"));
    hero.compare(&samples(&file, "/robot1/hero/telemetry"));
    state.compare(&samples(&file, "/robot1/bridge/state"));
    assert_in_time(&file);
    let check = check(&file);
    assert!(check.is_complete);
    let topics: BTreeSet<&str> = check.topics.keys().map(String::as_str).collect();
    for topic in [
        "/robot1/dsp/telemetry",
        "/robot1/hero/telemetry",
        "/robot1/bridge/state",
        "/robot1/status/state",
        "/robot1/fix",
        "/robot1/pose",
        "/robot1/imu/data",
        "/robot1/battery_state",
        "/robot1/flown_path",
        "/tf",
        "/robot1/log",
        "/robot1/bridge/journal",
        "/robot1/requests",
    ] {
        assert!(topics.contains(topic), "{topic}: {topics:?}");
    }
    // Each byte of the serial line is there once: in the journal.
    assert!(
        !topics.iter().any(|topic| topic.contains("serial")),
        "{topics:?}"
    );
    assert_processes_are_known(&file, pids);
    let name = file.display();
    rig.run(&format!("log check {name}"), 0);
    let summary = json(&rig.run(&format!("log summary {name} --json"), 0).stdout[0]);
    assert_eq!(summary["take_offs"], 1, "{summary:#}");
    assert_eq!(summary["utc_source"], "column");
    let report = format!("log report {name} --output report.html --json");
    let report = json(&rig.run(&report, 0).stdout[0]);
    assert_eq!(report["samples"], summary["rows"], "{report:#}");
    let page = std::fs::read_to_string(rig.folder().join("report.html")).unwrap();
    for expected in [
        "taking off",
        "landing",
        "Requests",
        "takeoff",
        "\"name\":\"asked for\"",
        "ril.flight",
    ] {
        assert!(page.contains(expected), "{expected}");
    }
    // A file that its recorder did not finish says what its chunks have.
    let bytes = std::fs::read(&file).unwrap();
    let cut = rig.path("cut.mcap");
    std::fs::write(&cut, &bytes[..bytes.len() * 3 / 4]).unwrap();
    let of_cut = summary_of(&RecordFile::open(&cut).unwrap()).unwrap();
    assert!(!of_cut.is_complete && of_cut.first_ns.is_some());
    assert!(
        of_cut.topics.contains_key("/robot1/dsp/telemetry"),
        "{of_cut:#?}"
    );
    let finished = rig.run("log summary cut.mcap --json", 8);
    let rows = json(&finished.stdout[0])["rows"].as_u64().unwrap();
    assert!(
        (1..summary["rows"].as_u64().unwrap()).contains(&rows),
        "{finished:#?}"
    );
    finished.err_says("of a row that is cut off");
    // A part of it is a record, too, with the times of the whole.
    let part = "--topic dsp/telemetry --topic requests --from 500ms --to 2s --output part.mcap";
    rig.run(&format!("log export {name} {part}"), 0);
    rig.run(&format!("log export {name} {part}"), 2)
        .err_says("exists already")
        .err_says("name another file with --output");
    rig.run("log check part.mcap", 0);
    let part = self::check(&rig.folder().join("part.mcap"));
    let of_part: Vec<&str> = part.topics.keys().map(String::as_str).collect();
    assert_eq!(of_part[0], "/robot1/dsp/telemetry");
    assert!(of_part.len() <= 2 && part.errors.is_empty(), "{part:#?}");
    let start_ns = check.first_ns.unwrap();
    assert!(part.first_ns.unwrap() >= start_ns + 500_000_000);
    assert!(part.last_ns.unwrap() <= start_ns + 2_000_000_000);
    let nothing = format!("log export {name} --from 1h --output nothing.mcap");
    rig.run(&nothing, 2)
        .err_says("no message of these topics lies in this time");
    assert!(!rig.path("nothing.mcap").exists());
    let csv = rig.run(&format!("log csv {name}"), 0).stdout;
    assert_eq!(csv.len() as u64, 1 + summary["rows"].as_u64().unwrap());
    let tail = rig.run(&format!("log tail -n 3 {name}"), 0).stdout;
    assert_eq!(tail.len(), 3);
    let list = rig.run("log list --dir record --json", 0).stdout;
    assert_eq!(
        json(&list[0])["file"]
            .as_str()
            .map(|path| path.ends_with(".mcap")),
        Some(true)
    );
}
