//! Who commands what: hold and pre-emption, the geofence, and long paths.
//!
//! Most tests run against a stand-in for the bridge. Those whose name begins with `the_real_bridge` run the real processes.

use std::fmt::Write as _;

use crate::common::{FOR_SLOW_MACHINES, Flight, end, json, movement, sandbox, says, shown_state};
use ipc_types::RobotId;
use ipc_types::code::{MovementKind, Reason};
use ipc_types::payload::MovementData;
use ril_tests::process::Signal;
use ril_tests::{Answer, Process, Sandbox, StandInBridge};

#[test]
fn hold_always_pre_empts_and_the_others_when_they_are_told_to() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    for (args, kind, flags) in [
        ("hold", MovementKind::Hold, &[1][..]),
        ("land", MovementKind::Land, &[0]),
        ("land --preempt", MovementKind::Land, &[1]),
        (
            "goto 37,-6,20 37,-6,21",
            MovementKind::GoToWaypoint,
            &[0, 0],
        ),
        (
            "goto 37,-6,20 37,-6,21 --preempt",
            MovementKind::GoToWaypoint,
            &[1, 1],
        ),
        ("takeoff --altitude 5", MovementKind::TakeOff, &[0]),
    ] {
        rig.run(args, 0);
        for flag in flags {
            let request = movement(bridge.next_request());
            assert_eq!(
                (request.kind(), request.preempt),
                (Some(kind), *flag),
                "{args}"
            );
        }
    }
}

#[test]
fn a_path_that_was_replaced_ended_early() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    for next in ["hold", "land --preempt", "goto 37,-6,30 --preempt"] {
        bridge.answer_next(Answer::under_way());
        let mut path = rig.start("goto 37,-6,20");
        path.wait_for_text("the path is complete");
        rig.run("land", 5).err_says("replace a path with --preempt");
        rig.run(next, 0);
        let finished = path.exits(5);
        assert!(
            says(
                &finished.stderr,
                "goto was begun and ended early (replaced)"
            ),
            "{next}: {finished:#?}"
        );
        finished.err_says("took its place");
    }
}

#[test]
fn a_path_of_1024_waypoints_comes_from_a_file() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    let mut text = String::from("# a survey\n");
    for index in 0..1024 {
        writeln!(text, "37.{index:04},-6,20 # {index}").unwrap();
    }
    rig.write("survey.path", &text);
    let finished = rig.run("goto --file survey.path", 0);
    let [accepted, done] = &finished.stdout[..] else {
        panic!("{finished:#?}");
    };
    assert_eq!(
        accepted,
        "goto: 1024 waypoints accepted, the path is complete"
    );
    assert!(done.starts_with("goto: done, "), "{done}");
    let sent: Vec<MovementData> = (0..1024).map(|_| movement(bridge.next_request())).collect();
    assert_eq!((sent[0].first, sent[0].last), (1, 0));
    assert_eq!((sent[1023].first, sent[1023].last), (0, 1));
    assert_eq!(sent[1023].latitude_deg, 37.1023);

    for (file, text, expected) in [
        (
            "wrong.path",
            "37,-6,20\n37,-6\n",
            "wrong.path: line 2: 2 numbers",
        ),
        (
            "empty.path",
            "# nothing\n",
            "empty.path: there is no waypoint",
        ),
    ] {
        rig.write(file, text);
        rig.run(&format!("goto --file {file}"), 2)
            .err_says(expected);
    }
    rig.run("goto --file absent.path", 2)
        .err_says("absent.path: cannot be read");
}

#[test]
fn standard_input_is_a_file_of_waypoints() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    rig.write("path", "-37,-6,20\n");
    let command = rig.shell("exec \"$0\" goto --file - < path");
    Process::spawn(&rig.domain, command).exits(0);
    assert_eq!(movement(bridge.next_request()).latitude_deg, -37.0);
}

fn was_replaced(mut path: Process) {
    let finished = path.exits(5);
    assert!(
        says(
            &finished.stderr,
            "goto was begun and ended early (replaced)"
        ),
        "{finished:#?}"
    );
}

#[test]
fn the_real_bridge_holds_replaces_and_lands_in_the_middle_of_a_path() {
    let rig = sandbox();
    let flight = Flight::begin(&rig);
    let (latitude, longitude, altitude) = flight.place;
    let path = flight.far_away(&rig);
    rig.run("land", 5);
    rig.run("hold", 0);
    was_replaced(path);
    let state = shown_state(&rig, 1);
    assert_eq!(state["link"]["dsp_path"], "empty");

    let path = flight.far_away(&rig);
    rig.run(
        &format!("goto {latitude},{longitude},{altitude} --preempt"),
        0,
    );
    was_replaced(path);

    // The landing is ordered when the helicopter is home.
    let remote = latitude + 0.045;
    let mut way = rig.start(&format!("rtl --home {remote},{longitude} --land"));
    way.wait_for_text("rtl: progress");
    way.signal(Signal::INT);
    let finished = way.exits(7);
    finished.err_says("the path is flown to its end");
    finished.err_says("not landed: `ril land`");
    rig.run("hold", 0);

    let path = flight.far_away(&rig);
    rig.run("land --preempt", 0);
    was_replaced(path);
    let state = shown_state(&rig, 1);
    assert_eq!(state["movement"]["kind"], "land");
    assert_eq!(state["link"]["dsp_path"], "empty");
    flight.end();
}

#[test]
fn the_real_bridge_takes_a_path_of_1024_waypoints() {
    let rig = sandbox();
    let flight = Flight::begin(&rig);
    let (latitude, longitude, altitude) = flight.place;
    let mut text = String::new();
    for index in 0..1024 {
        let north = latitude + f64::from(index + 1) * 2e-5;
        writeln!(text, "{north},{longitude},{altitude}").unwrap();
    }
    rig.write("survey.path", &text);
    let mut path = rig.start("goto --file survey.path");
    path.wait_for_text("1024 waypoints accepted, the path is complete");
    rig.run("hold", 0);
    was_replaced(path);
    flight.end();
}

/// A fence of one area far to the north of where the simulator begins.
const MAST: &str = "[fence]\nceiling_m = 120.0\n[[fence.area]]\nname = \"north mast\"\nkind = \"exclusion\"\n\
                    centre = [37.4115, -6.001]\nradius_m = 5.0\nceiling_m = 60.0\n";

#[test]
fn the_first_program_that_asks_a_bridge_that_has_just_begun_is_answered() {
    let rig = sandbox();
    rig.write("bridge.toml", MAST);
    let sim = rig.sim(1, "");
    let bridge = rig.start_ready("run bridge --port dsp-1");
    rig.run("fence show --timeout 8s", 0).out_says("north mast");
    for process in [bridge, sim] {
        end(process, Signal::INT);
    }
}

#[test]
fn the_fence_in_force_is_shown_its_areas_are_named_and_a_mistake_reaches_who_reloads_it() {
    let rig = sandbox();
    rig.run("fence show", 3).err_says("bridge is not running");
    rig.write("patient.toml", &format!("{FOR_SLOW_MACHINES}{MAST}"));
    let sim = rig.sim(1, "--speed 10");
    let bridge = rig.start_ready("run bridge --port dsp-1 --config patient.toml");
    rig.watch(1).until_ready();
    let shown = rig.run("fence show", 0);
    assert_eq!(
        shown.stdout[..4],
        [
            "fence of robot 1, in force: 1 area",
            "floor     none",
            "ceiling   120.0 m",
            "exclusion north mast: circle of 5.0 m round 37.4115000, -6.0010000; floor none, ceiling 60.0 m",
        ]
    );
    let object = json(&rig.run("fence show --json", 0).stdout[0]);
    assert_eq!(object["schema"], "ril.Fence.v1");
    assert_eq!(object["area"][0]["name"], "north mast");

    rig.run("start", 0);
    rig.run("takeoff --altitude 10", 0);
    let refused = rig.run("goto 37.412,-6.001,25", 5);
    refused.err_says("(fence-breach: fence-exclusion, area `north mast`, leg 1, by ");
    let refused = rig.run("goto 37.412,-6.001,25 --json", 5);
    assert_eq!(json(&refused.stdout[0])["area"], "north mast");

    // The fence in force is not that of the file.
    rig.write("patient.toml", "[fence]\nceiling_m = 5\nfloor_m = 6\n");
    let failed = rig.run("fence reload", 5);
    failed.err_says("fence reload was refused (invalid-fence)");
    failed.err_says("floor_m = 6 is not below its ceiling_m = 5");
    failed.err_says("correct the file");
    rig.run("fence show", 0).out_says("north mast");
    let logged = end(bridge, Signal::INT);
    logged.err_says("area=\"north mast\"");
    end(sim, Signal::INT);
}

#[test]
fn moves_and_the_way_home_are_flown_from_where_the_helicopter_is() {
    let rig = sandbox();
    let flight = Flight::begin(&rig);
    let (latitude, longitude, _) = flight.place;
    let place = |rig: &Sandbox| {
        let echo = rig.run("echo dsp --count 1 --json --field geographic", 0);
        let sample = json(&echo.stdout[0]);
        let value = |name: &str| sample["geographic"][name].as_f64().unwrap();
        (
            value("latitude_deg"),
            value("longitude_deg"),
            value("altitude_m"),
        )
    };
    let east_m_per_deg = 111_320.0 * latitude.to_radians().cos();
    let near = |found: (f64, f64, f64), north_m: f64, east_m: f64| {
        let north = (found.0 - latitude) * 111_000.0 - north_m;
        let east = (found.1 - longitude) * east_m_per_deg - east_m;
        assert!(
            north.abs() < 3.0 && east.abs() < 3.0,
            "{found:?}: {north} {east}"
        );
    };
    rig.run("goto +30,-20 +0m,+0m,+5m", 0);
    let away = place(&rig);
    near(away, 30.0, -20.0);
    let up_m = away.2 - flight.place.2;
    assert!((up_m - 5.0).abs() < 1.5, "{up_m}");
    let home = rig.run("rtl +25m --land", 0);
    home.out_says("rtl: 2 waypoints accepted, the path is complete, 3");
    home.out_says("land: done");
    near(place(&rig), 0.0, 0.0);
    rig.run("rtl --home 37.411", 2)
        .err_says("a place is LAT,LON");
    flight.end();
}

#[test]
fn hold_all_orders_every_robot_and_one_that_fails_keeps_no_other_from_it() {
    let rig = sandbox();
    rig.run("hold --all", 3)
        .err_says("there is no robot to hold");
    let robots = [1, 2].map(|id| RobotId::new(id).unwrap());
    let bridges = robots.map(|robot| StandInBridge::start_for(&rig.domain, robot));
    let held = rig.run("hold --all", 0);
    assert_eq!(
        held.stdout,
        [
            "robot 1: hold: accepted",
            "robot 1: hold: done",
            "robot 2: hold: accepted",
            "robot 2: hold: done",
        ]
    );
    bridges[0].answer_next(Answer::refuse(Reason::NotFlying));
    let failed = rig.run("hold --all --json", 5);
    failed.err_says("robot 1: hold was refused (not-flying)");
    let robot = |line: &String| json(line)["robot"].clone();
    let named: Vec<_> = failed.stdout[..3].iter().map(robot).collect();
    assert_eq!(named, [1, 2, 2]);
    for bridge in bridges {
        for _ in 0..2 {
            let request = movement(bridge.next_request());
            assert_eq!(
                (request.kind(), request.preempt),
                (Some(MovementKind::Hold), 1)
            );
        }
    }
}
