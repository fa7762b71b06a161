//! Requests against a bridge that answers as it is told: what is sent, what is printed, how it ends.

use crate::common::{end, json, movement, sandbox, says, shown_state};
use ipc_types::code::{
    ControlCommand, MovementKind, ParameterOperation, Reason, SenderLost, Stage,
};
use ipc_types::payload::{ModuleControl, MovementData, RequestReport};
use ril_tests::process::Signal;
use ril_tests::{Answer, Process, Received, StandInBridge, stand_in};

fn control(received: Received) -> ModuleControl {
    match received {
        Received::Control(control) => control,
        other => panic!("a control was expected: {other:?}"),
    }
}

/// Accepted, and nothing more: the request stays open.
fn accepted() -> Answer {
    Answer::Reports(vec![RequestReport::new(Stage::Accepted, Reason::None)])
}

#[test]
fn each_command_sends_its_request() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    for (verb, command) in [
        ("start", ControlCommand::Start),
        ("stop", ControlCommand::Stop),
        ("fence reload", ControlCommand::ReloadFence),
    ] {
        let finished = rig.run(verb, 0);
        assert_eq!(
            finished.stdout,
            [format!("{verb}: accepted"), format!("{verb}: done")]
        );
        assert_eq!(control(bridge.next_request()).command(), Some(command));
    }
    use MovementKind::{GoToWaypoint, Hold, Land, TakeOff};
    // The kind of each movement, its altitude, and of each request whether it may pre-empt.
    for (args, kind, altitude_m, preempt) in [
        ("takeoff --altitude 7.5", TakeOff, 7.5, &[0][..]),
        ("hold", Hold, 0.0, &[1]),
        ("land", Land, 0.0, &[0]),
        ("land --preempt", Land, 0.0, &[1]),
        ("goto 37,-6,20 37,-6,20", GoToWaypoint, 20.0, &[0, 0]),
        (
            "goto 37,-6,20 37,-6,20 --preempt",
            GoToWaypoint,
            20.0,
            &[1, 1],
        ),
    ] {
        rig.run(args, 0);
        for preempt in preempt {
            let request = movement(bridge.next_request());
            assert_eq!(
                (request.kind(), request.altitude_m, request.preempt),
                (Some(kind), altitude_m, *preempt),
                "{args}"
            );
        }
    }
}

#[test]
fn a_path_is_framed_and_shares_one_id() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    let mut paths = Vec::new();
    for (args, frames) in [
        ("goto -37.1,-6.0,20 --no-wait", &[(1, 1)][..]),
        (
            "goto -37.1,-6.0,20 37.2,6.1,21 -.5,0,-3 --timeout 60s",
            &[(1, 0), (0, 0), (0, 1)],
        ),
    ] {
        rig.run(args, 0);
        let requests: Vec<MovementData> = frames
            .iter()
            .map(|_| movement(bridge.next_request()))
            .collect();
        let sent: Vec<_> = requests
            .iter()
            .map(|request| (request.first, request.last))
            .collect();
        assert_eq!(sent, frames);
        let first = requests[0];
        assert_eq!(
            (first.latitude_deg, first.longitude_deg, first.altitude_m),
            (-37.1, -6.0, 20.0)
        );
        assert!(
            requests
                .iter()
                .all(|request| request.path_id == first.path_id)
        );
        assert!(
            requests
                .iter()
                .all(|request| request.kind() == Some(MovementKind::GoToWaypoint))
        );
        let mut ids: Vec<u64> = requests.iter().map(|request| request.request_id).collect();
        ids.dedup();
        assert_eq!(ids.len(), frames.len());
        paths.push(first.path_id);
    }
    assert!(paths[0] != 0 && paths[0] != paths[1], "{paths:?}");
}

/// The speed is written before the path, and the one from before after it, however the path ends.
#[test]
fn a_goto_with_a_speed_leaves_the_cruise_speed_as_it_was() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    // The names of parameters are looked up, and values read, in between.
    let ordered = || loop {
        match bridge.next_request() {
            Received::Parameter(request) => match request.operation() {
                Some(ParameterOperation::Write) => return (request.value as f32).to_string(),
                _ => continue,
            },
            Received::Movement(_) => return "path".to_owned(),
            other => panic!("{other:?}"),
        }
    };
    for (answer, code) in [(None, 0), (Some(Answer::refuse(Reason::TooFar)), 5)] {
        if let Some(answer) = answer {
            bridge.answer_as_usual(2);
            bridge.answer_next(answer);
        }
        let finished = rig.run("goto 37,-6,20 --speed 8m/s", code);
        assert_eq!(
            [(); 3].map(|()| ordered()),
            ["8", "path", "5"],
            "{finished:#?}"
        );
        assert_eq!(
            rig.run("param get cruise_speed_mps", 0).stdout,
            ["cruise_speed_mps = 5"]
        );
    }
    // Another command has written one while the path was flown: it stays.
    bridge.answer_as_usual(2);
    bridge.answer_next(accepted());
    let mut flown = rig.start("goto 37,-6,20 --speed 8");
    flown.wait_for_text("goto: 1 waypoint accepted");
    assert_eq!([(); 2].map(|()| ordered()), ["8", "path"]);
    rig.run("param set cruise_speed_mps 3", 0);
    rig.run("land --preempt", 0);
    flown
        .exits(5)
        .err_says("another command has set a cruise speed of 3 m/s meanwhile, which stays");
    assert_eq!(
        rig.run("param get cruise_speed_mps", 0).stdout,
        ["cruise_speed_mps = 3"]
    );
    // After a signal the path goes on, and so does its speed.
    bridge.answer_as_usual(2);
    bridge.answer_next(accepted());
    let mut flown = rig.start("goto 37,-6,20 --speed 8");
    flown.wait_for_text("goto: 1 waypoint accepted");
    flown.signal(Signal::INT);
    flown
        .exits(7)
        .err_says("the cruise speed stays as this command has set it");
    rig.run("goto 37,-6,20 --speed 21", 2)
        .err_says("the DSP takes a speed of 0.1 to 20 m/s");
    rig.run("goto 37,-6,20 --speed 8 --no-wait", 2);
}

#[test]
fn final_reports_become_exit_codes_and_so_does_none() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    let unknown = |reason| Answer::Reports(vec![RequestReport::new(Stage::Unknown, reason)]);
    let (take_off, path) = ("takeoff 5m", "goto 37,-6,20 37,-6,21 --timeout 5s");
    #[rustfmt::skip]
    let cases = [
        (take_off, vec![Answer::done()], 0, ""),
        (take_off, vec![Answer::refuse(Reason::Busy)], 5, "takeoff was refused (busy)"),
        (take_off, vec![Answer::refuse(Reason::LinkDown)], 6, "takeoff was refused (link-down)"),
        (take_off, vec![Answer::abort(Reason::MovementTimeout)], 4, "(movement-timeout)"),
        (take_off, vec![unknown(Reason::BridgeEnding)], 7, "unknown outcome (bridge-ending)"),
        ("start --timeout 100ms", vec![Answer::Hang], 4, "did not answer to start in time"),
        (path, vec![accepted(), Answer::Hang], 4, "did not answer to waypoint 2 of 2"),
    ];
    for (args, answers, code, told) in cases {
        for answer in &answers {
            bridge.answer_next(answer.clone());
        }
        let finished = rig.run(args, code);
        let is_told = says(&finished.stderr, told) || told.is_empty();
        assert!(is_told, "{answers:?}: {finished:#?}");
    }
}

#[test]
fn programs_read_one_object_a_line() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    bridge.answer_next(stand_in::progress(1));
    let finished = rig.run("goto 37,-6,20 --json", 0);
    let request = movement(bridge.next_request());
    let reports: Vec<_> = finished.stdout.iter().map(|line| json(line)).collect();
    let stages: Vec<_> = reports.iter().map(|report| &report["stage"]).collect();
    assert_eq!(stages, ["accepted", "progress", "done"]);
    for report in &reports {
        assert_eq!(report["schema"], "hero.RequestReport.v3");
        assert_eq!(report["request"], "goto");
        assert_eq!(report["request_id"], request.request_id);
        assert_eq!(report["path_id"], request.path_id);
        assert_eq!(report["reason"], "none");
    }
    assert_eq!(reports[2]["waypoints_reached"], 1);
}

#[test]
fn deadline_and_timeout_come_from_the_command_line_then_the_environment_then_the_file() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    rig.write("ril.toml", "[request]\ndeadline_ms = 300\n");
    rig.write("other.toml", "");
    for (args, variable, expected) in [
        ("start --deadline 100ms", Some("200ms"), 100),
        ("start", Some("200ms"), 200),
        ("start", None, 300),
        ("fence reload", None, 300),
        ("start --config other.toml", None, 0),
    ] {
        let mut command = rig.command(args.split(' '));
        if let Some(value) = variable {
            command.env("RIL_DEADLINE", value);
        }
        Process::spawn(&rig.domain, command).exits(0);
        let request = control(bridge.next_request());
        let begin_by_ns = match expected {
            0 => 0,
            ms => request.issued_ns + ms * 1_000_000,
        };
        assert_eq!(request.begin_by_ns, begin_by_ns, "{args} {variable:?}");
    }
    rig.run("land --deadline 50ms", 0);
    let land = movement(bridge.next_request());
    assert_eq!(land.begin_by_ns, land.issued_ns + 50_000_000);
}

#[test]
fn an_interrupted_command_says_what_goes_on() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    #[rustfmt::skip]
    let cases = [
        ("takeoff --altitude 5", Signal::INT, "the take-off goes on and cannot be aborted"),
        ("land", Signal::TERM, "the landing goes on and cannot be aborted"),
        ("goto 37,-6,20", Signal::INT, "the bridge lets the helicopter hover where it is, unless `sender_lost`"),
        ("goto 37,-6,20 --sender-lost hold", Signal::TERM, "the bridge lets the helicopter hover where it is"),
        ("goto 37,-6,20 --sender-lost land", Signal::HUP, "the bridge lands the helicopter where it is"),
        ("goto 37,-6,20 --sender-lost continue", Signal::INT, "`ril hold` makes the helicopter hover at once"),
        ("stop", Signal::INT, "the bridge goes on with it"),
    ];
    for (args, signal, expected) in cases {
        bridge.answer_next(accepted());
        let mut process = rig.start(args);
        process.wait_for_text("accepted");
        process.signal(signal);
        process.exits(7).err_says(expected);
        bridge.next_request();
    }
    // The bridge flies no path that was not sent to its end.
    bridge.answer_next(accepted());
    bridge.answer_next(Answer::Hang);
    let mut process = rig.start("goto 37,-6,20 37,-6,21 --timeout 80s");
    bridge.next_request();
    bridge.next_request();
    process.signal(Signal::INT);
    process.exits(7).err_says("nothing of it is flown");
}

#[test]
fn a_path_says_what_becomes_of_it_without_its_command() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    for (options, sender_lost, lease_ms) in [
        ("", None, 0),
        ("--sender-lost land", Some(SenderLost::Land), 0),
        ("--hold-on-exit", Some(SenderLost::Hold), 0),
        (
            "--sender-lost continue --lease 1.5s",
            Some(SenderLost::Continue),
            1500,
        ),
        ("--no-wait", Some(SenderLost::Continue), 0),
    ] {
        bridge.answer_next(Answer::done());
        rig.run(&format!("goto 37,-6,20 {options}"), 0);
        let path = movement(bridge.next_request());
        assert_eq!(path.sender_lost(), sender_lost, "{options}");
        assert_eq!(path.lease_ms, lease_ms, "{options}");
    }
    for (options, expected) in [
        (
            "--no-wait --sender-lost hold",
            "the command ends before its path",
        ),
        ("--no-wait --lease 2s", "the command ends before its path"),
        ("--sender-lost fly", "possible values: continue, hold, land"),
        ("--lease 100ms", "it must be from 500ms to 1m"),
    ] {
        let finished = rig.run(&format!("goto 37,-6,20 {options}"), 2);
        finished.err_says(expected);
    }
}

/// `head -n 1` ends after *accepted*.
#[test]
fn a_goto_whose_reader_has_gone_says_that_its_outcome_is_unknown() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    for (option, expected) in [
        ("", "the bridge lets the helicopter hover"),
        (
            "--sender-lost continue",
            "`ril hold` makes the helicopter hover at once",
        ),
    ] {
        bridge.answer_next(accepted());
        let line = format!(
            "{{ \"$0\" goto 37,-6,20 {option}; echo \"code $?\" >&2; }} | {{ head -n 1; exec <&-; echo gone >&2; }}"
        );
        let mut process = Process::spawn(&rig.domain, rig.shell(&line));
        let path = movement(bridge.next_request());
        process.wait_for_text("gone");
        let under_way = RequestReport::new(Stage::Progress, Reason::None);
        bridge.report(path.request_id, &under_way).unwrap();
        let finished = process.wait_exit();
        finished.err_says("code 7");
        for expected in [
            "standard output was closed before the final report",
            expected,
        ] {
            finished.err_says(expected);
        }
    }
    // The final report was there before its reader had gone: the outcome is known.
    bridge.answer_next(Answer::refuse(Reason::Busy));
    let line = "{ \"$0\" goto 37,-6,20; echo \"code $?\" >&2; } | true";
    let finished = Process::spawn(&rig.domain, rig.shell(line)).wait_exit();
    finished.err_says("code 5");
}

#[test]
fn a_bridge_without_a_port_refuses_a_start_and_one_that_was_stopped_is_not_waited_for() {
    let rig = sandbox();
    let bridge = rig.bridge(1);
    let finished = rig.run("start", 6);
    assert!(finished.stdout.is_empty(), "{finished:#?}");
    let expected = "start was refused (link-down)";
    finished.err_says(expected);
    rig.run("goto -37,-6,20", 6);
    let state = shown_state(&rig, 1);
    assert_eq!(state["link"]["state"], "gone");
    let mut watch = rig.watch(1);
    watch.until("both are counted", |state| state.refused.requests == 2);

    bridge.signal(Signal::STOP);
    rig.run("start --timeout 200ms", 4);
    rig.run("status --timeout 200ms", 4);
    bridge.signal(Signal::CONT);
    rig.run("start", 6);
    // What was withdrawn while it was stopped never happened.
    let state = watch.until("the last is counted", |state| state.refused.requests > 2);
    assert_eq!(state.refused.requests, 3);
    drop(watch);
    end(bridge, Signal::INT);
}
