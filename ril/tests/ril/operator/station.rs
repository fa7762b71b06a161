//! A robot as an operator has it before a flight, and a terminal.

use std::io::Read;
use std::os::fd::OwnedFd;
use std::process::Stdio;

use ipc_types::files;
use ipc_types::inspect::Life;
use ril_tests::process::Signal;
use ril_tests::{Process, Sandbox, pty};
use rustix::fs::{Mode, OFlags};
use rustix::termios::{Winsize, tcsetwinsize};

use crate::common::{Flight, end, sandbox};

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

/// Simulator, bridge and status of robot 1, with the configurations above.
pub struct Station {
    pub sim: Process,
    pub bridge: Process,
    pub status: Process,
}

impl Station {
    /// Writes the configurations that the test has not written, and starts the processes.
    pub fn start(rig: &Sandbox, sim_options: &str) -> Station {
        for (name, text) in [
            ("bridge.toml", BRIDGE),
            ("status.toml", STATUS),
            ("ril.toml", OPERATOR),
        ] {
            if !rig.folder().join(name).exists() {
                rig.write(name, text);
            }
        }
        let sim = rig.sim(1, sim_options);
        let bridge = rig.bridge(1);
        let status = rig.status(1);
        rig.watch(1).until_ready();
        rig.run("wait --for up --for landed --timeout 600s", 0);
        Station {
            sim,
            bridge,
            status,
        }
    }

    /// Ends all processes.
    pub fn end(self) {
        for process in [self.status, self.bridge, self.sim] {
            end(process, Signal::INT);
        }
    }
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

/// What `ril` writes on a terminal of 80 × 24, line by line; it must end with `code`. Standard error is another one.
#[track_caller]
pub fn on_terminal(rig: &Sandbox, args: &str, code: i32) -> Vec<String> {
    let (mut master, path) = pty::open();
    let size = Winsize {
        ws_row: 24,
        ws_col: 80,
        ws_xpixel: 0,
        ws_ypixel: 0,
    };
    tcsetwinsize(&master, size).unwrap();
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
    let slave: OwnedFd = rustix::fs::open(&path, flags, Mode::empty()).unwrap();
    let mut command = rig.command(args.split_whitespace());
    command
        .envs(rig.domain.environment())
        .stdin(Stdio::null())
        .stdout(Stdio::from(slave))
        .stderr(Stdio::null());
    // It inherits the umask.
    let mut child = files::while_no_port_opens(|| command.spawn()).unwrap();
    // The command holds the slave open.
    drop(command);
    let mut bytes = Vec::new();
    // The end of a terminal is an error, when its other end is closed.
    let _ = master.read_to_end(&mut bytes);
    let status = child.wait().unwrap();
    let text = String::from_utf8(bytes).unwrap();
    assert_eq!(status.code(), Some(code), "ril {args}: {text}");
    let lines: Vec<String> = text
        .lines()
        .map(|line| line.trim_end().to_owned())
        .collect();
    for line in &lines {
        assert!(line.chars().count() <= 80, "ril {args}: {line:?} wraps");
    }
    assert!(!lines.is_empty(), "ril {args} wrote nothing");
    lines
}

#[test]
fn a_path_on_a_terminal_has_one_line_that_is_renewed_until_it_is_done() {
    let rig = sandbox();
    let flight = Flight::begin(&rig);
    let lines = on_terminal(&rig, "goto +20,+0", 0);
    let text = lines.join("\n");
    assert!(text.contains("goto: 1 waypoint, "), "{text}");
    assert!(text.contains(" m to go"), "{text}");
    // Each is gone before the next one, and the last one before the end: one line up, and the rest of the screen erased.
    let shown =
        text.matches("goto: 1 waypoint, ").count() + text.matches("goto: 0 waypoints, ").count();
    let erased = text.matches("\u{1b}[1A\u{1b}[J").count();
    assert_eq!(shown, erased, "{text}");
    // What was reported stands.
    assert!(text.contains("goto: done, 1 of 1 waypoints sent"), "{text}");
    flight.end();
}
