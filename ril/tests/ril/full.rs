//! Standard output on a disk that is full: each verb that prints ends with an error that says so, and an order is
//! followed to its end before. Names of files that a terminal would obey are written out, and variables that are empty
//! are not set.

use clap::{Command, CommandFactory};
use ril::cli::Cli;
use ril_tests::process::Finished;
use ril_tests::sandbox::records_in;
use ril_tests::{Process, Sandbox, StandInBridge};

use crate::common::sandbox;

/// Verbs that none of [`LINES`] is, and why.
const LEFT_OUT: &[(&str, &str)] = &[
    ("bridge", "a process"),
    ("conform", "needs a DSP for itself"),
    ("control pass", "nobody asks"),
    ("demo", "prints at the end of a long flight, as others do"),
    ("mavlink", "a process"),
    ("plan fly", "prints as orders do"),
    ("record", "prints at the end of a recording, as orders do"),
    ("relay", "a program of its own"),
    ("replay", "prints as it plays"),
    ("run", "processes"),
    ("sim", "a process"),
    ("view", "prints of a process that runs"),
    ("watch", "wants a terminal"),
];

/// A line for each verb that prints something when its robot lives.
const LINES: &[&str] = &[
    "start",
    "takeoff 5m --json",
    "hold --json",
    "goto 37.411,-6.001,15",
    "rtl --json",
    "land",
    "stop --json",
    "plan check plan.geojson",
    "plan show plan.geojson",
    "param list",
    "param get cruise_speed_mps",
    "param set cruise_speed_mps 3",
    "fence show",
    "fence reload --json",
    "control show",
    "control take",
    "control release --json",
    "status",
    "echo state --count 1",
    "hz state --count 2",
    "delay state --count 2",
    "bw state --count 2",
    "topic list",
    "topic info state",
    "topic echo state --count 1 --json",
    "topic hz state --count 2",
    "topic delay state --count 2",
    "topic bw state --count 2",
    "topic generate layout.txt",
    "new module belt --lang python",
    "doctor",
    "preflight",
    "wait --for up",
    "log list --dir .",
    "log summary RECORD",
    "log report RECORD",
    "log tail RECORD",
    "log csv RECORD",
    "log check RECORD",
    "log recover RECORD",
    "log export RECORD",
    "robots",
    "completions bash",
    "--help",
    "--version",
    "status --help",
    "bridge --check-config",
    "run status --check-config --json",
];

/// The verbs that have none below them.
fn verbs(command: &Command, path: &str, found: &mut Vec<String>) {
    let mut inner = command.get_subcommands().peekable();
    if inner.peek().is_none() {
        found.push(path.trim_start().to_owned());
    }
    for command in inner.filter(|command| !command.is_hide_set()) {
        verbs(command, &format!("{path} {}", command.get_name()), found);
    }
}

#[test]
fn every_verb_that_prints_says_that_the_disk_is_full() {
    let mut all = Vec::new();
    verbs(&Cli::command(), "", &mut all);
    let is_of = |line: &str, verb: &str| format!("{line} ").starts_with(&format!("{verb} "));
    for verb in all {
        let is_tried = LINES.iter().any(|line| is_of(line, &verb));
        let is_left_out = LEFT_OUT.iter().any(|(line, _)| is_of(&verb, line));
        assert!(is_tried || is_left_out, "`ril {verb}` is not tried");
    }

    let rig = sandbox();
    rig.write(
        "plan.geojson",
        r#"{"type": "Point", "coordinates": [-6.001, 37.411, 20]}"#,
    );
    rig.write(
        "layout.txt",
        "# Layout: a.A.v1\n\nuint64 sequence\nuint64 epoch_ns\nuint64 x\n",
    );
    let robot = rig.start_robot(1, 10);
    rig.run("record --duration 500ms --output .", 0);
    let record = records_in(rig.folder()).remove(0);
    let record = record.file_name().unwrap().to_str().unwrap();
    for line in LINES {
        let line = line.replace("RECORD", record);
        let shell = rig.shell(&format!("exec \"$0\" {line} > /dev/full"));
        let finished = Process::spawn(&rig.domain, shell).wait_exit();
        assert_eq!(finished.code(), Some(1), "{line}: {finished:#?}");
        finished.err_says("standard output cannot be written");
        finished.err_says("No space left on device");
    }
    robot.end();
}

#[test]
fn no_name_of_a_file_commands_the_terminal() {
    let rig = sandbox();
    let name = "a\u{1b}]0;x\u{7}\u{202e}";
    let [log, record, plan] = ["tsv", "mcap", "geojson"].map(|kind| format!("{name}.{kind}"));
    rig.write(&log, "flying\tsequence\treceived_ns\n0\t1\t5\n");
    rig.write(&record, "no record");
    rig.write(
        &plan,
        r#"{"type": "Point", "coordinates": [-6.001, 37.411, 20]}"#,
    );
    let absent = format!("{name}.absent");
    for args in [
        vec!["log", "summary", &log],
        vec!["log", "check", &record],
        vec!["log", "recover", &record],
        vec!["log", "summary", &absent],
        vec!["log", "csv", &log, "--field", name],
        vec!["plan", "check", &plan],
        vec!["plan", "check", &absent],
        vec!["bridge", "--config", &absent],
        vec!["replay", &record],
    ] {
        let finished = Process::spawn(&rig.domain, rig.command(&args)).wait_exit();
        let obeys = |line: &&String| line.contains(char::is_control) || line.contains('\u{202e}');
        let all = || finished.stdout.iter().chain(&finished.stderr);
        assert_eq!(all().find(obeys), None, "{args:?}: {finished:#?}");
        let is_named = all().any(|line| line.contains("\\u{1b}") || line.contains("\\u001b"));
        assert!(is_named, "{args:?}: {finished:#?}");
    }
}

fn with_empty_variables(rig: &Sandbox, args: &str) -> Finished {
    let mut command = rig.command(args.split(' '));
    for name in ["ROBOT", "CONFIG", "PORT", "TIMEOUT", "DEADLINE", "LOG"] {
        command.env(format!("RIL_{name}"), "");
    }
    Process::spawn(&rig.domain, command).wait_exit()
}

#[test]
fn variables_that_are_empty_are_not_set() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    let finished = with_empty_variables(&rig, "land");
    assert_eq!(finished.code(), Some(0), "{finished:#?}");
    bridge.next_request();
    for (args, code) in [("bridge --check-config", 0), ("robots --json", 0)] {
        let finished = with_empty_variables(&rig, args);
        assert_eq!(finished.code(), Some(code), "{args}: {finished:#?}");
    }
    let shown = with_empty_variables(&rig, "bridge --check-config")
        .stdout
        .join("\n");
    assert!(!shown.contains("RIL_"), "{shown}");
}
