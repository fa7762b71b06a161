//! Who commands what: hold and pre-emption, parameters, the geofence, and which robot is meant.
//!
//! Most tests run against a stand-in for the bridge. Those whose name begins with `the_real_bridge` run the real processes.

mod common;

use std::fmt::Write as _;

use common::{Rig, end, json, says};
use dsp_protocol::port;
use ipc_types::RobotId;
use ipc_types::code::{
    ControlCommand, MovementKind, ParameterOperation, Reason, SafetyRule, Stage,
};
use ipc_types::payload::{ModuleControl, MovementData, ParameterRequest, RequestReport};
use ril_tests::process::Signal;
use ril_tests::{Answer, Process, Received, StandInBridge, StandInPort};

fn movement(received: Received) -> MovementData {
    match received {
        Received::Movement(movement) => movement,
        other => panic!("a movement was expected: {other:?}"),
    }
}

fn parameter(received: Received) -> ParameterRequest {
    match received {
        Received::Parameter(request) => request,
        other => panic!("a parameter was expected: {other:?}"),
    }
}

/// The next request that is no lookup of a name in the list.
fn written_or_read(bridge: &StandInBridge) -> ParameterRequest {
    loop {
        let request = parameter(bridge.next_request());
        if request.operation() != Some(ParameterOperation::List) {
            return request;
        }
    }
}

#[test]
fn hold_always_pre_empts_and_the_others_when_they_are_told_to() {
    let rig = Rig::new();
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
    let rig = Rig::new();
    let bridge = StandInBridge::start(&rig.domain);
    for next in ["hold", "land --preempt", "goto 37,-6,30 --preempt"] {
        bridge.answer_next(Answer::under_way());
        let mut path = rig.start("goto 37,-6,20");
        path.wait_for_text("the path is complete");
        let busy = rig.run("land", 5);
        assert!(
            says(&busy.stderr, "replace a path with --preempt"),
            "{busy:#?}"
        );
        rig.run(next, 0);
        let finished = path.wait_exit();
        assert_eq!(finished.code(), Some(5), "{next}: {finished:#?}");
        assert!(
            says(&finished.stdout, "goto: aborted (replaced)"),
            "{next}: {finished:#?}"
        );
        assert!(
            says(&finished.stderr, "took its place"),
            "{next}: {finished:#?}"
        );
    }
}

#[test]
fn a_refusal_says_rule_leg_and_amount_and_one_by_the_dsp_its_error() {
    let rig = Rig::new();
    let bridge = StandInBridge::start(&rig.domain);
    bridge.answer_next(Answer::Reports(vec![RequestReport {
        rule: SafetyRule::FenceCeiling.code(),
        waypoint: 3,
        value: 4.2,
        value_valid: 1,
        ..RequestReport::new(Stage::Refused, Reason::FenceBreach)
    }]));
    let finished = rig.run("goto 37,-6,200", 5);
    let expected = "(fence-breach: fence-ceiling, leg 3, by 4.2 m)";
    assert!(says(&finished.stdout, expected), "{finished:#?}");
    assert!(says(&finished.stderr, expected), "{finished:#?}");

    let refused = RequestReport {
        waypoint: 2,
        dsp_error_code: 30,
        dsp_error_valid: 1,
        ..RequestReport::new(Stage::Aborted, Reason::RefusedByDsp)
    };
    bridge.answer_next(Answer::Reports(vec![refused]));
    let finished = rig.run("goto 37,-6,200", 5);
    let expected = "(refused-by-dsp: waypoint 2, dsp-error-30 (invalid command))";
    assert!(says(&finished.stderr, expected), "{finished:#?}");

    bridge.answer_next(Answer::Reports(vec![refused]));
    let finished = rig.run("goto 37,-6,200 --json", 5);
    let report = json(&finished.stdout[0]);
    assert_eq!(
        (&report["waypoint"], &report["dsp_error_code"]),
        (&2.into(), &30.into())
    );
}

#[test]
fn a_take_off_prints_the_height_that_was_reached() {
    let rig = Rig::new();
    let bridge = StandInBridge::start(&rig.domain);
    bridge.answer_next(Answer::Reports(vec![RequestReport {
        value: 9.84,
        value_valid: 1,
        ..RequestReport::new(Stage::Done, Reason::None)
    }]));
    let finished = rig.run("takeoff --altitude 10", 0);
    let expected = "takeoff: done, 9.8 m over the point of take-off";
    assert_eq!(finished.stdout, [expected]);
}

#[test]
fn the_geofence_is_read_again() {
    let rig = Rig::new();
    let bridge = StandInBridge::start(&rig.domain);
    rig.run("fence reload --deadline 70", 0);
    let Received::Control(request) = bridge.next_request() else {
        panic!("no control");
    };
    let expected = ModuleControl::new(request.request_id, ControlCommand::ReloadFence);
    assert_eq!(
        request,
        ModuleControl {
            deadline_ms: 70,
            ..expected
        }
    );
    bridge.answer_next(Answer::refuse(Reason::InvalidFence));
    let finished = rig.run("fence reload", 5);
    let expected = "fence reload was refused (invalid-fence): ";
    assert!(says(&finished.stderr, expected), "{finished:#?}");
}

#[test]
fn parameters_are_listed_with_who_may_write_them() {
    let rig = Rig::new();
    let bridge = StandInBridge::start(&rig.domain);
    let finished = rig.run("param list", 0);
    let row = |name: &str| {
        let mut rows = finished.stdout.iter();
        let row = rows.find(|row| row.contains(name));
        let row = row.unwrap_or_else(|| panic!("{name}: {finished:#?}"));
        row.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    assert_eq!(row("NAME"), "NUMBER NAME KIND RANGE WRITABLE");
    assert_eq!(
        row("cruise_speed_mps"),
        "20000 cruise_speed_mps f32 0.1 to 20 yes"
    );
    assert_eq!(
        row("trim_tail_us"),
        "10203 trim_tail_us i16 -500 to 500 on the ground"
    );
    assert_eq!(row("take_off "), "10121 take_off u16 1 to 1 no");
    assert_eq!(
        finished.stdout.len(),
        1 + port::PORTS_16.len() + port::PORTS_32.len()
    );

    let lines = rig.run("param list --json", 0).stdout;
    assert_eq!(lines.len(), finished.stdout.len() - 1);
    let of = |name: &str| {
        let mut reports = lines.iter().map(|line| json(line));
        reports
            .find(|report| report["port"]["name"] == name)
            .unwrap_or_else(|| panic!("{name}: {lines:#?}"))
    };
    let gain = of("position_gain");
    assert_eq!(gain["schema"], "hero.RequestReport.v2");
    assert_eq!(gain["request"], "param list");
    let expected = serde_json::json!({
        "number": 20_010, "name": "position_gain", "kind": "f32", "min": 0.05, "max": 5.0,
        "writable": true, "writable_in_flight": false,
    });
    assert_eq!(gain["port"], expected);
    drop(bridge);
}

#[test]
fn a_parameter_is_read_and_written_by_name_and_by_number() {
    let rig = Rig::new();
    let bridge = StandInBridge::start(&rig.domain);
    assert_eq!(rig.run("param get yaw_gain", 0).stdout, ["yaw_gain = 1.5"]);
    assert_eq!(written_or_read(&bridge).port, u32::from(port::YAW_GAIN));
    for (name, value, number) in [
        ("yaw_gain", "0.7", port::YAW_GAIN),
        ("20013", "0.8", port::YAW_GAIN),
        ("trim_tail_us", "-40", port::TRIM_TAIL_US),
    ] {
        let finished = rig.run(&format!("param set {name} {value} --deadline 70"), 0);
        let request = written_or_read(&bridge);
        assert_eq!(request.operation(), Some(ParameterOperation::Write));
        assert_eq!((request.port, request.deadline_ms), (number.into(), 70));
        let written = bridge.port(number).unwrap();
        assert_eq!(
            finished.stdout,
            [format!("{} = {value}", written.name)],
            "{name}"
        );
        assert_eq!(written.value as f32, value.parse::<f32>().unwrap());
    }
    let report = json(&rig.run("param get trim_tail_us --json", 0).stdout[0]);
    assert_eq!(
        (&report["value"], &report["port"]["name"]),
        (&(-40.0).into(), &"trim_tail_us".into())
    );
}

#[test]
fn a_parameter_that_cannot_be_set_is_refused_with_the_reason() {
    let rig = Rig::new();
    let bridge = StandInBridge::start(&rig.domain);
    bridge.set_port(StandInPort {
        refuses_with: Some(30),
        ..bridge.port(port::YAW_GAIN).unwrap()
    });
    bridge.publish(&ipc_types::payload::DspTelemetry {
        flying: 1,
        ..Default::default()
    });
    bridge.set_port(StandInPort {
        writable_in_flight: true,
        ..bridge.port(port::YAW_GAIN).unwrap()
    });
    for (args, code, expected) in [
        (
            "set yaw_gian 1",
            2,
            "no parameter has the name `yaw_gian`; did you mean `yaw_gain`?",
        ),
        ("get zzz", 2, "`ril param list` shows all names"),
        (
            "get 9999",
            5,
            "refused (no-such-port): the port does not exist",
        ),
        ("set take_off 1", 5, "refused (no-such-port)"),
        (
            "set cruise_speed_mps 21",
            5,
            "refused (out-of-range): cruise_speed_mps takes 0.1 to 20",
        ),
        (
            "set status_period_ms 20.5",
            5,
            "status_period_ms takes whole numbers from 1 to 10000",
        ),
        (
            "set trim_tail_us 4",
            5,
            "refused (not-in-flight): the port may not be written while the helicopter flies",
        ),
        (
            "set yaw_gain 1",
            5,
            "refused (refused-by-dsp: dsp-error-30 (invalid command)): the DSP did not take the value",
        ),
    ] {
        let finished = rig.run(&format!("param {args}"), code);
        assert!(says(&finished.stderr, expected), "{args}: {finished:#?}");
    }
    bridge.answer_next(Answer::refuse(Reason::LinkDown));
    rig.run("param get 20013", 6);
    bridge.answer_next(Answer::Hang);
    rig.run("param get 20013 --timeout 0.1", 4);
}

#[test]
fn a_path_of_1024_waypoints_comes_from_a_file() {
    let rig = Rig::new();
    let bridge = StandInBridge::start(&rig.domain);
    let mut text = String::from("# a survey\n");
    for index in 0..1024 {
        writeln!(text, "37.{index:04},-6,20 # {index}").unwrap();
    }
    rig.write("survey.path", &text);
    let finished = rig.run("goto --file survey.path", 0);
    assert!(
        says(
            &finished.stdout,
            "waypoint 1024 of 1024 accepted, the path is complete"
        ),
        "{finished:#?}"
    );
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
        let finished = rig.run(&format!("goto --file {file}"), 2);
        assert!(says(&finished.stderr, expected), "{finished:#?}");
    }
    let finished = rig.run("goto --file absent.path", 2);
    assert!(
        says(&finished.stderr, "absent.path: cannot be read"),
        "{finished:#?}"
    );
}

#[test]
fn standard_input_is_a_file_of_waypoints() {
    let rig = Rig::new();
    let bridge = StandInBridge::start(&rig.domain);
    rig.write("path", "-37,-6,20\n");
    let command = rig.shell("exec \"$0\" goto --file - < path");
    let finished = Process::spawn(&rig.domain, command).wait_exit();
    assert_eq!(finished.code(), Some(0), "{finished:#?}");
    assert_eq!(movement(bridge.next_request()).latitude_deg, -37.0);
}

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
    let rig = Rig::new();
    let robots = [2, 1].map(|id| RobotId::new(id).unwrap());
    let bridges = robots.map(|robot| StandInBridge::start_for(&rig.domain, robot));
    for args in COMMANDS {
        let finished = rig.run(args, 2);
        let expected = "several robots are alive (1, 2) and none was named";
        assert!(says(&finished.stderr, expected), "{args}: {finished:#?}");
        assert!(finished.stdout.is_empty(), "{args}: {finished:#?}");
        // Named, it is sent.
        rig.run(&format!("{args} --robot 2"), 0);
        bridges[0].next_request();
    }
    // The environment names it, too.
    let mut command = rig.command(["hold"]);
    command.env("RIL_ROBOT", "1");
    let finished = Process::spawn(&rig.domain, command).wait_exit();
    assert_eq!(finished.code(), Some(0), "{finished:#?}");
    // Nothing was sent to robot 1 before.
    assert_eq!(
        movement(bridges[1].next_request()).kind(),
        Some(MovementKind::Hold)
    );
    // What only looks has a default.
    rig.run("state", 0);
    rig.run("param list", 0);
    rig.run("param get yaw_gain", 0);

    // Robot 2 alone is not taken in the place of the default, but named.
    let [two, one] = bridges;
    one.die();
    let finished = rig.run("hold", 3);
    let expected = "robot 2 is alive: name it with --robot 2";
    assert!(says(&finished.stderr, expected), "{finished:#?}");
    drop(two);
}

#[test]
fn the_real_bridges_of_two_robots_are_told_apart() {
    let rig = Rig::new();
    let sims = [1, 2].map(|robot| rig.sim(robot, ""));
    let mut bridges = [1, 2].map(|robot| rig.bridge(robot)).map(Some);
    for args in ["stop", "land", "takeoff --altitude 5"] {
        let finished = rig.run(args, 2);
        assert!(
            says(&finished.stderr, "alive (1, 2)"),
            "{args}: {finished:#?}"
        );
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

/// A simulator and a bridge, started and in the air; the place as `LATITUDE,LONGITUDE` and the altitude, m.
struct Flight {
    sim: Process,
    bridge: Process,
    place: (f64, f64, f64),
}

impl Flight {
    fn begin(rig: &Rig) -> Flight {
        let sim = rig.sim(1, "--speed 10");
        let bridge = rig.bridge(1);
        rig.watch(1).until_ready();
        rig.run("start", 0);
        rig.run("takeoff --altitude 10", 0);
        let sample = json(
            &rig.run("echo dsp --count 1 --json --field geographic", 0)
                .stdout[0],
        );
        let value = |name: &str| sample["geographic"][name].as_f64().unwrap();
        Flight {
            place: (
                value("latitude_deg"),
                value("longitude_deg"),
                value("altitude_m"),
            ),
            sim,
            bridge,
        }
    }

    /// A path of 5 km, which takes minutes.
    fn far_away(&self, rig: &Rig) -> Process {
        let (latitude, longitude, altitude) = self.place;
        let remote = latitude + 0.045;
        let mut path = rig.start(&format!("goto {remote},{longitude},{altitude}"));
        path.wait_for_text("goto: progress");
        path
    }

    fn end(self) {
        for process in [self.bridge, self.sim] {
            end(process, Signal::INT);
        }
    }
}

fn was_replaced(mut path: Process) {
    let finished = path.wait_exit();
    assert_eq!(finished.code(), Some(5), "{finished:#?}");
    assert!(
        says(&finished.stdout, "goto: aborted (replaced)"),
        "{finished:#?}"
    );
}

#[test]
fn the_real_bridge_holds_replaces_and_lands_in_the_middle_of_a_path() {
    let rig = Rig::new();
    let flight = Flight::begin(&rig);
    let (latitude, longitude, altitude) = flight.place;
    let path = flight.far_away(&rig);
    rig.run("land", 5);
    rig.run("hold", 0);
    was_replaced(path);
    let state = json(&rig.run("state --json", 0).stdout[0]);
    assert_eq!(state["link"]["dsp_path"], "empty");

    let path = flight.far_away(&rig);
    rig.run(
        &format!("goto {latitude},{longitude},{altitude} --preempt"),
        0,
    );
    was_replaced(path);

    let path = flight.far_away(&rig);
    rig.run("land --preempt", 0);
    was_replaced(path);
    let state = json(&rig.run("state --json", 0).stdout[0]);
    assert_eq!(state["movement"]["kind"], "land");
    assert_eq!(state["link"]["dsp_path"], "empty");
    flight.end();
}

#[test]
fn the_real_bridge_serves_the_dsp_s_parameters() {
    let rig = Rig::new();
    let sim = rig.sim(1, "--speed 10");
    let bridge = rig.bridge(1);
    rig.watch(1).until_ready();
    let list = rig.run("param list", 0);
    assert!(says(&list.stdout, "cruise_speed_mps"), "{list:#?}");
    for (args, expected) in [
        ("set cruise_speed_mps 7.5", "cruise_speed_mps = 7.5"),
        ("get cruise_speed_mps", "cruise_speed_mps = 7.5"),
        ("set trim_tail_us -40", "trim_tail_us = -40"),
        ("get 10203", "trim_tail_us = -40"),
    ] {
        assert_eq!(rig.run(&format!("param {args}"), 0).stdout, [expected]);
    }
    for (args, reason) in [
        ("set cruise_speed_mps 21", "out-of-range"),
        ("set 10121 1", "no-such-port"),
        ("get 9999", "no-such-port"),
    ] {
        let finished = rig.run(&format!("param {args}"), 5);
        let expected = format!("refused ({reason})");
        assert!(says(&finished.stderr, &expected), "{args}: {finished:#?}");
    }
    for process in [bridge, sim] {
        end(process, Signal::INT);
    }

    let flight = Flight::begin(&rig);
    let finished = rig.run("param set trim_tail_us 10", 5);
    assert!(says(&finished.stderr, "not-in-flight"), "{finished:#?}");
    rig.run("param set cruise_speed_mps 6", 0);
    flight.end();
}

#[test]
fn the_real_bridge_takes_a_path_of_1024_waypoints() {
    let rig = Rig::new();
    let flight = Flight::begin(&rig);
    let (latitude, longitude, altitude) = flight.place;
    let mut text = String::new();
    for index in 0..1024 {
        let north = latitude + f64::from(index + 1) * 2e-5;
        writeln!(text, "{north},{longitude},{altitude}").unwrap();
    }
    rig.write("survey.path", &text);
    let mut path = rig.start("goto --file survey.path");
    path.wait_for_text("waypoint 1024 of 1024 accepted, the path is complete");
    rig.run("hold", 0);
    was_replaced(path);
    flight.end();
}
