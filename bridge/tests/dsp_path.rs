//! What the DSP's path buffer may hold: whatever ends a movement or makes its state uncertain, the buffer is emptied before
//! anything else is flown (requirement H1).

mod desk;

use bridge::{BridgeConfig, Input};
use desk::{Desk, aborted, north};
use dsp_protocol::{Command, port};
use ipc_types::code::{
    ControlCommand, DspPathState, Functionality, ImiError, LinkState, Reason, Stage,
};

fn dsp_path(desk: &Desk) -> DspPathState {
    desk.bridge.state().link.dsp_path().unwrap()
}

/// A path of four waypoints of which the DSP has some.
fn mid_path(desk: &mut Desk) -> Vec<u64> {
    let path = desk.path(1, &[north(100), north(200), north(300), north(400)]);
    desk.run(350);
    assert!(!desk.dsp.held.is_empty());
    assert_eq!(dsp_path(desk), DspPathState::Ours);
    path
}

#[test]
fn a_stop_in_silence_empties_the_buffer_when_the_dsp_is_back_without_a_start_up() {
    let mut desk = Desk::flying();
    let path = mid_path(&mut desk);
    desk.dsp.silent = true;
    desk.run(1100);
    assert_eq!(desk.link(), LinkState::Silent);
    desk.dsp.commands.clear();
    let stop = desk.control(ControlCommand::Stop);
    assert_eq!(desk.last(stop), aborted(Reason::LinkDown));
    assert_eq!(desk.last(path[3]), aborted(Reason::Stopped));
    desk.run(100);
    assert_eq!(dsp_path(&desk), DspPathState::Unknown);
    desk.dsp.silent = false;
    desk.run(3000);
    assert_eq!(desk.link(), LinkState::Up);
    assert_eq!(desk.bridge.state().link.port_openings, 1);
    assert!(desk.dsp.held.is_empty(), "nothing is flown on");
    assert_eq!(dsp_path(&desk), DspPathState::Empty);
    let activations = desk.dsp.commands.iter();
    let activations = activations.filter(|command| **command == Command::ActivateStatus);
    assert_eq!(activations.count(), 0, "without a start-up");
}

#[test]
fn an_emptying_that_fails_three_times_goes_on_and_no_path_begins_before() {
    let mut desk = Desk::flying();
    mid_path(&mut desk);
    // The DSP gets nothing of it, and says other things meanwhile, so the link stays up.
    desk.dsp.acknowledges = false;
    let stop = desk.control(ControlCommand::Stop);
    desk.run(700);
    let fatal = ImiError::CommunicationFatalError;
    assert_eq!(
        desk.last(stop),
        (Stage::Unknown, Reason::CommunicationFatalError, fatal)
    );
    assert_eq!(desk.imi_error(), fatal);
    assert_eq!(desk.link(), LinkState::Up);
    let start = desk.control(ControlCommand::Start);
    assert_eq!(desk.last(start).0, Stage::Done);
    assert_eq!(desk.imi_error(), fatal, "it still holds");
    desk.dsp.waypoints.clear();
    let path = desk.path(2, &[north(7)]);
    desk.run(2000);
    assert_eq!(desk.last(path[0]).0, Stage::Aborted, "an ack error ends it");
    assert!(desk.dsp.waypoints.is_empty());
    desk.dsp.acknowledges = true;
    desk.run(3000);
    assert_eq!(dsp_path(&desk), DspPathState::Empty);
    desk.control(ControlCommand::Start);
    assert_eq!(desk.imi_error(), ImiError::None);
    desk.path(3, &[north(8)]);
    desk.run(300);
    assert_eq!(
        desk.dsp.held,
        [north(8)],
        "nothing is appended to leftovers"
    );
}

#[test]
fn a_path_waits_until_the_buffer_is_empty() {
    let mut desk = Desk::flying();
    mid_path(&mut desk);
    desk.dsp.loses_acks = 2;
    let next = desk.preempting(2, north(7));
    desk.run(150);
    assert_eq!(desk.functionality(), Functionality::FollowingPath);
    assert!(!desk.dsp.held.contains(&north(7)));
    desk.run(3000);
    assert_eq!(desk.dsp.held, [north(7)]);
    assert_eq!(desk.last(next).0, Stage::Progress);
}

#[test]
fn a_late_acknowledgement_of_an_earlier_emptying_proves_nothing() {
    let mut desk = Desk::flying();
    desk.dsp.loses_acks = 1;
    let hold = desk.hold();
    desk.run(300);
    assert_eq!(desk.last(hold).0, Stage::Done, "the second attempt");
    mid_path(&mut desk);
    // The lost acknowledgement comes after all, while the next emptying is lost on its way.
    desk.dsp.acknowledges = false;
    let hold = desk.hold();
    desk.say(dsp_protocol::Downlink::Ack {
        command: Command::InvalidatePath.code(),
    });
    assert_ne!(dsp_path(&desk), DspPathState::Empty);
    assert!(!desk.last(hold).0.is_final());
    desk.dsp.acknowledges = true;
    desk.run(2500);
    assert_eq!(desk.last(hold).0, Stage::Done);
    assert!(desk.dsp.held.is_empty());
}

#[test]
fn a_path_is_done_when_the_dsp_holds_nothing() {
    let mut desk = Desk::flying();
    let path = desk.path(1, &[north(3)]);
    desk.run(300);
    desk.dsp.acknowledges = false;
    desk.dsp.at(north(3));
    desk.run(300);
    assert_eq!(desk.last(path[0]).0, Stage::Progress);
    desk.dsp.acknowledges = true;
    desk.run(300);
    assert_eq!(desk.last(path[0]).0, Stage::Done);
    assert!(desk.dsp.held.is_empty());
    assert_eq!(dsp_path(&desk), DspPathState::Empty);
}

#[test]
fn the_helicopter_goes_on_to_the_last_waypoint_before_the_path_ends() {
    let mut desk = Desk::flying();
    let path = desk.path(1, &[north(10)]);
    desk.run(300);
    // In the box of 1.1 m, 0.9 m away.
    let mut near = north(10);
    near.latitude_deg -= 0.8e-5;
    desk.dsp.at(near);
    desk.run(1000);
    assert_eq!(desk.last(path[0]).0, Stage::Progress);
    assert_eq!(desk.dsp.held, [north(10)], "the DSP still flies there");
    desk.run(1200);
    assert_eq!(desk.last(path[0]).0, Stage::Done, "it came no nearer");
    assert!(desk.dsp.held.is_empty());
}

#[test]
fn a_path_may_begin_where_the_last_one_ended_and_where_the_helicopter_hovers() {
    let mut desk = Desk::flying();
    for path_id in 1..=3 {
        let path = desk.path(path_id, &[north(3)]);
        desk.run(300);
        desk.dsp.at(north(3));
        desk.run(100);
        assert_eq!(desk.last(path[0]).0, Stage::Done, "path {path_id}");
    }
    assert_eq!(desk.dsp.waypoints, [north(3); 3]);
}

#[test]
fn the_dsp_hears_of_the_bridge_while_it_holds_a_path_and_a_classic_one_is_told_apart() {
    let keep_alive = Command::Read16 {
        port: port::PC_TIMEOUT_MS,
    };
    for has_pc_timeout in [true, false] {
        let mut desk = Desk::closed(&BridgeConfig::default());
        desk.dsp.has_pc_timeout = has_pc_timeout;
        desk.open();
        desk.control(ControlCommand::Start);
        desk.lift_off();
        let supported = desk.bridge.state().link.pc_timeout_supported;
        assert_eq!(supported, u32::from(has_pc_timeout));
        desk.dsp.commands.clear();
        desk.run(5000);
        assert!(!desk.dsp.commands.contains(&keep_alive), "at rest");
        mid_path(&mut desk);
        desk.dsp.grants = false;
        desk.dsp.commands.clear();
        desk.run(6000);
        let signs = desk.dsp.commands.iter();
        let signs = signs.filter(|command| **command == keep_alive).count();
        let expected = if has_pc_timeout { 8..=10 } else { 0..=0 };
        assert!(expected.contains(&signs), "{signs}");
    }
}

#[test]
fn a_dsp_that_may_have_dropped_the_path_ends_it() {
    let mut desk = Desk::flying();
    let path = mid_path(&mut desk);
    // It sends status, and hears nothing.
    desk.dsp.grants = false;
    desk.dsp.acknowledges = false;
    desk.run(2700);
    assert_eq!(desk.link(), LinkState::Up);
    let fatal = ImiError::CommunicationFatalError;
    assert_eq!(
        desk.last(path[3]),
        (Stage::Unknown, Reason::CommunicationFatalError, fatal)
    );
}

#[test]
fn a_bridge_that_was_stopped_for_so_long_that_the_dsp_dropped_the_path_ends_it() {
    let mut desk = Desk::flying();
    let path = mid_path(&mut desk);
    desk.dsp.grants = false;
    desk.dsp.acknowledges = false;
    // A sign of life is on its way, and then the process stands still, for longer than the DSP waits.
    desk.run(700);
    desk.now = ipc_types::MonotonicNs(desk.now.0 + 1_500_000_000);
    desk.say(dsp_protocol::Downlink::Ack16 {
        command: 0,
        value: 2000,
    });
    assert_eq!(desk.last(path[3]).0, Stage::Unknown);
    desk.dsp.acknowledges = true;
    desk.run(3000);
    assert_eq!(dsp_path(&desk), DspPathState::Empty);
}

#[test]
fn a_path_whose_bridge_stood_still_longer_than_the_dsp_waits_never_goes_on() {
    for has_pc_timeout in [true, false] {
        let mut desk = Desk::closed(&BridgeConfig::default());
        desk.dsp.has_pc_timeout = has_pc_timeout;
        desk.open();
        desk.control(ControlCommand::Start);
        desk.lift_off();
        let points: Vec<_> = (1..=9).map(|step| north(100 * step)).collect();
        let path = desk.path(1, &points);
        desk.run(350);
        let sent = desk.dsp.waypoints.len();
        // Flow control says 1 all the time.
        desk.stand_still(2000);
        let fatal = ImiError::CommunicationFatalError;
        assert_eq!(
            desk.last(path[8]),
            (Stage::Unknown, Reason::CommunicationFatalError, fatal)
        );
        desk.run(3000);
        assert_eq!(desk.dsp.waypoints.len(), sent, "{has_pc_timeout}");
        assert!(desk.dsp.held.is_empty());
        assert_eq!(dsp_path(&desk), DspPathState::Empty);
    }
}

#[test]
fn a_path_whose_bridge_stood_still_right_after_it_was_accepted_is_not_flown_late() {
    let mut desk = Desk::flying();
    let path = desk.path(1, &[north(100), north(200)]);
    desk.stand_still(12_000);
    desk.run(3000);
    assert_eq!(desk.last(path[1]), aborted(Reason::TooLate));
    assert!(desk.dsp.waypoints.is_empty());
}

#[test]
fn a_waypoint_that_has_not_left_before_a_standstill_does_not_leave_after_it() {
    let mut desk = Desk::flying();
    mid_path(&mut desk);
    let sent = desk.dsp.waypoints.len();
    // It is on its way to the port when the process stands still.
    desk.say(dsp_protocol::Downlink::FlowControl(
        dsp_protocol::FlowControl::Send,
    ));
    assert!(!desk.bridge.unsent().is_empty());
    desk.now = ipc_types::MonotonicNs(desk.now.0 + 2_000_000_000);
    assert!(desk.bridge.transmit(desk.now).is_empty());
    desk.run(1000);
    assert_eq!(desk.dsp.waypoints.len(), sent);
    assert!(desk.dsp.held.is_empty());
}

#[test]
fn a_bridge_that_ends_in_flight_says_so_when_the_buffer_is_empty_and_else_that_it_does_not_know() {
    for acknowledges in [true, false] {
        let mut desk = Desk::flying();
        let path = mid_path(&mut desk);
        desk.dsp.acknowledges = acknowledges;
        desk.apply(Input::WindDown);
        assert_eq!(desk.last(path[3]).0, Stage::Progress);
        desk.exchange();
        assert_eq!(desk.bridge.has_wound_down(), acknowledges);
        let ending = Reason::BridgeEnding;
        if acknowledges {
            assert_eq!(desk.last(path[3]), aborted(ending));
        }
        desk.apply(Input::Close);
        if !acknowledges {
            let unknown = (Stage::Unknown, ending, ImiError::None);
            assert_eq!(desk.last(path[3]), unknown);
        }
    }
}

#[test]
fn a_bridge_that_ends_in_flight_empties_the_buffer_before_it_goes() {
    let mut desk = Desk::flying();
    let path = mid_path(&mut desk);
    desk.apply(Input::WindDown);
    assert!(!desk.bridge.has_wound_down());
    let late = desk.land();
    assert_eq!(desk.last(late), desk::refused(Reason::BridgeEnding));
    desk.exchange();
    assert_eq!(desk.last(path[3]), aborted(Reason::BridgeEnding));
    assert!(desk.bridge.has_wound_down());
    assert!(desk.dsp.held.is_empty());
    desk.apply(Input::Close);
    assert_eq!(desk.imi_error(), ImiError::None, "it ends as it should");
}
