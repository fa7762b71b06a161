//! `ril preflight`, and what `ril start` says of it.

use ril_tests::Sandbox;
use std::fs;

use ipc_types::Subscriber;
use ipc_types::payload::DspTelemetry;
use ril_tests::process::Signal;
use rustix::process::{Pid, Resource, Rlimit, getrlimit, prlimit};
use serde_json::Value;

use super::station::{STATUS, station};
use crate::common::{end, end_all, json, sandbox};
use crate::watch::screen::on_terminal;

/// The report of `ril preflight --json`, which must end with `code`.
#[track_caller]
fn report(rig: &Sandbox, args: &str, code: i32) -> Value {
    let finished = rig.run(&format!("preflight --json {args}"), code);
    // A second object tells of the failure.
    let count = 1 + usize::from(code != 0);
    assert_eq!(finished.stdout.len(), count, "{finished:#?}");
    let report = json(&finished.stdout[0]);
    assert_eq!(report["schema"], "ril.Preflight.v1");
    report
}

/// The verdict of the check `id`, such as `pass`; `none` when it could not be made.
fn verdict<'a>(report: &'a Value, id: &str) -> &'a str {
    let checks = report["checks"].as_array().unwrap();
    let check = checks.iter().find(|check| check["id"] == id);
    let check = check.unwrap_or_else(|| panic!("{id}: {report}"));
    check["verdict"].as_str().unwrap_or("none")
}

#[test]
fn a_robot_that_is_ready_passes_and_starts_without_a_word() {
    let rig = sandbox();
    let station = station(&rig, 1);
    let first = report(&rig, "--strict", 0);
    assert_eq!(first["verdict"], "pass", "{first:#}");
    let unmade: Vec<&Value> = first["checks"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|check| check["checked"] == false)
        .map(|check| &check["id"])
        .collect();
    assert!(unmade.is_empty(), "{unmade:?}");
    let finished = rig.run("preflight", 0);
    for expected in [
        "ok    bridge          running (process ",
        "ok    battery         25.2 V; limit: at least 24 V (fail below 23 V)",
        "ok    fence           1 area in force",
        "ok    orders          the bridge answers",
        "ready to take off: 0 failed, 0 warnings, ",
    ] {
        finished.out_says(expected);
    }
    let lines = on_terminal(&rig, "preflight", 0);
    assert!(
        lines.len() > finished.stdout.len(),
        "long lines are divided"
    );
    let started = rig.run("start", 0);
    assert_eq!(started.stdout, ["start: done"]);
    // A start waits for samples for half a second only, which may be too short here: then it says what it has not
    // checked.
    let trouble = started.stderr.iter();
    let trouble = trouble.filter(|line| !line.contains("not checked"));
    for id in ["battery", "fence", "log-room", "serial-port"] {
        let mut lines = trouble.clone();
        assert!(!lines.any(|line| line.contains(id)), "{id}: {started:#?}");
    }
    station.end();
}

#[test]
fn an_empty_battery_and_a_missing_fix_fail_and_a_start_says_so_and_goes_on() {
    let rig = sandbox();
    rig.write(
        "dsp-sim.toml",
        "[energy]\nbattery_v = 22.0\nfuel_percent = 40\n[gps]\nfix_after_s = 3600.0\n",
    );
    let station = station(&rig, 1);
    let report = report(&rig, "", 8);
    for (id, expected) in [
        ("battery", "fail"),
        ("gps-fix", "fail"),
        ("fuel", "warn"),
        ("home", "none"),
        ("dsp-link", "pass"),
        ("telemetry", "pass"),
    ] {
        assert_eq!(verdict(&report, id), expected, "{report:#}");
    }
    let started = rig.run("start", 0);
    for expected in [
        "not ready to take off: battery: 22.0 V",
        "not ready to take off: gps-fix: quality 0 (no fix)",
        "`ril preflight` says what to do",
    ] {
        started.err_says(expected);
    }
    assert_eq!(started.stdout, ["start: done"]);
    station.end();
}

#[test]
fn a_dead_link_fails_and_what_depends_on_it_is_not_judged() {
    use ipc_types::code::LinkState;
    let rig = sandbox();
    // Old telemetry is what this is about.
    rig.write(
        "ril.toml",
        "[observe]\ntimeout_s = 60.0\n[preflight]\nmax_age_s = 0.1\nlog_room_mib = 0\n",
    );
    let station = station(&rig, 1);
    end(station.sim, Signal::INT);
    rig.watch(1).until("the port is gone", |state| {
        state.link.state() == Some(LinkState::Gone)
            && ipc_types::MonotonicNs::now()
                .since(ipc_types::MonotonicNs(state.link.last_telemetry_ns))
                > std::time::Duration::from_millis(100)
    });
    let report = report(&rig, "", 8);
    for (id, expected) in [
        ("bridge", "pass"),
        ("dsp-link", "fail"),
        ("telemetry", "fail"),
        ("battery", "none"),
        ("fence", "pass"),
    ] {
        assert_eq!(verdict(&report, id), expected, "{id}: {report:#}");
    }
    on_terminal(&rig, "preflight", 8);
    end_all([station.status, station.bridge]);
}

/// Subscribers use up the descriptors of a bridge that may have few. Then either an order is answered all the same, or
/// the robot is not ready.
#[test]
fn a_robot_that_would_not_answer_an_order_is_not_ready() {
    let rig = sandbox();
    let station = station(&rig, 1);
    let ipc = rig.domain.join("consumer");
    let mut watch = rig.watch(1);
    let process = Pid::from_raw(station.bridge.id() as i32);
    let open = fs::read_dir(format!("/proc/{}/fd", station.bridge.id())).unwrap();
    let limits = Rlimit {
        current: Some(open.count() as u64 + 10),
        ..getrlimit(Resource::Nofile)
    };
    prlimit(process, Resource::Nofile, limits).unwrap();
    let subscribers: Vec<Subscriber<DspTelemetry>> =
        (0..16).filter_map(|_| ipc.subscriber().ok()).collect();
    let sequence = watch.until("a state", |_| true).sequence;
    // The bridge takes in new subscribers before it publishes.
    watch.until("a later state", |state| state.sequence > sequence + 1);
    let preflight = rig.start("preflight --json --timeout 3s").wait_exit();
    let report = json(&preflight.stdout[0]);
    let land = rig.start("land --timeout 3s").wait_exit();
    match verdict(&report, "orders") {
        "pass" => assert_ne!(land.code(), Some(4), "{land:#?}"),
        "fail" => assert_eq!((preflight.code(), land.code()), (Some(8), Some(4))),
        other => panic!("{other}: {report:#}"),
    }
    drop(subscribers);
    station.end();
}

#[test]
fn a_wrong_configuration_and_logs_without_a_folder_to_write_are_found() {
    let rig = sandbox();
    rig.write(
        "status.toml",
        "[[log]]\ndirectory = '/proc/nowhere'\ngroups = ['time']\n",
    );
    rig.write("bridge.toml", "[serail]\n");
    let report = report(&rig, "", 8);
    assert_eq!(verdict(&report, "configuration"), "fail");
    assert_eq!(verdict(&report, "log-room"), "fail");
    assert_eq!(verdict(&report, "supply-rules"), "none");
    rig.run("preflight --config absent.toml", 78);
}

#[test]
fn of_a_relayed_robot_the_link_is_checked_and_the_disk_is_not() {
    use ipc_types::code::RelayLinkState;
    use ipc_types::payload::{ModuleState, RelayLink};
    let rig = sandbox();
    rig.write("status.toml", STATUS);
    // In the place of a relay on a station's machine.
    let ipc = rig.domain.join("relay");
    let mut link = ipc.publisher::<RelayLink>().unwrap();
    let mut module = ipc.publisher::<ModuleState>().unwrap();
    link.publish(|link| link.state = RelayLinkState::Down.code())
        .unwrap();
    module.publish(|_| {}).unwrap();
    let report = report(&rig, "--timeout 2s", 8);
    for (id, expected) in [
        ("bridge", "pass"),
        ("relay-link", "fail"),
        ("orders", "none"),
    ] {
        assert_eq!(verdict(&report, id), expected, "{id}: {report:#}");
    }
    let mut checks = report["checks"].as_array().unwrap().iter();
    assert!(checks.all(|check| check["id"] != "log-room"), "{report:#}");
    rig.run("preflight --timeout 2s", 8)
        .out_says("relayed from another machine (process ");
}

#[test]
fn what_the_live_bridge_runs_with_counts_and_not_a_file_that_was_changed_since() {
    let rig = sandbox();
    let station = station(&rig, 1);
    let ready = rig.run("preflight", 0);
    ready.out_says("battery and fuel are watched in flight, as the running configuration says");
    rig.run("doctor", 0).out_says(
        "bridge.toml of `ril run bridge` is right, and the running process has it in force",
    );
    // An operator prepares the next flight, or stands in the folder of another robot.
    rig.write("bridge.toml", "[movement]\nmax_distance_m = 10.0\n");
    let report = report(&rig, "", 0);
    for (id, expected) in [
        ("fence", "pass"),
        ("supply-rules", "pass"),
        ("configuration", "warn"),
    ] {
        assert_eq!(verdict(&report, id), expected, "{id}: {report:#}");
    }
    rig.run("doctor", 78)
        .out_says("is right, but the running process has another configuration");
    rig.write("square.waypoints", crate::plans::check::SQUARE);
    let checked = rig.finish("plan check square.waypoints");
    checked.out_says("of the robot: the running configuration with 1 area");
    // A file that is named is meant.
    let report = self::report(&rig, "--bridge bridge.toml", 0);
    assert_eq!(verdict(&report, "supply-rules"), "warn", "{report:#}");
    self::report(&rig, "--bridge bridge.toml --strict", 8);
    let checked = rig.finish("plan check square.waypoints --bridge bridge.toml");
    checked.out_says("of the robot: bridge.toml with 0 areas");
    station.end();
}
