//! `ril relay`, and what other commands say of a robot that comes through a relay, for which a thread of the test
//! stands in.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use crate::common::{json, sandbox, says, shown_state, state_of};
use ipc_types::code::RelayLinkState;
use ipc_types::payload::{HeroTelemetry, ModuleState, RelayLink, RelayStations, ascii_bytes};
use ipc_types::{Domain, MonotonicNs, RobotId, Topic};
use ril_tests::process::Finished;
use ril_tests::{Process, Publishing, Sandbox, StandInBridge, StandInTopic};

/// From one sample of the stand-in to the next: often enough that none is stale while the machine lets it run.
const PERIOD: Duration = Duration::from_millis(20);

/// A relay on a station's machine: publishes the state of its link, and, unless that is connecting at first, a robot's
/// topics, again and again as of now.
fn relayed(domain: &Domain, link: RelayLink) -> Publishing {
    relayed_with(domain, link, |_| {})
}

/// A relay on a station's machine whose link `change` changes from sample to sample.
fn relayed_with(domain: &Domain, mut link: RelayLink, change: fn(&mut RelayLink)) -> Publishing {
    let domain = domain.clone();
    Publishing::start(PERIOD, move || {
        let ipc = ipc_types::Ipc::join(&domain, RobotId::DEFAULT, "relay").unwrap();
        let state = ipc.publisher::<RelayLink>().unwrap();
        let is_connecting = link.state == RelayLinkState::Connecting.code();
        let robot = (!is_connecting).then(|| {
            let hero = ipc.publisher::<HeroTelemetry>().unwrap();
            let stations = ipc.publisher::<RelayStations>().unwrap();
            (hero, ipc.publisher::<ModuleState>().unwrap(), stations)
        });
        // The membership goes after its ports.
        let mut held = (state, robot, ipc);
        move || {
            let (state, robot, _) = &mut held;
            let now = MonotonicNs::now().0;
            link.published_ns = now;
            link.since_ns = now;
            link.last_heard_ns = if is_connecting { 0 } else { now };
            state.publish(|sample| fill(sample, link)).unwrap();
            if let Some((hero, module, stations)) = robot {
                hero.publish(|sample| (sample.received_ns, sample.published_ns) = (now, now))
                    .unwrap();
                module.publish(|sample| sample.published_ns = now).unwrap();
                stations
                    .publish(|sample| sample.published_ns = now)
                    .unwrap();
            }
            change(&mut link);
        }
    })
}

/// The sample with everything of `link` but what the publisher writes.
fn fill(sample: &mut RelayLink, link: RelayLink) {
    let (sequence, epoch_ns) = (Topic::sequence(sample), Topic::epoch_ns(sample));
    *sample = link;
    sample.stamp(sequence, epoch_ns);
}

/// A link that is up and in order.
fn up() -> RelayLink {
    RelayLink {
        state: RelayLinkState::Up.code(),
        robot: 7,
        clock_valid: 1,
        clock_offset_ns: 3_600_000_000_000,
        clock_uncertainty_s: 0.0025,
        round_trip_s: 0.0123,
        samples_received: 995,
        samples_lost_on_air: 5,
        link: ascii_bytes("tcp/10.0.0.2:7447"),
        station: ascii_bytes("ground-1"),
        ..RelayLink::default()
    }
}

/// What `ril` says, which must end with `code`. On a machine that stalls it takes the relay for silent, and says so:
/// then it is asked again.
#[track_caller]
fn look(rig: &Sandbox, args: &str, code: i32) -> Finished {
    look_begun(rig, args, rig.start(args), code)
}

/// As [`look`], which has begun with this process.
fn look_begun(rig: &Sandbox, args: &str, mut process: Process, code: i32) -> Finished {
    loop {
        let finished = process.wait_exit();
        let mut lines = finished.stdout.iter().chain(&finished.stderr);
        if !lines.any(|line| line.contains("is the machine overloaded?")) {
            assert_eq!(finished.code(), Some(code), "ril {args}: {finished:#?}");
            return finished;
        }
        process = rig.start(args);
    }
}

#[test]
fn the_link_of_a_station_is_shown_and_its_state_is_the_exit_code() {
    let rig = sandbox();
    let relay = relayed(&rig.domain, up());
    let shown = look(&rig, "relay status", 0);
    for expected in [
        "over tcp/10.0.0.2:7447, last message",
        "the robot's is 3600.000000 s ahead, true within 2.500 ms; round trip 12.3 ms",
        "995 received, 5 lost on the air (0.50 %)",
    ] {
        shown.out_says(expected);
    }
    let report = json(&look(&rig, "relay status --json", 0).stdout[0]);
    assert_eq!(report["schema"], "ril.Relay.v3");
    assert_eq!(report["link"]["station"], "ground-1");
    let stations = &report["stations"]["stations"];
    assert_eq!(stations.as_array().map(Vec::len), Some(0), "{report}");
    drop(relay);

    let down = RelayLink {
        state: RelayLinkState::Down.code(),
        ..up()
    };
    let _relay = relayed(&rig.domain, down);
    let shown = look(&rig, "relay status", 6);
    shown.out_says("link        down for ");
    shown.err_says("the link to the robot is not up: down for ");
}

#[test]
fn a_station_that_is_still_connecting_says_so_whatever_it_is_asked() {
    let rig = sandbox();
    let connecting = RelayLink {
        open_timeout_s: 8.0,
        state: RelayLinkState::Connecting.code(),
        ..up()
    };
    let _relay = relayed(&rig.domain, connecting);
    let begun = [
        "status --timeout 300ms",
        "takeoff 10m",
        "goto 37.4,-5.9,+20m --timeout 300ms",
        "echo hero --count 1 --timeout 300ms",
        "wait --for flying",
        "relay status",
    ]
    .map(|verb| (verb, rig.start(verb)));
    for (verb, process) in begun {
        let finished = look_begun(&rig, verb, process, 6);
        for words in [
            "the link to the robot is not up: connecting for ",
            "over tcp/10.0.0.2:7447",
            "given up after 8 s",
        ] {
            finished.err_says(words);
        }
        let start = "start `ril run";
        assert!(!says(&finished.stderr, start), "{verb}: {finished:#?}");
    }
    let report = json(&look(&rig, "relay status --json", 6).stdout[0]);
    let next_step = report["next_step"].as_str().unwrap();
    assert!(next_step.contains("on the robot's machine"), "{next_step}");
    let trouble = report["trouble"].as_str().unwrap();
    assert!(trouble.contains("connecting"), "{trouble}");
    let report = json(&look(&rig, "doctor --json", 8).stdout[0]);
    let findings = report["findings"].as_array().unwrap().iter();
    let mut texts = findings.map(|one| one["text"].to_string());
    assert!(
        texts.any(|text| text.contains("connecting for ")),
        "{report}"
    );
}

#[test]
fn names_in_samples_are_printed_as_text() {
    let rig = sandbox();
    let relay = StandInTopic::<RelayLink>::start(&rig.domain);
    relay.publish(&up());
    let shown = rig.run("echo relay/link --count 1", 0);
    shown.out_says("station: ground-1");
    shown.out_says("link: tcp/10.0.0.2:7447");
    let sample = json(&rig.run("echo relay/link --count 1 --json", 0).stdout[0]);
    assert_eq!(sample["station"], "ground-1");
    let mut hostile = up();
    hostile.station[0] = 0x1b;
    relay.publish(&hostile);
    let sample = json(&rig.run("echo relay/link --count 1 --json", 0).stdout[0]);
    assert_eq!(sample["station"][0], 0x1b, "no text: {sample}");
}

#[test]
fn without_a_relay_status_says_how_to_start_one_and_a_silent_one_is_a_timeout() {
    let rig = sandbox();
    let absent = rig.run("relay status --robot 7", 3);
    for expected in [
        "no relay of robot 7 is running here",
        "start `ril relay station` here",
    ] {
        absent.err_says(expected);
    }
    rig.domain.assert_empty();
    let _silent = StandInTopic::<RelayLink>::start(&rig.domain);
    rig.run("relay status --timeout 100ms", 4)
        .err_says("although it is running");
}

#[test]
fn the_state_of_a_relayed_robot_says_over_which_link_it_comes() {
    let rig = sandbox();
    let relay = relayed(&rig.domain, up());
    let shown = state_of(&rig, "status");
    let expected = "relay       relayed over tcp/10.0.0.2:7447, link up, round trip 12.3 ms, 0.50 % lost on the air";
    shown.out_says(expected);
    let state = shown_state(&rig, 1);
    assert_eq!(state["relayed"], true);
    assert_eq!(state["relay"]["clock"]["uncertainty_s"], 0.0025);
    drop(relay);

    let bridge = StandInBridge::start(&rig.domain);
    bridge.publish_state(&ModuleState::default());
    let shown = state_of(&rig, "status");
    assert!(!says(&shown.stdout, "relayed"), "{shown:#?}");
    let state = shown_state(&rig, 1);
    assert_eq!(
        (&state["relayed"], &state["relay"]),
        (&false.into(), &serde_json::Value::Null)
    );
}

#[test]
fn the_fence_of_a_relayed_robot_is_asked_for_on_its_own_machine() {
    let rig = sandbox();
    let relay = relayed(&rig.domain, up());
    let failed = rig.run("fence show", 3);
    failed.err_says("robot 1's bridge runs on another machine, and its fence is not relayed");
    failed.err_says("on the robot's own machine");
    assert!(!says(&failed.stderr, "not running"), "{failed:#?}");
    drop(relay);
}

#[test]
fn ages_of_relayed_samples_are_shown_with_their_uncertainty() {
    let rig = sandbox();
    let _relay = relayed(&rig.domain, up());
    let shown = rig.run("delay hero --count 2", 0);
    let expected = "relayed from another machine: ages are true within ±2.500 ms";
    shown.out_says(expected);
    for command in ["delay hero", "topic delay hero_telemetry"] {
        let report = json(&rig.run(&format!("{command} --count 2 --json"), 0).stdout[0]);
        assert_eq!(report["relayed"], true, "{command}");
        assert_eq!(report["age_uncertainty_ms"], 2.5, "{command}");
    }
    // The relay's own topics are of this machine, but for the stations, which only the robot's relay knows.
    for (topic, expected) in [("relay/link", false), ("relay/stations", true)] {
        let report = rig.run(&format!("topic delay {topic} --count 2 --json"), 0);
        assert_eq!(json(&report.stdout[0])["relayed"], expected, "{topic}");
    }
}

#[test]
fn what_the_air_lost_while_it_was_measured_is_shown() {
    let rig = sandbox();
    let relay = relayed_with(&rig.domain, up(), |link| {
        link.samples_received += 3;
        link.samples_lost_on_air += 1;
    });
    for verb in ["hz", "delay", "bw"] {
        let shown = rig.run(&format!("{verb} hero --count 20"), 0);
        shown.out_says(" samples of all topics lost (25.00 %)");
        let report = json(&rig.run(&format!("{verb} hero --count 20 --json"), 0).stdout[0]);
        assert_eq!(report["relayed"], true, "{verb}");
        assert_eq!(report["lost"], 0, "{verb}");
        assert_eq!(report["lost_on_air_percent"], 25.0, "{verb}");
    }
    drop(relay);
}

#[test]
fn the_doctor_judges_the_link_and_does_not_miss_what_is_not_relayed() {
    let rig = sandbox();
    let relay = relayed(&rig.domain, up());
    let shown = look(&rig, "doctor", 0);
    for expected in [
        "robot 1 is relayed over tcp/10.0.0.2:7447, link up",
        "provides module_state of robot 1 from another machine",
        "provides hero_telemetry of robot 1 from another machine",
    ] {
        shown.out_says(expected);
    }
    drop(relay);

    let poor = RelayLink {
        samples_lost_on_air: 105,
        clock_uncertainty_s: 0.2,
        clock_resets: 3,
        ..up()
    };
    let _relay = relayed(&rig.domain, poor);
    let report = json(&look(&rig, "doctor --json", 8).stdout[0]);
    let findings = report["findings"].as_array().unwrap();
    let of_relay = findings.iter().filter(|one| one["subject"] == "relay");
    let ids: Vec<&str> = of_relay.map(|one| one["id"].as_str().unwrap()).collect();
    assert_eq!(
        ids,
        [
            "relay-link-lossy",
            "relay-clock-uncertain",
            "relay-clock-reset"
        ]
    );
}

/// A folder with `ril` alone, which is deleted in the end.
///
/// `cp` makes the copy: a file that this process has written may still be open for writing in a process that another
/// test forks, and then cannot be executed. A link would not do: `ril` would look beside its target, and a hard link
/// ends at the border of a file system.
struct Install(PathBuf);

impl Install {
    fn new(name: &str) -> Install {
        let name = format!("{name}-{}", std::process::id());
        let folder = std::env::temp_dir().join(format!("ril-test-install-{name}"));
        fs::create_dir_all(&folder).unwrap();
        let copied = Command::new("cp")
            .args([Path::new(env!("CARGO_BIN_EXE_ril")), &folder])
            .status();
        assert!(copied.unwrap().success());
        Install(folder)
    }

    fn run(&self, rig: &Sandbox, path: &Path, args: &[&str]) -> Finished {
        let mut command = Command::new(self.0.join("ril"));
        command.arg("relay").args(args).env("PATH", path);
        Process::spawn(&rig.domain, command).wait_exit()
    }
}

impl Drop for Install {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// What a shell in the place of the relay's program does: it prints its arguments and ends with a code of its own.
const PRINT: [&str; 5] = [
    "-c",
    "echo \"$0 $*\"; exit 42",
    "--config",
    "relay.toml",
    "status",
];

#[test]
fn the_relay_s_program_is_run_with_all_arguments_and_its_exit_code_is_its_own() {
    let rig = sandbox();
    let install = Install::new("beside");
    let missing = install.run(&rig, Path::new("/nowhere"), &["--robot", "7"]);
    assert_eq!(missing.code(), Some(1), "{missing:#?}");
    missing.err_says("`cargo install --path gateways/relay`");
    symlink("/bin/sh", install.0.join("ril-relay")).unwrap();
    let nowhere = Path::new("/nowhere");
    let finished = install.run(&rig, nowhere, &PRINT);
    assert_eq!(finished.code(), Some(42), "{finished:#?}");
    assert_eq!(finished.stdout, ["--config relay.toml status"]);

    let elsewhere = Install::new("path");
    let finished = elsewhere.run(&rig, &install.0, &PRINT);
    assert_eq!(finished.code(), Some(42), "{finished:#?}");
    assert_eq!(finished.stdout, ["--config relay.toml status"]);
}
