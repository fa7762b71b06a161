//! `ril replay FILE --verify`, `--against` and `--keep`, with a flight of the library.

use ril_tests::Sandbox;
use std::fs;
use std::path::{Path, PathBuf};

use super::made::record;
use crate::common::{json, sandbox, says};

fn flight() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/flights/wind.mcap")
}

/// A folder with the flight and configurations of the bridge: the one with which it was flown, and another one.
fn rig() -> Sandbox {
    let rig = sandbox();
    fs::copy(flight(), rig.folder().join("wind.mcap")).unwrap();
    rig.write("same.toml", "[movement]\ntime_limit_s = 60.0\n");
    let other = "[movement]\ntime_limit_s = 60.0\n[safety.battery_v]\nwarn = 99.0\n";
    rig.write("other.toml", other);
    rig.write("wrong.toml", "[movement]\nnonsense = 1\n");
    rig
}

#[test]
fn a_flight_is_verified_bit_for_bit() {
    let rig = rig();
    rig.run("replay wind.mcap --verify", 0)
        .out_says("the same, bit for bit")
        .out_says("times as fast");
    let object = json(&rig.run("replay wind.mcap --verify --json", 0).stdout[0]);
    assert_eq!(object["schema"], "ril.Verification.v1");
    assert_eq!(object["verified"], true);
    assert!(object["first_difference"].is_null(), "{object:#}");
    assert!(
        object["bridge"]["samples"].as_u64().unwrap() > 100,
        "{object:#}"
    );
    assert!(
        object["status"]["samples"].as_u64().unwrap() > 100,
        "{object:#}"
    );
    rig.run("replay wind.mcap --against same.toml", 0);
}

#[test]
fn another_configuration_is_a_difference_with_time_topic_field_and_both_values() {
    let rig = rig();
    let text = rig.run("replay wind.mcap --against other.toml", 8);
    text.out_says("DIFFERENT");
    text.out_says("more, which may be a consequence");
    let expected = "module_state: safety.amount was 0 and is ";
    assert!(
        says(&text.stdout, expected) && says(&text.stderr, expected),
        "{text:#?}"
    );
    let lines = rig
        .run("replay wind.mcap --against other.toml --json", 8)
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
    rig.run("replay wind.mcap --keep library/new", 0)
        .err_says("library/new/wind.mcap");
    rig.run("replay library/new/wind.mcap --verify", 0);
    rig.run("replay wind.mcap --keep library/new", 2)
        .err_says("exists already")
        .err_says("name another folder with --keep");
}

#[test]
fn what_cannot_be_verified_is_told() {
    let rig = rig();
    record(rig.folder());
    for (args, code, expected) in [
        ("replay flight.mcap --verify", 2, "has no journal"),
        ("replay flight.mcap --keep library", 2, "has no journal"),
        ("replay same.toml --verify", 2, "not an MCAP file"),
        ("replay none.mcap --verify", 2, "none.mcap cannot be read"),
        ("replay wind.mcap --against wrong.toml", 78, "nonsense"),
        (
            "replay wind.mcap --verify --speed 2",
            2,
            "cannot be used with",
        ),
    ] {
        rig.run(args, code).err_says(expected);
    }
    // A byte in the middle of a journal.
    let mut bytes = fs::read(flight()).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x55;
    fs::write(rig.folder().join("damaged.mcap"), bytes).unwrap();
    let damaged = rig.start("replay damaged.mcap --verify").wait_exit();
    assert!(matches!(damaged.code(), Some(0 | 2 | 8)), "{damaged:#?}");
}
