//! What a robot's samples make of it.

use ipc_types::code::{
    Functionality, MovementKind, Reason, RelayLinkState, SafetyAction, SafetyRule, Stage,
};

use super::*;
use crate::robot::fixture::{at, fly, hero, on_path, state, translating, without_fix};

fn flown() -> WatchedRobot {
    let mut robot = WatchedRobot::new(RobotId::DEFAULT);
    fly(&mut robot);
    robot
}

fn journal(robot: &WatchedRobot) -> Vec<String> {
    let lines = robot.journal.newest(usize::MAX);
    lines.map(|line| line.text.clone()).collect()
}

fn alarms(robot: &WatchedRobot) -> Vec<(&'static str, u32)> {
    let alarms = robot.alarms.lasting();
    alarms
        .map(|alarm| {
            let number = alarm.finding.items.first();
            (alarm.finding.id, number.copied().unwrap_or_default())
        })
        .collect()
}

#[test]
fn a_flight_is_told_in_order() {
    let expected = [
        "at rest",
        "taking off",
        "in the air",
        "order: path of 3 waypoints",
        "flying the path",
        "waypoint 1 of 3 reached",
    ];
    let robot = flown();
    assert_eq!(journal(&robot), expected);
    assert!(alarms(&robot).is_empty());
    assert_eq!(robot.reached.len(), 1);
    assert_eq!(robot.height_m(), Some(10.0));
    assert!(robot.track.points().len() > 20);
}

#[test]
fn everybody_is_told_of_a_movement_that_nobody_ordered_to_end() {
    let mut robot = flown();
    let before = journal(&robot).len();
    for (ms, reason) in [(20_000, Reason::Replaced), (20_100, Reason::SenderLost)] {
        let mut ended = state(Functionality::FollowingPath, ms);
        ended.movement = on_path(1, ms).movement;
        ended.last_end.request_id = ended.movement.request_id;
        ended.last_end.ended_ns = at(ms).0;
        ended.last_end.kind = MovementKind::GoToWaypoint.code();
        ended.last_end.stage = Stage::Aborted.code();
        ended.last_end.reason = reason.code();
        robot.state(&ended, at(ms));
    }
    let text = "goto ended early: sender-lost";
    // A relay translates the moment anew with each sample.
    for ms in 20_200..20_300 {
        let mut again = *robot.state.as_ref().unwrap();
        again.last_end.ended_ns += 20_000;
        robot.state(&again, at(ms));
    }
    assert_eq!(journal(&robot)[before..], [text]);
    let mut state = *robot.state.as_ref().unwrap();
    let shown = |state: &ModuleState| pilot::movement(state).unwrap();
    state.functionality = Functionality::AtRest.code();
    assert_eq!(shown(&state), text);
    state.functionality = Functionality::FollowingPath.code();
    state.movement.request_id += 1;
    assert_eq!(shown(&state), "1 of 3 reached", "it is the next one");
    // Those of safety rules have no number.
    (state.movement.request_id, state.last_end.request_id) = (0, 0);
    assert_eq!(shown(&state), "1 of 3 reached", "it goes on");
    state.functionality = Functionality::AtRest.code();
    assert_eq!(shown(&state), text);
}

#[test]
fn without_a_fix_the_last_place_stays_with_its_age() {
    let mut robot = flown();
    let (last, home) = (robot.pilot.place.unwrap(), robot.home);
    assert_eq!(robot.lost_place(at(20_000)), None);
    // As status publishes it, and as the bridge does.
    let none = without_fix(21_000);
    let dsp = DspTelemetry {
        valid_groups: 0xffff,
        received_ns: at(21_250).0,
        ..DspTelemetry::default()
    };
    robot.hero(&none, at(21_000));
    robot.dsp(&dsp, at(21_250));
    let view = robot.pilot;
    assert_eq!(
        (view.place, view.altitude_m, view.ground_speed_mps),
        (None, None, None)
    );
    assert_eq!((view.climb_mps, view.course_deg), (None, None));
    assert_eq!(view.gps.map(|gps| gps.0), Some(0));
    assert_eq!(
        robot.lost_place(at(23_000)),
        Some((last, Duration::from_secs(3)))
    );
    assert_eq!((robot.home, robot.height_m()), (home, None));
    assert!(robot.track.points().last().unwrap().latitude_deg > 37.0);
}

#[test]
fn a_track_has_no_line_where_no_flight_was_seen() {
    let mut robot = WatchedRobot::new(RobotId::DEFAULT);
    for (east_m, ms) in [
        (0.0, 0),
        (2.0, 1_000),
        (4.0, 2_000),
        // After a pause.
        (40.0, 9_000),
        (42.0, 10_000),
        // Another fix.
        (900.0, 10_500),
        (902.0, 11_000),
    ] {
        robot.hero(&hero(east_m, 20.0, ms), at(ms));
    }
    let lengths: Vec<usize> = robot.track.pieces().map(<[Place]>::len).collect();
    assert_eq!(lengths, [3, 2, 2]);
}

#[test]
fn a_flight_lasts_since_the_take_off_that_was_seen() {
    let mut robot = WatchedRobot::new(RobotId::DEFAULT);
    for (altitude_m, ms, since_ms) in [
        // In the air when it is first seen.
        (25.0, 0, None),
        (15.0, 1_000, None),
        (16.0, 2_000, Some(2_000)),
        (25.0, 10_000, Some(2_000)),
        (15.0, 11_000, None),
        (16.0, 12_000, Some(12_000)),
        // It may have landed meanwhile.
        (25.0, 60_000, None),
    ] {
        robot.hero(&hero(0.0, altitude_m, ms), at(ms));
        assert_eq!(robot.airborne, since_ms.map(at), "{ms}");
    }
}

#[test]
fn a_bridge_that_is_killed_is_one_alarm_and_one_bell_and_comes_back() {
    let mut robot = flown();
    let lost = at(20_500);
    assert!(
        robot
            .looks_due(lost)
            .any(|process| process == Process::Bridge)
    );
    robot.provider(Process::Bridge, false, lost);
    for ms in (20_500..30_000).step_by(250) {
        robot.status(&translating(ms), at(ms));
        robot.judge(at(ms));
    }
    assert_eq!(alarms(&robot), [("bridge-gone", 0)]);
    assert_eq!(robot.take_bells(), 1);
    assert!(robot.process(Process::Bridge, at(30_000)).age().is_some());
    assert!(robot.telemetry_freshness(at(30_000)).age().is_some());

    let mut again = state(Functionality::AtRest, 30_000);
    again.epoch_ns = 8;
    robot.state(&again, at(30_000));
    robot.hero(&hero(0.0, 15.0, 30_000), at(30_000));
    robot.judge(at(30_000));
    assert!(alarms(&robot).is_empty());
    assert_eq!(robot.take_bells(), 0);
    assert!(journal(&robot).contains(&"the bridge was started again".to_owned()));
}

#[test]
fn telemetry_that_stops_is_stale_after_a_second_although_nothing_comes() {
    let mut robot = flown();
    for ms in [20_250, 20_500, 20_750, 21_000] {
        robot.state(&on_path(1, ms), at(ms));
        robot.status(&translating(ms), at(ms));
        robot.judge(at(ms));
    }
    assert!(alarms(&robot).is_empty());
    let next = robot.next(at(21_000)).unwrap();
    assert_eq!(next, at(21_001));
    robot.judge(next);
    assert_eq!(alarms(&robot), [("telemetry", 0)]);
}

#[test]
fn a_status_that_hangs_is_an_alarm_and_one_that_has_ended_a_warning() {
    let mut robot = flown();
    let dsp = |ms| DspTelemetry {
        received_ns: at(ms).0,
        ..DspTelemetry::default()
    };
    for ms in (20_250..=24_000).step_by(250) {
        robot.state(&on_path(1, ms), at(ms));
        robot.dsp(&dsp(ms), at(ms));
        for process in robot.looks_due(at(ms)) {
            robot.provider(process, process != Process::Relay, at(ms));
        }
        robot.judge(at(ms));
    }
    assert_eq!(alarms(&robot), [("status-silent", 0)]);
    assert!(robot.telemetry_freshness(at(24_000)).is_fresh());
    robot.provider(Process::Status, false, at(24_000));
    robot.judge(at(24_000));
    assert_eq!(alarms(&robot), [("status-gone", 0)]);
    robot.status(&translating(24_000), at(24_000));
    robot.judge(at(24_000));
    assert!(alarms(&robot).is_empty());
}

#[test]
fn a_safety_rule_is_told_once_with_what_the_bridge_does() {
    let mut robot = flown();
    let mut breach = on_path(1, 20_250);
    breach.safety.rule = SafetyRule::FenceCeiling.code();
    breach.safety.action = SafetyAction::Hold.code();
    for tenth in 0..10 {
        breach.safety.amount = 4.2 + f64::from(tenth) / 10.0;
        robot.state(&breach, at(20_250));
        robot.judge(at(20_250));
    }
    let lines = journal(&robot);
    let about: Vec<_> = lines
        .iter()
        .filter(|line| line.contains("fence-ceiling"))
        .collect();
    assert_eq!(
        about,
        [
            "above the ceiling of the fence by 4.2 m: the path is ended and the helicopter hovers (fence-ceiling)"
        ]
    );
    let shown = robot.alarms.lasting().next().unwrap();
    assert_eq!(
        shown.finding.text,
        "above the ceiling of the fence by 5.1 m: the path is ended and the helicopter hovers (fence-ceiling)"
    );
    assert_eq!(robot.take_bells(), 1);
}

#[test]
fn a_dsp_error_is_shown_for_a_while_and_stays_in_the_journal() {
    let mut robot = flown();
    let mut error = on_path(1, 20_250);
    error.dsp_errors.total = 1;
    error.dsp_errors.last_code = 30;
    robot.state(&error, at(20_250));
    robot.judge(at(20_250));
    assert_eq!(alarms(&robot), [("dsp-error", 30)]);
    assert_eq!(robot.take_bells(), 0, "it ended nothing");
    let mut ms = 20_250;
    while ms < 31_000 {
        ms += 250;
        error.published_ns = at(ms).0;
        robot.state(&error, at(ms));
        robot.hero(&hero(30.0, 25.0, ms), at(ms));
        robot.status(&translating(ms), at(ms));
        robot.judge(at(ms));
    }
    assert!(alarms(&robot).is_empty());
    assert!(
        journal(&robot)
            .iter()
            .any(|line| line.contains("invalid command"))
    );
}

#[test]
fn without_status_raw_telemetry_is_shown() {
    let mut robot = WatchedRobot::new(RobotId::DEFAULT);
    let mut dsp = DspTelemetry {
        received_ns: at(0).0,
        valid_groups: u16::MAX,
        ..DspTelemetry::default()
    };
    dsp.supply.battery_mv = 23_500;
    robot.dsp(&dsp, at(0));
    assert_eq!(robot.pilot.battery_v, Some(23.5));
    assert!(robot.telemetry_freshness(at(0)).is_fresh());
}

#[test]
fn a_relay_whose_link_is_down_is_the_cause_and_not_the_bridge() {
    let mut robot = flown();
    robot.is_relayed = true;
    let mut link = RelayLink {
        published_ns: at(25_000).0,
        state: RelayLinkState::Down.code(),
        ..RelayLink::default()
    };
    robot.relay(&link, at(25_000));
    robot.judge(at(25_000));
    assert_eq!(alarms(&robot)[0], ("relay-link", 0));
    assert!(!alarms(&robot).contains(&("bridge-silent", 0)));
    link.state = RelayLinkState::Up.code();
    robot.relay(&link, at(25_000));
    robot.state(&on_path(1, 25_000), at(25_000));
    robot.hero(&hero(30.0, 25.0, 25_000), at(25_000));
    robot.judge(at(25_000));
    assert!(!alarms(&robot).contains(&("relay-link", 0)));
}

#[test]
fn a_lost_fix_in_flight_is_an_alarm() {
    let mut robot = flown();
    let mut lost = hero(30.0, 25.0, 20_250);
    lost.gps_quality = 0;
    robot.hero(&lost, at(20_250));
    robot.judge(at(20_250));
    assert_eq!(alarms(&robot), [("no-fix", 0)]);
}
