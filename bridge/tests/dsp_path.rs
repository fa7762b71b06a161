//! What the DSP's path buffer may hold: whatever ends a movement or makes its state uncertain, the buffer is emptied
//! before anything else is flown (requirement H1).

use crate::rig::{Rig, aborted, north};
use bridge::{BridgeConfig, Input};
use dsp_protocol::{Command, port};
use ipc_types::code::{
    ControlCommand, DspPathState, Functionality, ImiError, LinkState, Reason, Stage,
};

fn dsp_path(rig: &Rig) -> DspPathState {
    rig.bridge.state().link.dsp_path().unwrap()
}

/// A path of four waypoints of which the DSP has some.
fn mid_path(rig: &mut Rig) -> Vec<u64> {
    let path = rig.path(1, &[north(100), north(200), north(300), north(400)]);
    rig.run(350);
    assert!(!rig.dsp.held.is_empty());
    assert_eq!(dsp_path(rig), DspPathState::Ours);
    path
}

#[test]
fn a_stop_in_silence_empties_the_buffer_when_the_dsp_is_back_without_a_start_up() {
    let mut rig = Rig::flying();
    let path = mid_path(&mut rig);
    rig.dsp.silent = true;
    rig.run(1100);
    assert_eq!(rig.link(), LinkState::Silent);
    rig.dsp.commands.clear();
    let stop = rig.control(ControlCommand::Stop);
    assert_eq!(rig.last(stop), aborted(Reason::LinkDown));
    assert_eq!(rig.last(path[3]), aborted(Reason::Stopped));
    rig.run(100);
    assert_eq!(dsp_path(&rig), DspPathState::Unknown);
    rig.dsp.silent = false;
    rig.run(3000);
    assert_eq!(rig.link(), LinkState::Up);
    assert_eq!(rig.bridge.state().link.port_openings, 1);
    assert!(rig.dsp.held.is_empty(), "nothing is flown on");
    assert_eq!(dsp_path(&rig), DspPathState::Empty);
    let activations = rig.dsp.commands.iter();
    let activations = activations.filter(|command| **command == Command::ActivateStatus);
    assert_eq!(activations.count(), 0, "without a start-up");
}

#[test]
fn an_emptying_that_fails_three_times_goes_on_and_no_path_begins_before() {
    let mut rig = Rig::flying();
    mid_path(&mut rig);
    // The DSP gets nothing of it, and says other things meanwhile, so the link stays up.
    rig.dsp.acknowledges = false;
    let stop = rig.control(ControlCommand::Stop);
    rig.run(700);
    let fatal = ImiError::CommunicationFatalError;
    assert_eq!(
        rig.last(stop),
        (Stage::Unknown, Reason::CommunicationFatalError, fatal)
    );
    assert_eq!(rig.imi_error(), fatal);
    assert_eq!(rig.link(), LinkState::Up);
    let start = rig.control(ControlCommand::Start);
    assert_eq!(rig.last(start).0, Stage::Done);
    assert_eq!(rig.imi_error(), fatal, "it still holds");
    rig.dsp.waypoints.clear();
    let path = rig.path(2, &[north(7)]);
    rig.run(2000);
    assert_eq!(rig.last(path[0]).0, Stage::Aborted, "an ack error ends it");
    assert!(rig.dsp.waypoints.is_empty());
    rig.dsp.acknowledges = true;
    rig.run(3000);
    assert_eq!(dsp_path(&rig), DspPathState::Empty);
    rig.control(ControlCommand::Start);
    assert_eq!(rig.imi_error(), ImiError::None);
    rig.path(3, &[north(8)]);
    rig.run(300);
    assert_eq!(rig.dsp.held, [north(8)], "nothing is appended to leftovers");
}

#[test]
fn a_path_waits_until_the_buffer_is_empty() {
    let mut rig = Rig::flying();
    mid_path(&mut rig);
    rig.dsp.loses_acks = 2;
    let next = rig.preempting(2, north(7));
    rig.run(150);
    assert_eq!(rig.functionality(), Functionality::FollowingPath);
    assert!(!rig.dsp.held.contains(&north(7)));
    rig.run(3000);
    assert_eq!(rig.dsp.held, [north(7)]);
    assert_eq!(rig.last(next).0, Stage::Progress);
}

#[test]
fn a_late_acknowledgement_of_an_earlier_emptying_proves_nothing() {
    let mut rig = Rig::flying();
    rig.dsp.loses_acks = 1;
    let hold = rig.hold();
    rig.run(300);
    assert_eq!(rig.last(hold).0, Stage::Done, "the second attempt");
    mid_path(&mut rig);
    // The lost acknowledgement comes after all, while the next emptying is lost on its way.
    rig.dsp.acknowledges = false;
    let hold = rig.hold();
    rig.say(dsp_protocol::Downlink::Ack {
        command: Command::InvalidatePath.code(),
    });
    assert_ne!(dsp_path(&rig), DspPathState::Empty);
    assert!(!rig.last(hold).0.is_final());
    rig.dsp.acknowledges = true;
    rig.run(2500);
    assert_eq!(rig.last(hold).0, Stage::Done);
    assert!(rig.dsp.held.is_empty());
}

#[test]
fn a_path_is_done_when_the_dsp_holds_nothing() {
    let mut rig = Rig::flying();
    let path = rig.path(1, &[north(3)]);
    rig.run(300);
    rig.dsp.acknowledges = false;
    rig.dsp.at(north(3));
    rig.run(300);
    assert_eq!(rig.last(path[0]).0, Stage::Progress);
    rig.dsp.acknowledges = true;
    rig.run(300);
    assert_eq!(rig.last(path[0]).0, Stage::Done);
    assert!(rig.dsp.held.is_empty());
    assert_eq!(dsp_path(&rig), DspPathState::Empty);
}

#[test]
fn the_helicopter_goes_on_to_the_last_waypoint_before_the_path_ends() {
    let mut rig = Rig::flying();
    let path = rig.path(1, &[north(10)]);
    rig.run(300);
    // In the box of 1.1 m, 0.9 m away.
    let mut near = north(10);
    near.latitude_deg -= 0.8e-5;
    rig.dsp.at(near);
    rig.run(1000);
    assert_eq!(rig.last(path[0]).0, Stage::Progress);
    assert_eq!(rig.dsp.held, [north(10)], "the DSP still flies there");
    rig.run(1200);
    assert_eq!(rig.last(path[0]).0, Stage::Done, "it came no nearer");
    assert!(rig.dsp.held.is_empty());
}

#[test]
fn a_path_may_begin_where_the_last_one_ended_and_where_the_helicopter_hovers() {
    let mut rig = Rig::flying();
    for path_id in 1..=3 {
        let path = rig.path(path_id, &[north(3)]);
        rig.run(300);
        rig.dsp.at(north(3));
        rig.run(100);
        assert_eq!(rig.last(path[0]).0, Stage::Done, "path {path_id}");
    }
    assert_eq!(rig.dsp.waypoints, [north(3); 3]);
}

#[test]
fn the_dsp_hears_of_the_bridge_while_it_holds_a_path_and_a_classic_one_is_told_apart() {
    let keep_alive = Command::Read16 {
        port: port::PC_TIMEOUT_MS,
    };
    for has_pc_timeout in [true, false] {
        let mut rig = Rig::closed(&BridgeConfig::default());
        rig.dsp.has_pc_timeout = has_pc_timeout;
        rig.open();
        rig.control(ControlCommand::Start);
        rig.lift_off();
        let supported = rig.bridge.state().link.pc_timeout_supported;
        assert_eq!(supported, u32::from(has_pc_timeout));
        rig.dsp.commands.clear();
        rig.run(5000);
        assert!(!rig.dsp.commands.contains(&keep_alive), "at rest");
        mid_path(&mut rig);
        rig.dsp.grants = false;
        rig.dsp.commands.clear();
        rig.run(6000);
        let signs = rig.dsp.commands.iter();
        let signs = signs.filter(|command| **command == keep_alive).count();
        let expected = if has_pc_timeout { 8..=10 } else { 0..=0 };
        assert!(expected.contains(&signs), "{signs}");
    }
}

#[test]
fn a_dsp_that_may_have_dropped_the_path_ends_it() {
    let mut rig = Rig::flying();
    let path = mid_path(&mut rig);
    // It sends status, and hears nothing.
    rig.dsp.grants = false;
    rig.dsp.acknowledges = false;
    rig.run(2700);
    assert_eq!(rig.link(), LinkState::Up);
    let fatal = ImiError::CommunicationFatalError;
    assert_eq!(
        rig.last(path[3]),
        (Stage::Unknown, Reason::CommunicationFatalError, fatal)
    );
}

#[test]
fn a_bridge_that_was_stopped_for_so_long_that_the_dsp_dropped_the_path_ends_it() {
    let mut rig = Rig::flying();
    let path = mid_path(&mut rig);
    rig.dsp.grants = false;
    rig.dsp.acknowledges = false;
    // A sign of life is on its way, and then the process stands still, for longer than the DSP waits.
    rig.run(700);
    rig.now = ipc_types::MonotonicNs(rig.now.0 + 1_500_000_000);
    rig.say(dsp_protocol::Downlink::Ack16 {
        command: 0,
        value: 2000,
    });
    assert_eq!(rig.last(path[3]).0, Stage::Unknown);
    rig.dsp.acknowledges = true;
    rig.run(3000);
    assert_eq!(dsp_path(&rig), DspPathState::Empty);
}

#[test]
fn a_path_whose_bridge_stood_still_longer_than_the_dsp_waits_never_goes_on() {
    for has_pc_timeout in [true, false] {
        let mut rig = Rig::closed(&BridgeConfig::default());
        rig.dsp.has_pc_timeout = has_pc_timeout;
        rig.open();
        rig.control(ControlCommand::Start);
        rig.lift_off();
        let points: Vec<_> = (1..=9).map(|step| north(100 * step)).collect();
        let path = rig.path(1, &points);
        rig.run(350);
        let sent = rig.dsp.waypoints.len();
        // Flow control says 1 all the time.
        rig.stand_still(2000);
        let fatal = ImiError::CommunicationFatalError;
        assert_eq!(
            rig.last(path[8]),
            (Stage::Unknown, Reason::CommunicationFatalError, fatal)
        );
        rig.run(3000);
        assert_eq!(rig.dsp.waypoints.len(), sent, "{has_pc_timeout}");
        assert!(rig.dsp.held.is_empty());
        assert_eq!(dsp_path(&rig), DspPathState::Empty);
    }
}

#[test]
fn a_path_whose_bridge_stood_still_right_after_it_was_accepted_is_not_flown_late() {
    let mut rig = Rig::flying();
    let path = rig.path(1, &[north(100), north(200)]);
    rig.stand_still(12_000);
    rig.run(3000);
    assert_eq!(rig.last(path[1]), aborted(Reason::TooLate));
    assert!(rig.dsp.waypoints.is_empty());
}

#[test]
fn a_waypoint_that_has_not_left_before_a_standstill_does_not_leave_after_it() {
    let mut rig = Rig::flying();
    mid_path(&mut rig);
    let sent = rig.dsp.waypoints.len();
    // It is on its way to the port when the process stands still.
    rig.say(dsp_protocol::Downlink::FlowControl(
        dsp_protocol::FlowControl::Send,
    ));
    assert!(!rig.bridge.unsent().is_empty());
    rig.now = ipc_types::MonotonicNs(rig.now.0 + 2_000_000_000);
    assert!(rig.bridge.transmit(rig.now).is_empty());
    rig.run(1000);
    assert_eq!(rig.dsp.waypoints.len(), sent);
    assert!(rig.dsp.held.is_empty());
}

#[test]
fn a_bridge_that_ends_in_flight_says_so_when_the_buffer_is_empty_and_else_that_it_does_not_know() {
    for acknowledges in [true, false] {
        let mut rig = Rig::flying();
        let path = mid_path(&mut rig);
        rig.dsp.acknowledges = acknowledges;
        rig.apply(Input::WindDown);
        assert_eq!(rig.last(path[3]).0, Stage::Progress);
        rig.exchange();
        assert_eq!(rig.bridge.has_wound_down(), acknowledges);
        let ending = Reason::BridgeEnding;
        if acknowledges {
            assert_eq!(rig.last(path[3]), aborted(ending));
        }
        rig.apply(Input::Close);
        if !acknowledges {
            let unknown = (Stage::Unknown, ending, ImiError::None);
            assert_eq!(rig.last(path[3]), unknown);
        }
    }
}

#[test]
fn a_bridge_that_ends_in_flight_empties_the_buffer_before_it_goes() {
    let mut rig = Rig::flying();
    let path = mid_path(&mut rig);
    rig.apply(Input::WindDown);
    assert!(!rig.bridge.has_wound_down());
    let late = rig.land();
    assert_eq!(rig.last(late), crate::rig::refused(Reason::BridgeEnding));
    rig.exchange();
    assert_eq!(rig.last(path[3]), aborted(Reason::BridgeEnding));
    assert!(rig.bridge.has_wound_down());
    assert!(rig.dsp.held.is_empty());
    rig.apply(Input::Close);
    assert_eq!(rig.imi_error(), ImiError::None, "it ends as it should");
}
