//! Who commands what: hold and pre-emption, the geofence, long paths, and senders that sessions distinguish
//! (`ril control`).
//!
//! Most tests run against a stand-in for the bridge. Those whose name begins with `the_real_bridge` run the real
//! processes.

use std::fmt::Write as _;

use crate::common::{
    FOR_SLOW_MACHINES, Flight, end, end_all, json, movement, place, sandbox, shown_state,
};
use ipc_types::RobotId;
use ipc_types::code::{Functionality, MovementKind, Reason};
use ipc_types::payload::ModuleState;
use ril_tests::process::Signal;
use ril_tests::{Answer, Process, StandInBridge};

#[test]
fn waypoints_come_from_a_file_or_standard_input_and_what_is_none_is_refused() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    rig.write("path", "-37,-6,20\n");
    let command = rig.shell("exec \"$0\" goto --file - < path");
    Process::spawn(&rig.domain, command).exits(0);
    assert_eq!(movement(bridge.next_request()).latitude_deg, -37.0);
    rig.write("wrong.path", "37,-6,20\n37,-6\n");
    rig.write("empty.path", "# nothing\n");
    for (file, expected) in [
        ("wrong.path", "wrong.path: line 2: 2 numbers"),
        ("empty.path", "empty.path: there is no waypoint"),
        ("absent.path", "absent.path: cannot be read"),
    ] {
        rig.run(&format!("goto --file {file}"), 2)
            .err_says(expected);
    }
}

#[track_caller]
fn was_replaced(mut path: Process) {
    path.exits(5)
        .err_says("goto was begun and ended early (replaced)")
        .err_says("took its place");
}

#[test]
fn the_real_bridge_holds_replaces_and_lands_in_the_middle_of_a_path() {
    let rig = sandbox();
    let flight = Flight::begin(&rig);
    let (latitude, longitude, altitude) = flight.place;
    let path = flight.far_away(&rig);
    rig.run("land", 5)
        .err_says("in the middle of a path with --preempt");
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
    finished.err_says("the bridge lets the helicopter hover");
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
    let mut text = String::from("# a survey\n");
    for index in 0..1024 {
        let north = latitude + f64::from(index + 1) * 2e-5;
        writeln!(text, "{north},{longitude},{altitude} # {index}").unwrap();
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
    end_all([bridge, sim]);
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
    let away = place(&rig, 1);
    near(away, 30.0, -20.0);
    let up_m = away.2 - flight.place.2;
    assert!((up_m - 5.0).abs() < 1.5, "{up_m}");
    let home = rig.run("rtl +25m --land", 0);
    home.out_says("rtl: 2 waypoints accepted, the path is complete, 3");
    home.out_says("land: done");
    near(place(&rig, 1), 0.0, 0.0);
    // The next flight begins elsewhere: home is there, for each command.
    rig.run("takeoff 5m", 0);
    rig.run("goto +25m,+0m", 0);
    rig.run("land", 0);
    let mut state = rig.watch(1);
    let stood = state.until("home", |state| {
        state.functionality() == Some(Functionality::AtRest)
    });
    near(
        (stood.home_latitude_deg, stood.home_longitude_deg, 0.0),
        25.0,
        0.0,
    );
    drop(state);
    rig.run("takeoff 5m", 0);
    rig.run("goto +20m,+0m", 0);
    rig.run("rtl --land", 0);
    near(place(&rig, 1), 25.0, 0.0);
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

/// An operator at a terminal of its own: takes control, and keeps it until something is written into the pipe.
const TERMINAL: &str = "mkfifo go && exec setsid --wait sh -c '\"$0\" control take && \"$0\" control show && read line < go' \"$0\"";

#[test]
fn the_one_at_another_terminal_asks_for_control_and_has_it_when_the_first_is_gone() {
    let rig = sandbox();
    let config = format!("{FOR_SLOW_MACHINES}[control]\nexclusive = true\nsilence_s = 3600.0\n");
    rig.write("bridge.toml", &config);
    let robot = rig.start_robot(1, 1);
    rig.run("control show", 0)
        .out_says("control of robot 1: free; the first sender that orders gets it");
    let mut first = Process::spawn(&rig.domain, rig.shell(TERMINAL));
    first.wait_for_text("this terminal, for");

    let second = |args: &str, code: i32| rig.start_by("setsid --wait", args).exits(code);
    let refused = second("takeoff 5", 5);
    refused.err_says("takeoff was refused (not-in-control): another sender has control");
    second("control pass", 5).err_says("not-in-control");
    let hold = rig.start_by("setsid --wait", "hold").wait_exit();
    assert!(
        !hold
            .stderr
            .iter()
            .any(|line| line.contains("not-in-control")),
        "{hold:#?}"
    );
    second("control take", 5).err_says("`ril control show` names it");
    let shown = json(&rig.run("control show --json", 0).stdout[0]);
    assert_eq!(shown["schema"], "ril.Control.v1");
    let control = &shown["control"];
    assert_eq!(control["exclusive"], true);
    for sender in ["holder", "asker"] {
        assert!(control[sender]["session"].as_u64() > Some(0), "{shown}");
    }
    let status = rig.finish("status").stdout;
    let said = status.iter().find(|line| line.starts_with("control  "));
    assert!(
        said.is_some_and(|line| line.contains("asks for it")),
        "{status:#?}"
    );

    std::fs::write(rig.path("go"), "on\n").expect("a reader");
    first.exits(0);
    let mut states = rig.subscribe::<ModuleState>(1);
    states.until("control is free", |state| state.holder().is_none());
    second("control take", 0).out_says("control take: done");
    robot.end();
}
