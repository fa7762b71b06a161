//! Orders go out first: neither a disk that hangs nor an output that nobody reads keeps an order from the bridge, a
//! signal or the next step from being handled, or the command from its end.

use std::fs::OpenOptions;
use std::io::Read;
use std::os::unix::fs::OpenOptionsExt;
use std::time::{Duration, Instant};

use ipc_types::code::{ControlCommand, Functionality, MovementKind, Reason, Stage};
use ipc_types::payload::RequestReport;
use ril_tests::process::{Finished, Signal};
use ril_tests::sandbox::FOR_SLOW_MACHINES;
use ril_tests::{Answer, Process, Received, Sandbox, StandInBridge, UnreadOutput};
use rustix::fs::{CWD, Mode, OFlags, mkfifoat};

use crate::common::{json, movement, sandbox, shown_state, start_robot};
use crate::plans::check::SQUARE;
use crate::waits::has_strace;

/// Longest time until a process has ended after a signal.
const END_LIMIT: Duration = Duration::from_secs(3);

/// The tries of each kind.
const TRIES: usize = 6;

/// `ril` with the pipe `unread` as its standard output.
fn unread(rig: &Sandbox, args: &str) -> Process {
    rig.spawn(rig.shell(&format!("exec \"$0\" {args} >{}", UnreadOutput::NAME)))
}

/// Ends a process by a signal, in time.
fn ends_in_time(process: &mut Process, signal: Signal, code: i32) -> Finished {
    let begin = Instant::now();
    process.signal(signal);
    let finished = process.exits(code);
    let took = begin.elapsed();
    assert!(took < END_LIMIT, "{took:?}");
    finished
}

fn accepted() -> Answer {
    Answer::Reports(vec![RequestReport::new(Stage::Accepted, Reason::None)])
}

#[test]
fn a_goto_whose_output_is_not_read_ends_at_a_signal_and_its_path_with_it() {
    let rig = sandbox();
    let _pipe = UnreadOutput::full(&rig);
    let bridge = StandInBridge::start(&rig.domain);
    for attempt in 0..TRIES {
        let (json, signal) = match attempt % 2 {
            0 => ("", Signal::TERM),
            _ => ("--json", Signal::INT),
        };
        bridge.answer_next(accepted());
        let mut path = unread(&rig, &format!("goto 37,-6,20 --sender-lost hold {json}"));
        let sent = movement(bridge.next_request());
        let under_way = RequestReport::new(Stage::Progress, Reason::None);
        bridge.report(sent.request_id, &under_way).unwrap();
        let finished = ends_in_time(&mut path, signal, 7);
        finished.err_says("the bridge lets the helicopter hover where it is");
        // To the bridge it is lost.
        let report = bridge.report(sent.request_id, &under_way);
        assert!(report.is_err(), "{attempt}: {report:?}");
    }
}

#[test]
fn what_waits_for_a_reader_who_is_late_arrives_in_order() {
    let rig = sandbox();
    let _pipe = UnreadOutput::full(&rig);
    let mut options = OpenOptions::new();
    options.custom_flags(OFlags::NONBLOCK.bits() as i32);
    let mut pipe = options
        .read(true)
        .open(rig.path(UnreadOutput::NAME))
        .unwrap();
    let bridge = StandInBridge::start(&rig.domain);
    bridge.answer_next(accepted());
    let mut path = unread(&rig, "goto 37,-6,20 --json --timeout 80s");
    let sent = movement(bridge.next_request());
    let under_way = RequestReport::new(Stage::Progress, Reason::None);
    for _ in 0..3 {
        bridge.report(sent.request_id, &under_way).unwrap();
    }
    let done = RequestReport::new(Stage::Done, Reason::None);
    bridge.report(sent.request_id, &done).unwrap();
    let mut text = Vec::new();
    let last = loop {
        let mut bytes = [0; 4096];
        match pipe.read(&mut bytes) {
            Ok(count) => text.extend(&bytes[..count]),
            Err(_) if !path.is_running() => break text,
            Err(_) => std::thread::yield_now(),
        }
    };
    path.exits(0);
    let text = String::from_utf8(last).unwrap();
    let lines: Vec<serde_json::Value> = text.trim_start_matches('x').lines().map(json).collect();
    let stages: Vec<_> = lines.iter().map(|line| &line["stage"]).collect();
    let expected = ["accepted", "progress", "progress", "progress", "done"];
    assert_eq!(stages, expected, "{text}");
}

#[test]
fn a_command_whose_output_is_never_read_ends_with_its_exit_code() {
    let rig = sandbox();
    let _pipe = UnreadOutput::full(&rig);
    let bridge = StandInBridge::start(&rig.domain);
    for (args, answer, code) in [
        ("land", Answer::done(), 0),
        ("takeoff 5m --json", Answer::refuse(Reason::Busy), 5),
        ("param list", Answer::done(), 0),
    ] {
        bridge.answer_next(answer);
        unread(&rig, args).exits(code);
    }
    unread(&rig, "wait --for up --timeout 100ms --json").exits(4);
    bridge.die();
    unread(&rig, "hold --json").exits(3);
}

#[test]
fn a_plan_whose_output_is_not_read_is_flown_and_ends_at_a_signal() {
    let rig = sandbox();
    rig.write("bridge.toml", FOR_SLOW_MACHINES);
    let _pipe = UnreadOutput::full(&rig);
    let robot = start_robot(&rig, 10);
    rig.run("start", 0);
    rig.write("square.waypoints", SQUARE);
    unread(&rig, "plan fly square.waypoints").exits(0);
    let state = shown_state(&rig, 1);
    assert_eq!(state["flight"]["flying"], false, "it has landed: {state}");
    // The landing is far away.
    rig.write(
        "far.waypoints",
        &SQUARE.replace("2 0 3 16 0 0 0 0 37.4113", "2 0 3 16 0 0 0 0 37.4513"),
    );
    let mut flown = unread(&rig, "plan fly far.waypoints --json");
    rig.watch(1).until("the path is flown", |state| {
        state.movement.kind() == Some(MovementKind::GoToWaypoint)
    });
    ends_in_time(&mut flown, Signal::TERM, 7);
    rig.watch(1).until("it hovers", |state| {
        state.functionality() == Some(Functionality::AtRest)
    });
    rig.run("land", 0);
    robot.end();
}

/// The request of an urgent order.
fn order(received: Received) -> String {
    match received {
        Received::Movement(order) => format!("{:?}", order.kind()),
        Received::Control(order) => format!("{:?}", order.command()),
        other => panic!("{other:?}"),
    }
}

/// A named pipe stands for what cannot be read, and a text that is wrong for a file that can.
#[test]
fn land_hold_and_stop_go_out_whatever_is_in_the_place_of_their_configuration() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    let mut none = rig.command(["land"]);
    none.env_remove("RIL_TIMEOUT");
    rig.spawn(none).exits(0);
    bridge.next_request();
    mkfifoat(CWD, rig.path("ril.toml"), Mode::RUSR | Mode::WUSR).unwrap();
    rig.write("wrong.toml", "[request]\ntimeout = 1\n");
    for (args, expected) in [
        ("land", format!("{:?}", Some(MovementKind::Land))),
        ("hold", format!("{:?}", Some(MovementKind::Hold))),
        ("hold --all", format!("{:?}", Some(MovementKind::Hold))),
        ("stop", format!("{:?}", Some(ControlCommand::Stop))),
    ] {
        for (config, reason) in [
            ("", "ril.toml: is a pipe"),
            ("--config wrong.toml", "did you mean `timeout_s`?"),
        ] {
            let line = format!("unset RIL_TIMEOUT; exec \"$0\" {args} {config}");
            let mut command = Process::spawn(&rig.domain, rig.shell(&line));
            command
                .exits(0)
                .err_says(reason)
                .err_says("the order goes on");
            assert_eq!(order(bridge.next_request()), expected, "{args}");
        }
    }
    // What is less urgent is not begun with a configuration that is wrong.
    rig.run("takeoff 5m", 78);
    rig.run("plan fly none.waypoints", 78);
}

/// `ril`, whose looks at this file strace answers with `fault`.
fn with_looks(rig: &Sandbox, file: &str, fault: &str, args: &str) -> Process {
    let line = format!(
        "unset RIL_TIMEOUT; exec strace -f -qq -P {file} -P \"$PWD/{file}\" --inject=%file,openat:{fault} \"$0\" {args}"
    );
    Process::spawn(&rig.domain, rig.shell(&line))
}

/// `ril`, whose every look at this file lasts long. Its tracer, and so this process, ends no sooner.
fn with_a_file_that_hangs(rig: &Sandbox, file: &str, args: &str) -> Process {
    with_looks(rig, file, "delay_enter=4000000", args)
}

fn with_a_disk_that_hangs(rig: &Sandbox, args: &str) -> Process {
    with_a_file_that_hangs(rig, "ril.toml", args)
}

/// The process stands still at its first look at `ril.toml`: the bridge has the request by then, or has none.
#[test]
fn what_is_urgent_is_sent_before_the_first_look_at_the_configuration_and_nothing_else_is() {
    if !has_strace("the order of request and configuration") {
        return;
    }
    let rig = sandbox();
    rig.write("ril.toml", "");
    let bridge = StandInBridge::start(&rig.domain);
    let movement = |kind| Some(format!("{:?}", Some(kind)));
    for (args, sent) in [
        ("land", movement(MovementKind::Land)),
        ("land --preempt --json", movement(MovementKind::Land)),
        ("land --robot 1", movement(MovementKind::Land)),
        ("hold", movement(MovementKind::Hold)),
        ("hold --all", movement(MovementKind::Hold)),
        ("stop", Some(format!("{:?}", Some(ControlCommand::Stop)))),
        ("takeoff 5m", None),
        ("goto 37,-6,20", None),
    ] {
        let mut command = with_looks(&rig, "ril.toml", "signal=STOP:when=1", args);
        command.wait_for_text("stopped by SIGSTOP");
        match &sent {
            Some(expected) => assert_eq!(&order(bridge.next_request()), expected, "{args}"),
            None => assert!(bridge.take_requests().is_empty(), "{args}"),
        }
        // Each of its threads stands still once.
        while command.is_running() {
            command.signal_group(Signal::CONT);
        }
        command.exits(0);
        if sent.is_none() {
            bridge.next_request();
        }
    }
}

#[test]
fn orders_wait_for_a_disk_that_hangs_no_longer_than_the_limit() {
    if !has_strace("orders of a disk that hangs") {
        return;
    }
    let rig = sandbox();
    rig.write("ril.toml", "");
    let bridge = StandInBridge::start(&rig.domain);
    for args in ["land", "hold", "stop", "takeoff 5m", "goto 37,-6,20"] {
        let finished = with_a_disk_that_hangs(&rig, args).exits(0);
        finished.err_says("ril.toml: was not read within 300ms");
        finished.err_says("the order goes on with the built-in values");
        bridge.next_request();
    }
    // What is not known may forbid a plan.
    rig.write("square.waypoints", SQUARE);
    let finished = with_a_disk_that_hangs(&rig, "plan fly square.waypoints").exits(78);
    finished.err_says("ril.toml: was not read within 300ms");
    assert!(bridge.take_requests().is_empty());
    // What only shows something goes on.
    let mut shown = with_a_disk_that_hangs(&rig, "status --timeout 100ms");
    let shown = shown.wait_exit();
    shown.err_says("ril.toml: was not read within 1s");
    shown.err_says("the command goes on with the built-in values");
}

#[test]
fn a_start_does_not_wait_for_a_look_at_a_disk_that_hangs() {
    if !has_strace("a start beside a disk that hangs") {
        return;
    }
    let rig = sandbox();
    let robot = start_robot(&rig, 1);
    rig.write("status.toml", "");
    let finished = with_a_file_that_hangs(&rig, "status.toml", "start").exits(0);
    finished.err_says("whether the robot is ready is not known");
    robot.end();
}
