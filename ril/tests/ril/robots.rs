//! `ril robots`, and which robot a command is for, when several are alive.

use crate::common::{end, json, movement, sandbox, state_of};
use crate::watch::screen::{Screen, on_terminal};
use ipc_types::RobotId;
use ipc_types::code::MovementKind;
use ril_tests::process::Signal;
use ril_tests::{Process, Sandbox, StandInBridge, StandInStatus};
use serde_json::Value;

/// Every command that moves a helicopter, or changes how it flies.
const COMMANDS: [&str; 8] = [
    "start",
    "stop",
    "takeoff --altitude 5",
    "goto 37,-6,20",
    "land",
    "hold",
    "param set yaw_gain 1",
    "fence reload",
];

#[test]
fn a_command_that_moves_a_helicopter_refuses_to_guess_among_several() {
    let rig = sandbox();
    let robots = [2, 1].map(|id| RobotId::new(id).unwrap());
    let bridges = robots.map(|robot| StandInBridge::start_for(&rig.domain, robot));
    for args in COMMANDS {
        let finished = rig.run(args, 2);
        let expected = "several robots are alive (1, 2) and none was named";
        finished.err_says(expected);
        assert!(finished.stdout.is_empty(), "{args}: {finished:#?}");
        // Named, it is sent.
        rig.run(&format!("{args} --robot 2"), 0);
        bridges[0].next_request();
    }
    // The environment names it, too.
    let mut command = rig.command(["hold"]);
    command.env("RIL_ROBOT", "1");
    Process::spawn(&rig.domain, command).exits(0);
    // Nothing was sent to robot 1 before.
    assert_eq!(
        movement(bridges[1].next_request()).kind(),
        Some(MovementKind::Hold)
    );
    // What only looks has a default.
    state_of(&rig, "status");
    rig.run("param list", 0);
    rig.run("param get yaw_gain", 0);

    // Robot 2 alone is not taken in the place of the default, but named.
    let [two, one] = bridges;
    one.die();
    let finished = rig.run("hold", 3);
    let expected = "robot 2 is alive: name it with --robot 2";
    finished.err_says(expected);
    drop(two);
}

/// More robots than a wait has sources, several times over.
const FLEET: u32 = 32;

#[test]
fn no_command_has_a_limit_that_a_fleet_of_thirty_two_robots_reaches() {
    ipc_types::allow_many_files();
    let rig = sandbox();
    let ids = || (1..=FLEET).filter_map(RobotId::new);
    let bridges: Vec<StandInBridge> = ids()
        .map(|robot| StandInBridge::start_lossy(&rig.domain, robot))
        .collect();
    // A status that stands still: what it would publish is waited for.
    let still = StandInStatus::start_for(&rig.domain, RobotId::new(7).unwrap());
    let found = rig.run("robots --json --timeout 200ms", 0).stdout;
    assert_eq!(found.len(), FLEET as usize, "{found:#?}");
    // No status runs.
    rig.run("wait --all --for landed --timeout 200ms", 3);
    let late = rig.run("wait --all --for flying --for up --timeout 200ms --json", 3);
    assert!(late.stdout[31].contains("\"robot\":32,"), "{late:#?}");
    drop(still);
    let mut waiting = rig.start("wait --all --for up --timeout 60s");
    while waiting.is_running() {
        for bridge in &bridges {
            bridge.publish_state(&StandInBridge::idle_state());
        }
    }
    let up = waiting.exits(0);
    assert_eq!(up.stdout.len(), FLEET as usize, "{up:#?}");
    assert!(up.stdout[31].starts_with("robot 32: up: "), "{up:#?}");
    rig.run("hold --all", 0);
    for bridge in &bridges {
        let hold = movement(bridge.next_request());
        assert_eq!(hold.kind(), Some(MovementKind::Hold));
    }
    let doctor = rig.finish("doctor");
    let said = [doctor.stdout.concat(), doctor.stderr.concat()].concat();
    assert!(said.contains("32") && !said.contains("sources"), "{said}");
    let mut screen = Screen::start(&rig, "watch", 100, 30);
    screen.shows("robot 1 ");
    screen.shows("more");
    // Back from the first to the last.
    screen.types("\x1b[Z");
    screen.shows("robot 32 ");
    screen.quits();
}

fn robots(rig: &Sandbox) -> Vec<Value> {
    let finished = rig.run("robots --json", 0);
    finished.stdout.iter().map(|line| json(line)).collect()
}

/// The robots, as soon as `is_right`: what is shown as the present may be old on a machine that stalls.
#[track_caller]
fn robots_until(rig: &Sandbox, is_right: impl Fn(&[Value]) -> bool) -> Vec<Value> {
    for _ in 0..100 {
        let found = robots(rig);
        if is_right(&found) {
            return found;
        }
    }
    panic!("never right: {:#?}", robots(rig));
}

#[test]
fn without_a_robot_the_list_is_empty_and_says_what_to_start() {
    let rig = sandbox();
    let finished = rig.run("robots", 0);
    assert!(finished.stdout.is_empty(), "{finished:#?}");
    finished.err_says("no robot: `ril run bridge`");
    assert!(robots(&rig).is_empty());
    rig.domain.assert_empty();
}

#[test]
fn two_robots_are_told_apart_by_processes_link_and_phase() {
    let rig = sandbox();
    let sim = rig.sim(1, "");
    let bridge = rig.bridge(1);
    let status = rig.status(1);
    // Robot 2 has no DSP.
    let other = rig.bridge(2);
    rig.watch(1).until_ready();
    let found = robots_until(&rig, |found| {
        found[0]["link"] == "up" && found[1]["link"] == "gone"
    });
    assert_eq!(found.len(), 2);
    let [one, two] = [&found[0], &found[1]];
    for robot in [one, two] {
        assert_eq!(robot["schema"], "ril.Robot.v1");
        assert_eq!(
            (&robot["live"], &robot["relayed"]),
            (&true.into(), &false.into())
        );
    }
    assert_eq!(one["processes"], serde_json::json!(["bridge", "status"]));
    assert_eq!(two["processes"], serde_json::json!(["bridge"]));
    assert_eq!((&one["robot"], &two["robot"]), (&1.into(), &2.into()));
    assert_eq!(two["flying"], Value::Null);
    let lines = on_terminal(&rig, "robots", 0);
    assert!(lines[0].starts_with("ROBOT  LIVE"), "{lines:#?}");
    assert!(lines[1].starts_with("1      yes"), "{lines:#?}");
    assert_eq!(lines.len(), 3);

    for args in ["stop", "land", "takeoff --altitude 5"] {
        rig.run(args, 2).err_says("alive (1, 2)");
    }

    // A link that dies is seen.
    end(sim, Signal::INT);
    robots_until(&rig, |found| found[0]["link"] == "gone");
    // A bridge that was killed is not alive, whatever it left.
    rig.kill(other);
    rig.run("land", 5);

    // A status without its bridge is no robot that takes orders.
    rig.kill(bridge);
    let found = robots(&rig);
    assert_eq!(found[0]["processes"], serde_json::json!(["status"]));
    assert_eq!(found[0]["phase"], Value::Null);
    let lines = on_terminal(&rig, "robots", 0);
    assert!(lines[1].starts_with("1      yes"), "{lines:#?}");
    assert!(lines[1].contains(" no bridge "), "{lines:#?}");
    end(status, Signal::TERM);
}

#[test]
fn a_robot_whose_processes_were_killed_is_listed_as_dead() {
    let rig = sandbox();
    let bridge = rig.bridge(3);
    // Killed.
    drop(bridge);
    let found = robots(&rig);
    assert_eq!(found.len(), 1, "{found:#?}");
    assert_eq!(
        (&found[0]["robot"], &found[0]["live"]),
        (&3.into(), &false.into())
    );
    assert_eq!(found[0]["phase"], Value::Null);
    rig.run("doctor --repair", 0);
    assert!(robots(&rig).is_empty());
    rig.domain.sweep();
}
