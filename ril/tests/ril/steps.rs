//! The next step of a command, and a command that was stopped meanwhile: neither is done after something newer
//! (requirement H13).

use ipc_types::code::{Functionality, ModuleStatus};
use ril_tests::process::Signal;
use ril_tests::sandbox::Robot;
use ril_tests::{Process, Sandbox};

use crate::common::{FOR_SLOW_MACHINES, sandbox, shown_state, start_robot};

/// A path, a hover of 12 s, and a landing.
const HOVERS: &str = "QGC WPL 110
0 1 0 16 0 0 0 0 37.411 -6.001 10 1
1 0 3 22 0 0 0 0 0 0 8 1
2 0 3 16 12 0 0 0 37.4111 -6.001 12 1
3 0 3 16 0 0 0 0 37.4112 -6.001 12 1
4 0 3 21 0 0 0 0 0 0 0 1
";

/// Simulator, bridge and status; the module is started.
fn start(rig: &Sandbox) -> Robot {
    rig.write("bridge.toml", FOR_SLOW_MACHINES);
    rig.write("ril.toml", "[request]\ntimeout_s = 20.0\n");
    let robot = start_robot(rig, 10);
    rig.run("start", 0);
    robot
}

/// Begins the plan, and waits until it hovers.
fn hovering(rig: &Sandbox) -> Process {
    rig.write("hovers.waypoints", HOVERS);
    let mut flight = rig.start("plan fly hovers.waypoints");
    flight.wait_for_text("plan: hover for 12s, item 2");
    flight
}

fn waypoints_sent(rig: &Sandbox) -> u64 {
    let sent = &shown_state(rig, 1)["link"]["waypoints_sent"];
    sent.as_u64().unwrap()
}

#[test]
fn a_plan_that_hovers_does_not_go_on_after_another_order() {
    let rig = sandbox();
    let robot = start(&rig);
    let flight = hovering(&rig);
    let sent = waypoints_sent(&rig);
    rig.run("hold", 0);
    let finished = flight_ends(flight, "before it came a hold of process ");
    assert_eq!(waypoints_sent(&rig), sent, "{finished}");

    let flight = hovering_again(&rig);
    let sent = waypoints_sent(&rig);
    rig.run("stop", 0);
    rig.run("start", 0);
    flight_ends(flight, "before it came a start of process ");
    assert_eq!(waypoints_sent(&rig), sent);

    let flight = hovering_again(&rig);
    rig.run("goto +0,+5", 0);
    let sent = waypoints_sent(&rig);
    flight_ends(flight, "before it came a goto of process ");
    assert_eq!(waypoints_sent(&rig), sent);
    robot.end();
}

/// In the air already.
fn hovering_again(rig: &Sandbox) -> Process {
    let mut flight = rig.start("plan fly hovers.waypoints --from 2 --home 37.411,-6.001,10");
    flight.wait_for_text("plan: hover for 12s, item 2");
    flight
}

fn flight_ends(flight: Process, why: &str) -> String {
    flight_ends_at(flight, 3, why)
}

/// The plan goes on with this item.
fn flight_ends_at(mut flight: Process, item: u32, why: &str) -> String {
    let finished = flight.exits(5);
    finished.err_says("superseded").err_says(why);
    finished.err_says(format!(
        "go on with `ril plan fly hovers.waypoints --from {item}"
    ));
    finished.stderr.join("\n")
}

/// Ctrl+Z and `fg`, on its way and in a hover, with newer orders in between: of another path, and a landing and a
/// take-off.
#[test]
fn a_plan_that_was_stopped_does_not_go_on_after_another_order() {
    let rig = sandbox();
    let robot = start(&rig);
    rig.run("takeoff 8m", 0);
    for (is_hovering, orders, why) in [
        (
            false,
            &["goto +5,+0"][..],
            "before it came a goto of process ",
        ),
        (true, &["goto +0,+5"], "before it came a goto of process "),
        (
            true,
            &["land", "takeoff 8m"],
            "before it came a takeoff of process ",
        ),
    ] {
        let flight = match is_hovering {
            true => hovering_again(&rig),
            false => {
                rig.write("hovers.waypoints", HOVERS);
                rig.start("plan fly hovers.waypoints --from 2 --home 37.411,-6.001,10")
            }
        };
        let mut states = rig.watch(1);
        if !is_hovering {
            states.until("the path is flown", |state| {
                state.functionality() == Some(Functionality::FollowingPath)
            });
        }
        flight.signal(Signal::STOP);
        states.until("the path has ended", |state| {
            state.functionality() == Some(Functionality::AtRest)
        });
        for order in orders {
            rig.run(order, 0);
        }
        let sent = waypoints_sent(&rig);
        flight.signal(Signal::CONT);
        let finished = flight_ends_at(flight, 3, why);
        assert_eq!(waypoints_sent(&rig), sent, "{finished}");
        let state = shown_state(&rig, 1);
        assert_eq!(state["flight"]["flying"], true, "{finished}");
    }
    robot.end();
}

#[test]
fn a_way_home_that_was_stopped_does_not_land_after_another_order() {
    let rig = sandbox();
    let robot = start(&rig);
    rig.run("takeoff 8m", 0);
    rig.run("goto +150,+0", 0);
    let mut home = rig.start("rtl --land");
    rig.watch(1).until("the way home is flown", |state| {
        state.functionality() == Some(Functionality::FollowingPath)
    });
    home.signal(Signal::STOP);
    rig.watch(1).until("the helicopter is at home", |state| {
        state.functionality() == Some(Functionality::AtRest)
    });
    rig.run("goto +5,+0", 0);
    home.signal(Signal::CONT);
    let finished = home.exits(5);
    finished.err_says("land was refused (superseded: before it came a goto of process ");
    finished.err_says("not landed: `ril status` shows what goes on");
    let state = shown_state(&rig, 1);
    assert_eq!(state["flight"]["flying"], true, "{finished:?}");
    robot.end();
}

#[test]
fn a_start_is_as_old_as_its_command_line() {
    let rig = sandbox();
    rig.write("bridge.toml", FOR_SLOW_MACHINES);
    rig.write("ril.toml", "[request]\ntimeout_s = 20.0\n");
    let robot = start_robot(&rig, 10);
    robot.bridge.signal(Signal::STOP);
    let mut start = rig.start("start");
    // It has begun when another command is over, and its preflight still waits for the bridge.
    rig.run("--version", 0);
    let mut stop = rig.start("stop");
    rig.run("--version", 0);
    robot.bridge.signal(Signal::CONT);
    start.wait_exit();
    stop.exits(0);
    let state = shown_state(&rig, 1);
    assert_ne!(
        state["module"]["status"],
        ModuleStatus::Running.name(),
        "{state}"
    );
    robot.end();
}
