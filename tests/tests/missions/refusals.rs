//! Requests that must be refused, each at a moment when it makes sense to try.

use std::time::Duration;

use bridge::flight::assembly::MAX_WAYPOINTS;
use ipc_types::code::{
    ControlCommand, Functionality, ImiCode, ImiError, MovementKind, Reason, Stage,
};
use ipc_types::payload::{ModuleControl, MovementData, WaypointPosition};

use crate::config::WorldConfig;
use crate::operator::{Step, await_link, fly, point};
use crate::world::World;

/// When to try.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Moment {
    BeforeStart,
    OnGround,
    TakingOff,
    InFlight,
    ReceivingPath,
    FollowingPath,
    Landing,
    /// The port is closed.
    NoLink,
}

/// How often the state is published, so that each refusal is soon seen in it.
const STATE_PERIOD: Duration = Duration::from_millis(250);

/// A world at that moment.
fn world_at(moment: Moment) -> World {
    let mut config = WorldConfig::new();
    config.bridge.state.period_ms = STATE_PERIOD.as_millis() as u64;
    let mut world = World::new(&config);
    if moment == Moment::NoLink {
        // The port opens a little later.
        return world;
    }
    await_link(&mut world);
    if moment != Moment::BeforeStart {
        fly(&mut world, &[Step::Start]);
    }
    let has_taken_off = !matches!(
        moment,
        Moment::BeforeStart | Moment::OnGround | Moment::TakingOff
    );
    if has_taken_off {
        fly(&mut world, &[Step::TakeOff(10.0)]);
    }
    let path = [point(0.0, 30.0, 12.0), point(30.0, 30.0, 12.0)];
    let expected = match moment {
        Moment::TakingOff => {
            world.movement(MovementData::take_off(0, 10.0));
            Functionality::TakingOff
        }
        Moment::ReceivingPath => {
            world.waypoint(PATH, &path, 0);
            Functionality::ReceivingPath
        }
        Moment::FollowingPath => {
            world.waypoint(PATH, &path, 0);
            world.waypoint(PATH, &path, 1);
            Functionality::FollowingPath
        }
        Moment::Landing => {
            world.movement(MovementData::land(0));
            Functionality::Landing
        }
        _ => return world,
    };
    assert_eq!(world.witness.state.functionality(), Some(expected));
    world
}

/// Id of the path that is open or being flown.
const PATH: u64 = 77;

enum Try {
    Control(ModuleControl),
    Movement(MovementData),
}

fn control(command: ControlCommand) -> Try {
    Try::Control(ModuleControl::new(0, command))
}

fn take_off(height_m: f64) -> Try {
    Try::Movement(MovementData::take_off(0, height_m))
}

fn land() -> Try {
    Try::Movement(MovementData::land(0))
}

fn go_to(latitude_deg: f64, longitude_deg: f64, altitude_m: f64) -> Try {
    waypoint(5, (1, 1), [latitude_deg, longitude_deg, altitude_m])
}

fn waypoint(path_id: u64, (first, last): (u16, u16), position: [f64; 3]) -> Try {
    let [latitude_deg, longitude_deg, altitude_m] = position;
    let position = WaypointPosition {
        latitude_deg,
        longitude_deg,
        altitude_m,
    };
    Try::Movement(MovementData {
        first,
        last,
        ..MovementData::waypoint(0, path_id, position, false, false)
    })
}

/// A place 11 m north of the default home.
const NEAR: [f64; 3] = [37.4111, -6.001, 25.0];

/// The commands of a take-off after its first: the altitude is read back, the take-off is ordered, and its port is read, twice
/// in the time that is waited here.
const MOST_COMMANDS: usize = 4;

#[test]
fn every_refusal_has_its_reason_and_changes_nothing() {
    use ControlCommand::{Start, Stop};
    use Moment::{
        BeforeStart, FollowingPath, InFlight, Landing, NoLink, OnGround, ReceivingPath, TakingOff,
    };
    let [latitude, longitude, altitude] = NEAR;
    let unknown_kind = MovementData {
        kind: 99,
        ..MovementData::land(0)
    };
    let unknown_command = ModuleControl {
        command: 99,
        ..ModuleControl::new(0, Start)
    };
    let table = [
        (BeforeStart, take_off(10.0), Reason::NotStarted),
        (BeforeStart, land(), Reason::NotStarted),
        (BeforeStart, waypoint(5, (1, 1), NEAR), Reason::NotStarted),
        (
            BeforeStart,
            Try::Control(unknown_command),
            Reason::InvalidRequest,
        ),
        (NoLink, control(Start), Reason::LinkDown),
        (OnGround, control(Start), Reason::AlreadyRunning),
        (OnGround, land(), Reason::NotFlying),
        (OnGround, waypoint(5, (1, 1), NEAR), Reason::NotFlying),
        (OnGround, take_off(0.4), Reason::OutOfRange),
        (OnGround, take_off(200.5), Reason::OutOfRange),
        (OnGround, take_off(f64::NAN), Reason::NotFinite),
        (
            OnGround,
            Try::Movement(unknown_kind),
            Reason::InvalidRequest,
        ),
        (TakingOff, take_off(10.0), Reason::Busy),
        (TakingOff, land(), Reason::Busy),
        (TakingOff, waypoint(5, (1, 1), NEAR), Reason::Busy),
        (TakingOff, control(Stop), Reason::UnableToAbort),
        (TakingOff, control(Start), Reason::AlreadyRunning),
        (InFlight, take_off(10.0), Reason::AlreadyFlying),
        (
            InFlight,
            go_to(f64::INFINITY, longitude, altitude),
            Reason::NotFinite,
        ),
        (
            InFlight,
            go_to(latitude, f64::NAN, altitude),
            Reason::NotFinite,
        ),
        (
            InFlight,
            go_to(90.1, longitude, altitude),
            Reason::OutOfRange,
        ),
        (
            InFlight,
            go_to(latitude, -180.1, altitude),
            Reason::OutOfRange,
        ),
        (
            InFlight,
            go_to(latitude, longitude, 20_001.0),
            Reason::OutOfRange,
        ),
        (
            InFlight,
            go_to(latitude + 0.2, longitude, altitude),
            Reason::TooFar,
        ),
        (
            InFlight,
            go_to(-latitude, longitude + 180.0, altitude),
            Reason::TooFar,
        ),
        (InFlight, waypoint(5, (0, 0), NEAR), Reason::PathWithoutHead),
        (InFlight, waypoint(5, (0, 1), NEAR), Reason::PathWithoutHead),
        (InFlight, waypoint(5, (2, 1), NEAR), Reason::InvalidRequest),
        (
            ReceivingPath,
            waypoint(PATH + 1, (0, 0), NEAR),
            Reason::PathWithoutHead,
        ),
        (FollowingPath, waypoint(5, (1, 1), NEAR), Reason::Busy),
        (FollowingPath, land(), Reason::Busy),
        (FollowingPath, take_off(10.0), Reason::Busy),
        (FollowingPath, control(Start), Reason::AlreadyRunning),
        (Landing, land(), Reason::Busy),
        (Landing, waypoint(5, (1, 1), NEAR), Reason::Busy),
        (Landing, control(Stop), Reason::UnableToAbort),
    ];
    for (moment, request, reason) in table {
        let mut world = world_at(moment);
        let phases = world.witness.phases.clone();
        let (sent, refused) = (
            world.probe.commands.len(),
            world.witness.state.refused.requests,
        );
        let id = match request {
            Try::Control(control) => world.control_request(control),
            Try::Movement(movement) => world.movement(movement),
        };
        let outcome = world.witness.outcome(id).expect("a word at once");
        assert_eq!(
            (outcome.stage, outcome.reason),
            (Stage::Refused, reason),
            "{moment:?}"
        );
        let imi = match reason {
            Reason::AlreadyRunning => ImiError::ModuleRunningToRestartStopItBefore,
            Reason::UnableToAbort => ImiError::ImpossibleToStopModule,
            _ => ImiError::None,
        };
        assert_eq!(outcome.imi, ImiCode::from(imi), "{moment:?} {reason:?}");
        // The state says so at its next publication.
        world.run_for(STATE_PERIOD);
        if moment != NoLink {
            assert_eq!(world.witness.state.refused.requests, refused + 1);
            assert!(world.witness.phases.starts_with(&phases));
            assert!(
                world.probe.commands.len() - sent <= MOST_COMMANDS,
                "the rest of the movement under way"
            );
        }
        world.finish();
    }
}

#[test]
fn a_path_is_broken_by_what_does_not_belong_to_it() {
    let far = [NEAR[0] + 0.2, NEAR[1], NEAR[2]];
    // What comes into the open path 77, its own fate, and that of the path's first waypoint.
    let table = [
        (
            waypoint(PATH, (0, 0), far),
            Reason::TooFar,
            Reason::PathBroken,
        ),
        (
            waypoint(PATH, (0, 2), NEAR),
            Reason::InvalidRequest,
            Reason::PathBroken,
        ),
        (
            waypoint(PATH, (0, 0), [f64::NAN; 3]),
            Reason::NotFinite,
            Reason::PathBroken,
        ),
        (
            waypoint(PATH + 1, (1, 0), NEAR),
            Reason::None,
            Reason::PathReplaced,
        ),
        (land(), Reason::None, Reason::PathReplaced),
    ];
    for (request, own, others) in table {
        let mut world = world_at(Moment::ReceivingPath);
        let head = world.last_request();
        assert_eq!(world.witness.outcome(head), None);
        let Try::Movement(request) = request else {
            panic!("a movement");
        };
        let id = world.movement(request);
        match own {
            Reason::None => assert_eq!(world.witness.words(id)[0].stage(), Some(Stage::Accepted)),
            reason => {
                let outcome = world.witness.outcome(id).expect("a final report");
                assert_eq!((outcome.stage, outcome.reason), (Stage::Refused, reason));
            }
        }
        let outcome = world.witness.outcome(head).expect("a final report");
        assert_eq!((outcome.stage, outcome.reason), (Stage::Aborted, others));
        assert_eq!(world.probe.waypoints, 0, "something of the path was sent");
        world.finish();
    }
}

#[test]
fn a_waypoint_too_many_breaks_its_path() {
    let mut world = world_at(Moment::InFlight);
    let path: Vec<_> = (0..=MAX_WAYPOINTS as u32)
        .map(|index| point(f64::from(index), 5.0, 12.0))
        .collect();
    let ids: Vec<_> = (0..path.len())
        .map(|index| world.waypoint(PATH, &path, index))
        .collect();
    let outcomes: Vec<_> = ids
        .iter()
        .map(|id| world.witness.outcome(*id).expect("a final report"))
        .map(|outcome| (outcome.stage, outcome.reason))
        .collect();
    // Each is done when the next one has become part of the path; the newest answers for the path.
    let (one_too_many, others) = outcomes.split_last().expect("waypoints");
    let (newest, older) = others.split_last().expect("waypoints");
    assert!(older.iter().all(|o| *o == (Stage::Done, Reason::None)));
    assert_eq!(*newest, (Stage::Aborted, Reason::PathTooLong));
    assert_eq!(*one_too_many, (Stage::Refused, Reason::PathTooLong));
    world.run_for(Duration::from_secs(1));
    assert_eq!(world.probe.waypoints, 0, "something of the path was sent");
    assert_eq!(
        world.witness.state.movement.kind(),
        Some(MovementKind::TakeOff)
    );
    world.finish();
}
