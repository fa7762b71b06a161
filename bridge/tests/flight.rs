//! The core's side of the operator: control, movements, and the one final report of every request.

use crate::rig::{Rig, STOP, aborted, go_to, north, refused};
use bridge::{BridgeConfig, Input};
use dsp_protocol::{Command, Waypoint, port};
use ipc_types::code::{
    ControlCommand, Functionality, ImiError, ModuleId, ModuleStatus, MovementKind, Reason, Stage,
};
use ipc_types::payload::{MovementData, ParameterRequest};

const TAKE_OFF: [Command; 3] = [
    Command::Write32 {
        port: port::TAKE_OFF_ALTITUDE_M,
        value: 10.0,
    },
    // Read back: the DSP may have rebooted since.
    Command::Read32 {
        port: port::TAKE_OFF_ALTITUDE_M,
    },
    Command::Write16 {
        port: port::TAKE_OFF,
        value: 1,
    },
];
const LAND: Command = Command::Write16 {
    port: port::LAND,
    value: 1,
};

fn place(latitude_deg: f64, longitude_deg: f64) -> Waypoint {
    Waypoint {
        latitude_deg,
        longitude_deg,
        ..north(0)
    }
}

#[test]
fn a_whole_mission() {
    let mut rig = Rig::started();
    rig.dsp.grants = false;
    let take_off = rig.take_off();
    assert!(rig.dsp.commands.ends_with(&[
        TAKE_OFF[0],
        TAKE_OFF[1],
        TAKE_OFF[2],
        Command::Read16 {
            port: port::TAKE_OFF
        }
    ]));
    assert_eq!(rig.functionality(), Functionality::TakingOff);
    rig.dsp.grants = false;
    rig.dsp.status.flying = true;
    rig.run(100);
    assert_eq!(rig.functionality(), Functionality::TakingOff, "10 m to go");
    rig.dsp.at(north(0));
    rig.run(400);
    assert_eq!(
        rig.functionality(),
        Functionality::TakingOff,
        "the DSP takes no waypoints yet"
    );
    let is_look = |command: &&Command| {
        **command
            == Command::Read16 {
                port: port::TAKE_OFF,
            }
    };
    let looks = rig.dsp.commands.iter().filter(is_look).count();
    assert_eq!(looks, 1, "the port is looked at each second");
    rig.dsp.grants = true;
    rig.run(100);
    assert_eq!(
        rig.stages(take_off),
        [Stage::Accepted, Stage::Progress, Stage::Done]
    );
    assert_eq!(
        rig.last_report(take_off).value(),
        Some(10.0),
        "the height that was reached"
    );
    assert_eq!(rig.module(), ModuleStatus::Ended);

    let path = rig.path(7, &[north(3), north(6), north(9)]);
    for point in [3, 6, 9] {
        rig.run(400);
        rig.dsp.at(north(point));
    }
    rig.run(40);
    assert_eq!(rig.dsp.waypoints.len(), 3);
    assert_eq!(rig.stages(path[0]), [Stage::Accepted, Stage::Done]);
    let last = rig.last_report(path[2]);
    assert_eq!(Stage::from_code(last.stage), Some(Stage::Done));
    let counts = (
        last.waypoints_total,
        last.waypoints_sent,
        last.waypoints_reached,
    );
    assert_eq!((last.path_id, counts), (7, (3, 3, 3)));

    let land = rig.land();
    assert!(rig.dsp.commands.contains(&LAND));
    rig.run(500);
    assert_eq!(rig.functionality(), Functionality::Landing);
    rig.dsp.status.flying = false;
    rig.run(300);
    assert_eq!(rig.last(land).0, Stage::Done);

    let stop = rig.control(ControlCommand::Stop);
    assert_eq!(rig.stages(stop), [Stage::Accepted, Stage::Done]);
    assert!(rig.dsp.commands.ends_with(&STOP));
    assert_eq!(rig.module(), ModuleStatus::Ended);
    assert_eq!(rig.bridge.state().blocked, 1);
}

#[test]
fn what_is_refused_when() {
    type Ask = fn(&mut Rig) -> u64;
    type Case = (&'static str, fn() -> Rig, Ask, Reason);
    let (take_off, land): (Ask, Ask) = (|rig| rig.take_off(), |rig| rig.land());
    let go: Ask = |rig| rig.waypoint(1, 1, 1, north(5));
    let start: Ask = |rig| rig.control(ControlCommand::Start);
    let closed: fn() -> Rig = || Rig::closed(&BridgeConfig::default());
    let not_started: fn() -> Rig = || Rig::up(&BridgeConfig::default());
    let blind: fn() -> Rig = || {
        let mut rig = Rig::started();
        rig.dsp.status.geographic = None;
        rig.dsp.status.flying = true;
        rig.run(1200);
        rig
    };
    let without_fix: fn() -> Rig = || {
        let mut rig = Rig::started();
        rig.dsp.status.gps_quality = Some(0);
        rig.run(1200);
        rig
    };
    let gone: fn() -> Rig = || {
        let mut rig = Rig::flying();
        rig.apply(Input::PortClosed);
        rig
    };
    let gone_on_ground: fn() -> Rig = || {
        let mut rig = Rig::started();
        rig.apply(Input::PortClosed);
        rig
    };
    let taking_off: fn() -> Rig = || {
        let mut rig = Rig::started();
        rig.take_off();
        rig
    };
    let following: fn() -> Rig = || {
        let mut rig = Rig::flying();
        rig.waypoint(9, 1, 1, north(90));
        rig
    };
    #[rustfmt::skip]
    let table: [Case; 20] = [
        ("start without a DSP", closed, start, Reason::LinkDown),
        ("take-off before start", not_started, take_off, Reason::NotStarted),
        ("go-to before start", not_started, go, Reason::NotStarted),
        ("land before start", not_started, land, Reason::NotStarted),
        ("land on the ground", Rig::started, land, Reason::NotFlying),
        ("go-to on the ground", Rig::started, go, Reason::NotFlying),
        ("take-off in the air", Rig::flying, take_off, Reason::AlreadyFlying),
        ("go-to without a position", blind, go, Reason::NoPosition),
        ("take-off without a GPS fix", without_fix, take_off, Reason::NoPosition),
        ("land on the ground without a port", gone_on_ground, land, Reason::LinkDown),
        ("go-to without a port", gone, go, Reason::LinkDown),
        ("take-off twice", taking_off, take_off, Reason::Busy),
        ("go-to during take-off", taking_off, go, Reason::Busy),
        ("go-to on the way", following, go, Reason::Busy),
        ("land on the way", following, land, Reason::Busy),
        ("a far-away waypoint", Rig::flying, |rig| rig.waypoint(1, 1, 1, north(10_000)), Reason::TooFar),
        ("the farthest waypoint", Rig::flying, |rig| rig.waypoint(1, 1, 1, place(90.0, 180.0)), Reason::TooFar),
        ("a waypoint beyond the pole", Rig::flying, |rig| rig.waypoint(1, 1, 1, place(90.1, 180.0)), Reason::OutOfRange),
        ("a waypoint beyond the antimeridian", Rig::flying, |rig| rig.waypoint(1, 1, 1, place(0.0, -180.1)), Reason::OutOfRange),
        (
            "a waypoint that is none",
            Rig::flying,
            |rig| {
                rig.movement(MovementData {
                    latitude_deg: f64::NAN,
                    ..go_to(north(1))
                })
            },
            Reason::NotFinite,
        ),
    ];
    for (what, situation, ask, reason) in table {
        let mut rig = situation();
        let before = rig.dsp.commands.len();
        let request = ask(&mut rig);
        assert_eq!(rig.last(request), refused(reason), "{what}");
        assert_eq!(rig.stages(request).len(), 1, "{what}");
        assert_eq!(
            rig.dsp.commands.len(),
            before,
            "{what}: nothing goes to the DSP"
        );
    }
}

#[test]
fn a_waypoint_that_is_too_far_is_named_with_its_distance() {
    // Path, whether it is its first waypoint, and which of it that is.
    for (path, first, waypoint) in [(1, 1, 1), (2, 1, 1), (1, 0, 2)] {
        let mut rig = Rig::flying();
        rig.waypoint(1, 1, 0, north(10));
        let request = rig.waypoint(path, first, 1, north(10_000));
        let report = *rig.last_report(request);
        assert_eq!(report.reason(), Some(Reason::TooFar));
        assert_eq!(report.waypoint, waypoint, "{path} {first}");
        if waypoint == 1 {
            continue;
        }
        let distance_m = report.value().expect("a distance");
        assert!((distance_m - 11_119.5).abs() < 5.0, "{distance_m}");
        assert_eq!((report.port.max, report.port.kind), (10_000.0, 0));
    }
}

/// A path that has the number of one before.
#[test]
fn the_counts_of_a_report_are_those_of_its_own_movement() {
    let mut rig = Rig::flying();
    let path = rig.path(1, &[north(3), north(90)]);
    rig.run(500);
    // One report for each waypoint that was sent, or reached.
    for (point, counts) in [(north(0), (2, 2, 0)), (north(3), (3, 2, 1))] {
        rig.dsp.at(point);
        rig.run(1000);
        let report = rig.last_report(path[1]);
        let (sent, reached) = (report.waypoints_sent, report.waypoints_reached);
        let stages = rig.stages(path[1]);
        let progress = stages.iter().filter(|it| **it == Stage::Progress);
        assert_eq!((progress.count(), sent, reached), counts);
    }
    rig.dsp.at(north(90));
    rig.run(2000);
    assert_eq!(rig.last(path[1]).0, Stage::Done);
    let next = rig.waypoint(1, 1, 0, north(6));
    assert_eq!(rig.last(next).0, Stage::Accepted);
    let report = rig.last_report(next);
    let counts = (report.waypoints_total, report.waypoints_sent);
    assert_eq!((counts, report.waypoints_reached), ((1, 0), 0));
}

#[test]
fn control_errors_have_their_names() {
    let mut rig = Rig::started();
    let again = rig.control(ControlCommand::Start);
    let running = ImiError::ModuleRunningToRestartStopItBefore;
    assert_eq!(
        rig.last(again),
        (Stage::Refused, Reason::AlreadyRunning, running)
    );
    assert_eq!(rig.imi_error(), running);
    let take_off = rig.take_off();
    let stop = rig.control(ControlCommand::Stop);
    let impossible = ImiError::ImpossibleToStopModule;
    assert_eq!(
        rig.last(stop),
        (Stage::Refused, Reason::UnableToAbort, impossible)
    );
    assert_eq!(rig.imi_error(), impossible);
    assert!(!rig.last(take_off).0.is_final(), "the take-off goes on");
}

#[test]
fn a_command_that_nobody_acknowledges_ends_the_functionality() {
    let mut rig = Rig::started();
    rig.dsp.acknowledges = false;
    rig.dsp.commands.clear();
    let take_off = rig.take_off();
    rig.run(1000);
    assert_eq!(
        rig.dsp.commands[..3],
        [TAKE_OFF[0]; 3],
        "three attempts in all"
    );
    let fatal = ImiError::CommunicationFatalError;
    assert_eq!(
        rig.last(take_off),
        (Stage::Aborted, Reason::CommunicationFatalError, fatal),
        "the order itself was never given"
    );
    assert_eq!(
        (rig.module(), rig.imi_error()),
        (ModuleStatus::Aborted, fatal)
    );
    assert_eq!(rig.bridge.state().module_id, ModuleId::HeroBridge.code());
    assert!(
        !rig.dsp.commands.contains(&TAKE_OFF[2]),
        "no dangerous command arrives late"
    );
    // Nor one that the kernel still has.
    assert!(rig.bridge.take_discard_unsent() && !rig.bridge.take_discard_unsent());
}

#[test]
fn a_stop_that_nobody_acknowledges_is_unknown() {
    let mut rig = Rig::flying();
    rig.path(1, &[north(3)]);
    rig.dsp.acknowledges = false;
    let stop = rig.control(ControlCommand::Stop);
    assert_eq!(rig.functionality(), Functionality::Stopping);
    let another = rig.control(ControlCommand::Stop);
    assert_eq!(rig.last(another), refused(Reason::Busy));
    rig.run(1000);
    let fatal = ImiError::CommunicationFatalError;
    assert_eq!(
        rig.last(stop),
        (Stage::Unknown, Reason::CommunicationFatalError, fatal)
    );
    assert_eq!(rig.functionality(), Functionality::AtRest);
}

#[test]
fn a_movement_that_does_not_begin_or_end_in_time_is_given_up() {
    let mut rig = Rig::flying();
    rig.dsp.grants = false;
    let path = rig.path(1, &[north(3)]);
    rig.run(5100);
    assert_eq!(rig.last(path[0]), aborted(Reason::TooLate));
    assert_eq!(
        (rig.module(), rig.imi_error()),
        (ModuleStatus::Running, ImiError::None),
        "nothing has happened, so the next movement may come"
    );

    let mut rig = Rig::flying();
    let path = rig.path(1, &[north(3)]);
    let timeout = ImiError::MovementTimeout;
    rig.run(600_000);
    assert_eq!(rig.last(path[0]).0, Stage::Progress);
    // 14 m at the slowest speed come on top.
    rig.run(20_000);
    assert_eq!(
        rig.last(path[0]),
        (Stage::Aborted, Reason::MovementTimeout, timeout)
    );
    assert!(rig.dsp.commands.ends_with(&STOP));
}

#[test]
fn a_path_may_take_longer_the_longer_it_is() {
    let mut config = BridgeConfig::default();
    config.movement.time_limit_s = 10.0;
    // There, and there and back and there again, m.
    for (points, length_m) in [
        (vec![north(30)], 33.4),
        (vec![north(30), north(0), north(30)], 100.1),
    ] {
        let mut rig = Rig::up(&config);
        rig.control(ControlCommand::Start);
        rig.lift_off();
        let path = rig.path(1, &points);
        let last = path[points.len() - 1];
        let limit_s = 10.0 + length_m / config.movement.min_speed_mps;
        rig.run((limit_s * 1e3) as u32 - 500);
        assert_eq!(rig.last(last).0, Stage::Progress, "{length_m} m");
        rig.run(1_500);
        assert_eq!(rig.last(last).1, Reason::MovementTimeout, "{length_m} m");
    }
}

#[test]
fn where_the_helicopter_stands_is_published_as_soon_as_it_is_known() {
    let mut rig = Rig::closed(&BridgeConfig::default());
    let place = rig.dsp.status.geographic.take();
    rig.open();
    // Just after a state, so that the next one that is due anyway is far.
    let states = rig.out.states.len();
    while rig.out.states.len() == states {
        rig.run(10);
    }
    assert_eq!(rig.bridge.state().ground_valid, 0);
    rig.dsp.status.geographic = place;
    rig.run(20);
    assert_eq!(rig.bridge.state().ground_valid, 1);
}

#[test]
fn refusals_and_the_distance_to_go_are_published() {
    let mut rig = Rig::flying();
    for expected in 0..3 {
        rig.run(1_100);
        assert_eq!(rig.bridge.state().refused.requests, expected);
        rig.parameter(ParameterRequest::read(0, 9));
    }
    let movement = |rig: &Rig| rig.bridge.state().movement;
    assert_eq!(movement(&rig).distance_valid, 0);
    rig.path(1, &[north(30)]);
    rig.run(1_100);
    assert_eq!(movement(&rig).distance_valid, 1);
    let to_go_m = movement(&rig).distance_to_go_m;
    assert!((to_go_m - 33.4).abs() < 0.1, "{to_go_m}");
    rig.hold();
    rig.run(1_100);
    assert_eq!(movement(&rig).distance_valid, 0);
}

#[test]
fn an_aborted_module_flies_again_after_a_start() {
    let mut rig = Rig::flying();
    rig.path(1, &[north(3)]);
    rig.control(ControlCommand::Stop);
    assert_eq!(rig.module(), ModuleStatus::Aborted);
    let path = rig.path(2, &[north(3)]);
    assert_eq!(rig.last(path[0]), refused(Reason::NotStarted));
    let start = rig.control(ControlCommand::Start);
    assert_eq!(rig.last(start).0, Stage::Done);
    let path = rig.path(3, &[north(3)]);
    rig.run(200);
    rig.dsp.at(north(3));
    rig.run(40);
    assert_eq!(rig.last(path[0]).0, Stage::Done);
}

#[test]
fn a_mask_without_position_flies_no_path_but_lands() {
    let mut config = BridgeConfig::default();
    config.status.groups = vec![dsp_protocol::Group::Time];
    let mut rig = Rig::up(&config);
    rig.control(ControlCommand::Start);
    rig.dsp.status.geographic = None;
    rig.dsp.status.flying = true;
    rig.run(1100);
    let path = rig.path(1, &[north(3)]);
    assert_eq!(rig.last(path[0]), refused(Reason::NoPosition));
    let land = rig.land();
    rig.dsp.status.flying = false;
    rig.run(100);
    assert_eq!(rig.last(land).0, Stage::Done);
}

#[test]
fn ending_answers_everybody() {
    let mut rig = Rig::flying();
    let open = rig.waypoint(1, 1, 0, north(3));
    rig.apply(Input::Close);
    assert_eq!(rig.last(open), aborted(Reason::BridgeEnding));
    let mut rig = Rig::flying();
    let path = rig.path(1, &[north(3)]);
    rig.run(200);
    rig.apply(Input::Close);
    assert_eq!(
        rig.last(path[0]),
        (Stage::Unknown, Reason::BridgeEnding, ImiError::None)
    );
}

#[test]
fn asking_again_never_executes_twice() {
    let mut rig = Rig::started();
    let take_off = rig.take_off();
    let again = |rig: &mut Rig, repeat| {
        let data = MovementData {
            request_id: take_off,
            issued_ns: rig.now.0,
            kind: MovementKind::TakeOff.code(),
            altitude_m: 10.0,
            repeat,
            ..MovementData::default()
        };
        rig.ask_movement(data);
        rig.exchange();
        rig.last(take_off)
    };
    assert_eq!(
        again(&mut rig, 0),
        refused(Reason::StillOpen),
        "while it is open"
    );
    rig.lift_off();
    rig.run(100);
    assert_eq!(rig.last(take_off).0, Stage::Done);
    let commands = rig.dsp.commands.len();
    assert_eq!(
        again(&mut rig, 1).0,
        Stage::Done,
        "the same final report once more"
    );
    assert_eq!(rig.dsp.commands.len(), commands);

    let mut successor = Rig::started();
    let unknown = (Stage::Unknown, Reason::NotRemembered, ImiError::None);
    assert_eq!(
        again(&mut successor, 1),
        unknown,
        "another bridge may have flown it"
    );
    assert!(!successor.dsp.commands.contains(&TAKE_OFF[2]));
}

#[test]
fn an_order_that_the_dsp_does_not_carry_out_ends_within_a_second() {
    let mut rig = Rig::flying();
    rig.dsp.obeys = false;
    let land = rig.land();
    rig.run(1100);
    assert_eq!(rig.last(land), aborted(Reason::RefusedByDsp));
    assert_eq!(rig.functionality(), Functionality::AtRest);
    rig.dsp.obeys = true;
    let land = rig.land();
    rig.dsp.status.flying = false;
    rig.run(40);
    assert_eq!(rig.last(land).0, Stage::Done);
}
