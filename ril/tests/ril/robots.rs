//! Which robot a command is for, when several are alive.
//!
//! Most tests run against a stand-in for the bridge. Those whose name begins with `the_real_bridge` run the real processes.

use crate::common::{end, movement, sandbox, state_of};
use ipc_types::RobotId;
use ipc_types::code::MovementKind;
use ril_tests::process::Signal;
use ril_tests::{Process, StandInBridge};

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

#[test]
fn the_real_bridges_of_two_robots_are_told_apart() {
    let rig = sandbox();
    let sims = [1, 2].map(|robot| rig.sim(robot, ""));
    let mut bridges = [1, 2].map(|robot| rig.bridge(robot)).map(Some);
    for args in ["stop", "land", "takeoff --altitude 5"] {
        rig.run(args, 2).err_says("alive (1, 2)");
    }
    // A bridge that was killed is not alive, whatever it left.
    let mut second = bridges[1].take().unwrap();
    second.signal(Signal::KILL);
    second.wait_status();
    rig.run("land", 5);
    for process in bridges.into_iter().flatten().chain(sims) {
        end(process, Signal::INT);
    }
}
