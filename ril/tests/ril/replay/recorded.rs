//! What `ril record` has recorded of the real processes is verified, played, and kept.

use std::fs;
use std::sync::LazyLock;

use ril_tests::Sandbox;
use ril_tests::sandbox::records_in;

use super::made::record;
use crate::common::{end_all, json, sandbox};

/// A flight of the real processes.
pub struct RecordedFlight {
    /// The file.
    pub file: Vec<u8>,
    /// The configuration of its bridge.
    pub config: String,
}

/// One that was recorded from the start of the processes, for all tests of what follows from a recording.
pub static RECORDED: LazyLock<RecordedFlight> = LazyLock::new(|| fly_and_record(&sandbox()));

fn fly_and_record(rig: &Sandbox) -> RecordedFlight {
    let mut recorder = rig.start("record --output rec --min-free 0");
    recorder.wait_for_text("recording file=");
    let status = rig.status(1);
    let bridge = rig.bridge(1);
    // Until the DSP speaks, the journals wait for the recorder with the start of the processes.
    for journal in ["bridge/journal", "status/journal"] {
        recorder.wait_for_text(&format!("recorded topic=\"/robot1/{journal}\""));
    }
    let sim = rig.sim(1, "--speed 5");
    rig.watch(1).until_ready();
    for order in ["start", "takeoff --altitude 3", "land", "stop"] {
        rig.run(order, 0);
    }
    end_all([bridge, status, sim, recorder]);
    let files = records_in(&rig.folder().join("rec"));
    assert_eq!(files.len(), 1, "{files:?}");
    RecordedFlight {
        file: fs::read(&files[0]).unwrap(),
        config: fs::read_to_string(rig.path("patient.toml")).unwrap(),
    }
}

#[test]
fn what_was_recorded_is_verified_bit_for_bit_and_played() {
    let rig = sandbox();
    fs::write(rig.path("flight.mcap"), &RECORDED.file).unwrap();
    rig.run("replay flight.mcap --verify", 0)
        .out_says("the same, bit for bit")
        .out_says("times as fast");
    let object = json(&rig.run("replay flight.mcap --verify --json", 0).stdout[0]);
    assert_eq!(object["schema"], "ril.Verification.v1");
    assert_eq!(object["verified"], true, "{object:#}");
    assert!(object["first_difference"].is_null(), "{object:#}");
    for journal in ["bridge", "status"] {
        let count = |name: &str| object[journal][name].as_u64().unwrap();
        let of_file = count("samples") - count("samples_before");
        assert!(of_file > 100, "{object:#}");
    }
    let played = rig.run("replay flight.mcap --speed 100 --json", 0);
    let summary = json(played.stdout.last().unwrap());
    assert_eq!(summary["schema"], "ril.Replay.v1");
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
