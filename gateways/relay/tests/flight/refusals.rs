//! What is refused, and what the operator is told about it.

use std::path::Path;

use ipc_types::payload::ModuleState;
use ril_tests::Process;
use ril_tests::chain::beside_or_skip;

use crate::machine::{Crew, Machine, end, free_endpoint, says};
use crate::rig::{RELAY, Rig};

/// Exit code of a verb that was refused.
const REFUSED: i32 = 5;

/// Ends with exit code 1 and these words.
#[track_caller]
fn assert_ends_with(mut process: Process, words: &str) {
    let ended = process.wait_exit();
    assert_eq!(ended.code(), Some(1), "{ended:#?}");
    assert!(says(&ended.stderr, words), "{ended:#?}");
}

#[test]
fn a_station_that_may_not_command_sees_everything_and_is_told_who_may() {
    let Some(mut rig) = Rig::start("may not command", "") else {
        return;
    };
    let ril = beside_or_skip(Path::new(RELAY)).expect("it was there");
    let other = Machine::new(&ril, "may not command");
    let mut relay = other.start(&format!(
        "relay station --name other --connect {}",
        rig.endpoint()
    ));
    relay.wait_for_text("this station may not command");
    other.await_link(1);
    other.run("status", 0);
    let refused = other.run("takeoff --altitude 5", REFUSED);
    assert!(says(&refused.stderr, "relay-not-permitted"), "{refused:#?}");
    // The robot's own log names it, too.
    let log = end(relay);
    assert!(says(&log.stderr, "commands.stations"), "{log:#?}");
    // Nothing of it came to the bridge.
    let state = rig.robot.subscribe::<ModuleState>(1).next();
    assert_eq!(state.refused.requests, 0);
    rig.end();
}

#[test]
fn a_second_relay_of_a_robot_or_a_station_ends_at_once_and_says_why() {
    let Some(mut rig) = Rig::start("second relay", "") else {
        return;
    };
    let elsewhere = free_endpoint();
    let second = rig
        .robot
        .start(&format!("relay robot --listen {elsewhere}"));
    assert_ends_with(second, "relay/state");
    let second = rig.station.start(&format!(
        "relay station --name second --connect {}",
        rig.endpoint()
    ));
    assert_ends_with(second, "relay/state");
    rig.station.run("relay status", 0);
    rig.end();
}

#[test]
fn a_robot_whose_number_is_taken_on_the_station_waits_for_its_place() {
    let Some(ril) = beside_or_skip(Path::new(RELAY)) else {
        return;
    };
    let robot = Machine::new(&ril, "number is taken");
    let station = Machine::new(&ril, "number is taken");
    let (crew, here) = (Crew::start(&robot, 1), Crew::start(&station, 1));
    let endpoint = free_endpoint();
    let robot_relay = robot.start_ready(&format!(
        "relay robot --listen {endpoint} --may-command gcs"
    ));
    let mut relay = station.start_ready(&format!("relay station --name gcs --connect {endpoint}"));
    relay.wait_for_text("cannot be provided here");
    let local = station.subscribe::<ModuleState>(1).next();
    here.end();
    let mut states = station.subscribe::<ModuleState>(1);
    states.until("the robot's state", |state| {
        state.epoch_ns != local.epoch_ns
    });
    station.run("start", 0);
    end(relay);
    end(robot_relay);
    crew.end();
}
