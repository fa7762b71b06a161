//! `ril replay FILE --verify`, `--against` and `--keep`, with a flight of the real processes and one of the library.

use ril_tests::Sandbox;
use std::fs;
use std::path::{Path, PathBuf};

use super::made::record;
use super::recorded::RECORDED;
use crate::common::{json, sandbox, says};

/// A kept flight.
fn kept() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/flights/demo.kept")
}

/// A folder with a recorded and a kept flight, and configurations of the bridge: that of the recorded one, and other
/// ones.
fn rig() -> Sandbox {
    let rig = sandbox();
    fs::write(rig.path("real.mcap"), &RECORDED.file).unwrap();
    fs::copy(kept(), rig.path("demo.kept")).unwrap();
    rig.write("same.toml", &RECORDED.config);
    // The flight may be shorter than a supply must be low by default.
    let other = "[safety]\nsupply_for_s = 0.1\nbattery_v = { warn = 99.0 }\n";
    let other = format!("{}\n{other}", RECORDED.config);
    rig.write("other.toml", &other);
    rig.write("wrong.toml", "[movement]\nnonsense = 1\n");
    rig
}

#[test]
fn another_configuration_is_a_difference_with_time_topic_field_and_both_values() {
    let rig = rig();
    rig.run("replay real.mcap --against same.toml", 0);
    let text = rig.run("replay real.mcap --against other.toml", 8);
    text.out_says("DIFFERENT");
    text.out_says("more, which may be a consequence");
    let expected = "module_state: safety.amount was 0 and is ";
    assert!(
        says(&text.stdout, expected) && says(&text.stderr, expected),
        "{text:#?}"
    );
    let lines = rig
        .run("replay real.mcap --against other.toml --json", 8)
        .stdout;
    let first = &json(&lines[0])["first_difference"];
    assert_eq!(first["topic"], "module_state");
    assert_eq!(first["field"], "safety.amount");
    assert_eq!(first["recorded"], "0");
    assert!(first["at_s"].as_f64().unwrap() < 60.0, "{first:#}");
    assert_eq!(json(&lines[1])["exit_code"], 8);
}

#[test]
fn a_recording_becomes_a_test_by_one_command() {
    let rig = rig();
    rig.run("replay real.mcap --keep library/new", 0).err_says(
        "library/new/real.kept has the inputs of the flight from the start of the processes",
    );
    let verify = "replay library/new/real.kept --verify";
    let [of_record, of_kept] = ["replay real.mcap --verify", verify]
        .map(|args| json(&rig.run(&format!("{args} --json"), 0).stdout[0]));
    for journal in ["bridge", "status"] {
        for figure in ["inputs", "samples", "states", "reports", "bytes_sent"] {
            assert_eq!(
                of_kept[journal][figure], of_record[journal][figure],
                "{figure}"
            );
        }
    }
    rig.run("replay real.mcap --keep library/new", 2)
        .err_says("exists already")
        .err_says("name another folder with --keep");
    // A changed behaviour is found, and the library would fail.
    let changed = rig.run(&verify.replace("--verify", "--against other.toml"), 8);
    changed.out_says("DIFFERENT").out_says("module_state: ");
    // What is kept is small beside the recording, and has no snapshot.
    let size = |name: &str| fs::metadata(rig.path(name)).unwrap().len();
    let (kept, recorded) = (size("library/new/real.kept"), size("real.mcap"));
    assert!(kept * 5 < recorded, "{kept} of {recorded}");
}

#[test]
fn what_cannot_be_verified_is_told() {
    let rig = rig();
    record(rig.folder());
    let mut bytes = fs::read(kept()).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x55;
    fs::write(rig.path("damaged.kept"), &bytes).unwrap();
    bytes[8] = 9;
    fs::write(rig.path("newer.kept"), &bytes).unwrap();
    for (args, code, expected) in [
        ("replay flight.mcap --verify", 2, "has no journal"),
        ("replay flight.mcap --keep library", 2, "has no journal"),
        ("replay same.toml --verify", 2, "not an MCAP file"),
        ("replay none.mcap --verify", 2, "none.mcap cannot be read"),
        ("replay real.mcap --against wrong.toml", 78, "nonsense"),
        (
            "replay damaged.kept --verify",
            2,
            "damaged.kept: it is damaged",
        ),
        ("replay newer.kept --verify", 2, "its format is version 9"),
        (
            "replay demo.kept --keep library",
            2,
            "is a kept flight already",
        ),
        ("replay demo.kept", 2, "has inputs, and no samples to play"),
        (
            "replay real.mcap --verify --speed 2",
            2,
            "cannot be used with",
        ),
    ] {
        rig.run(args, code).err_says(expected);
    }
    // A byte in the middle of a journal.
    let mut bytes = RECORDED.file.clone();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x55;
    fs::write(rig.folder().join("damaged.mcap"), bytes).unwrap();
    let damaged = rig.start("replay damaged.mcap --verify").wait_exit();
    assert!(matches!(damaged.code(), Some(0 | 2 | 8)), "{damaged:#?}");
}
