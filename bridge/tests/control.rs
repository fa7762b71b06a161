//! The core's side of control: whose movements are taken, and what is everyone's. The table itself:
//! `bridge/src/flight/control.rs`.

use crate::rig::{Rig, north, refused};
use bridge::{BridgeConfig, Input, Sender};
use ipc_types::code::{ControlCommand, Functionality, Reason, Stage};
use ipc_types::payload::{ModuleControl, ParameterRequest};

const TAKE: ControlCommand = ControlCommand::TakeControl;

/// The operator at a terminal, whose commands are processes of one session.
fn terminal(session: u32, process: u32) -> Sender {
    Sender {
        process: Some(process),
        session: Some(session),
        ..Sender::default()
    }
}

/// A helicopter in the air whose control is exclusive.
fn exclusive() -> Rig {
    let config: BridgeConfig =
        runtime::config::parse("[control]\nexclusive = true\nsilence_s = 30.0\n", "a test")
            .unwrap();
    let mut rig = Rig::up(&config);
    rig.control(ControlCommand::Start);
    rig.lift_off();
    rig.run(100);
    rig
}

fn holder(rig: &Rig) -> Option<u32> {
    rig.bridge.state().holder().map(|holder| holder.session)
}

#[test]
fn movements_and_writes_of_others_are_refused_and_hold_and_land_are_everyone_s() {
    let mut rig = exclusive();
    rig.sender = terminal(10, 11);
    assert_eq!(holder(&rig), None);
    let path = rig.path(1, &[north(20)]);
    assert_eq!(rig.last(path[0]).0, Stage::Accepted);
    assert_eq!(holder(&rig), Some(10));
    let control = rig.bridge.state().control;
    assert!(control.last_order_ns > 0 && control.exclusive == 1);

    rig.sender = terminal(20, 21);
    let not_in_control = refused(Reason::NotInControl);
    let other = rig.preempting(2, north(-20));
    assert_eq!(rig.last(other), not_in_control);
    let take_off = rig.take_off();
    assert_eq!(rig.last(take_off), not_in_control);
    let write = rig.parameter(ParameterRequest::write(0, 10_006, 2.0));
    assert_eq!(rig.last(write), not_in_control);
    let read = rig.parameter(ParameterRequest::read(0, 10_006));
    assert_ne!(rig.last(read), not_in_control);
    assert_eq!(rig.functionality(), Functionality::FollowingPath);

    let hold = rig.hold();
    assert_eq!(rig.last(hold).0, Stage::Done);
    assert_eq!(holder(&rig), Some(10), "a hold takes no control");
    rig.land();
    assert_eq!(rig.functionality(), Functionality::Landing);
}

#[test]
fn control_is_asked_for_passed_and_lost_by_silence_and_by_the_end_of_its_holder() {
    let mut rig = exclusive();
    rig.sender = terminal(10, 11);
    let take = rig.control(TAKE);
    assert_eq!(rig.last(take).0, Stage::Done);
    assert_eq!(rig.bridge.controller(), Some(10));

    rig.sender = terminal(20, 21);
    let take = rig.control(TAKE);
    assert_eq!(rig.last(take), refused(Reason::NotInControl));
    let asker = rig.bridge.state().asker().map(|asker| asker.session);
    assert_eq!((holder(&rig), asker), (Some(10), Some(20)));
    // Another command of the same terminal.
    rig.sender = terminal(10, 12);
    let pass = rig.control(ControlCommand::PassControl);
    assert_eq!(rig.last(pass).0, Stage::Done);
    assert_eq!(holder(&rig), Some(20));
    assert_eq!(rig.bridge.state().asker(), None);

    rig.apply(Input::ProcessEnded(10));
    assert_eq!(holder(&rig), Some(20), "it is another's end");
    rig.apply(Input::ProcessEnded(20));
    assert_eq!((holder(&rig), rig.bridge.controller()), (None, None));

    // A movement is waited for, and silence counts from its end.
    let path = rig.path(1, &[north(20)]);
    rig.run(40_000);
    assert_eq!(rig.functionality(), Functionality::FollowingPath);
    assert_eq!(holder(&rig), Some(10));
    rig.dsp.at(north(20));
    rig.run(15_000);
    assert_eq!(rig.last(path[0]).0, Stage::Done);
    assert_eq!(holder(&rig), Some(10));
    while rig.bridge.controller().is_some() {
        rig.run(10);
    }
    assert_eq!(holder(&rig), None, "published at once");
}

#[test]
fn what_comes_too_late_takes_no_control_and_a_refused_movement_neither() {
    let mut rig = exclusive();
    rig.sender = terminal(10, 11);
    let request_id = rig.request_id();
    rig.ask_control(ModuleControl {
        issued_ns: 1,
        begin_by_ns: rig.now.0 - 1,
        ..ModuleControl::new(request_id, TAKE)
    });
    assert_eq!(rig.last(request_id), refused(Reason::TooLate));
    let take_off = rig.take_off();
    assert_eq!(rig.last(take_off), refused(Reason::AlreadyFlying));
    assert_eq!(holder(&rig), None);
}

#[test]
fn without_exclusive_control_the_last_one_to_order_commands() {
    let mut rig = Rig::flying();
    for session in [10, 20] {
        rig.sender = terminal(session, session + 1);
        let path = rig.preempting(u64::from(session), north(20));
        assert_eq!(rig.last(path).0, Stage::Accepted, "{session}");
        assert_eq!(holder(&rig), Some(session));
    }
    assert_eq!(rig.bridge.state().control.exclusive, 0);
}
