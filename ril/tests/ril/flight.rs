//! The real robot together: simulator, bridge, status and the operator's commands, each a process of its own.

use std::fs;

use crate::common::{
    FOR_SLOW_MACHINES, Flight, end, end_all, json, place, sandbox, says, shown_state, start_robot,
};
use ipc_types::code::{Functionality, LinkState, ModuleStatus, MovementKind};
use ril_tests::process::Signal;
use ril_tests::pty::is_link;
use rustix::fs::{CWD, Mode, mkfifoat};

#[test]
fn a_whole_mission_by_hand() {
    let rig = sandbox();
    let robot = start_robot(&rig, 10);
    let (latitude, longitude, altitude) = place(&rig, 1);

    assert_eq!(rig.run("start", 0).stdout, ["start: done"]);
    let take_off = rig.run("takeoff --altitude 5", 0);
    let [accepted, begun, done] = &take_off.stdout[..] else {
        panic!("{take_off:#?}");
    };
    assert_eq!(accepted, "takeoff: accepted");
    assert_eq!(begun, "takeoff: begun on the DSP");
    assert!(done.starts_with("takeoff: done"), "{take_off:#?}");
    rig.watch(1).until("the take-off has ended", |state| {
        state.status() == Some(ModuleStatus::Ended)
    });

    let north = latitude + 1e-4;
    let (up, high) = (altitude + 6.0, altitude + 8.0);
    let path = rig.run(
        &format!("goto {north},{longitude},{up} {latitude},{longitude},{high}"),
        0,
    );
    assert!(
        says(
            &path.stdout,
            "goto: 2 waypoints accepted, the path is complete, 2"
        ),
        "{path:#?}"
    );
    // Of those that were reached while the machine stalled, the bridge may have seen nothing.
    let last = path.stdout.last().unwrap();
    let expected = "goto: done, 2 of 2 waypoints sent, ";
    assert!(last.starts_with(expected), "{path:#?}");
    assert!(
        last.contains(" reached, 2") && last.contains(" m in "),
        "{path:#?}"
    );
    let begun = path.stdout.iter().find(|line| line.contains("progress"));
    assert!(begun.unwrap().contains(" m to go"), "{path:#?}");
    let (_, _, reached) = place(&rig, 1);
    assert!((reached - high).abs() < 2.0, "{reached} and not {high}");

    rig.run("land", 0);
    let stop = rig.run("stop --json", 0);
    let word = json(stop.stdout.last().unwrap());
    assert_eq!(
        (&word["request"], &word["stage"]),
        (&"stop".into(), &"done".into())
    );
    let state = shown_state(&rig, 1);
    assert_eq!(state["module"]["status"], "ended");
    assert_eq!(state["module"]["blocked"], true);
    assert_eq!(state["link"]["waypoints_sent"], 2);
    assert_eq!(state["dsp_errors"]["total"], 0);
    // How old it is, the machine decides.
    assert!(state["hero"]["stale"].is_boolean(), "{state:#}");
    robot.end();
}

#[test]
fn a_path_with_a_bad_waypoint_is_not_flown_and_a_path_under_way_can_be_stopped() {
    let rig = sandbox();
    let robot = start_robot(&rig, 10);
    let (latitude, longitude, altitude) = place(&rig, 1);
    rig.run("start", 0);
    rig.run("takeoff --altitude 5", 0);
    let (far, up) = (latitude + 1.0, altitude + 5.0);
    let near = format!("{latitude},{longitude},{up}");
    let refused = rig.run(
        &format!("goto {near} {near} {far},{longitude},{up} {near}"),
        5,
    );
    refused.err_says("goto was refused (too-far: waypoint 3, 111 km away (limit 10.0 km))");
    refused.err_says("are latitude and longitude swapped?");
    rig.run("takeoff 500m", 5)
        .err_says("the DSP takes 0.5 to 200 m above take-off (port 20121)");
    let state = rig.watch(1).until("at rest", |state| {
        state.functionality() == Some(Functionality::AtRest)
    });
    assert_eq!(state.link.waypoints_sent, 0);

    // 5 km: it takes minutes, at whatever speed the clock runs here.
    let remote = latitude + 0.045;
    let mut path = rig.start(&format!("goto {remote},{longitude},{up}"));
    path.wait_for_text("goto: progress");
    rig.run("stop", 0);
    path.exits(5).err_says("ended early (stopped)");
    robot.end();
}

#[test]
fn each_signal_ends_each_process_with_nothing_left() {
    for signal in [Signal::INT, Signal::TERM, Signal::HUP] {
        let rig = sandbox();
        let robot = start_robot(&rig, 1);
        let link = rig.folder().join("dsp-1");
        assert!(is_link(&link));
        let bridge = end(robot.bridge, signal);
        bridge.err_says("ended");
        assert!(is_link(&link), "the port is the simulator's");
        end(robot.sim, signal);
        assert!(!is_link(&link));
        end(robot.status, signal);
        rig.domain.assert_empty();
    }
}

#[test]
fn two_robots_do_not_see_each_other() {
    let rig = sandbox();
    rig.write("south.toml", "[home]\nlatitude_deg = -10.0\n");
    let sims = [
        rig.sim(1, "--speed 10"),
        rig.sim(2, "--speed 10 --config south.toml"),
    ];
    let bridges = [rig.bridge(1), rig.bridge(2)];
    let statuses = [rig.status(1), rig.status(2)];
    let mut watches = [rig.watch(1), rig.watch(2)];
    for watch in &mut watches {
        watch.until_ready();
    }
    rig.run("start --robot 2", 0);
    rig.run("takeoff --robot 2 --altitude 5", 0);
    let state = |robot: u32| shown_state(&rig, robot);
    assert_eq!(state(2)["module"]["status"], "ended");
    assert_eq!(state(2)["movement"]["kind"], "takeoff");
    assert_eq!(state(1)["module"]["status"], "waiting-data-to-start");
    assert!(state(1)["movement"].is_null());
    let ((latitude_1, ..), (latitude_2, ..)) = (place(&rig, 1), place(&rig, 2));
    assert!(
        (latitude_1 - 37.411).abs() < 0.01 && (latitude_2 + 10.0).abs() < 0.01,
        "{latitude_1} {latitude_2}"
    );
    drop(watches);
    end_all(sims.into_iter().chain(bridges).chain(statuses));
}

#[test]
fn a_bridge_that_was_killed_comes_back_while_status_goes_on() {
    let rig = sandbox();
    let mut robot = start_robot(&rig, 1);
    rig.run("start", 0);
    let mut echo = rig.start("echo hero --json --field source_epoch_ns --timeout 80s");
    let first = json(&echo.wait_for_text("source_epoch_ns").text);
    let mut take_off = rig.start("takeoff --altitude 100");
    take_off.wait_for_text("takeoff: begun");

    robot.bridge.signal(Signal::KILL);
    robot.bridge.wait_status();
    take_off.exits(7).err_says("bridge-gone");
    rig.run("status --timeout 100ms", 3);

    robot.bridge = rig.bridge(1);
    echo.wait_for_line(|line| {
        line.text.contains("source_epoch_ns")
            && json(&line.text)["source_epoch_ns"] != first["source_epoch_ns"]
    });
    // What the killed bridge has published last comes first.
    rig.watch(1).until("the new bridge is ready", |state| {
        state.status() == Some(ModuleStatus::WaitingDataToStart)
            && state.link.state() == Some(LinkState::Up)
    });
    // Telemetry in SI units came from the same status all the time.
    let finished = end(echo, Signal::INT);
    finished.err_says(" 0 publisher restarts");
    robot
        .status
        .wait_for_text("telemetry comes from another bridge now");
    robot.end();
}

#[test]
fn a_geofence_that_is_no_file_any_more_does_not_stop_the_bridge_in_flight() {
    let rig = sandbox();
    let config = rig.write("bridge.toml", FOR_SLOW_MACHINES);
    let robot = start_robot(&rig, 4);
    rig.run("start", 0);
    rig.run("takeoff --altitude 3", 0);
    fs::remove_file(&config).unwrap();
    mkfifoat(CWD, &config, Mode::RUSR | Mode::WUSR).unwrap();
    rig.run("fence reload", 5).err_says("invalid-fence");
    // `land` reads ril.toml, and the bridge nothing.
    rig.run("land", 0);
    rig.run("stop", 0);
    robot.end();
}

#[test]
fn a_path_that_would_begin_late_because_the_bridge_stood_still_is_not_flown() {
    let rig = sandbox();
    let prompt = FOR_SLOW_MACHINES.replace("begin_within_ms = 60000", "begin_within_ms = 4000");
    rig.write("bridge.toml", &prompt);
    let flight = Flight::begin(&rig);
    let (latitude, longitude, altitude) = flight.place;
    let (mut watch, mut former) = (rig.watch(1), 0);
    for deadline in ["--deadline 2s", ""] {
        // Without flow control no waypoint leaves: the path stays at accepted.
        flight.sim.signal(Signal::STOP);
        let target = format!("{},{longitude},{altitude}", latitude + 0.001);
        rig.run(&format!("goto {target} --no-wait {deadline}"), 0);
        flight.bridge.signal(Signal::STOP);
        flight.sim.signal(Signal::CONT);
        // So long nothing new comes from the bridge, and grants wait in the terminal.
        rig.run("status --timeout 5s", 4);
        flight.bridge.signal(Signal::CONT);
        let state = watch.until("the path has ended", |state| {
            state.movement.kind() == Some(MovementKind::GoToWaypoint)
                && state.movement.path_id != former
                && state.functionality() != Some(Functionality::FollowingPath)
        });
        former = state.movement.path_id;
        assert_eq!(state.movement.waypoints_sent, 0, "{state:#?}");
        assert_eq!(state.link.waypoints_sent, 0, "{state:#?}");
        assert_eq!(state.status(), Some(ModuleStatus::Running), "not blocked");
    }
    drop(watch);
    flight.end();
}
