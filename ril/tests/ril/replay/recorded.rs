//! What `ril record` has recorded of the real processes is verified, and played.

use std::fs;

use ril_tests::process::Signal;
use ril_tests::sandbox::records_in;

use super::made::record;
use crate::common::{end, json, sandbox};

#[test]
fn what_was_recorded_is_verified_bit_for_bit_and_played() {
    let rig = sandbox();
    let mut recorder = rig.start("record --output rec --min-free 0");
    recorder.wait_for_text("recording file=");
    let sim = rig.sim(1, "--speed 5");
    let status = rig.status(1);
    let bridge = rig.bridge(1);
    rig.watch(1).until_ready();
    // What was ordered before is not in the record.
    recorder.wait_for_text("recorded topic=\"/robot1/bridge/journal\"");
    for order in ["start", "takeoff --altitude 3", "land", "stop"] {
        rig.run(order, 0);
    }
    for process in [bridge, status, sim, recorder] {
        end(process, Signal::TERM);
    }
    let files = records_in(&rig.folder().join("rec"));
    assert_eq!(files.len(), 1, "{files:?}");
    fs::rename(&files[0], rig.folder().join("flight.mcap")).unwrap();

    let object = json(&rig.run("replay flight.mcap --verify --json", 0).stdout[0]);
    assert_eq!(object["verified"], true, "{object:#}");
    for journal in ["bridge", "status"] {
        assert!(
            object[journal]["samples"].as_u64().unwrap() > 100,
            "{object:#}"
        );
    }
    let played = rig.run("replay flight.mcap --speed 100 --json", 0);
    let summary = json(played.stdout.last().unwrap());
    assert!(summary["samples"].as_u64().unwrap() > 200, "{summary}");
    // Four requests, and what became of them.
    assert!(summary["requests"].as_u64().unwrap() >= 8, "{summary}");
    played.out_says("\"command\":\"takeoff\"");
}

#[test]
fn without_a_file_the_record_of_the_last_flight_is_meant_and_not_one_of_the_ground() {
    let rig = sandbox();
    let made = record(rig.folder());
    rig.run(
        "log export flight.mcap --from 7050ms --output ground.mcap",
        0,
    );
    fs::create_dir(rig.path("log")).unwrap();
    let [flown, ground] = [10, 11].map(|hour| format!("log/hero1_2026-11-01T{hour}-00-00Z.mcap"));
    fs::rename(&made.file, rig.path(&flown)).unwrap();
    fs::rename(rig.path("ground.mcap"), rig.path(&ground)).unwrap();
    let of_ground = json(&rig.run(&format!("log summary {ground} --json"), 0).stdout[0]);
    assert_eq!(of_ground["take_offs"], 0, "{of_ground:#}");
    for verb in ["summary", "report", "check"] {
        let object = json(&rig.run(&format!("log {verb} --dir log --json"), 0).stdout[0]);
        let text = object.to_string();
        assert!(text.contains("T10-00-00Z"), "{verb}: {object:#}");
    }
}
