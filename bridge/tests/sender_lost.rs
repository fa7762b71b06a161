//! The sender of a path is lost: its process ends, it gives the path up, or it does not renew its lease (requirement
//! H14).

mod chance;

use crate::rig::{Rig, aborted, go_to, north};
use bridge::{BridgeConfig, Input, RequestKey, Sender, SenderClock};
use dsp_protocol::Command;
use ipc_types::MonotonicNs;
use ipc_types::code::{Functionality, ModuleStatus, MovementKind, Reason, SenderLost, Stage};
use ipc_types::payload::MovementData;

const MS: u64 = 1_000_000;
/// Its sender.
const PROCESS: u32 = 4711;

fn sender(process: u32) -> Sender {
    Sender {
        process: Some(process),
        session: Some(300),
        clock: SenderClock::Own,
    }
}

/// A path of one far waypoint that says what becomes of it.
fn order(sender_lost: Option<SenderLost>, lease_ms: u32) -> MovementData {
    MovementData {
        path_id: 5,
        first: 1,
        last: 1,
        lease_ms,
        sender_lost: sender_lost.map_or(0, SenderLost::code),
        ..go_to(north(900)).preempting()
    }
}

/// A path under way, and its request.
fn following(config: &str, order: MovementData) -> (Rig, u64) {
    let config: BridgeConfig = runtime::config::parse(config, "a test").unwrap();
    let mut rig = Rig::up(&config);
    rig.control(ipc_types::code::ControlCommand::Start);
    rig.lift_off();
    rig.sender = sender(PROCESS);
    let path = rig.movement(order);
    rig.run(300);
    assert_eq!(rig.functionality(), Functionality::FollowingPath);
    assert_eq!(rig.dsp.held.len(), 1);
    (rig, path)
}

fn lose(rig: &mut Rig, path: u64, how: usize) {
    match how {
        0 => rig.apply(Input::ProcessEnded(PROCESS)),
        _ => rig.apply(Input::SenderGone(RequestKey::Movement(path))),
    }
}

#[test]
fn a_path_whose_sender_is_lost_goes_on_holds_or_lands_as_it_says_or_as_the_configuration_does() {
    use SenderLost::{Continue, Hold, Land};
    let configured = |name: &str| format!("[movement]\nsender_lost = \"{name}\"\n");
    for (config, said, then) in [
        (String::new(), None, Hold),
        (String::new(), Some(Continue), Continue),
        (String::new(), Some(Hold), Hold),
        (String::new(), Some(Land), Land),
        (configured("continue"), None, Continue),
        (configured("land"), None, Land),
        (configured("land"), Some(Hold), Hold),
    ] {
        for how in [0, 1] {
            let (mut rig, path) = following(&config, order(said, 0));
            let watched = (then != Continue).then_some(PROCESS);
            assert_eq!(rig.bridge.path_sender(), watched);
            rig.dsp.commands.clear();
            lose(&mut rig, path, how);
            // Within 300 ms.
            rig.run(100);
            if then == Continue {
                assert_eq!(rig.functionality(), Functionality::FollowingPath);
                continue;
            }
            assert_eq!(
                rig.last(path),
                aborted(Reason::SenderLost),
                "{said:?} {how}"
            );
            let end = rig.bridge.state().last_end;
            assert_eq!(
                end.request_id, path,
                "the state tells it, also when a landing follows"
            );
            assert_eq!(end.kind(), Some(MovementKind::GoToWaypoint));
            assert_eq!(end.early(), Some(Reason::SenderLost));
            assert_eq!(rig.bridge.path_sender(), None);
            assert!(rig.dsp.held.is_empty());
            assert!(rig.dsp.commands.contains(&Command::InvalidatePath));
            let expected = match then {
                Land => Functionality::Landing,
                _ => Functionality::AtRest,
            };
            assert_eq!(rig.functionality(), expected, "{said:?} {how}");
            if then == Hold {
                assert_eq!(rig.module(), ModuleStatus::Running, "it stays started");
                let next = rig.preempting(6, north(3));
                assert_eq!(rig.last(next).0, Stage::Accepted);
            }
        }
    }
}

#[test]
fn a_lease_that_is_not_renewed_in_time_is_a_sender_that_is_lost_whatever_it_says() {
    use SenderLost::{Continue, Land};
    for (said, functionality) in [
        (None, Functionality::AtRest),
        (Some(Continue), Functionality::AtRest),
        (Some(Land), Functionality::Landing),
    ] {
        let (mut rig, path) = following("", order(said, 500));
        let began = rig.now.0 - 300 * MS;
        let until = |rig: &Rig| rig.bridge.lease().expect("a lease");
        assert_eq!(until(&rig), (5, MonotonicNs(began + 500 * MS)));
        // A moment of the future is none.
        rig.apply(Input::LeaseRenewed(MonotonicNs(u64::MAX)));
        assert_eq!(until(&rig).1, MonotonicNs(rig.now.0 + 500 * MS));
        for _ in 0..10 {
            rig.run(400);
            let renewed = rig.now;
            rig.apply(Input::LeaseRenewed(renewed));
            assert_eq!(until(&rig).1, MonotonicNs(renewed.0 + 500 * MS));
            // An older one changes nothing.
            rig.apply(Input::LeaseRenewed(MonotonicNs(renewed.0 - 1)));
            assert_eq!(until(&rig).1, MonotonicNs(renewed.0 + 500 * MS));
        }
        assert_eq!(rig.functionality(), Functionality::FollowingPath);
        rig.run(480);
        assert_eq!(rig.last(path).0, Stage::Progress);
        rig.run(40);
        assert_eq!(rig.last(path), aborted(Reason::SenderLost));
        assert_eq!(
            (rig.functionality(), rig.bridge.lease()),
            (functionality, None)
        );
    }
    for lease_ms in [1, 499, 60_001, u32::MAX] {
        let mut rig = Rig::flying();
        let refused = rig.movement(order(None, lease_ms));
        assert_eq!(rig.last(refused).1, Reason::InvalidRequest, "{lease_ms}");
    }
}

#[test]
fn a_sender_that_is_lost_before_its_path_begins_begins_none() {
    for how in [0, 1] {
        let mut rig = Rig::flying();
        rig.sender = sender(PROCESS);
        rig.dsp.grants = false;
        let path = rig.movement(order(None, 0));
        assert_eq!(rig.last(path).0, Stage::Accepted);
        lose(&mut rig, path, how);
        assert_eq!(rig.last(path), aborted(Reason::SenderLost));
        rig.dsp.grants = true;
        rig.run(1000);
        assert!(rig.dsp.waypoints.is_empty());
    }
}

#[test]
fn the_end_of_a_sender_touches_no_order_of_another_and_none_that_has_ended() {
    // Another's path has replaced it.
    let (mut rig, first) = following("", order(None, 0));
    rig.sender = sender(99);
    let second = rig.preempting(6, north(800));
    rig.run(300);
    assert_eq!(rig.last(first), aborted(Reason::Replaced));
    for how in [0, 1] {
        lose(&mut rig, first, how);
        rig.run(300);
        assert_eq!(rig.functionality(), Functionality::FollowingPath);
    }
    assert_eq!(rig.last(second).0, Stage::Progress);
    // It was flown, and its sender ends as it should.
    rig.dsp.at(north(800));
    rig.run(3000);
    assert_eq!(rig.last(second).0, Stage::Done);
    rig.apply(Input::ProcessEnded(99));
    assert_eq!(rig.module(), ModuleStatus::Ended);
    // A landing goes on, and so does a take-off, which ends in a hover.
    let land = rig.land();
    rig.run(100);
    rig.apply(Input::ProcessEnded(99));
    rig.apply(Input::SenderGone(RequestKey::Movement(land)));
    assert_eq!(rig.functionality(), Functionality::Landing);
}

#[test]
fn a_process_that_is_not_seen_is_not_watched_and_its_client_s_end_is_noticed() {
    let (mut rig, path) = {
        let mut rig = Rig::flying();
        rig.sender = Sender {
            clock: SenderClock::Unknown,
            ..sender(PROCESS)
        };
        let path = rig.movement(order(None, 0));
        rig.run(300);
        (rig, path)
    };
    assert_eq!(rig.bridge.path_sender(), None);
    rig.apply(Input::ProcessEnded(PROCESS));
    assert_eq!(rig.last(path).0, Stage::Progress, "it is another's number");
    rig.apply(Input::SenderGone(RequestKey::Movement(path)));
    assert_eq!(rig.last(path), aborted(Reason::SenderLost));
}

#[test]
fn whatever_happens_to_senders_the_helicopter_hovers_in_time_and_no_other_order_is_touched() {
    let count = std::env::var("RIL_SENDERS").map_or(500, |count| count.parse().unwrap());
    let seen = chance::play(0, count);
    eprintln!("{seen:?}");
    assert!(seen.ended > count / 10 && seen.hung > count / 20 && seen.untouched > count / 20);
    assert!(seen.worst_ms <= 300, "{seen:?}");
}
