//! The machine is suspended in flight: its monotonic clock stands still, and the DSP lives on (requirement H1).

use crate::rig::{Rig, aborted, go_to, north, refused};
use bridge::outputs::Notice;
use bridge::{BridgeConfig, Input};
use dsp_protocol::{Command, Waypoint};
use ipc_types::MonotonicNs;
use ipc_types::code::{ControlCommand, DspPathState, ImiError, LinkState, Reason, Stage};
use ipc_types::payload::MovementData;

const MS: u64 = 1_000_000;

/// Round an exclusion area: the first waypoints are beside it, the last behind it.
fn round_the_mast() -> Vec<Waypoint> {
    let aside = |steps| Waypoint {
        longitude_deg: -6.0 + 3e-3,
        ..north(steps)
    };
    let mut path: Vec<_> = (0..7).map(|step| aside(50 * step)).collect();
    path.push(north(300));
    path
}

const MAST: &str = "[[fence.area]]\nname = \"mast\"\nkind = \"exclusion\"\n\
                    centre = [37.0015, -6.0]\nradius_m = 50.0\n";

#[test]
fn a_path_of_a_machine_that_slept_has_ended_and_none_of_it_follows() {
    let config: BridgeConfig = runtime::config::parse(MAST, "a test").unwrap();
    let mut cases = 0;
    for has_pc_timeout in [true, false] {
        for places in [2, 4, usize::MAX] {
            for slept_ms in [2_000, 3_600_000] {
                let mut rig = Rig::closed(&config);
                rig.dsp.has_pc_timeout = has_pc_timeout;
                rig.dsp.places = places;
                rig.open();
                rig.control(ControlCommand::Start);
                rig.lift_off();
                let path = rig.path(1, &round_the_mast());
                rig.run(250);
                let sent = rig.dsp.waypoints.len();
                assert!(sent > 0 && sent < 8, "{sent}");
                let issued_ns = rig.now.0;
                rig.dsp.commands.clear();
                // It flies what it has, or empties its buffer by itself: either way its next leg begins elsewhere.
                rig.dsp.held.clear();
                rig.suspend(slept_ms);
                let fatal = ImiError::CommunicationFatalError;
                let unknown = (Stage::Unknown, Reason::CommunicationFatalError, fatal);
                let case = (has_pc_timeout, places, slept_ms);
                assert_eq!(rig.last(path[7]), unknown, "{case:?}");
                rig.run(3000);
                assert_eq!(rig.dsp.waypoints.len(), sent, "{case:?}");
                assert!(rig.dsp.commands.contains(&Command::InvalidatePath));
                assert!(
                    rig.dsp.commands.contains(&Command::ActivateStatus),
                    "started up"
                );
                assert_eq!(rig.link(), LinkState::Up);
                let state = rig.bridge.state().link;
                assert_eq!(state.dsp_path(), Some(DspPathState::Empty));

                // What was ordered before the machine slept is too late after it.
                let start = rig.control(ControlCommand::Start);
                assert_eq!(rig.last(start).0, Stage::Done);
                let old = rig.ordered(MovementData {
                    path_id: 7,
                    first: 1,
                    last: 1,
                    issued_ns,
                    ..go_to(north(3))
                });
                assert_eq!(rig.last(old), refused(Reason::Superseded));
                let new = rig.preempting(8, north(-30));
                assert_eq!(rig.last(new).0, Stage::Accepted, "{case:?}");
                // What is said has moments of the host's clock.
                rig.out.states.clear();
                rig.run(1000);
                let reported_ns = rig.last_report(new).reported_ns;
                assert!(reported_ns <= rig.now.0 && reported_ns + 2000 * MS > rig.now.0);
                let telemetry = rig.out.telemetry.last().unwrap();
                assert!(telemetry.received_ns <= rig.now.0);
                let state = rig.out.states.last().unwrap();
                assert!(state.link.last_message_ns <= rig.now.0);
                // The path ended when the machine was back.
                assert!((1..=rig.now.0).contains(&state.last_end.ended_ns));
                cases += 1;
            }
        }
    }
    assert_eq!(cases, 12);
}

#[test]
fn orders_from_before_the_machine_slept_are_too_late_after_it() {
    let mut rig = Rig::flying();
    rig.run(1000);
    let waiting = rig.waypoint(1, 1, 0, north(3));
    assert_eq!(rig.last(waiting).0, Stage::Accepted);
    let issued_ns = rig.now.0;
    rig.suspend(60_000);
    assert_eq!(rig.last(waiting).0, Stage::Aborted, "its path is broken");
    rig.run(1000);
    rig.control(ControlCommand::Start);
    for begin_by_ns in [0, issued_ns + 5000 * MS] {
        let take_off = rig.ordered(MovementData {
            issued_ns,
            begin_by_ns,
            ..MovementData::take_off(0, 10.0)
        });
        assert_eq!(rig.last(take_off).0, Stage::Refused, "{begin_by_ns}");
    }
    let mut rig = Rig::flying();
    rig.run(1000);
    rig.dsp.silent = true;
    rig.run(1500);
    let hold = rig.hold();
    assert_eq!(rig.last(hold).1, Reason::LinkDown, "deferred");
    rig.suspend(60_000);
    assert_eq!(rig.last(hold), aborted(Reason::TooLate));
}

#[test]
fn an_order_gets_no_younger_by_suspensions_that_came_after_it() {
    for suspensions in [1, 2, 3, 12] {
        let mut rig = Rig::flying();
        rig.run(1000);
        let issued_ns = rig.now.0;
        rig.run(200);
        let newer = rig.preempting(1, north(30));
        assert_eq!(rig.last(newer).0, Stage::Accepted);
        for _ in 0..suspensions {
            rig.suspend(300);
            rig.run(20);
        }
        let old = rig.ordered(MovementData {
            path_id: 7,
            first: 1,
            last: 1,
            preempt: 1,
            issued_ns,
            ..go_to(north(3))
        });
        let superseded = refused(Reason::Superseded);
        assert_eq!(rig.last(old), superseded, "{suspensions}");
        assert_eq!(rig.last(newer).0, Stage::Accepted, "{suspensions}");
    }
}

#[test]
fn a_short_suspension_is_a_short_standstill() {
    let mut rig = Rig::flying();
    let path = rig.path(1, &[north(100), north(200), north(300)]);
    rig.run(250);
    rig.suspend(200);
    rig.dsp_error(77);
    let error = |notice: &Notice| matches!(notice, Notice::DspError { .. });
    assert!(rig.out.notices.iter().any(error), "told as before");
    let before = (rig.out.sent, rig.out.telemetry.len());
    rig.run(2000);
    assert!(rig.out.sent > before.0 && rig.out.telemetry.len() > before.1);
    assert_eq!(rig.dsp.waypoints.len(), 3);
    assert_eq!(rig.last(path[2]).0, Stage::Progress);
}

#[test]
fn the_deadline_of_a_bridge_that_slept_is_one_of_the_host_s_clock() {
    let mut rig = Rig::flying();
    rig.apply(Input::Suspended(3_600_000 * MS));
    rig.run(500);
    let state = rig.out.states.last().unwrap();
    assert_eq!(state.control.last_order_ns, 0, "never is never");
    let deadline = rig.bridge.deadline();
    assert!(
        deadline <= MonotonicNs(rig.now.0 + 1000 * MS),
        "{deadline:?}"
    );
}

/// Its sender stood still as well.
#[test]
fn a_lease_does_not_run_while_the_machine_sleeps() {
    let mut rig = Rig::flying();
    let path = rig.movement(MovementData {
        path_id: 5,
        first: 1,
        last: 1,
        lease_ms: 1000,
        ..go_to(north(900))
    });
    rig.run(600);
    let renewed = rig.now;
    rig.run(200);
    rig.suspend(1500);
    rig.run(100);
    // It is looked at when the lease ends, and is of before the machine slept.
    rig.apply(Input::LeaseRenewed(renewed));
    rig.run(600);
    assert_eq!(rig.last(path).0, Stage::Progress);
    rig.run(200);
    assert_eq!(rig.last(path), aborted(Reason::SenderLost));
}
