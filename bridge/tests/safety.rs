//! Rules of flight safety about places: a position that is lost, and a fence that is ahead.

use bridge::BridgeConfig;
use dsp_protocol::downlink::GpsVelocity;
use dsp_protocol::{Command, StatusMask, Waypoint, port};
use ipc_types::code::{
    ControlCommand, Functionality, LinkState, ModuleStatus, Reason, SafetyAction, SafetyRule, Stage,
};
use ipc_types::payload::ParameterRequest;

use crate::rig::{HOME, Rig, aborted, north, refused};

fn flying_with(text: &str) -> Rig {
    let config: BridgeConfig = runtime::config::parse(text, "test.toml").unwrap();
    let mut rig = Rig::up(&config);
    rig.control(ControlCommand::Start);
    rig.lift_off();
    rig
}

fn following(rig: &mut Rig, path_id: u64) -> u64 {
    let path = rig.path(path_id, &[north(40)]);
    rig.run(350);
    assert_eq!(rig.functionality(), Functionality::FollowingPath);
    path[0]
}

fn fix(rig: &mut Rig, quality: u8) {
    rig.dsp.status.gps_quality = Some(quality);
}

fn landings(rig: &Rig) -> usize {
    let land = Command::Write16 {
        port: port::LAND,
        value: 1,
    };
    let commands = rig.dsp.commands.iter();
    commands.filter(|command| **command == land).count()
}

/// Of each action for a lost position: what the helicopter does then, and how many landings are ordered.
const POSITION_LOST: [(&str, Functionality, usize); 3] = [
    ("warn", Functionality::FollowingPath, 0),
    ("hold", Functionality::AtRest, 0),
    ("land", Functionality::Landing, 1),
];

/// With this action when the position was lost for 2 s.
fn flying_by(action: &str) -> Rig {
    let text = format!("[safety]\nposition_lost = \"{action}\"\nposition_lost_s = 2.0\n");
    flying_with(&text)
}

#[test]
fn a_position_is_lost_as_well_when_no_status_comes_any_more() {
    for (action, doing, landings_then) in POSITION_LOST {
        let mut rig = flying_by(action);
        following(&mut rig, 1);
        // Flow control and acknowledgements go on.
        let period_ms = std::mem::replace(&mut rig.dsp.status_period_ms, u32::MAX);
        rig.run(12_500);
        assert_eq!(rig.functionality(), Functionality::FollowingPath);
        rig.run(4000);
        assert_eq!(rig.link(), LinkState::Up);
        let safety = rig.bridge.state().safety;
        assert_eq!(safety.rule(), Some(SafetyRule::PositionLost), "{action}");
        assert_eq!(
            (rig.functionality(), landings(&rig)),
            (doing, landings_then)
        );
        // It is found again after as long.
        rig.dsp.status_period_ms = period_ms;
        rig.run(1000);
        assert_eq!(
            rig.bridge.state().safety.rule(),
            Some(SafetyRule::PositionLost)
        );
        rig.run(1500);
        assert_eq!(rig.bridge.state().safety.rule(), None);
        assert_eq!(landings(&rig), landings_then, "once");
    }
    // On the ground there is nothing to lose.
    let mut rig = Rig::started();
    rig.dsp.status_period_ms = u32::MAX;
    rig.run(30_000);
    assert_eq!(
        (rig.bridge.state().safety.rule(), landings(&rig)),
        (None, 0)
    );
}

#[test]
fn a_lost_position_warns_holds_or_lands_after_its_time_and_is_found_after_as_long() {
    for (action, doing, landings_then) in POSITION_LOST {
        let mut rig = flying_by(action);
        let path = following(&mut rig, 1);
        // Shorter than the time: nothing happens, however often.
        for _ in 0..3 {
            fix(&mut rig, 0);
            rig.run(1900);
            fix(&mut rig, 1);
            rig.run(40);
        }
        assert_eq!(
            rig.functionality(),
            Functionality::FollowingPath,
            "{action}"
        );
        rig.dsp.grants = false;
        fix(&mut rig, 0);
        rig.run(2100);
        assert_eq!(rig.functionality(), doing, "{action}");
        assert_eq!(landings(&rig), landings_then, "{action}: once");
        let safety = rig.bridge.state().safety;
        assert_eq!(safety.rule(), Some(SafetyRule::PositionLost), "{action}");
        assert!((2.0..2.2).contains(&safety.amount), "{}", safety.amount);
        let ended = u32::from(action != "warn");
        assert_eq!(safety.interventions, ended + landings_then as u32);
        if action == "warn" {
            assert_eq!(safety.action(), Some(SafetyAction::Warn));
            continue;
        }
        if action == "land" {
            rig.dsp.status.flying = false;
            rig.run(600);
            assert_eq!(rig.functionality(), Functionality::AtRest);
            assert_eq!(rig.module(), ModuleStatus::Running, "as before");
        }
        assert_eq!(rig.last(path), aborted(Reason::NoPosition));
        assert_eq!(rig.last_report(path).rule(), Some(SafetyRule::PositionLost));
        assert!(rig.dsp.held.is_empty());
        if action == "hold" {
            // It is back: for as long nobody flies by it.
            fix(&mut rig, 1);
            rig.run(1900);
            let next = rig.path(2, &[north(50)]);
            assert_eq!(rig.last(next[0]), refused(Reason::NoPosition));
            assert_eq!(
                rig.last_report(next[0]).rule(),
                Some(SafetyRule::PositionLost)
            );
            let hold = rig.hold();
            assert_eq!(rig.last(hold).0, Stage::Done, "holding is always allowed");
            rig.run(200);
            assert_eq!(rig.bridge.state().safety.rule(), None);
            let next = rig.path(3, &[north(50)]);
            assert_eq!(rig.last(next[0]).0, Stage::Accepted);
        }
    }
}

#[test]
fn a_position_that_is_stale_or_leaps_is_lost_too() {
    let mut rig = flying_with("[safety]\nposition_lost = \"hold\"\nposition_lost_s = 1.0\n");
    let path = following(&mut rig, 1);
    rig.dsp.status.withdraw(StatusMask(1 << 1));
    rig.run(4000);
    assert_eq!(rig.last(path), aborted(Reason::NoPosition));

    let mut rig = flying_with("[safety]\nposition_lost = \"hold\"\nposition_lost_s = 1.0\n");
    let path = following(&mut rig, 1);
    // One leap is taken as soon as the next sample confirms it.
    rig.dsp.at(north(900));
    rig.run(40);
    rig.dsp.at(north(0));
    rig.run(2000);
    assert_eq!(rig.last(path).0, Stage::Progress);
    for step in 0..60 {
        rig.dsp.at(north(if step % 2 == 0 { 900 } else { 0 }));
        rig.run(20);
    }
    assert_eq!(rig.last(path), aborted(Reason::NoPosition));
    assert_eq!(rig.last_report(path).rule(), Some(SafetyRule::PositionLost));
}

/// While the pilot flies, the bridge does not land the helicopter. It lands when the pilot lets go and its position is
/// not known.
#[test]
fn a_lost_position_waits_for_the_pilot_and_for_the_end_of_a_take_off() {
    let switch = |rig: &mut Rig, is_auto| {
        let supply = rig.dsp.status.supply.as_mut().unwrap();
        supply.auto_switch = is_auto;
    };
    let mut rig = flying_with("[safety]\nposition_lost_s = 1.0\n");
    rig.dsp.grants = false;
    switch(&mut rig, 0);
    fix(&mut rig, 0);
    rig.run(3000);
    assert_eq!(landings(&rig), 0);
    let safety = rig.bridge.state().safety;
    assert_eq!(safety.rule(), Some(SafetyRule::PilotSwitch));
    switch(&mut rig, 1);
    rig.run(100);
    assert_eq!(landings(&rig), 1);
    assert_eq!(rig.functionality(), Functionality::Landing);

    // What never was known cannot be lost: a DSP without a GPS that the pilot flew up.
    let mut rig = Rig::closed(&BridgeConfig::default());
    fix(&mut rig, 0);
    rig.dsp.status.flying = true;
    rig.open();
    rig.run(10_000);
    assert_eq!(
        (landings(&rig), rig.bridge.state().safety.rule()),
        (0, None)
    );

    let text = "[safety]\nposition_lost_s = 1.0\n";
    let mut rig = Rig::up(&runtime::config::parse(text, "test.toml").unwrap());
    rig.control(ControlCommand::Start);
    rig.dsp.grants = false;
    let take_off = rig.take_off();
    rig.run(40);
    rig.dsp.status.flying = true;
    fix(&mut rig, 0);
    rig.run(3000);
    assert!(!rig.last(take_off).0.is_final(), "a take-off is not ended");
    assert_eq!(rig.bridge.state().safety.rule(), None);
    // Nor is it missed on the ground.
    let mut rig = flying_with(text);
    rig.dsp.status.flying = false;
    fix(&mut rig, 0);
    rig.run(3000);
    assert_eq!(rig.bridge.state().safety.rule(), None);
}

/// A mast whose outline begins 100 m north of home.
const MAST: &str = "[fence]\n[[fence.area]]\nname = \"mast\"\nkind = \"exclusion\"\n\
                    centre = [37.001, -6.0]\nradius_m = 11.0\n";

/// At 5 m/s the helicopter stops within 5 · 0.6 + 25 / 5 = 8 m, and half of the margin of 2 m is to be left: a path may
/// come to 9 m before the mast, and not nearer. At 8 m/s it is 8 · 0.6 + 64 / 5 + 1 = 18.6 m.
#[test]
fn a_leg_leaves_room_to_stop_before_the_fence_or_is_refused_with_what_is_missing() {
    let ahead = |rig: &mut Rig, path: &[Waypoint]| {
        let requests = rig.path(1, path);
        let report = rig.last_report(*requests.last().unwrap());
        if report.stage() == Some(Stage::Refused) {
            assert_eq!(report.reason(), Some(Reason::FenceBreach));
            assert_eq!(report.rule(), Some(SafetyRule::FenceAhead));
            assert_eq!(report.area(), Some("mast"));
        }
        report
            .value()
            .filter(|_| report.stage() == Some(Stage::Refused))
    };
    let east = |steps: i32, at: Waypoint| Waypoint {
        longitude_deg: HOME.longitude_deg + f64::from(steps) * 1e-5,
        ..at
    };
    // Path, and metres that are missing at 5 and at 8 m/s. The mast begins at step 89.9.
    let table = [
        (vec![north(70)], None, None),
        (vec![north(80)], None, Some(7.6)),
        (vec![north(84)], Some(2.4), Some(12.0)),
        // Along it, and away from it, there is room; within the margin there is none.
        (vec![east(-40, north(87)), east(40, north(87))], None, None),
        (
            vec![east(-40, north(89)), east(40, north(89))],
            Some(1.0),
            Some(1.0),
        ),
    ];
    for (path, at_5, at_8) in table {
        for (speed, expected) in [(5.0, at_5), (8.0, at_8)] {
            let text = format!("[parameters]\ncruise_speed_mps = {speed:.1}\n{MAST}");
            let found = ahead(&mut flying_with(&text), &path);
            let is_near =
                |found: f64| expected.is_some_and(|expected: f64| (found - expected).abs() < 0.5);
            assert!(
                found.map_or(expected.is_none(), is_near),
                "{path:?} at {speed}: {found:?}, not {expected:?}"
            );
        }
    }
}

/// The way to its first waypoint is judged from where the helicopter is when the path is closed.
#[test]
fn a_path_whose_way_to_it_has_become_forbidden_is_not_begun() {
    let mut rig = flying_with(MAST);
    let first = rig.waypoint(1, 1, 0, north(70));
    rig.dsp.at(north(160));
    rig.run(40);
    let last = rig.waypoint(1, 0, 1, north(60));
    assert_eq!(rig.last(last), refused(Reason::FenceBreach));
    let report = rig.last_report(last);
    assert_eq!(report.rule(), Some(SafetyRule::FenceExclusion));
    assert_eq!((report.waypoint, report.area()), (1, Some("mast")));
    assert_eq!(rig.last(first), aborted(Reason::PathBroken));
    assert_eq!(rig.functionality(), Functionality::AtRest);
}

/// Take-off and landing pass every altitude.
#[test]
fn a_floor_holds_in_flight_and_not_for_take_off_landing_and_what_stands() {
    type Begin = fn(&mut Rig);
    let table: [(&str, bool, Begin, Option<SafetyRule>); 4] = [
        ("stands", false, |_| (), None),
        ("takes off", false, |rig| _ = rig.take_off(), None),
        ("hovers", true, |_| (), Some(SafetyRule::FenceFloor)),
        ("lands", true, |rig| _ = rig.land(), None),
    ];
    for (what, is_flying, begin, rule) in table {
        let mut rig = flying_with("[fence]\nfloor_m = 15.0\n");
        rig.dsp.grants = false;
        rig.dsp.status.flying = is_flying;
        rig.run(100);
        begin(&mut rig);
        rig.dsp.status.flying = what != "stands";
        rig.dsp.at(Waypoint {
            altitude_m: 12.0,
            ..north(0)
        });
        rig.run(40);
        assert_eq!(rig.bridge.state().safety.rule(), rule, "{what}");
    }
}

/// The helicopter hovers 2.4 m below the ceiling. Its first waypoint is where it is, but for how far a GPS strays.
#[test]
fn a_leg_of_almost_no_length_is_no_flight_at_full_speed() {
    let text = format!("[fence]\nceiling_m = {:.1}\n", north(0).altitude_m + 2.4);
    // Below where the leg begins, how fast the helicopter climbs then, and whether the leg is taken.
    for (below_m, climb_mps, is_taken) in [
        (0.1, Some(0.0), true),
        (0.3, Some(0.1), true),
        (8.0, Some(0.0), false),
        (0.1, Some(2.0), false),
        // Unknown is unknown.
        (0.1, None, false),
    ] {
        let mut rig = flying_with(&text);
        rig.dsp.at(Waypoint {
            altitude_m: north(0).altitude_m - below_m,
            ..north(0)
        });
        rig.dsp.status.gps_velocity = climb_mps.map(|climb_mps| GpsVelocity {
            vertical_speed_mps: climb_mps,
            ..GpsVelocity::default()
        });
        if climb_mps.is_none() {
            rig.dsp.status.withdraw(StatusMask(1 << 3));
        }
        rig.run(40);
        let path = rig.path(1, &[north(0)]);
        let what = format!("{below_m} m below, {climb_mps:?}");
        assert_eq!(rig.last(path[0]).0 != Stage::Refused, is_taken, "{what}");
    }
}

#[test]
fn a_path_is_held_when_the_measured_velocity_leads_into_the_fence_and_not_before() {
    let west = |steps: i32| Waypoint {
        longitude_deg: HOME.longitude_deg - f64::from(steps) * 1e-6,
        ..north(100)
    };
    // Where, its speed and course, and whether it is held.
    let table = [
        (north(70), 5.0, 0.0, false),
        (north(80), 5.0, 0.0, false),
        (north(83), 5.0, 0.0, true),
        (north(70), 12.0, 0.0, true),
        (north(70), 12.0, 90.0, false),
        (north(70), 12.0, 180.0, false),
        // Nearer than the margin, but on its way out, or along.
        (north(89), 3.0, 180.0, false),
        (north(89), 3.0, 90.0, false),
        (north(89), 3.0, 45.0, true),
        // West of it.
        (west(210), 5.0, 90.0, true),
        (west(210), 5.0, 270.0, false),
        (west(210), 5.0, 0.0, false),
    ];
    for action in ["warn", "hold", "land"] {
        for (at, speed, course, is_held) in table {
            let mut rig = flying_with(&format!("[safety]\nfence_breach = \"{action}\"\n{MAST}"));
            let path = following(&mut rig, 1);
            rig.dsp.grants = false;
            rig.dsp.at(at);
            rig.dsp.status.gps_velocity = Some(GpsVelocity {
                horizontal_speed_mps: speed,
                vertical_speed_mps: 0.0,
                heading_deg: course,
            });
            rig.run(20);
            let what = format!("{action}: {at:?} {speed} {course}");
            if is_held && action != "warn" {
                assert_eq!(rig.last(path), aborted(Reason::FenceBreach), "{what}");
                let report = rig.last_report(path);
                assert_eq!(report.rule(), Some(SafetyRule::FenceAhead), "{what}");
                assert_eq!(report.area(), Some("mast"));
                assert!(report.value().unwrap() > 0.0, "{what}");
                // It is inside: nobody lands.
                assert_eq!(rig.functionality(), Functionality::AtRest, "{what}");
                assert!(rig.dsp.held.is_empty());
                // The rule says where a path may lead, and not that none may.
                let away = rig.path(2, &[north(40)]);
                assert_eq!(rig.last(away[0]).0, Stage::Accepted, "{what}");
            } else {
                assert_eq!(rig.last(path).0, Stage::Progress, "{what}");
            }
            for _ in 0..2 {
                let rule = rig.bridge.state().safety.rule();
                assert_eq!(rule, is_held.then_some(SafetyRule::FenceAhead), "{what}");
                rig.run(20);
            }
            rig.dsp.status.gps_velocity = Some(GpsVelocity::default());
            rig.run(40);
            assert_eq!(rig.bridge.state().safety.rule(), None, "{what}");
        }
    }
}

/// Who flies no path is not held, and nothing is shown.
#[test]
fn what_is_ahead_counts_on_a_path_alone() {
    let mut rig = flying_with(MAST);
    rig.dsp.at(north(83));
    rig.dsp.status.gps_velocity = Some(GpsVelocity {
        horizontal_speed_mps: 5.0,
        ..GpsVelocity::default()
    });
    rig.run(100);
    assert_eq!(rig.bridge.state().safety.rule(), None);
}

/// Floor and ceiling are boundaries, too; and a bridge that gets no velocity judges the place alone.
#[test]
fn floor_and_ceiling_are_ahead_as_well_and_without_a_velocity_only_the_place_counts() {
    let text = "[fence]\nfloor_m = 12.0\nceiling_m = 40.0\n";
    for (climb_mps, is_known, is_held) in [
        (-4.0, true, true),
        (-1.0, true, false),
        (8.0, true, true),
        (-4.0, false, false),
    ] {
        let mut rig = flying_with(text);
        let path = following(&mut rig, 1);
        rig.dsp.status.gps_velocity = is_known.then_some(GpsVelocity {
            horizontal_speed_mps: 0.0,
            vertical_speed_mps: climb_mps,
            heading_deg: 0.0,
        });
        if !is_known {
            rig.dsp.status.withdraw(StatusMask(1 << 3));
        }
        let above = if climb_mps < 0.0 { 16.0 } else { 22.0 };
        rig.dsp.at(Waypoint {
            altitude_m: above,
            ..north(0)
        });
        rig.run(40);
        let is_ended = rig.last(path) == aborted(Reason::FenceBreach);
        assert_eq!(is_ended, is_held, "{climb_mps} {is_known}");
    }
    // The speed may be changed at any time: the measured one counts.
    let mut rig = flying_with(MAST);
    rig.parameter(ParameterRequest::write(0, port::CRUISE_SPEED_MPS, 8.0));
    rig.run(100);
    let path = rig.path(1, &[north(80)]);
    assert_eq!(rig.last(path[0]), refused(Reason::FenceBreach));
}
