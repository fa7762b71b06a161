//! `ril doctor` in domains that are in order and in some that are not.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use crate::common::{end, end_all, json, sandbox, says};
use ipc_types::{Ipc, RobotId};
use ril_tests::process::Signal;
use ril_tests::{Process, Sandbox};
use rustix::fs::{CWD, Mode, mkfifoat};
use serde_json::Value;

/// The findings of `ril doctor` that are not in order, by name; it must end with `code`.
#[track_caller]
pub fn troubles(rig: &Sandbox, args: &str, code: i32) -> Vec<String> {
    let report = examine(rig, args, code);
    let findings = report["findings"].as_array().unwrap();
    let troubles = findings.iter().filter(|one| one["severity"] != "note");
    troubles
        .map(|one| {
            assert!(one["next_step"].is_string(), "{one}");
            one["id"].as_str().unwrap().to_owned()
        })
        .collect()
}

/// What `ril doctor --json` says.
#[track_caller]
pub fn examine(rig: &Sandbox, args: &str, code: i32) -> Value {
    let finished = rig.run(&format!("doctor --json {args}"), code);
    // The failure is an object of its own behind it.
    let expected = if code == 0 { 1 } else { 2 };
    assert_eq!(finished.stdout.len(), expected, "{finished:#?}");
    let report = json(&finished.stdout[0]);
    assert_eq!(report["schema"], "ril.Doctor.v1");
    assert_eq!(report["exit_code"], code);
    report
}

pub fn texts(report: &Value) -> String {
    let findings = report["findings"].as_array().unwrap();
    let texts = findings.iter().map(|one| one["text"].as_str().unwrap());
    texts.collect::<Vec<_>>().join("\n")
}

/// A pipe without a writer: a process that opens it to read waits without end.
fn make_pipe(path: &Path) {
    let _ = fs::remove_file(path);
    mkfifoat(CWD, path, Mode::RUSR | Mode::WUSR).unwrap();
}

#[test]
fn an_empty_domain_is_in_order_and_stays_empty() {
    let rig = sandbox();
    let finished = rig.run("doctor", 0);
    finished.out_says("the domain is empty");
    finished.out_says("no bridge.toml here");
    finished.out_says("no bridge of robot 1 is running");
    assert!(says(
        &finished.stdout,
        "everything that was looked at is in order"
    ));
    rig.domain.assert_empty();
    assert!(troubles(&rig, "--repair", 0).is_empty());
    rig.domain.assert_empty();
}

#[test]
fn a_root_that_cannot_be_made_and_limits_that_are_low_are_no_order() {
    let rig = sandbox();
    let doctor = |line: &str| Process::spawn(&rig.domain, rig.shell(line)).wait_exit();
    let found = doctor("export RIL_IPC_ROOT=/proc/nohero; exec \"$0\" doctor");
    assert_eq!(found.code(), Some(8), "{found:#?}");
    found.out_says("/proc/nohero cannot be made");
    let found = doctor("ulimit -n 200; exec \"$0\" doctor");
    assert_eq!(found.code(), Some(8), "{found:#?}");
    found.out_says("the limit `nofile` is 200 here");
    rig.domain.assert_empty();
}

#[test]
fn live_processes_are_shown_with_what_they_provide() {
    let rig = sandbox();
    let sim = rig.sim(1, "");
    let bridge = rig.bridge(1);
    rig.watch(1).until_ready();
    let status = rig.status(1);
    let report = examine(&rig, "--port dsp-1", 0);
    let text = texts(&report);
    for expected in [
        format!(
            "bridge (process {}) provides dsp_telemetry, module_state",
            bridge.id()
        ),
        format!("status (process {}) provides hero_telemetry", status.id()),
        format!("the bridge (process {}) has it open", bridge.id()),
        format!("its other end is in `ril` (process {})", sim.id()),
    ] {
        assert!(text.contains(&expected), "{expected:?} is not in\n{text}");
    }
    // No configuration names a port: the one that counts is that on the bridge's command line.
    let text = texts(&examine(&rig, "", 0));
    let expected = format!("the live bridge (process {}) has /dev/pts/", bridge.id());
    assert!(text.contains(&expected), "{text}");
    assert!(!text.contains("/dev/ttyS0"), "{text}");
    // A repair leaves the living alone.
    assert!(troubles(&rig, "--repair --port dsp-1", 0).is_empty());
    end_all([status, bridge, sim]);
}

#[test]
fn a_killed_bridge_is_found_and_repaired_while_others_live() {
    let rig = sandbox();
    let bridge = rig.bridge(1);
    let pid = bridge.id();
    // Ready means that it has entered what the bridge provides.
    let status = rig.status(1);
    drop(bridge);
    assert_eq!(troubles(&rig, "", 8), ["dead-nodes"]);
    let finished = rig.run("doctor", 8);
    let expected = format!("left by dead processes of robot 1: bridge (process {pid})");
    finished.out_says(&expected);
    finished.err_says("1 warning; each says");

    // Status is in one generation of the dead bridge; the others go at once, and that one with the next bridge.
    let report = examine(&rig, "--repair", 8);
    let text = texts(&report);
    assert!(
        text.contains("removed: 7 generations of leftover shared memory"),
        "{text}"
    );
    assert!(text.contains("robot 1 has 1 generation of"), "{text}");
    let bridge = rig.bridge(1);
    assert!(troubles(&rig, "", 0).is_empty());
    end(bridge, Signal::TERM);
    end(status, Signal::TERM);
    rig.domain.assert_empty();
}

#[test]
fn what_the_last_process_left_is_found_and_removed() {
    let rig = sandbox();
    let bridge = rig.bridge(1);
    let pid = bridge.id();
    drop(bridge);
    assert_eq!(troubles(&rig, "", 8), ["residue"]);
    let text = texts(&examine(&rig, "", 8));
    let expected = format!("8 generations with bridge (process {pid})");
    assert!(text.contains(&expected), "{text}");
    let text = texts(&examine(&rig, "--repair", 0));
    assert!(text.contains("removed: 1 robot in which"), "{text}");
    // The folder itself, which is empty.
    assert_eq!(rig.domain.residue(), [rig.domain.root()]);
    rig.domain.sweep();
}

#[test]
fn what_was_half_removed_is_found_and_removed() {
    let rig = sandbox();
    // A process that provides nothing, and so removes nothing while others look.
    let ipc = rig.domain.join("test");
    fs::create_dir(rig.domain.root().join("2~abcdefgh")).unwrap();
    assert_eq!(troubles(&rig, "", 8), ["leftovers"]);
    let text = texts(&examine(&rig, "--repair", 0));
    assert!(text.contains("removed: 1 thing half removed"), "{text}");
    drop(ipc);
}

#[test]
fn a_process_that_was_stopped_is_told_from_one_that_works() {
    let rig = sandbox();
    let status = rig.status(1);
    status.signal(Signal::STOP);
    // The signal is on its way for a moment; a parent that waits for the stop sees when it has come.
    let pid = rustix::process::Pid::from_raw(status.id() as i32).unwrap();
    let options = rustix::process::WaitIdOptions::STOPPED;
    rustix::process::waitid(rustix::process::WaitId::Pid(pid), options).unwrap();
    assert_eq!(troubles(&rig, "", 8), ["process-stopped"]);
    status.signal(Signal::CONT);
    end(status, Signal::TERM);
}

#[test]
fn a_root_that_others_may_write_to_is_an_error_that_is_not_repaired() {
    let rig = sandbox();
    let status = rig.status(1);
    let root = rig.domain.root();
    for (mode, code, expected) in [
        (0o777, 8, &["root-open"][..]),
        (0o750, 8, &["root-readable"]),
        (0o700, 0, &[]),
    ] {
        fs::set_permissions(root, fs::Permissions::from_mode(mode)).unwrap();
        assert_eq!(troubles(&rig, "", code), expected, "{mode:o}");
    }
    fs::set_permissions(root, fs::Permissions::from_mode(0o777)).unwrap();
    assert_eq!(troubles(&rig, "--repair", 8), ["root-open"]);
    fs::set_permissions(root, fs::Permissions::from_mode(0o700)).unwrap();
    end(status, Signal::TERM);
}

#[test]
fn whatever_stands_in_the_place_of_the_root_is_described() {
    let rig = sandbox();
    let root = rig.domain.root();
    make_pipe(root);
    assert_eq!(troubles(&rig, "", 8), ["root-not-a-folder"]);
    assert_eq!(troubles(&rig, "--repair", 8), ["root-not-a-folder"]);
    fs::remove_file(root).unwrap();
    std::os::unix::fs::symlink("/proc", root).unwrap();
    assert_eq!(troubles(&rig, "", 8), ["root-not-a-folder"]);
    fs::remove_file(root).unwrap();
}

#[test]
fn a_wrong_configuration_is_told_in_the_words_of_its_process() {
    let rig = sandbox();
    rig.write("bridge.toml", "[serial]\nprot = '/dev/ttyUSB0'\n");
    rig.write("other.toml", "\n[[log]]\nname = '../x'\n");
    let finished = rig.run("doctor --status other.toml", 78);
    for expected in [
        "the configuration of `ril run bridge` is refused: bridge.toml:2: unknown field `prot`",
        "the configuration of `ril run status` is refused: other.toml:3: ",
        "no dsp-sim.toml here",
    ] {
        finished.out_says(expected);
    }
    let finished = rig.run("doctor --check-config", 78);
    assert!(!says(&finished.stdout, "domain"), "{finished:#?}");
    rig.run("doctor --check-config --bridge absent.toml", 78);
    rig.write("bridge.toml", "");
    rig.run("doctor --check-config", 0);
    rig.domain.assert_empty();
}

#[test]
fn a_root_that_no_process_can_use_is_a_wrong_configuration() {
    let rig = sandbox();
    // The rig gives its children the root of its own domain: a shell replaces it.
    let command = rig.shell("RIL_IPC_ROOT=lab exec \"$0\" doctor");
    let finished = Process::spawn(&rig.domain, command).exits(78);
    let expected = "`lab` is no root for shared memory";
    finished.out_says(expected);
    finished.out_says("fix RIL_IPC_ROOT");
}

#[test]
fn a_serial_port_that_cannot_be_used_is_told_with_what_to_do() {
    let rig = sandbox();
    rig.write("bridge.toml", "[serial]\nport = 'ttyUSB0'\n");
    assert_eq!(troubles(&rig, "", 6), ["port-missing"]);
    fs::create_dir(rig.folder().join("folder")).unwrap();
    make_pipe(&rig.folder().join("pipe"));
    for port in ["folder", "pipe", "bridge.toml", "/dev/null"] {
        let args = format!("--port {port}");
        assert_eq!(troubles(&rig, &args, 6), ["port-not-a-terminal"], "{port}");
    }
    // A terminal of the simulator's is a port; this test has it open as well.
    let sim = rig.sim(1, "");
    assert!(troubles(&rig, "--port dsp-1", 0).is_empty());
    let held = fs::File::open(rig.folder().join("dsp-1")).unwrap();
    let finished = rig.run("doctor --port dsp-1", 6);
    let expected = format!("(process {})", std::process::id());
    finished.out_says(&expected);
    drop(held);
    end(sim, Signal::TERM);
}

#[test]
fn nothing_that_keeps_a_reader_waiting_holds_it_up() {
    let rig = sandbox();
    make_pipe(&rig.write("status.toml", ""));
    let ipc = Ipc::join(&rig.domain, RobotId::DEFAULT, "test").unwrap();
    let server = ipc.server::<ipc_types::payload::ModuleControl>().unwrap();
    // In the place of every file of the domain: some are opened to look at it, or to repair it.
    let files = rig.domain.residue();
    let files = files.iter().filter(|path| path.is_file());
    let inside = files.filter(|path| path.starts_with(rig.domain.root()));
    let count = inside.map(|path| make_pipe(path)).count();
    assert!(count > 4, "{count} files");
    let report = examine(&rig, "", 78);
    assert!(texts(&report).contains("status.toml: is a pipe, not a regular file"));
    examine(&rig, "--repair", 78);
    drop((server, ipc));
    let _ = fs::remove_dir_all(rig.domain.root());
    rig.domain.sweep();
}
