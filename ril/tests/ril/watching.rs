//! `ril echo` against publishers that do as they are told.

use std::io::{BufRead, BufReader, Read};
use std::process::Stdio;

use crate::common::{end, json, sandbox};
use ipc_types::payload::{DspTelemetry, HeroTelemetry};
use ipc_types::{RobotId, TelemetryGroup, files};
use ril_tests::process::{Finished, Signal};
use ril_tests::{StandInBridge, StandInStatus};

/// A sample in which only the position is valid.
fn position(altitude_m: f64) -> DspTelemetry {
    let mut sample = DspTelemetry {
        valid_groups: TelemetryGroup::Geographic.bit(),
        // Not valid, so it must not be shown.
        rotor_rpm: 4711,
        ..DspTelemetry::default()
    };
    sample.geographic.altitude_m = altitude_m;
    sample
}

/// Whether a line on standard error is a note that a sample is old, as it may be on a machine that stalls.
fn is_of_age(line: &str) -> bool {
    line.starts_with("note: this is the last sample of ")
}

/// The summary, which is the last line that is no error.
fn summary(finished: &Finished) -> &str {
    let mut lines = finished.stderr.iter().rev();
    lines
        .find(|line| line.contains(" lost, "))
        .expect("a summary")
}

#[test]
fn samples_are_printed_as_they_come_and_what_is_not_valid_is_null() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    bridge.publish(&position(1.0));
    let mut echo = rig.start("echo dsp --count 3 --json --field geographic.altitude_m --field rotor_rpm --field sequence");
    for number in 1..=3 {
        let line = json(&echo.wait_for_text("hero.DspTelemetry.v3").text);
        assert_eq!(line["sequence"], number);
        assert_eq!(line["geographic"]["altitude_m"], f64::from(number));
        assert!(line["rotor_rpm"].is_null(), "{line}");
        assert_eq!(line.as_object().unwrap().len(), 4, "{line}");
        if number < 3 {
            bridge.publish(&position(f64::from(number + 1)));
        }
    }
    let finished = echo.exits(0);
    assert!(
        summary(&finished).starts_with("3 samples, 0 lost"),
        "{finished:#?}"
    );
    assert!(
        summary(&finished).ends_with("0 lost, 0 publisher restarts"),
        "{finished:#?}"
    );
}

#[test]
fn people_read_text() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    let status = StandInStatus::start(&rig.domain);
    bridge.publish(&position(1.5));
    status.publish(&HeroTelemetry::default());
    let whole = rig.run("echo dsp --count 1", 0);
    for line in ["geographic.altitude_m: 1.5", "rotor_rpm: -", "---"] {
        assert!(
            whole.stdout.iter().any(|text| text == line),
            "{line}: {whole:#?}"
        );
    }
    let chosen = rig.run(
        "echo hero --count 1 --field sequence --field geodetic.altitude_m",
        0,
    );
    assert_eq!(chosen.stdout, ["sequence=1  geodetic.altitude_m=-"]);
    let state = rig.run(
        "echo state --count 1 --field status --field link.state -q",
        0,
    );
    assert_eq!(state.stdout, ["status=running  link.state=up"]);
    let mut told = state.stderr.iter().map(String::as_str);
    assert!(told.all(is_of_age), "quiet: {state:#?}");
}

#[test]
fn a_publisher_that_says_nothing_is_a_timeout() {
    let rig = sandbox();
    let _bridge = StandInBridge::start(&rig.domain);
    let _status = StandInStatus::start(&rig.domain);
    for topic in ["dsp", "hero"] {
        rig.run(&format!("echo {topic} --timeout 100ms"), 4)
            .err_says("although `ril ");
    }
}

#[test]
fn a_publisher_that_goes_is_waited_for_and_its_successor_is_counted() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    bridge.publish(&position(1.0));
    let mut echo = rig.start("echo dsp --timeout 80s --count 2 --field geographic.altitude_m");
    echo.wait_for_text("geographic.altitude_m=1");
    bridge.die();
    let bridge = StandInBridge::start(&rig.domain);
    bridge.publish(&position(2.0));
    echo.wait_for_text("geographic.altitude_m=2");
    let finished = echo.exits(0);
    assert!(
        summary(&finished).ends_with("0 lost, 1 publisher restart"),
        "{finished:#?}"
    );

    let mut echo = rig.start("echo dsp --timeout 5s --field geographic.altitude_m");
    echo.wait_for_text("geographic.altitude_m=2");
    bridge.die();
    echo.exits(3)
        .err_says("start `ril run bridge --robot 1`")
        .err_says("1 sample, 0 lost");
}

#[test]
fn losses_are_counted_and_never_hidden() {
    const SAMPLES: u64 = 400;
    let rig = sandbox();
    let bridge = StandInBridge::start_lossy(&rig.domain, RobotId::DEFAULT);
    bridge.publish(&position(0.0));
    let mut echo = rig.start("echo dsp --json --field sequence");
    echo.wait_for_text("\"sequence\":1}");
    // More than its buffer holds, while it cannot read.
    echo.signal(Signal::STOP);
    for _ in 2..=SAMPLES {
        bridge.publish(&position(0.0));
    }
    echo.signal(Signal::CONT);
    echo.wait_for_text(&format!("\"sequence\":{SAMPLES}}}"));
    let finished = end(echo, Signal::INT);
    let printed: Vec<u64> = finished
        .stdout
        .iter()
        .map(|line| json(line)["sequence"].as_u64().unwrap())
        .collect();
    assert!(printed.is_sorted());
    let lost = SAMPLES - printed.len() as u64;
    assert!(lost > 0, "nothing was lost, so nothing was tested");
    let expected = format!(", {lost} lost, 0 publisher restarts");
    assert!(
        summary(&finished).ends_with(&expected),
        "{expected}: {}",
        summary(&finished)
    );
}

#[test]
fn a_duration_ends_it_and_so_does_a_signal() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    bridge.publish(&position(0.0));
    let finished = rig.run("echo dsp --duration 100ms --field sequence", 0);
    assert_eq!(finished.stdout, ["sequence=1"]);
    for signal in [Signal::INT, Signal::TERM] {
        let mut echo = rig.start("echo state --json");
        echo.wait_for_text("hero.ModuleState.v7");
        assert!(summary(&end(echo, signal)).starts_with("1 sample,"));
    }
}

/// No second sample: the end of a reader is noticed on a silent topic, too. It may take a moment, because a process
/// that another test is starting has a copy of the pipe for as long.
#[test]
fn a_reader_that_has_gone_is_a_quiet_end() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    bridge.publish(&position(0.0));
    let mut command = rig.command(["echo", "dsp", "--json", "--timeout", "600s"]);
    command.envs(rig.domain.environment());
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut echo = files::while_no_port_opens(|| command.spawn()).unwrap();
    let mut line = String::new();
    BufReader::new(echo.stdout.take().unwrap())
        .read_line(&mut line)
        .unwrap();
    assert!(line.starts_with("{\"schema\":"), "{line}");
    let code = echo.wait().unwrap().code();
    let mut errors = String::new();
    echo.stderr
        .take()
        .unwrap()
        .read_to_string(&mut errors)
        .unwrap();
    assert_eq!(code, Some(0), "{errors}");
    assert!(errors.lines().all(is_of_age), "{errors}");
}
