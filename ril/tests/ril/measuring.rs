//! `ril hz`, `ril delay` and `ril bw` against publishers that do as they are told, and over the real chain.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::process::Stdio;

use crate::common::{end, end_all, json, sandbox, says};
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use ipc_types::{MonotonicNs, RobotId, files};
use ril_tests::process::Signal;
use ril_tests::{Process, Sandbox, StandInBridge, StandInStatus, pty};
use rustix::process::{Pid, kill_process};
use serde_json::Value;

/// Starts a measurement and returns when it has subscribed: what is published from here on is measured.
fn start(rig: &Sandbox, args: &str) -> Process {
    let mut process = rig.start(&format!("{args} -v"));
    process.wait_for_text("subscribed");
    process
}

/// Waits for the end of a measurement, and returns the one JSON object that it has printed.
#[track_caller]
fn report(mut process: Process, code: i32) -> Value {
    let finished = process.exits(code);
    // The failure is an object of its own behind it.
    let expected = if code == 0 { 1 } else { 2 };
    assert_eq!(finished.stdout.len(), expected, "{finished:#?}");
    json(&finished.stdout[0])
}

/// A sample that says that it was published `ms` after `start`, which may be to come: only the past is not measured.
fn hero(start: MonotonicNs, ms: u64) -> HeroTelemetry {
    let published_ns = start.0 + ms * 1_000_000;
    HeroTelemetry {
        received_ns: published_ns,
        published_ns,
        ..HeroTelemetry::default()
    }
}

#[test]
fn losses_are_counted_by_sequence_while_the_published_rate_stays_true() {
    const SAMPLES: u64 = 400;
    /// What its buffer holds.
    const KEPT: u64 = 128;
    let rig = sandbox();
    let status = StandInStatus::start_lossy(&rig.domain, RobotId::DEFAULT);
    let mut hz = start(&rig, &format!("hz hero --count {} --json", 1 + KEPT));
    let now = MonotonicNs::now();
    status.publish(&hero(now, 0));
    hz.wait_for_text("first sample");
    hz.signal(Signal::STOP);
    for index in 1..=SAMPLES {
        status.publish(&hero(now, 5 * index));
    }
    hz.signal(Signal::CONT);
    let report = report(hz, 0);
    let lost = report["lost"].as_u64().unwrap();
    assert!(
        lost > 0,
        "nothing was lost, so nothing was tested: {report}"
    );
    assert_eq!(report["published_hz"], 200.0);
    let percent = 100.0 * lost as f64 / (SAMPLES + 1) as f64;
    let told = report["lost_percent"].as_f64().unwrap();
    assert!((told - percent).abs() < 1e-3, "{percent}: {report}");
}

#[test]
fn what_was_published_before_is_not_measured() {
    let rig = sandbox();
    let status = StandInStatus::start(&rig.domain);
    status.publish(&hero(MonotonicNs(0), 1));
    // The latest sample comes at once, and alone is nothing to measure.
    let finished = rig.run("delay hero --timeout 200ms --duration 50ms --json", 4);
    assert_eq!(finished.stdout.len(), 1, "{finished:#?}");
    assert_eq!(json(&finished.stdout[0])["schema"], "ril.Error.v1");
    finished.err_says("although `ril run status` is running");
    let hz = start(&rig, "hz hero --count 2 --json");
    let now = MonotonicNs::now();
    for index in 0..2 {
        status.publish(&hero(now, 20 * index));
    }
    assert_eq!(report(hz, 0)["published_hz"], 50.0);
}

#[test]
fn a_publisher_that_goes_ends_it_with_what_was_measured() {
    let rig = sandbox();
    let status = StandInStatus::start(&rig.domain);
    let mut hz = start(&rig, "hz hero --timeout 5s --count 1000 --json");
    status.publish(&HeroTelemetry::default());
    hz.wait_for_text("first sample");
    drop(status);
    let report = report(hz, 3);
    assert_eq!(report["samples"], 1);
    assert!(report["observed_hz"].is_null(), "{report}");
}

#[test]
fn a_signal_ends_it_with_what_was_measured_and_a_pipe_gets_no_drawing() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    for signal in [Signal::INT, Signal::TERM] {
        let mut bw = start(&rig, "bw state");
        bridge.publish_state(&ModuleState::default());
        bw.wait_for_text("first sample");
        let finished = end(bw, signal);
        let first = "module_state of robot 1: 1 sample in 0.000 s";
        assert!(finished.stdout[0].starts_with(first), "{finished:#?}");
        assert!(!says(&finished.stdout, "\u{1b}"), "{finished:#?}");
    }
}

#[test]
fn a_terminal_sees_the_figures_anew_and_keeps_the_last() {
    let rig = sandbox();
    let status = StandInStatus::start(&rig.domain);
    let (mut screen, name) = pty::open();
    let slave = File::options().write(true).open(name);
    let mut command = rig.command(["hz", "hero", "-v"]);
    command.envs(rig.domain.environment());
    command.stdout(slave.unwrap()).stderr(Stdio::piped());
    let mut hz = files::while_no_port_opens(|| command.spawn()).unwrap();
    // The command holds the terminal as well.
    drop(command);
    let mut log = BufReader::new(hz.stderr.take().unwrap()).lines();
    log.find(|line| line.as_ref().is_ok_and(|line| line.contains("subscribed")));
    status.publish(&HeroTelemetry::default());
    // It draws once a second, whatever comes; each drawing takes the place of the one before.
    let mut text = String::new();
    while text.matches("\u{1b}[J").count() < 2 {
        let mut bytes = [0; 4096];
        let read = screen.read(&mut bytes).unwrap();
        text.push_str(&String::from_utf8_lossy(&bytes[..read]));
    }
    kill_process(Pid::from_child(&hz), Signal::INT).unwrap();
    let mut rest = Vec::new();
    // A terminal without a writer ends with an error.
    let _ = screen.read_to_end(&mut rest);
    assert!(hz.wait().unwrap().success());
    text.push_str(&String::from_utf8_lossy(&rest));
    let last = text.rsplit("\u{1b}[J").next().unwrap();
    assert!(
        last.starts_with("hero_telemetry of robot 1: 1 sample in"),
        "{text}"
    );
}

#[test]
fn the_real_chain_is_measured() {
    let rig = sandbox();
    let processes = [rig.sim(1, ""), rig.bridge(1), rig.status(1)];
    rig.watch(1).until_ready();
    let rate = json(&rig.run("hz dsp --count 30 --json", 0).stdout[0]);
    // What a machine that stalls costs is in it.
    assert!(rate["lost"].is_u64(), "{rate}");
    assert_eq!(rate["samples"], 30);
    let delay = json(&rig.run("delay hero --count 10 --json", 0).stdout[0]);
    for key in [
        "since_sent_ms",
        "since_received_ms",
        "since_published_ms",
        "behind_quickest_ms",
    ] {
        assert_eq!(delay[key]["count"], 10, "{delay}");
    }
    let since = |key: &str| delay[key]["p50"].as_f64().unwrap();
    assert!(
        since("since_received_ms") >= since("since_published_ms"),
        "{delay}"
    );
    assert!(
        since("since_sent_ms") >= since("since_received_ms"),
        "{delay}"
    );
    let bandwidth = json(&rig.run("bw dsp --count 3 --json", 0).stdout[0]);
    let size = size_of::<DspTelemetry>();
    assert_eq!(bandwidth["payload_bytes"], size, "{bandwidth}");
    assert_eq!(bandwidth["bytes"], 3 * size, "{bandwidth}");
    end_all(processes.into_iter().rev());
}
