//! The shell and the binary `status` over real shared memory, each test in a domain of its own.

mod fixture;
mod logs;

use std::fs;
use std::process::Output;
use std::sync::mpsc;
use std::thread;

use fixture::{Ends, Process, TIMEOUT, command, config, folder, log_text};
use ipc_types::code::ModuleStatus;
use ipc_types::payload::{DspTelemetry, HeroEstimate, HeroTelemetry};
use ipc_types::{Domain, Ipc, RobotId, StateOf, StatusModule, Subscriber, TelemetryGroup, files};
use runtime::notify::Notifier;
use runtime::signal::Termination;
use rustix::process::Signal;
use status::config::Config;
use status::estimator::{Estimator, INPUT_SONAR};
use status::log::event::WriterEnd;
use status::shell::Shell;

/// An estimator as another crate would write it.
struct SonarAlone;

impl Estimator for SonarAlone {
    fn update(&mut self, _raw: &DspTelemetry, hero: &HeroTelemetry) -> HeroEstimate {
        HeroEstimate {
            altitude_m: hero.sonar_height_m.into(),
            altitude_variance_m2: 1.0,
            inputs: INPUT_SONAR,
            valid: 1,
            ..HeroEstimate::default()
        }
    }
}

#[test]
fn samples_go_through_the_shell_and_into_the_log() {
    const SAMPLES: u32 = 100;
    let folder = folder();
    let domain = Domain::isolated();
    let (termination, request) = Termination::by_hand().unwrap();
    let config: Config = runtime::config::parse(&config(folder.path()), "status.toml").unwrap();
    let (opened, is_open) = mpsc::channel();
    let process = thread::spawn({
        let domain = domain.clone();
        move || {
            let ipc = Ipc::join(&domain, RobotId::DEFAULT, "status").unwrap();
            let shell = Shell::open(ipc, &config).unwrap();
            let shell = shell.with_estimator(Box::new(SonarAlone));
            opened.send(()).unwrap();
            shell.run(&termination, &Notifier::from_env()).unwrap()
        }
    });
    is_open.recv_timeout(TIMEOUT).unwrap();

    let mut ends = Ends::join(&domain);
    for number in 1..=SAMPLES {
        let hero = ends.through(number);
        assert_eq!(hero.sonar_height_m, number as f32 / 2.0);
        assert_eq!(hero.sequence, u64::from(number));
        assert_eq!(hero.estimate.altitude_m, f64::from(number) / 2.0);
        assert!(hero.published_ns > 0);
    }
    request.request();
    let summary = process.join().unwrap();
    assert_eq!(
        (summary.received, summary.published, summary.lost),
        (100, 100, 0)
    );
    let log = &summary.logs[0];
    assert_eq!((log.offered, log.lost()), (100, 0));
    assert!(matches!(log.end, WriterEnd::Finished(written) if written.rows == 100));

    let text = log_text(folder.path());
    let mut lines = text.lines();
    let names = "flying\tsequence\treceived_ns\tx_m\ty_m\tsonar_adc";
    assert_eq!(lines.next(), Some(names));
    for number in 1..=SAMPLES {
        assert_eq!(
            lines.next(),
            Some(&*format!("0\t{number}\t0\t\t\t{number}"))
        );
    }
    assert_eq!(lines.next(), None);
    drop(ends);
    assert!(domain.residue().is_empty(), "{:?}", domain.residue());
}

#[test]
fn the_estimator_that_the_configuration_chooses_is_published() {
    let folder = folder();
    let file = folder.path().join("status.toml");
    let mut altitudes = Vec::new();
    for configuration in ["", "[estimator]\nkind = 'altitude'"] {
        fs::write(&file, configuration).unwrap();
        let domain = Domain::isolated();
        let mut ends = Ends::join(&domain);
        let mut process = Process::start(&domain, &file);
        let hero = ends.through_with(|dsp| {
            dsp.valid_groups = TelemetryGroup::Barometer.bit();
            dsp.barometer_adc = 900;
        });
        altitudes.push((hero.estimate.valid, hero.estimate.altitude_m.round()));
        drop(ends);
        assert_eq!(process.end(Signal::TERM).0, Some(0));
    }
    assert_eq!(altitudes, [(0, 0.0), (1, 100.0)]);
}

#[test]
fn status_publishes_its_own_state_at_every_change_and_all_the_time() {
    let folder = folder();
    let file = folder.path().join("status.toml");
    fs::write(&file, "").unwrap();
    let domain = Domain::isolated();
    let ipc = Ipc::join(&domain, RobotId::DEFAULT, "watcher").unwrap();
    let mut states: Subscriber<StateOf<StatusModule>> = ipc.subscriber().unwrap();
    let mut ends = Ends::join(&domain);
    let mut process = Process::start(&domain, &file);
    let mut next = |doing: &str| loop {
        let state = states.recv_timeout(TIMEOUT).unwrap().expect("a state");
        if state.doing() == Some(doing) {
            break state;
        }
    };

    let waiting = next("waiting for telemetry");
    assert_eq!(
        (waiting.module_id, waiting.status(), waiting.is_blocked()),
        (2, Some(ModuleStatus::Running), false)
    );
    // Nothing changes, and the state comes all the same.
    let again = next("waiting for telemetry");
    assert!(again.published_ns > waiting.published_ns);
    assert_eq!(again.since_ns, waiting.since_ns);

    ends.through(7);
    let translating = next("translating telemetry");
    assert!(translating.since_ns > waiting.since_ns);
    // No sample for a second.
    let silent = next("waiting for telemetry");
    assert!(silent.since_ns > translating.since_ns);

    drop((states, ipc, ends));
    assert_eq!(process.end(Signal::TERM).0, Some(0));
    assert!(domain.residue().is_empty(), "{:?}", domain.residue());
}

fn code_and_errors(output: Output) -> (Option<i32>, String) {
    assert_eq!(output.stdout, b"", "standard output is for data");
    (
        output.status.code(),
        String::from_utf8(output.stderr).unwrap(),
    )
}

#[test]
fn each_signal_ends_the_process_with_everything_in_order() {
    for signal in [Signal::INT, Signal::TERM] {
        let folder = folder();
        let logs = folder.path().join("log");
        let file = folder.path().join("status.toml");
        fs::write(&file, config(&logs)).unwrap();
        let domain = Domain::isolated();
        let mut process = Process::start(&domain, &file);
        let mut ends = Ends::join(&domain);
        for number in 1..=10 {
            ends.through(number);
        }
        drop(ends);
        let (code, messages) = process.end(signal);
        assert_eq!(code, Some(0));
        let last = messages.last().unwrap();
        assert!(
            last.contains("received=10 lost=0 published=10"),
            "{messages:#?}"
        );
        assert!(last.contains(": 10 rows"), "{messages:#?}");
        // Reported once: the log asks for groups that no sample has.
        let missing = messages.iter().filter(|line| line.ends_with(" groups=xy"));
        assert_eq!(missing.count(), 1, "{messages:#?}");
        assert_eq!(log_text(&logs).lines().count(), 11);
        assert!(domain.residue().is_empty(), "{:?}", domain.residue());
    }
}

#[test]
fn a_second_status_of_the_same_robot_is_refused() {
    let folder = folder();
    let file = folder.path().join("status.toml");
    fs::write(&file, "").unwrap();
    let domain = Domain::isolated();
    let mut first = Process::start(&domain, &file);
    let mut second = command(&domain);
    second.arg("--config").arg(&file);
    let second = files::while_no_port_opens(|| second.output()).unwrap();
    let (code, errors) = code_and_errors(second);
    assert_eq!(code, Some(1), "{errors}");
    assert!(errors.contains("already provided by `status`"), "{errors}");
    assert_eq!(first.end(Signal::TERM).0, Some(0));
}

#[test]
fn wrong_command_lines_and_configurations_have_their_exit_codes() {
    let folder = folder();
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        path.display().to_string()
    };
    let right = file("right.toml", "[calibration.sonar]\nm_per_step = 1\n");
    let wrong = file("wrong.toml", "[calibration.sonar]\n\nm_per_stap = 1\n");
    let wild = file("wild.toml", "[calibration.servo]\nhalf_travel_us = 1e9\n");
    let absent = folder.path().join("absent.toml").display().to_string();
    let cases: [(&[&str], i32, &str); 7] = [
        (
            &["--check-config", "--config", &wrong],
            78,
            "wrong.toml:3: unknown field `m_per_stap`",
        ),
        (&["--config", &wrong], 78, "did you mean `m_per_step`?"),
        (
            &["--config", &wild],
            78,
            "wild.toml:2: 1000000000 is out of range",
        ),
        (&["--config", &absent], 78, "absent.toml: cannot be read"),
        (&["--robot", "0"], 2, "a robot id is an integer from 1"),
        (&["--robots", "1"], 2, "--robots"),
        (&["-v", "-q"], 2, "cannot be used with"),
    ];
    let domain = Domain::isolated();
    for (arguments, expected_code, expected_text) in cases {
        let mut command = command(&domain);
        command.args(arguments);
        let output = files::while_no_port_opens(|| command.output()).unwrap();
        let (code, errors) = code_and_errors(output);
        assert_eq!(code, Some(expected_code), "{arguments:?}: {errors}");
        assert!(errors.contains(expected_text), "{arguments:?}: {errors}");
        assert!(domain.residue().is_empty(), "{:?}", domain.residue());
    }
    let mut command = command(&domain);
    command.args(["--check-config", "--config", &right]);
    let output = files::while_no_port_opens(|| command.output()).unwrap();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("right.toml is right"), "{text}");
    assert!(text.contains("calibration.sonar.m_per_step"), "{text}");
}
