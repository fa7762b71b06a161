//! A robot as an operator has it before a flight, and a terminal.

use ipc_types::inspect::Life;
use ril_tests::sandbox::Robot;
use ril_tests::{Process, Sandbox};

use crate::common::{Flight, sandbox, start_robot};
use crate::watch::screen::on_terminal;

/// A bridge that a machine that stalls for seconds does not take for dead, a fence, and limits of the supply.
pub const BRIDGE: &str = "\
[serial]
port = 'dsp-1'
[link]
ack_timeout_ms = 10000
pc_timeout_ms = 60000
silent_after_ms = 60000
[safety]
battery_v = { land = 20.0 }
fuel_percent = { land = 5 }
[[fence.area]]
name = 'field'
kind = 'inclusion'
centre = [37.411, -6.001]
radius_m = 2000.0
";

/// Logs that leave the disk to others.
pub const STATUS: &str = "\
[[log]]
utc = true
min_free_mib = 0
groups = ['time', 'geographic', 'gps_velocity', 'gps_quality', 'supply', 'dsp_errors']
";

/// Telemetry that is old on a machine that stalls is not the robot's fault.
pub const OPERATOR: &str = "[observe]\ntimeout_s = 60.0\n[preflight]\nmax_age_s = 60.0\nlog_room_mib = 0\nlink_loss_percent = { warn = 100.0, fail = 100.0 }\n";

/// Simulator, bridge and status of robot 1, with the configurations above where the test has written none.
pub fn station(rig: &Sandbox, speed: u32) -> Robot {
    for (name, text) in [
        ("bridge.toml", BRIDGE),
        ("status.toml", STATUS),
        ("ril.toml", OPERATOR),
    ] {
        if !rig.path(name).exists() {
            rig.write(name, text);
        }
    }
    let robot = start_robot(rig, speed);
    rig.run("wait --for up --for landed --timeout 600s", 0);
    robot
}

/// Waits for the end of a process, which must be in order, and returns what it wrote.
#[track_caller]
pub fn done(mut process: Process) -> Vec<String> {
    let finished = process.exits(0);
    finished.stdout
}

/// Waits until a process of this name takes part in a service of the domain; signals then reach what it does with them.
pub fn until_joined(rig: &Sandbox, name: &str) {
    loop {
        let inspection = rig.domain.inspect();
        let mut members = inspection.robots.iter().flat_map(|robot| &robot.members);
        if members.any(|member| member.process == name && member.life == Life::Live) {
            return;
        }
        std::thread::yield_now();
    }
}

#[test]
fn a_path_on_a_terminal_has_one_line_that_is_renewed_until_it_is_done() {
    let rig = sandbox();
    let flight = Flight::begin(&rig);
    let lines = on_terminal(&rig, "goto +20,+0", 0);
    let text = lines.join("\n");
    assert!(text.contains("goto: 1 waypoint, "), "{text}");
    assert!(text.contains(" m to go"), "{text}");
    // Each is gone before the next one, and the last one before the end: one line up, and the rest of the screen
    // erased.
    let shown =
        text.matches("goto: 1 waypoint, ").count() + text.matches("goto: 0 waypoints, ").count();
    let erased = text.matches("\u{1b}[1A\u{1b}[J").count();
    assert_eq!(shown, erased, "{text}");
    // What was reported stands.
    assert!(text.contains("goto: done, 1 of 1 waypoints sent"), "{text}");
    flight.end();
}
