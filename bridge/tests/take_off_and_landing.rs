//! Take-off and landing end by the DSP's own word, and what the DSP refuses is reported as refused by the DSP
//! (requirements H2, H3).

use crate::rig::{Rig, aborted, north};
use dsp_protocol::downlink::Geographic;
use dsp_protocol::{Command, DspErrorCode, FlowControl, port};
use ipc_types::code::{Functionality, ImiError, ModuleStatus, Reason, Stage};

/// A take-off that the DSP is carrying out on the ground.
fn taking_off() -> (Rig, u64) {
    let mut rig = Rig::started();
    rig.dsp.grants = false;
    let take_off = rig.take_off();
    rig.run(40);
    assert_eq!(rig.functionality(), Functionality::TakingOff);
    (rig, take_off)
}

#[test]
fn a_take_off_ends_by_the_dsps_word_whatever_the_altitude_is() {
    type Spoil = fn(&mut Rig);
    let drifts: Spoil = |rig| {
        let mut at = north(0);
        at.altitude_m += 7.0;
        rig.dsp.at(at);
    };
    let loses_the_fix: Spoil = |rig| rig.dsp.status.gps_quality = Some(0);
    let loses_the_position: Spoil = |rig| rig.dsp.status.geographic = None;
    for (spoil, height_m) in [
        (drifts, Some(17.0)),
        (loses_the_fix, None),
        (loses_the_position, None),
    ] {
        let (mut rig, take_off) = taking_off();
        rig.dsp.status.flying = true;
        spoil(&mut rig);
        rig.run(3000);
        assert_eq!(rig.functionality(), Functionality::TakingOff);
        rig.dsp.grants = true;
        rig.run(200);
        assert_eq!(rig.last(take_off).0, Stage::Done);
        assert_eq!(rig.last_report(take_off).value(), height_m);
    }
}

#[test]
fn a_take_off_whose_end_flow_control_does_not_tell_is_seen_at_its_port() {
    let (mut rig, take_off) = taking_off();
    rig.dsp.status.flying = true;
    rig.run(2000);
    assert_eq!(rig.functionality(), Functionality::TakingOff);
    rig.dsp.obeys = false;
    rig.run(1100);
    assert_eq!(rig.last(take_off).0, Stage::Done);
}

#[test]
fn a_landing_is_done_when_the_rotor_has_stopped() {
    let mut rig = Rig::flying();
    rig.dsp.grants = false;
    let land = rig.land();
    rig.run(500);
    // Touch-down: the port of a DSP that runs the rotor down still reads 1.
    rig.dsp.status.flying = false;
    rig.dsp.lands_until_told = true;
    rig.run(3000);
    assert_eq!(rig.functionality(), Functionality::Landing);
    rig.dsp.lands_until_told = false;
    rig.run(300);
    assert_eq!(rig.last(land).0, Stage::Done);
    let take_off = rig.take_off();
    assert_eq!(
        rig.last(take_off).0,
        Stage::Progress,
        "it may follow at once"
    );
}

#[test]
fn a_dsp_that_begins_a_little_later_is_not_taken_for_one_that_refuses() {
    let mut rig = Rig::started();
    rig.dsp.grants = false;
    rig.dsp.obeys = false;
    let take_off = rig.take_off();
    rig.run(400);
    assert_eq!(rig.functionality(), Functionality::TakingOff);
    rig.dsp.obeys = true;
    rig.run(2000);
    assert_eq!(rig.functionality(), Functionality::TakingOff);
    rig.dsp.status.flying = true;
    rig.dsp.grants = true;
    rig.run(200);
    assert_eq!(rig.last(take_off).0, Stage::Done);
}

#[test]
fn a_take_off_that_is_over_when_its_port_is_read_is_done() {
    let mut rig = Rig::started();
    rig.dsp.grants = false;
    rig.dsp.obeys = false;
    let take_off = rig.take_off();
    // So short that the port reads 0 already, and the flag is 1.
    rig.dsp.status.flying = true;
    rig.run(1200);
    assert_eq!(rig.last(take_off).0, Stage::Done);
}

/// The DSP sends flow control 1 between the acknowledgement of the order and the next status message.
fn granted_before_a_status() -> (Rig, u64) {
    let mut rig = Rig::started();
    rig.dsp.grants = false;
    rig.dsp.sends_status = false;
    let take_off = rig.take_off();
    rig.run(40);
    rig.say(dsp_protocol::Downlink::FlowControl(FlowControl::Send));
    rig.run(600);
    (rig, take_off)
}

#[test]
fn a_late_flow_control_does_not_end_a_take_off_whose_port_reads_one() {
    let (mut rig, take_off) = granted_before_a_status();
    assert_eq!(rig.functionality(), Functionality::TakingOff);
    // Nor does it count afterwards, when the DSP has given the take-off up on the ground.
    rig.dsp.obeys = false;
    rig.dsp.sends_status = true;
    rig.run(1200);
    assert_eq!(rig.last(take_off), aborted(Reason::RefusedByDsp));
}

#[test]
fn a_take_off_that_is_over_before_a_status_came_is_done_when_its_port_reads_zero_too() {
    let (mut rig, take_off) = granted_before_a_status();
    rig.dsp.obeys = false;
    rig.say(dsp_protocol::Downlink::FlowControl(FlowControl::Send));
    rig.run(100);
    assert_eq!(rig.last(take_off).0, Stage::Done);
}

#[test]
fn a_take_off_that_the_dsp_refused_is_not_done_by_a_late_flow_control() {
    let mut rig = Rig::started();
    rig.dsp.grants = false;
    rig.dsp.sends_status = false;
    rig.dsp.obeys = false;
    let take_off = rig.take_off();
    rig.dsp_error(30);
    rig.say(dsp_protocol::Downlink::FlowControl(FlowControl::Send));
    rig.run(600);
    assert_eq!(rig.last(take_off), aborted(Reason::RefusedByDsp));
}

#[test]
fn a_second_take_off_order_that_the_dsp_refuses_in_the_air_harms_nobody() {
    let mut rig = Rig::started();
    rig.dsp.grants = false;
    let take_off = rig.take_off();
    rig.dsp.status.flying = true;
    rig.run(100);
    // The answer to a repetition of the order, whose first acknowledgement was lost.
    rig.dsp_error(30);
    rig.run(500);
    assert_eq!(rig.functionality(), Functionality::TakingOff);
    rig.say(dsp_protocol::Downlink::FlowControl(FlowControl::Send));
    assert_eq!(rig.last(take_off).0, Stage::Done);
}

#[test]
fn a_refused_order_is_told_with_the_dsps_error_and_the_module_stays_started() {
    let mut rig = Rig::started();
    rig.dsp.grants = false;
    rig.dsp.obeys = false;
    let take_off = rig.take_off();
    rig.dsp_error(30);
    rig.run(300);
    assert_eq!(rig.last(take_off), aborted(Reason::RefusedByDsp));
    assert_eq!(rig.last_report(take_off).dsp_error(), Some(30));
    assert_eq!(
        (rig.module(), rig.imi_error()),
        (ModuleStatus::Running, ImiError::None),
        "not published as ended as it should"
    );
    rig.dsp.obeys = true;
    let take_off = rig.take_off();
    assert_eq!(rig.last(take_off).0, Stage::Progress);
}

#[test]
fn a_dsp_that_does_not_have_the_altitude_is_not_ordered_to_take_off() {
    let mut rig = Rig::started();
    // It rebooted between the two commands, or refuses the value.
    rig.dsp.refuses = Some(port::TAKE_OFF_ALTITUDE_M);
    rig.dsp.ports_32.insert(port::TAKE_OFF_ALTITUDE_M, 2.0);
    let take_off = rig.take_off();
    rig.run(500);
    assert_eq!(rig.last(take_off), aborted(Reason::RefusedByDsp));
    let order = Command::Write16 {
        port: port::TAKE_OFF,
        value: 1,
    };
    assert!(!rig.dsp.commands.contains(&order));
}

#[test]
fn an_order_that_is_late_is_not_given() {
    let mut rig = Rig::started();
    rig.dsp.acknowledges = false;
    // A parameter request that is not answered keeps the link busy.
    rig.parameter(ipc_types::payload::ParameterRequest::read(
        0,
        port::CRUISE_SPEED_MPS,
    ));
    let request = ipc_types::payload::MovementData {
        begin_by_ns: rig.now.0 + 50_000_000,
        ..ipc_types::payload::MovementData::take_off(0, 10.0)
    };
    let take_off = rig.movement(request);
    rig.run(100);
    assert_eq!(rig.last(take_off), aborted(Reason::TooLate));
    assert_eq!(rig.module(), ModuleStatus::Running, "not blocked");
    rig.dsp.acknowledges = true;
    rig.run(2000);
    let orders = rig.dsp.commands.iter();
    let orders = orders.filter(|command| matches!(command, Command::Write32 { .. }));
    assert_eq!(orders.count(), 0);
}

#[test]
fn a_waypoint_that_the_dsp_refuses_is_named_with_its_error() {
    let mut rig = Rig::flying();
    let path = rig.path(1, &[north(3), north(6)]);
    rig.run(150);
    rig.dsp.loses = u32::MAX;
    for _ in 0..3 {
        rig.run(100);
        rig.dsp_error(30);
    }
    assert_eq!(rig.last(path[1]), aborted(Reason::RefusedByDsp));
    let report = rig.last_report(path[1]);
    assert_eq!(
        (report.waypoint, report.dsp_error()),
        (2, Some(u32::from(DspErrorCode::INVALID_COMMAND.0)))
    );
    rig.run(100);
    assert!(rig.dsp.held.is_empty());
    assert_eq!(rig.module(), ModuleStatus::Running);
}

#[test]
fn errors_after_the_last_waypoint_are_about_none_of_them() {
    let mut rig = Rig::flying();
    let path = rig.path(1, &[north(3), north(6)]);
    rig.run(500);
    assert_eq!(rig.dsp.held, [north(3), north(6)]);
    for _ in 0..6 {
        rig.dsp_error(30);
        rig.run(100);
    }
    assert_eq!(rig.last(path[1]).0, Stage::Progress);
    for waypoint in [north(3), north(6)] {
        rig.dsp.at(waypoint);
        rig.run(200);
    }
    assert_eq!(rig.last(path[1]).0, Stage::Done);
}

#[test]
fn one_damaged_waypoint_costs_a_repetition() {
    let mut rig = Rig::flying();
    let path = rig.path(1, &[north(3)]);
    rig.dsp.loses = 1;
    rig.run(100);
    rig.dsp_error(102);
    rig.dsp_error(30);
    rig.run(300);
    rig.dsp.at(north(3));
    rig.run(100);
    assert_eq!(rig.last(path[0]).0, Stage::Done);
}

#[test]
fn a_landing_from_an_unknown_place_is_taken() {
    let mut rig = Rig::flying();
    rig.dsp.status.geographic = None::<Geographic>;
    rig.run(1500);
    rig.dsp.grants = false;
    let land = rig.land();
    rig.run(100);
    rig.dsp.status.flying = false;
    rig.run(300);
    assert_eq!(rig.last(land).0, Stage::Done);
}
