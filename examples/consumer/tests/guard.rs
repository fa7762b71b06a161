//! The consumer against stand-ins, a recorded flight and, where `ril` is at hand, the real thing.

use std::path::Path;
use std::time::Duration;

use altitude_guard::{Guard, Notice, watch};
use ipc_types::TelemetryGroup;
use ipc_types::payload::HeroTelemetry;
use ril_tests::{Process, Recording, Sandbox, Script, StandInStatus, TestDomain, sandbox};

/// Longer than any flight here, so that nothing counts as silence.
const TIMEOUT: Duration = Duration::from_secs(60);

/// What the guard of 20 m tells of a flight that is published all at once.
fn notices(flight: &[HeroTelemetry]) -> Vec<Notice> {
    let domain = TestDomain::new();
    let mut telemetry = domain.join("guard").subscriber().unwrap();
    let status = StandInStatus::start(&domain);
    for sample in flight {
        status.publish(sample);
    }
    let mut notices = Vec::new();
    watch(&mut telemetry, &mut Guard::new(20.0), TIMEOUT, |notice| {
        notices.push(notice)
    })
    .unwrap();
    assert_eq!(telemetry.losses().lost, 0);
    notices
}

#[test]
fn a_flight_that_is_too_high_is_told_once_each_way() {
    let flight = Script::at(37.4, -5.9, 10.0)
        .every_ms(500)
        .take_off(12.0)
        .land();
    assert_eq!(
        notices(&flight.hero()),
        [Notice::Above { altitude_m: 21.0 }, Notice::Below]
    );
}

#[test]
fn a_low_flight_is_not_worth_a_word() {
    let flight = Script::at(37.4, -5.9, 10.0)
        .every_ms(500)
        .take_off(5.0)
        .land();
    assert_eq!(notices(&flight.hero()), []);
}

#[test]
fn a_position_that_was_not_transmitted_is_not_believed() {
    let flight = Script::at(37.4, -5.9, 10.0)
        .every_ms(500)
        .take_off(12.0)
        .groups(&[TelemetryGroup::Time])
        .land();
    assert_eq!(
        notices(&flight.hero()),
        [Notice::Above { altitude_m: 21.0 }, Notice::NoPosition]
    );
}

#[test]
fn a_recorded_flight_is_a_test_as_well() {
    let log = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/flight.tsv");
    let notices = notices(&Recording::read(&log).hero());
    assert!(
        matches!(notices[..], [Notice::Above { .. }, Notice::Below]),
        "{notices:?}"
    );
}

#[test]
fn silence_is_told_and_is_not_the_end() {
    let domain = TestDomain::new();
    let mut telemetry = domain.join("guard").subscriber().unwrap();
    let status = StandInStatus::start(&domain);
    let flight = Script::at(37.4, -5.9, 10.0)
        .every_ms(500)
        .take_off(5.0)
        .land()
        .hero();
    let (start, end) = flight.split_at(1);
    status.publish(&start[0]);
    let mut told = Vec::new();
    watch(
        &mut telemetry,
        &mut Guard::new(20.0),
        Duration::from_millis(20),
        |notice| {
            // Only now the flight goes on.
            if told.is_empty() {
                end.iter().for_each(|sample| _ = status.publish(sample));
            }
            told.push(notice);
        },
    )
    .unwrap();
    assert_eq!(told[0], Notice::Silent);
}

fn program(domain: &TestDomain) -> Process {
    let mut guard = Process::start(domain, env!("CARGO_BIN_EXE_altitude-guard"), ["12"]);
    guard.wait_for_text("guarding 12 m");
    guard
}

#[test]
fn the_program_follows_a_status_that_dies_and_comes_back() {
    let domain = TestDomain::new();
    let mut guard = program(&domain);
    let flight = Script::at(37.4, -5.9, 10.0)
        .every_ms(500)
        .take_off(5.0)
        .land()
        .hero();
    let (up, down) = flight.split_at(flight.len() / 2);
    let publish = |samples: &[HeroTelemetry]| {
        let status = StandInStatus::start(&domain);
        samples.iter().for_each(|sample| _ = status.publish(sample));
        status
    };
    let first = publish(up);
    guard.wait_for_text("above the limit: 13.0 m");
    drop(first);
    let _second = publish(down);
    guard.wait_for_text("below the limit again");
    guard.exits(0);
}

#[test]
fn the_program_bears_a_bridge_that_is_killed_in_flight() {
    let Some(ril) = sandbox::installed_or_skip() else {
        return;
    };
    let sandbox = Sandbox::of(ril);
    let mut robot = sandbox.start_robot(1, 1);
    let mut guard = program(&sandbox.domain);
    sandbox.run("start", 0);
    sandbox.run("takeoff --altitude 4", 0);
    guard.wait_for_text("above the limit");
    robot.restart_bridge(&sandbox);
    sandbox.run("start", 0);
    sandbox.run("land", 0);
    guard.wait_for_text("landed");
    guard.exits(0);
    robot.end();
}
