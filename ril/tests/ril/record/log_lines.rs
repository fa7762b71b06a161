//! What the processes log is in the file, line by line, as standard error had it.

use std::fs;
use std::path::Path;

use recording::read::{self, RecordFile};
use ril_tests::process::Signal;
use ros_messages::{Level, Log};

use super::feed::{only_file, words};
use crate::common::{end, end_all, sandbox};

/// The lines of a process in the file, in their order: `INFO bridge::shell: ready`.
fn recorded(file: &Path, process: &str) -> Vec<String> {
    let bytes = RecordFile::open(file).unwrap();
    let messages = read::messages(&bytes).map(Result::unwrap);
    let of_log = messages.filter(|message| message.topic() == "/robot1/log");
    of_log
        .filter_map(|message| line(message.data(), process))
        .collect()
}

fn line(message: &[u8], process: &str) -> Option<String> {
    let log = Log::read(message).unwrap();
    let level = match log.level {
        Level::Info => "INFO",
        Level::Warn => "WARN",
        Level::Error => "ERROR",
        other => panic!("{other:?}"),
    };
    (log.process == process).then(|| format!("{level} {}: {}", log.module, log.text))
}

/// The lines of standard error without their times.
fn logged(standard_error: &[String]) -> Vec<String> {
    let lines = standard_error.iter();
    let rest = lines.filter_map(|line| line.split_once(' '));
    rest.map(|(_time, rest)| rest.trim_start().to_owned())
        .collect()
}

#[test]
fn what_the_processes_log_while_they_are_recorded_is_in_the_file() {
    let rig = sandbox();
    let sim = rig.sim(1, "--speed 5");
    let mut status = rig.status(1);
    let bridge = rig.bridge(1);
    rig.watch(1).until_ready();
    let mut recorder = rig.start(&words(""));
    recorder.wait_for_text("recording file=");
    for order in ["start", "takeoff --altitude 5", "land", "stop"] {
        rig.run(order, 0);
    }
    // A refusal is a warning.
    rig.run("takeoff --altitude 5", 5);
    let bridge = logged(&end(bridge, Signal::TERM).stderr);
    let second = rig.bridge(1);
    status.wait_for_text("another bridge");
    recorder.wait_for_text("began again topic=\"/robot1/bridge/journal\"");
    let second = logged(&end(second, Signal::TERM).stderr);
    let status = logged(&end(status, Signal::TERM).stderr);
    end(sim, Signal::TERM);
    recorder.signal(Signal::TERM);
    let finished = recorder.exits(0);

    let file = only_file(&rig);
    // All from the moment on from which a journal was recorded, to the last line of each bridge.
    let of_bridges = recorded(&file, "bridge");
    let is_last = |line: &String| line.contains("bridge::shell: ended");
    let of_bridges: Vec<_> = of_bridges.split_inclusive(is_last).collect();
    assert_eq!(of_bridges.len(), 2, "{of_bridges:#?}");
    for (recorded, logged) in of_bridges.iter().zip([&bridge, &second]) {
        assert!(logged.ends_with(recorded), "{recorded:#?}\n{logged:#?}");
    }
    let accepted = of_bridges[0]
        .iter()
        .filter(|line| line.contains("accepted"));
    assert_eq!(accepted.count(), 3, "take-off, landing, stop");
    // Status ends its journal before its logs have ended.
    let of_status = recorded(&file, "status");
    assert!(
        of_status.iter().any(|line| line.contains("another bridge"))
            && status
                .windows(of_status.len())
                .any(|part| part == of_status),
        "{of_status:#?}\n{status:#?}"
    );
    let own = recorded(&file, "record");
    let recorder = logged(&finished.stderr);
    assert!(recorder.starts_with(&own), "{own:#?}\n{recorder:#?}");
    assert!(own.iter().any(|line| line.contains("recorded topic")));
    // Beside them stand lines that the recorder makes of states and requests.
    let flight = recorded(&file, "flight");
    assert!(
        flight.iter().any(|line| line.contains("takeoff: done")),
        "{flight:#?}"
    );
}

#[test]
fn the_report_has_what_a_process_warned_of() {
    let rig = sandbox();
    let sim = rig.sim(1, "--speed 5");
    let mut bridge = rig.bridge(1);
    rig.watch(1).until_ready();
    let mut recorder = rig.start(&words(""));
    recorder.wait_for_text("recording file=");
    rig.run("takeoff --altitude 5", 5);
    end(sim, Signal::TERM);
    bridge.wait_for_text("the serial port is gone");
    end_all([bridge, recorder]);
    let file = only_file(&rig);
    rig.run(
        &format!("log report {} --output report.html", file.display()),
        0,
    );
    let page = fs::read_to_string(rig.folder().join("report.html")).unwrap();
    assert!(
        page.contains("bridge logged: the serial port is gone"),
        "{page}"
    );
    // The table of requests has it, and an event of its own would be the same a second time.
    assert!(page.contains("not-started"), "{page}");
    assert!(!page.contains("bridge logged: report request="), "{page}");
}
