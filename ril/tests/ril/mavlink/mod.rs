//! `ril run mavlink` beside a real robot, as a ground station sees it.

mod fences;
mod late;
mod missions;

use std::fs::{self, Permissions};
use std::net::UdpSocket;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use endurance::mavlink::station::{Received, Station};
use ipc_types::payload::MavlinkStations;
use ril_tests::process::{Signal, WAIT_LIMIT};
use ril_tests::{Process, Sandbox, languages, packages};

use crate::common::{end, end_all, json, sandbox, shown_state};

const NAN: f32 = f32::NAN;

/// Modes of PX4, as the heartbeat has them.
const HOLD: u32 = 0x0304_0000;
const LAND: u32 = 0x0604_0000;
const RETURN: u32 = 0x0504_0000;
const OFFBOARD: u32 = 0x0006_0000;

/// A gateway for this station. What a stall of the machine makes of ages and answers is no part of these tests, unless
/// `lost_s` says so.
fn gateway(rig: &Sandbox, port: u16, lost_s: f64) -> Process {
    gateway_with(rig, port, lost_s, "")
}

/// A gateway for this station with more lines of `mavlink.toml`.
fn gateway_with(rig: &Sandbox, port: u16, lost_s: f64, more: &str) -> Process {
    let config = format!(
        "port = 0\nstations = ['127.0.0.1:{port}']\nlost_s = {lost_s}\nanswer_s = 60.0\nstate = 'state'\n{more}"
    );
    rig.write("mavlink.toml", &config);
    rig.start_ready("run mavlink")
}

#[test]
fn a_station_arms_takes_off_flies_there_holds_and_lands() {
    let rig = sandbox();
    let robot = rig.start_robot(1, 10);
    let mut station = Station::new();
    let gateway = gateway(&rig, station.port(), 60.0);
    station.connect();
    // What nothing is done for is not supported.
    assert_eq!(station.command(2000, [0.0; 7]), 3);
    let on_ground = |message: &Received| message.is(245) && message.u8(1) == 1;
    station.until("on the ground", on_ground);
    assert_eq!(station.command(400, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]), 0);
    station.until("armed", |message| message.is(0) && message.u8(6) & 128 != 0);
    assert_eq!(station.command(22, [NAN, 0.0, 0.0, NAN, NAN, NAN, NAN]), 0);
    station.until_text("take-off done");
    station.until("in the air", |message| {
        message.is(245) && message.u8(1) == 2
    });
    // Kill, and "emergency stop" of QGroundControl.
    assert_eq!(
        station.command(400, [0.0, 21_196.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        2
    );
    rig.run("control show", 0).out_says("control of robot 1: ");
    let shown = rig.run("mavlink status", 0);
    shown.out_says("helicopter  heard for ");
    shown.out_says("station     255/190 at 127.0.0.1:");
    shown.out_says("may command");

    let here = station.until("a position", |message| {
        message.is(33) && message.i32(16) > 5_000
    });
    let (latitude, longitude) = (here.i32(4), here.i32(8));
    // 5 km to the north, 15 m above home: it takes minutes.
    assert_eq!(
        station.reposition(6, latitude + 450_000, longitude, 15.0),
        0
    );
    station.until_mode(OFFBOARD);
    assert_eq!(station.command(193, [0.0; 7]), 0);
    station.until_mode(HOLD);
    assert_eq!(station.command(21, [0.0, 0.0, 0.0, NAN, NAN, NAN, 0.0]), 0);
    station.until_mode(LAND);
    station.until_text("land done");
    station.until("on the ground", on_ground);
    end(gateway, Signal::TERM);
    robot.end();
}

#[test]
fn a_gateway_that_is_killed_in_flight_knows_home_when_it_starts_again() {
    let rig = sandbox();
    let robot = rig.start_robot(1, 10);
    let mut station = Station::new();
    let mut first = gateway(&rig, station.port(), 60.0);
    station.connect();
    assert_eq!(station.command(22, [NAN, 0.0, 0.0, NAN, NAN, NAN, NAN]), 0);
    station.until_text("take-off done");
    first.signal(Signal::KILL);
    first.wait_status();
    let gateway = gateway(&rig, station.port(), 60.0);
    station.reconnect();
    assert_eq!(station.command(20, [0.0; 7]), 0, "a return");
    station.until_mode(RETURN);
    station.until("on the ground", |message| {
        message.is(245) && message.u8(1) == 1
    });
    end(gateway, Signal::TERM);
    robot.end();
}

#[test]
fn a_helicopter_that_is_not_heard_is_silent_and_its_orders_are_refused() {
    let rig = sandbox();
    let robot = rig.start_robot(1, 1);
    let mut station = Station::new();
    let gateway = gateway(&rig, station.port(), 2.0);
    station.connect();
    end(robot.status, Signal::TERM);
    // Samples of before may still be new.
    station.until_not_heard();
    let shown = rig.run("mavlink status --json", 6);
    shown.out_says("\"helicopter\":\"no-telemetry\"");
    shown.err_says("nothing is sent to stations: no telemetry comes");
    let between = station.between_command(193, [0.0; 7]);
    assert!(
        between
            .iter()
            .all(|message| message.is(77) || message.is(253)),
        "{between:?}"
    );
    let status = rig.status(1);
    station.until("its heartbeat", |message| message.is(0));
    end_all([gateway, status, robot.bridge, robot.sim]);
}

#[test]
fn a_wrong_configuration_is_refused_and_a_port_has_one_owner() {
    let rig = sandbox();
    rig.write("mavlink.toml", "\nlisten = '0.0.0.0'\n");
    for command in ["run mavlink", "run mavlink --check-config"] {
        let wrong = rig.run(command, 78);
        wrong.err_says("mavlink.toml:2: MAVLink is not protected");
    }
    rig.write("mavlink.toml", "key = 'no-such.key'\nport = 0\n");
    rig.run("mavlink", 78)
        .err_says("the key of signatures no-such.key cannot be used");
    rig.write("mavlink.toml", "take_off_m = 5.0\n");
    rig.run("run mavlink --check-config", 0)
        .out_says("take_off_m = 5.0");
    let other = UdpSocket::bind("127.0.0.1:0").expect("a free port");
    let port = other.local_addr().expect("an address").port();
    rig.write("mavlink.toml", &format!("port = {port}\n"));
    rig.run("mavlink", 1)
        .err_says(format!("UDP port {port} is in use"));
}

/// In the order of QGroundControl: send, read, start, pause, go on.
#[test]
fn pymavlink_sends_and_flies_a_mission_as_qgroundcontrol_does() {
    judged("qgc_mission.py", "pymavlink==2.4.50", &[], "", |_| {});
}

/// A script that knows nothing of this project flies the helicopter.
#[test]
fn mavsdk_flies_a_mission_and_all_its_actions() {
    judged("mavsdk_flies.py", "mavsdk==4.1.0", &[], "", |_| {});
}

/// The first steps of docs/mavlink.md work.
#[test]
fn the_example_of_mavsdk_flies_its_mission() {
    let script = languages::root().join("examples/python/mavsdk_mission.py");
    flown(&script, "landed", "mavsdk==4.1.0", &[], "", |_| {});
}

/// Runs a judge in Python: with its station's port, `words` behind it, and more lines of `mavlink.toml`.
fn judged(script: &str, packages: &str, words: &[&str], config: &str, look: impl FnOnce(&Sandbox)) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/ril/mavlink");
    let script = folder.join(script);
    flown(&script, "all is well", packages, words, config, look);
}

/// Runs any such program, whose last line says that it has done everything.
fn flown(
    script: &Path,
    last_line: &str,
    packages: &str,
    words: &[&str],
    config: &str,
    look: impl FnOnce(&Sandbox),
) {
    let rig = sandbox();
    let what = format!("{} with {packages}", script.display());
    let python = match packages::python(packages) {
        Ok(python) => python,
        Err(why) => return languages::skip(&what, &why),
    };
    let robot = rig.start_robot(1, 10);
    let port = Station::new().port();
    rig.write("mavlink.key", &format!("{PASSPHRASE}\n"));
    fs::set_permissions(rig.path("mavlink.key"), Permissions::from_mode(0o600)).expect("a mode");
    let gateway = gateway_with(&rig, port, 60.0, config);
    let mut judge = std::process::Command::new(python);
    judge.args(["-u", "-B"]).arg(script);
    judge.arg(port.to_string()).args(words);
    let mut judge = rig.spawn(rig.place(judge));
    // It waits for each step of the flight as long as every test does for one.
    judge.wait_for_line_within(8 * WAIT_LIMIT, |line| line.text == last_line);
    judge.exits(0);
    look(&rig);
    end(gateway, Signal::TERM);
    robot.end();
}

/// What the stations of these tests sign with.
const PASSPHRASE: &str = "correct horse battery";

/// What a fence of the station is in `ril fence show`.
fn shows_fence(rig: &Sandbox, areas: &[&str]) {
    let shown = rig.run("fence show", 0);
    for area in areas {
        shown.out_says(area);
    }
}

#[test]
fn mavsdk_brings_a_fence_into_force_that_the_flight_keeps_to() {
    let config = "[fence]\naccept = true\n";
    judged("mavsdk_fence.py", "mavsdk==4.1.0", &[], config, |rig| {
        let areas = [
            "in force: 2 areas",
            "inclusion plan: inclusion 1: ",
            "exclusion plan: exclusion 2: circle of 20.0 m",
        ];
        shows_fence(rig, &areas);
    });
}

/// MAVProxy without what it needs for windows and maps.
const MAVPROXY: &str = "--no-deps mavproxy==1.8.75 pymavlink==2.4.50 pyserial==3.5 fastcrc==0.5.0";

#[test]
fn mavproxy_brings_a_fence_into_force_reads_and_clears_it() {
    let config = "[fence]\naccept = true\n";
    judged("mavproxy_fence.py", MAVPROXY, &[], config, |rig| {
        let areas = [
            "in force: 1 area",
            "exclusion plan: exclusion 1: circle of 25.0 m",
        ];
        shows_fence(rig, &areas);
    });
}

/// It pauses the mission, and returns.
#[test]
fn mavproxy_fetches_parameters_and_flies_a_mission_that_it_has_loaded() {
    judged("mavproxy_flies.py", MAVPROXY, &[], "", |rig| {
        // Those of the DSP are the ports that can be written.
        let listed = rig.run("param list --json", 0).stdout;
        let is_writable = |line: &&String| json(line)["port"]["writable"] == true;
        let writable = listed.iter().filter(is_writable).count();
        let fetched = fs::read_to_string(rig.path("mav.parm")).expect("MAVProxy has saved it");
        let ports = fetched.lines().filter(|row| row.starts_with("DSP_"));
        assert_eq!(ports.count(), writable, "{fetched}");
        // Set by the mission, after MAVProxy had set another one.
        rig.run("param get cruise_speed_mps", 0)
            .out_says("cruise_speed_mps = 7");
        assert_eq!(shown_state(rig, 1)["flight"]["phase"], "on the ground");
        // Arm, mission, hold, return. Counts alone are published once a second.
        let mut stations = rig.subscribe::<MavlinkStations>(1);
        stations.until("each command was taken once", |sample| {
            sample.stations().iter().any(|one| one.commands == 4)
        });
    });
}

/// Both sides sign; what was recorded or has another key is dropped.
#[test]
fn pymavlink_signs_and_takes_signatures_alone() {
    let config = "key = 'mavlink.key'\n";
    let (script, package) = ("signed.py", "pymavlink==2.4.50");
    judged(script, package, &[PASSPHRASE], config, |rig| {
        // Counts alone are published once a second.
        let mut stations = rig.subscribe::<MavlinkStations>(1);
        stations.until("what was dropped is counted", |sample| {
            sample.refused_signature == 1 && sample.refused_replayed == 3
        });
        let shown = rig.run("mavlink status", 0);
        shown.out_says("signatures  asked for");
        shown.out_says("1 with a signature of another key, 3 with an old signature");
        let kept = fs::read_to_string(rig.path("state/robot-1.timestamp")).expect("it is kept");
        assert!(
            kept.trim().parse::<u64>().is_ok_and(|kept| kept > 0),
            "{kept}"
        );
    });
}

/// By a library that others wrote: bytes, checksums and a flight.
#[test]
fn pymavlink_flies_the_helicopter() {
    judged("judge.py", "pymavlink==2.4.50", &[], "", |_| {});
}
