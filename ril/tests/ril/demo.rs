//! The demonstration: it flies, it judges, and whatever ends it leaves nothing behind.

use ril_tests::Sandbox;
use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::sync::LazyLock;

use crate::common::{has_relay, json, sandbox};
use ril_tests::languages::root;
use ril_tests::process::{Finished, Process, Signal};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::process::{Pid, PidfdFlags, pidfd_open};
use serde_json::Value;

/// What was there before the first demonstration: others may have been killed there, and the numbers of processes come
/// again.
static BEFORE: LazyLock<Vec<String>> = LazyLock::new(entries);

/// What is where demonstrations have folders and segments.
fn entries() -> Vec<String> {
    let folders = ["/dev/shm", "/tmp"].into_iter();
    let entries = folders.flat_map(|folder| fs::read_dir(folder).unwrap());
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path().display().to_string()));
    paths.collect()
}

/// Everything that still carries the mark of the demonstration with process id `demo`: segments, folders, processes.
fn left_of(demo: u32) -> Vec<String> {
    let mark = format!("hx{demo:x}-");
    let mut left = entries();
    left.retain(|path| path.contains(&mark) && !BEFORE.contains(path));
    left.extend(
        children_by_mark(&mark)
            .iter()
            .map(|pid| format!("process {pid}")),
    );
    left
}

/// Processes whose environment names the domain.
fn children_by_mark(mark: &str) -> Vec<u32> {
    let processes = fs::read_dir("/proc").unwrap();
    processes
        .filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok())
        .filter(|pid| {
            let environment = fs::read(format!("/proc/{pid}/environ")).unwrap_or_default();
            String::from_utf8_lossy(&environment).contains(&format!("RIL_IPC_ROOT=/dev/shm/{mark}"))
        })
        .collect()
}

/// Twice the real clock: a subscriber's buffer then holds more than a second, for which a machine that is busy
/// elsewhere may forget a process. At eight times it was a sixth of that, and samples were lost with two busy loops
/// beside.
const SPEED: &str = "--speed 2";

/// The checks that count samples, or look for the one next to a waypoint. A machine that stalls lets processes lose
/// some, whatever is right with them: they count them, and the demonstration has to say that not everything came.
const OF_SAMPLES: [&str; 4] = [
    "no sample lost",
    "waypoints reached in order",
    "log rows equal samples published",
    "every sample is in the record",
];

/// Whether a machine that stalls can be the reason why these checks failed. It also loses bytes of frames, where nobody
/// reads a pseudo-terminal in time, but only together with samples.
fn are_of_a_stall(failed: &[&str]) -> bool {
    let loses_samples = failed.contains(&OF_SAMPLES[0]);
    let is_of_a_stall =
        |check| OF_SAMPLES.contains(check) || (loses_samples && *check == "line without faults");
    failed.iter().all(is_of_a_stall)
}

/// Whether a demonstration that has flown passed, by its plain lines; nothing but the count of samples may be wrong
/// with it.
#[track_caller]
fn has_passed(finished: &Finished) -> bool {
    let lines = || finished.stdout.iter();
    let failed = lines().filter_map(|line| line.strip_prefix("FAIL "));
    let failed: Vec<&str> = failed
        .map(|line| line.trim_start().split("  ").next().unwrap())
        .collect();
    assert!(are_of_a_stall(&failed), "{finished:#?}");
    let passed = lines().filter(|line| line.starts_with("ok ")).count();
    assert!(passed + failed.len() >= 10, "{finished:#?}");
    let has_passed = lines().any(|line| line == "all checks passed");
    let code = if has_passed { 0 } else { 1 };
    assert_eq!(finished.code(), Some(code), "{finished:#?}");
    has_passed
}

fn start(rig: &Sandbox, options: &str) -> Process {
    LazyLock::force(&BEFORE);
    let folder = rig.folder().join("flight");
    rig.start(&format!("demo --folder {} {options}", folder.display()))
}

#[test]
fn it_flies_and_every_check_passes() {
    let rig = sandbox();
    let mut demo = start(&rig, &format!("{SPEED} --json"));
    let pid = demo.id();
    let finished = demo.wait_exit();
    // Behind the report is the failure, if there is one.
    let report = json(&finished.stdout[0]);
    assert_eq!(report["schema"], "ril.Demo.v1");
    let checks = report["checks"].as_array().unwrap();
    assert_eq!(checks.len(), 10);
    let readme = fs::read_to_string(root().join("README.md")).unwrap();
    let shown = readme
        .lines()
        .filter_map(|line| line.strip_prefix("ok    "));
    let shown: Vec<&str> = shown.filter_map(|line| line.split("  ").next()).collect();
    let names: Vec<&str> = checks
        .iter()
        .filter_map(|check| check["name"].as_str())
        .collect();
    assert_eq!(shown, names, "README.md shows each check");
    let failed = checks.iter().filter(|check| check["passed"] != true);
    let failed: Vec<&str> = failed
        .map(|check| check["name"].as_str().unwrap())
        .collect();
    assert!(are_of_a_stall(&failed), "{checks:#?}");
    assert_eq!(report["passed"], failed.is_empty());
    let code = i32::from(!failed.is_empty());
    assert_eq!(finished.code(), Some(code), "{finished:#?}");
    let log = fs::read_to_string(report["log"].as_str().unwrap()).unwrap();
    assert!(log.starts_with("flying\t"), "the log stays");
    let record = report["record"].as_str().unwrap();
    rig.run(&format!("log check {record}"), 0);
    assert_eq!(left_of(pid), Vec::<String>::new());
}

#[test]
fn a_signal_at_any_moment_leaves_nothing() {
    for (moment, signal) in [
        ("starting the simulator", Signal::INT),
        ("start: done", Signal::INT),
        ("ril takeoff 5m", Signal::TERM),
        ("ril goto --file square.txt", Signal::INT),
    ] {
        let rig = sandbox();
        let mut demo = start(&rig, "--speed 5");
        let pid = demo.id();
        demo.wait_for_text(moment);
        demo.signal_group(signal);
        let finished = demo.wait_exit();
        let ended_by = finished.status.signal();
        assert_eq!(ended_by, Some(signal.as_raw()), "{moment}: {finished:#?}");
        let told = finished.stderr.join("\n");
        assert!(
            told.contains("interrupted; nothing is left"),
            "{moment}: {told}"
        );
        assert_eq!(left_of(pid), Vec::<String>::new(), "{moment}");
    }
}

#[test]
fn elsewhere_than_on_a_terminal_it_speaks_in_plain_lines_and_a_folder_that_was_not_chosen_is_gone()
{
    for signal in [None, Some(Signal::INT)] {
        let rig = sandbox();
        let mut command = rig.command(["demo", "--speed", "2", "--robot", "7"]);
        command.env("TMPDIR", rig.folder());
        let mut demo = Process::spawn(&rig.domain, command);
        demo.wait_for_text("start: done");
        if let Some(signal) = signal {
            demo.signal_group(signal);
        }
        let finished = demo.wait_exit();
        // One that has failed leaves what the processes said.
        let is_left = match signal {
            Some(_) => {
                assert_eq!(finished.code(), None, "{finished:#?}");
                false
            }
            None => {
                let has_passed = has_passed(&finished);
                let verdict = match has_passed {
                    true => "all checks passed",
                    false => "not all checks passed",
                };
                assert_eq!(finished.stdout.last().unwrap(), verdict);
                assert!(!finished.stdout.join("\n").contains('\x1b'));
                !has_passed
            }
        };
        let left: Vec<_> = fs::read_dir(rig.folder()).unwrap().collect();
        assert_eq!(left.len(), usize::from(is_left), "{left:?}");
    }
}

#[test]
fn its_processes_do_not_outlive_it_even_when_it_is_killed() {
    let rig = sandbox();
    let mut demo = start(&rig, "--speed 5");
    let pid = demo.id();
    demo.wait_for_text("ril takeoff 5m");
    let children: Vec<_> = children_by_mark(&format!("hx{pid:x}-"))
        .into_iter()
        .map(|child| {
            let child = Pid::from_raw(child.cast_signed()).unwrap();
            pidfd_open(child, PidfdFlags::empty()).unwrap()
        })
        .collect();
    // The command of the operator may have begun already.
    assert!([4, 5].contains(&children.len()), "{}", children.len());
    demo.signal(Signal::KILL);
    demo.wait_exit();
    for child in &children {
        // Readable when the process has ended; the fixture's watchdog bounds the wait.
        poll(&mut [PollFd::new(child, PollFlags::IN)], None).unwrap();
    }
    assert_eq!(left_of(pid), Vec::<String>::new());
}

#[test]
fn a_fleet_flies_through_outages_deaths_and_a_replacement() {
    let rig = sandbox();
    if !has_relay("a fleet") {
        return;
    }
    let mut demo = start(&rig, "--robots 3 --speed 2 --json");
    let pid = demo.id();
    let finished = demo.wait_exit();
    let report = json(&finished.stdout[0]);
    assert_eq!(report["schema"], "ril.Fleet.v1");
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let robots = report["robots"].as_array().unwrap();
    let fates: Vec<_> = robots
        .iter()
        .map(|robot| (robot["robot"].as_u64().unwrap(), text(&robot["fate"])))
        .collect();
    let expected = [
        (1, "flew"),
        (2, "replaced"),
        (2, "replacement"),
        (3, "died"),
    ];
    assert_eq!(
        fates,
        expected.map(|(robot, fate)| (robot, fate.to_owned()))
    );
    let of_robots = robots
        .iter()
        .flat_map(|robot| robot["checks"].as_array().unwrap());
    let all = of_robots.chain(report["checks"].as_array().unwrap());
    let failed: Vec<_> = all
        .filter(|check| check["passed"] != true)
        .map(|check| check["name"].as_str().unwrap())
        .collect();
    assert!(are_of_a_stall(&failed), "{report:#}");
    assert_eq!(report["passed"], failed.is_empty());
    for kind in ["bridge", "record", "relay", "sim", "station", "status"] {
        let mut costs = report["costs"].as_array().unwrap().iter();
        let cost = costs.find(|cost| cost["process"] == kind).expect(kind);
        assert!(cost["memory_mib"].as_f64().unwrap() > 0.0, "{report:#}");
    }
    assert_eq!(left_of(pid), Vec::<String>::new());
}

#[test]
fn one_relay_carries_the_largest_fleet() {
    let rig = sandbox();
    if !has_relay("a fleet") {
        return;
    }
    rig.run("demo --robots 51", 2)
        .err_says("51 is not in 3..=50");
    let robots: Vec<String> = (1..=50)
        .map(|one| format!("{{ number = {one} }}"))
        .collect();
    let config = format!("[station]\nrobots = [{}]\n", robots.join(", "));
    rig.write("fleet.toml", &config);
    rig.run("relay station --check-config --config fleet.toml", 0);
}

#[test]
fn a_fleet_that_is_interrupted_leaves_nothing() {
    let rig = sandbox();
    if !has_relay("a fleet") {
        return;
    }
    for (moment, signal) in [
        ("starting 3 robots", Signal::INT),
        ("the air falls silent", Signal::TERM),
    ] {
        let mut demo = start(&rig, "--robots 3 --speed 2");
        let pid = demo.id();
        demo.wait_for_text(moment);
        demo.signal_group(signal);
        let finished = demo.wait_exit();
        let ended_by = finished.status.signal();
        assert_eq!(ended_by, Some(signal.as_raw()), "{moment}: {finished:#?}");
        assert_eq!(left_of(pid), Vec::<String>::new(), "{moment}");
    }
}
