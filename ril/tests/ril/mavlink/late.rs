//! What has waited: a disk that does not answer, and a gateway that stood still.

use std::fs;
use std::process::Command;

use endurance::mavlink::mission::{mission, upload_until};
use endurance::mavlink::station::{Station, long};
use ipc_types::MonotonicNs;
use ipc_types::code::Reason;
use ipc_types::payload::ModuleState;
use ril_tests::process::Signal;

use super::{gateway, sandbox};
use crate::common::end;

/// MISSION_ACK, and its result "error".
const MISSION_ACK: u32 = 47;
const ERROR: u8 = 1;

const ARM: [f32; 7] = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];

#[test]
fn a_disk_that_does_not_answer_costs_a_mission_and_neither_orders_nor_telemetry_nor_the_end() {
    let rig = sandbox();
    let robot = rig.start_robot(1, 10);
    let mut station = Station::new();
    // Opening it for writing waits until somebody reads it.
    fs::create_dir(rig.path("state")).expect("a folder");
    let disk = rig.path("state/.robot-1.mission.new");
    let made = Command::new("mkfifo").arg(&disk).status().expect("mkfifo");
    assert!(made.success());
    let gateway = gateway(&rig, station.port(), 60.0);
    station.connect();
    let items = mission(3, 15.0);
    assert_eq!(upload_until(&mut station, &items, Some(items.len())), None);
    station.command(193, [0.0; 7]);
    assert_eq!(station.command(400, ARM), 0);
    station.until("telemetry", |message| message.is(30));
    station.until("the answer to the mission", |message| {
        message.is(MISSION_ACK) && message.u8(2) == ERROR
    });
    assert_eq!(station.command(400, [0.0; 7]), 0);
    end(gateway, Signal::TERM);
    robot.end();
}

#[test]
fn what_has_waited_while_the_gateway_stood_still_is_not_carried_out() {
    let rig = sandbox();
    let robot = rig.start_robot(1, 10);
    let mut station = Station::new();
    rig.write(
        "mavlink.toml",
        &format!(
            "port = 0\nstations = ['127.0.0.1:{}']\nlost_s = 60.0\nanswer_s = 3.0\nstate = 'state'\n",
            station.port()
        ),
    );
    let gateway = rig.start_ready("run mavlink");
    station.connect();
    let mut states = rig.subscribe::<ModuleState>(1);
    gateway.signal(Signal::STOP);
    station.send(&long(400, ARM));
    let sent = MonotonicNs::now();
    // Longer than the answer may take.
    states.until("4 s have passed", |state| {
        state.published_ns > sent.0 + 4_000_000_000
    });
    gateway.signal(Signal::CONT);
    let answer = station.answer(400);
    let too_late = Reason::TooLate.code();
    assert_eq!((answer.u8(2), answer.i32(4) as u32), (1, too_late));
    let read = MonotonicNs::now();
    states.until("the bridge was asked for nothing", |state| {
        assert!(state.is_blocked(), "it was started");
        state.published_ns > read.0
    });
    // It was not carried out, so the next one is no copy.
    assert_eq!(station.command(400, ARM), 0);
    end(gateway, Signal::TERM);
    robot.end();
}
