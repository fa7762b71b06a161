//! The core's side of the operator: control, movements, and the one final report of every request.

mod desk;

use bridge::{BridgeConfig, Input, RequestKey};
use desk::{Desk, STOP, aborted, go_to, north, refused};
use dsp_protocol::{Command, port};
use ipc_types::code::{
    ControlCommand, Functionality, ImiError, ModuleStatus, MovementKind, Reason, Stage,
};
use ipc_types::payload::MovementData;

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

#[test]
fn a_whole_mission() {
    let mut desk = Desk::started();
    desk.dsp.grants = false;
    let take_off = desk.take_off();
    assert!(desk.dsp.commands.ends_with(&[
        TAKE_OFF[0],
        TAKE_OFF[1],
        TAKE_OFF[2],
        Command::Read16 {
            port: port::TAKE_OFF
        }
    ]));
    assert_eq!(desk.functionality(), Functionality::TakingOff);
    desk.dsp.grants = false;
    desk.dsp.status.flying = true;
    desk.run(100);
    assert_eq!(desk.functionality(), Functionality::TakingOff, "10 m to go");
    desk.dsp.at(north(0));
    desk.run(400);
    assert_eq!(
        desk.functionality(),
        Functionality::TakingOff,
        "the DSP takes no waypoints yet"
    );
    desk.dsp.grants = true;
    desk.run(100);
    assert_eq!(
        desk.stages(take_off),
        [Stage::Accepted, Stage::Progress, Stage::Done]
    );
    assert_eq!(
        desk.last_report(take_off).value(),
        Some(10.0),
        "the height that was reached"
    );
    assert_eq!(desk.module(), ModuleStatus::Ended);

    let path = desk.path(7, &[north(3), north(6), north(9)]);
    for point in [3, 6, 9] {
        desk.run(400);
        desk.dsp.at(north(point));
    }
    desk.run(40);
    assert_eq!(desk.dsp.waypoints.len(), 3);
    assert_eq!(desk.stages(path[0]), [Stage::Accepted, Stage::Done]);
    let last = desk.last_report(path[2]);
    assert_eq!(Stage::from_code(last.stage), Some(Stage::Done));
    let counts = (
        last.waypoints_total,
        last.waypoints_sent,
        last.waypoints_reached,
    );
    assert_eq!((last.path_id, counts), (7, (3, 3, 3)));

    let land = desk.land();
    assert!(desk.dsp.commands.contains(&LAND));
    desk.run(500);
    assert_eq!(desk.functionality(), Functionality::Landing);
    desk.dsp.status.flying = false;
    desk.run(300);
    assert_eq!(desk.last(land).0, Stage::Done);

    let stop = desk.control(ControlCommand::Stop);
    assert_eq!(desk.stages(stop), [Stage::Accepted, Stage::Done]);
    assert!(desk.dsp.commands.ends_with(&STOP));
    assert_eq!(desk.module(), ModuleStatus::Ended);
    assert_eq!(desk.bridge.state().blocked, 1);
}

#[test]
fn what_is_refused_when() {
    type Ask = fn(&mut Desk) -> u64;
    type Case = (&'static str, fn() -> Desk, Ask, Reason);
    let (take_off, land): (Ask, Ask) = (|desk| desk.take_off(), |desk| desk.land());
    let go: Ask = |desk| desk.waypoint(1, 1, 1, north(5));
    let start: Ask = |desk| desk.control(ControlCommand::Start);
    let closed: fn() -> Desk = || Desk::closed(&BridgeConfig::default());
    let not_started: fn() -> Desk = || Desk::up(&BridgeConfig::default());
    let blind: fn() -> Desk = || {
        let mut desk = Desk::started();
        desk.dsp.status.geographic = None;
        desk.dsp.status.flying = true;
        desk.run(1200);
        desk
    };
    let without_fix: fn() -> Desk = || {
        let mut desk = Desk::started();
        desk.dsp.status.gps_quality = Some(0);
        desk.run(1200);
        desk
    };
    let gone: fn() -> Desk = || {
        let mut desk = Desk::flying();
        desk.apply(Input::PortClosed);
        desk
    };
    let gone_on_ground: fn() -> Desk = || {
        let mut desk = Desk::started();
        desk.apply(Input::PortClosed);
        desk
    };
    let taking_off: fn() -> Desk = || {
        let mut desk = Desk::started();
        desk.take_off();
        desk
    };
    let following: fn() -> Desk = || {
        let mut desk = Desk::flying();
        desk.waypoint(9, 1, 1, north(90));
        desk
    };
    let table: [Case; 17] = [
        ("start without a DSP", closed, start, Reason::LinkDown),
        (
            "take-off before start",
            not_started,
            take_off,
            Reason::NotStarted,
        ),
        ("go-to before start", not_started, go, Reason::NotStarted),
        ("land before start", not_started, land, Reason::NotStarted),
        ("land on the ground", Desk::started, land, Reason::NotFlying),
        ("go-to on the ground", Desk::started, go, Reason::NotFlying),
        (
            "take-off in the air",
            Desk::flying,
            take_off,
            Reason::AlreadyFlying,
        ),
        ("go-to without a position", blind, go, Reason::NoPosition),
        (
            "take-off without a GPS fix",
            without_fix,
            take_off,
            Reason::NoPosition,
        ),
        (
            "land on the ground without a port",
            gone_on_ground,
            land,
            Reason::LinkDown,
        ),
        ("go-to without a port", gone, go, Reason::LinkDown),
        ("take-off twice", taking_off, take_off, Reason::Busy),
        ("go-to during take-off", taking_off, go, Reason::Busy),
        ("go-to on the way", following, go, Reason::Busy),
        ("land on the way", following, land, Reason::Busy),
        (
            "a far-away waypoint",
            Desk::flying,
            |desk| desk.waypoint(1, 1, 1, north(10_000)),
            Reason::TooFar,
        ),
        (
            "a waypoint that is none",
            Desk::flying,
            |desk| {
                desk.movement(MovementData {
                    latitude_deg: f64::NAN,
                    ..go_to(north(1))
                })
            },
            Reason::NotFinite,
        ),
    ];
    for (what, situation, ask, reason) in table {
        let mut desk = situation();
        let before = desk.dsp.commands.len();
        let request = ask(&mut desk);
        assert_eq!(desk.last(request), refused(reason), "{what}");
        assert_eq!(desk.stages(request).len(), 1, "{what}");
        assert_eq!(
            desk.dsp.commands.len(),
            before,
            "{what}: nothing goes to the DSP"
        );
    }
}

#[test]
fn control_errors_have_their_names() {
    let mut desk = Desk::started();
    let again = desk.control(ControlCommand::Start);
    let running = ImiError::ModuleRunningToRestartStopItBefore;
    assert_eq!(
        desk.last(again),
        (Stage::Refused, Reason::AlreadyRunning, running)
    );
    assert_eq!(desk.imi_error(), running);
    let take_off = desk.take_off();
    let stop = desk.control(ControlCommand::Stop);
    let impossible = ImiError::ImpossibleToStopModule;
    assert_eq!(
        desk.last(stop),
        (Stage::Refused, Reason::UnableToAbort, impossible)
    );
    assert_eq!(desk.imi_error(), impossible);
    assert!(!desk.last(take_off).0.is_final(), "the take-off goes on");
}

#[test]
fn a_command_that_nobody_acknowledges_ends_the_functionality() {
    let mut desk = Desk::started();
    desk.dsp.acknowledges = false;
    desk.dsp.commands.clear();
    let take_off = desk.take_off();
    desk.run(1000);
    assert_eq!(
        desk.dsp.commands[..3],
        [TAKE_OFF[0]; 3],
        "three attempts in all"
    );
    let fatal = ImiError::CommunicationFatalError;
    assert_eq!(
        desk.last(take_off),
        (Stage::Aborted, Reason::CommunicationFatalError, fatal),
        "the order itself was never given"
    );
    assert_eq!(
        (desk.module(), desk.imi_error()),
        (ModuleStatus::Aborted, fatal)
    );
    assert!(
        !desk.dsp.commands.contains(&TAKE_OFF[2]),
        "no dangerous command arrives late"
    );
}

#[test]
fn a_stop_that_nobody_acknowledges_is_unknown() {
    let mut desk = Desk::flying();
    desk.path(1, &[north(3)]);
    desk.dsp.acknowledges = false;
    let stop = desk.control(ControlCommand::Stop);
    assert_eq!(desk.functionality(), Functionality::Stopping);
    let another = desk.control(ControlCommand::Stop);
    assert_eq!(desk.last(another), refused(Reason::Busy));
    desk.run(1000);
    let fatal = ImiError::CommunicationFatalError;
    assert_eq!(
        desk.last(stop),
        (Stage::Unknown, Reason::CommunicationFatalError, fatal)
    );
    assert_eq!(desk.functionality(), Functionality::AtRest);
}

#[test]
fn a_movement_that_does_not_begin_or_end_in_time_is_given_up() {
    let mut desk = Desk::flying();
    desk.dsp.grants = false;
    let path = desk.path(1, &[north(3)]);
    desk.run(5100);
    assert_eq!(desk.last(path[0]), aborted(Reason::TooLate));
    assert_eq!(
        (desk.module(), desk.imi_error()),
        (ModuleStatus::Running, ImiError::None),
        "nothing has happened, so the next movement may come"
    );

    let mut desk = Desk::flying();
    let path = desk.path(1, &[north(3)]);
    let timeout = ImiError::MovementTimeout;
    desk.run(600_000);
    assert_eq!(desk.last(path[0]).0, Stage::Progress);
    // 14 m at the slowest speed come on top.
    desk.run(20_000);
    assert_eq!(
        desk.last(path[0]),
        (Stage::Aborted, Reason::MovementTimeout, timeout)
    );
    assert!(desk.dsp.commands.ends_with(&STOP));
}

#[test]
fn an_aborted_module_flies_again_after_a_start() {
    let mut desk = Desk::flying();
    desk.path(1, &[north(3)]);
    desk.control(ControlCommand::Stop);
    assert_eq!(desk.module(), ModuleStatus::Aborted);
    let path = desk.path(2, &[north(3)]);
    assert_eq!(desk.last(path[0]), refused(Reason::NotStarted));
    let start = desk.control(ControlCommand::Start);
    assert_eq!(desk.last(start).0, Stage::Done);
    let path = desk.path(3, &[north(3)]);
    desk.run(200);
    desk.dsp.at(north(3));
    desk.run(40);
    assert_eq!(desk.last(path[0]).0, Stage::Done);
}

#[test]
fn a_mask_without_position_flies_no_path_but_lands() {
    let mut config = BridgeConfig::default();
    config.status.groups = vec![dsp_protocol::Group::Time];
    let mut desk = Desk::up(&config);
    desk.control(ControlCommand::Start);
    desk.dsp.status.geographic = None;
    desk.dsp.status.flying = true;
    desk.run(1100);
    let path = desk.path(1, &[north(3)]);
    assert_eq!(desk.last(path[0]), refused(Reason::NoPosition));
    let land = desk.land();
    desk.dsp.status.flying = false;
    desk.run(100);
    assert_eq!(desk.last(land).0, Stage::Done);
}

#[test]
fn ending_answers_everybody() {
    let mut desk = Desk::flying();
    let open = desk.waypoint(1, 1, 0, north(3));
    desk.apply(Input::Close);
    assert_eq!(desk.last(open), aborted(Reason::BridgeEnding));
    let mut desk = Desk::flying();
    let path = desk.path(1, &[north(3)]);
    desk.run(200);
    desk.apply(Input::Close);
    assert_eq!(
        desk.last(path[0]),
        (Stage::Unknown, Reason::BridgeEnding, ImiError::None)
    );
}

#[test]
fn asking_again_never_executes_twice() {
    let mut desk = Desk::started();
    let take_off = desk.take_off();
    let again = |desk: &mut Desk, repeat| {
        let data = MovementData {
            request_id: take_off,
            issued_ns: desk.now.0,
            kind: MovementKind::TakeOff.code(),
            altitude_m: 10.0,
            repeat,
            ..MovementData::default()
        };
        let key = RequestKey::Movement(take_off);
        desk.apply(Input::Movement {
            key,
            sender: None,
            request: data,
        });
        desk.exchange();
        desk.last(take_off)
    };
    assert_eq!(
        again(&mut desk, 0),
        refused(Reason::StillOpen),
        "while it is open"
    );
    desk.lift_off();
    desk.run(100);
    assert_eq!(desk.last(take_off).0, Stage::Done);
    let commands = desk.dsp.commands.len();
    assert_eq!(
        again(&mut desk, 1).0,
        Stage::Done,
        "the same final report once more"
    );
    assert_eq!(desk.dsp.commands.len(), commands);

    let mut successor = Desk::started();
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
    let mut desk = Desk::flying();
    desk.dsp.obeys = false;
    let land = desk.land();
    desk.run(1100);
    assert_eq!(desk.last(land), aborted(Reason::RefusedByDsp));
    assert_eq!(desk.functionality(), Functionality::AtRest);
    desk.dsp.obeys = true;
    let land = desk.land();
    desk.dsp.status.flying = false;
    desk.run(40);
    assert_eq!(desk.last(land).0, Stage::Done);
}
