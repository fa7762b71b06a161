//! A station's fence beside a real bridge: it comes into force, a path keeps to it, and it goes.

use std::fs;

use endurance::mavlink::station::{Received, Station};
use mavlink_gateway::message::{
    MISSION_ACK, MISSION_CLEAR_ALL, MISSION_COUNT, MISSION_ITEM_INT, MISSION_REQUEST_INT,
};
use mavlink_gateway::wire::MessageWriter;
use ril_tests::process::Signal;

use super::{NAN, gateway_with, sandbox};
use crate::common::end;

const FENCE: u8 = 1;

/// A circle of 20 m to stay outside.
fn circle(x: i32, y: i32) -> MessageWriter {
    let message = MessageWriter::new(MISSION_ITEM_INT).f32(20.0).f32s(0.0, 3);
    let message = message.i32(x).i32(y).f32(0.0).u16(0).u16(5004);
    let message = message.u8(1).u8(1).u8(5).u8(0).u8(1);
    message.u8(FENCE)
}

fn count(count: u16) -> MessageWriter {
    let message = MessageWriter::new(MISSION_COUNT).u16(count);
    message.u8(1).u8(1).u8(FENCE)
}

fn is_answer(message: &Received) -> bool {
    message.is(MISSION_ACK.id) && message.u8(3) == FENCE
}

#[test]
fn a_fence_of_a_station_is_in_force_when_it_is_accepted_and_a_path_keeps_to_it() {
    let rig = sandbox();
    let robot = rig.start_robot(1, 10);
    let bridge_toml = || fs::read_to_string(rig.path("patient.toml")).expect("it is there");
    let mut station = Station::new();
    let config = "[fence]\naccept = true\n";
    let gateway = gateway_with(&rig, station.port(), 60.0, config);
    station.connect();
    let here = station.until("a position", |message| message.is(33));
    let (latitude, longitude) = (here.i32(4), here.i32(8));
    // 111 m to the north.
    station.send(&count(1));
    station.until("a question", |message| message.is(MISSION_REQUEST_INT.id));
    station.send(&circle(latitude + 10_000, longitude));
    assert_eq!(station.until("an answer", is_answer).u8(2), 0);
    let shown = rig.run("fence show", 0);
    shown.out_says("in force: 1 area");
    shown.out_says("exclusion plan: exclusion 1: circle of 20.0 m");

    assert_eq!(station.command(22, [NAN, 0.0, 0.0, NAN, NAN, NAN, NAN]), 0);
    station.until_text("take-off done");
    let into = (latitude + 10_000, longitude);
    assert_eq!(station.reposition(6, into.0, into.1, 15.0), 2);
    let away = (latitude - 10_000, longitude);
    assert_eq!(station.reposition(6, away.0, away.1, 15.0), 0);
    // In flight none comes and none goes.
    station.send(&count(1));
    assert_eq!(station.until("an answer", is_answer).u8(2), 14);
    assert_eq!(station.command(21, [0.0, 0.0, 0.0, NAN, NAN, NAN, 0.0]), 0);
    station.until_text("land done");
    station.until("on the ground", |message| {
        message.is(245) && message.u8(1) == 1
    });
    station.send(&MessageWriter::new(MISSION_CLEAR_ALL).u8(1).u8(1).u8(FENCE));
    assert_eq!(station.until("an answer", is_answer).u8(2), 0);
    rig.run("fence show", 0).out_says("in force: 0 areas");
    assert!(!bridge_toml().contains("plan: "));
    end(gateway, Signal::TERM);
    robot.end();
}
