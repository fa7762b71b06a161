//! The shell and the binary `status` over real shared memory, each test in a domain of its own.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStderr, Command, Output, Stdio};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use ipc_types::payload::{DspTelemetry, HeroTelemetry};
use ipc_types::{Domain, Ipc, Publisher, RobotId, Subscriber, TelemetryGroup};
use runtime::notify::Notifier;
use runtime::signal::Termination;
use rustix::process::{Pid, Resource, Rlimit, Signal, getrlimit, kill_process, prlimit};
use status::config::Config;
use status::shell::Shell;

/// Only a watchdog: no answer in this time is a failure.
const PATIENCE: Duration = Duration::from_secs(20);

/// The two ends that the status process stands between.
struct Ends {
    bridge: Publisher<DspTelemetry>,
    consumer: Subscriber<HeroTelemetry>,
}

impl Ends {
    fn join(domain: &Domain) -> Ends {
        let ipc = Ipc::join(domain, RobotId::DEFAULT, "test").unwrap();
        Ends {
            bridge: ipc.publisher().unwrap(),
            consumer: ipc.subscriber().unwrap(),
        }
    }

    /// Publishes a sample and gives what comes out for it.
    fn through(&mut self, sonar_adc: u32) -> HeroTelemetry {
        let fill = |dsp: &mut DspTelemetry| {
            dsp.valid_groups = TelemetryGroup::Sonar.bit();
            dsp.sonar_adc = sonar_adc;
        };
        let sequence = self.bridge.publish(fill).unwrap();
        let mut hero = None;
        while hero.is_none() {
            let wake = self.consumer.wait(PATIENCE).unwrap();
            assert_ne!(wake, ipc_types::Wake::TimedOut, "no telemetry came out");
            self.consumer
                .drain(|sample| {
                    if sample.source_sequence == sequence {
                        hero = Some(*sample);
                    }
                })
                .unwrap();
        }
        hero.unwrap()
    }
}

fn config(directory: &Path) -> String {
    format!(
        "[calibration.sonar]\nm_per_step = 0.5\n[[log]]\ndirectory = '{}'\ngroups = ['sonar', 'xy']\nmin_free_mib = 0\n",
        directory.display()
    )
}

/// The texts of all logs in `directory`, which need not exist yet.
fn log_texts(directory: &Path) -> Vec<String> {
    let entries = fs::read_dir(directory).into_iter().flatten();
    let paths = entries.map(|entry| entry.unwrap().path());
    let logs = paths.filter(|path| path.extension().is_some_and(|extension| extension == "tsv"));
    logs.map(|path| fs::read_to_string(path).unwrap()).collect()
}

/// The one log in `directory`.
fn log_text(directory: &Path) -> String {
    let [text] = <[String; 1]>::try_from(log_texts(directory)).expect("one log");
    text
}

#[test]
fn samples_go_through_the_shell_and_into_the_log() {
    const SAMPLES: u32 = 100;
    let folder = tempfile::tempdir().unwrap();
    let domain = Domain::isolated();
    let (termination, request) = Termination::by_hand().unwrap();
    let config: Config = runtime::config::parse(&config(folder.path()), "status.toml").unwrap();
    let (opened, is_open) = mpsc::channel();
    let process = thread::spawn({
        let domain = domain.clone();
        move || {
            let notifier = Notifier::from_env();
            let shell = Shell::open(&domain, RobotId::DEFAULT, &config, notifier).unwrap();
            opened.send(()).unwrap();
            shell.run(&termination).unwrap()
        }
    });
    is_open.recv_timeout(PATIENCE).unwrap();

    let mut ends = Ends::join(&domain);
    for number in 1..=SAMPLES {
        let hero = ends.through(number);
        assert_eq!(hero.sonar_height_m, number as f32 / 2.0);
        assert_eq!(hero.sequence, u64::from(number));
        assert!(hero.published_ns > 0);
    }
    request.request();
    let summary = process.join().unwrap();
    assert_eq!(
        (summary.received, summary.published, summary.lost),
        (100, 100, 0)
    );
    let log = &summary.logs[0];
    assert_eq!((log.taken, log.written.unwrap().rows), (100, 100));

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

/// A command for the binary that sees nothing of this process's environment that could matter.
fn command(domain: &Domain) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_status"));
    command
        .envs(domain.environment())
        .env_remove("RIL_CONFIG")
        .env_remove("RIL_ROBOT")
        .env_remove("RIL_LOG")
        .env_remove("NOTIFY_SOCKET");
    command
}

fn code_and_errors(output: Output) -> (Option<i32>, String) {
    assert_eq!(output.stdout, b"", "standard output is for data");
    (
        output.status.code(),
        String::from_utf8(output.stderr).unwrap(),
    )
}

/// The binary, at work. Killed when a test fails.
struct Process {
    child: Child,
    errors: BufReader<ChildStderr>,
    /// What it has said as far as it was listened to.
    said: Vec<String>,
}

impl Process {
    /// Starts the process and waits until it says that it is ready.
    fn start(domain: &Domain, config: &Path) -> Process {
        let mut child = command(domain)
            .arg("--config")
            .arg(config)
            .stderr(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        let errors = BufReader::new(child.stderr.take().unwrap());
        let mut process = Process {
            child,
            errors,
            said: Vec::new(),
        };
        process.hear("ready");
        process
    }

    /// Waits until the process says `word`, or has said it.
    fn hear(&mut self, word: &str) {
        while !self.said.iter().any(|line| line.contains(word)) {
            let mut line = String::new();
            let length = self.errors.read_line(&mut line).unwrap();
            assert_ne!(length, 0, "ended without `{word}`: {:#?}", self.said);
            self.said.push(line);
        }
    }

    fn id(&self) -> Pid {
        Pid::from_child(&self.child)
    }

    /// Sends `signal`; gives the exit code and the rest of what the process says.
    fn end(&mut self, signal: Signal) -> (Option<i32>, Vec<String>) {
        kill_process(self.id(), signal).unwrap();
        let told = self.errors.by_ref().lines().map(Result::unwrap).collect();
        (self.child.wait().unwrap().code(), told)
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It has ended already unless a test failed.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn each_signal_ends_the_process_with_everything_in_order() {
    for signal in [Signal::INT, Signal::TERM] {
        let folder = tempfile::tempdir().unwrap();
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
        let (code, told) = process.end(signal);
        assert_eq!(code, Some(0));
        let last = told.last().unwrap();
        assert!(
            last.contains("received=10 lost=0 published=10"),
            "{told:#?}"
        );
        assert!(last.contains(": 10 rows"), "{told:#?}");
        // Told once, however often: the log asks for groups that no sample has.
        let missing = told.iter().filter(|line| line.ends_with(" groups=xy"));
        assert_eq!(missing.count(), 1, "{told:#?}");
        assert_eq!(log_text(&logs).lines().count(), 11);
        assert!(domain.residue().is_empty(), "{:?}", domain.residue());
    }
}

#[test]
fn a_second_status_of_the_same_robot_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("status.toml");
    fs::write(&file, "").unwrap();
    let domain = Domain::isolated();
    let mut first = Process::start(&domain, &file);
    let second = command(&domain)
        .arg("--config")
        .arg(&file)
        .output()
        .unwrap();
    let (code, errors) = code_and_errors(second);
    assert_eq!(code, Some(1), "{errors}");
    assert!(errors.contains("already provided by `status`"), "{errors}");
    assert_eq!(first.end(Signal::TERM).0, Some(0));
}

#[test]
fn a_kill_leaves_whole_rows_and_the_next_start_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let logs = folder.path().join("log");
    let file = folder.path().join("status.toml");
    fs::write(&file, config(&logs)).unwrap();
    let domain = Domain::isolated();
    let mut ends = Ends::join(&domain);
    let mut process = Process::start(&domain, &file);
    // Until rows have reached the file by themselves.
    let mut number = 0;
    while log_texts(&logs).iter().all(|text| text.lines().count() < 2) {
        number += 1;
        ends.through(number);
    }
    assert_eq!(process.end(Signal::KILL).0, None);
    let text = log_text(&logs);
    assert!(text.ends_with('\n'));
    assert!(
        text.lines().all(|row| row.split('\t').count() == 6),
        "whole rows"
    );

    fs::remove_dir_all(&logs).unwrap();
    let mut process = Process::start(&domain, &file);
    // The bridge and the consumer are still the same.
    ends.through(1);
    drop(ends);
    assert_eq!(process.end(Signal::TERM).0, Some(0));
    assert!(domain.residue().is_empty(), "{:?}", domain.residue());
}

/// Lets the room for logs in `directory` run out while telemetry flows, and gives it back: nothing is lost, because it
/// was not for long, and a `word` was said about it.
fn room_runs_out_and_comes_back(
    directory: &Path,
    configuration: &str,
    word: &str,
    run_out: impl FnOnce(Pid),
    give_back: impl FnOnce(Pid),
) {
    const SAMPLES: u32 = 2000;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("status.toml");
    fs::write(&file, configuration).unwrap();
    let domain = Domain::isolated();
    let mut ends = Ends::join(&domain);
    let mut process = Process::start(&domain, &file);
    process.hear("log opened");
    ends.through(1);
    run_out(process.id());
    for number in 2..=SAMPLES {
        ends.through(number);
    }
    process.hear(word);
    for number in SAMPLES + 1..=2 * SAMPLES {
        ends.through(number);
    }
    give_back(process.id());
    process.hear("the log is written again");
    for number in 2 * SAMPLES + 1..=3 * SAMPLES {
        ends.through(number);
    }
    drop(ends);
    let (code, told) = process.end(Signal::TERM);
    assert_eq!(code, Some(0));
    let last = told.last().unwrap();
    let (all, rows) = (
        format!("published={}", 3 * SAMPLES),
        format!(": {} rows in", 3 * SAMPLES),
    );
    assert!(last.contains(&all) && last.contains(&rows), "{last}");
    assert!(!last.contains("rows lost"), "{last}");

    let mut numbers = Vec::new();
    for text in log_texts(directory) {
        assert!(text.starts_with("flying\t") && text.ends_with('\n'));
        for row in text.lines().skip(1) {
            let cells: Vec<_> = row.split('\t').collect();
            assert_eq!(cells.len(), 6, "{row:?}");
            numbers.push(cells[1].parse::<u32>().unwrap());
        }
    }
    numbers.sort_unstable();
    assert!(
        numbers.into_iter().eq(1..=3 * SAMPLES),
        "none twice and none missing"
    );
}

#[test]
fn writes_that_the_kernel_refuses_cost_no_telemetry_and_no_row() {
    let folder = tempfile::tempdir().unwrap();
    let limit_files = |process: Pid, current: Option<u64>| {
        // What a process inherits it has in common with this one.
        let maximum = getrlimit(Resource::Fsize).maximum;
        let limits = Rlimit { current, maximum };
        prlimit(Some(process), Resource::Fsize, limits).unwrap();
    };
    room_runs_out_and_comes_back(
        folder.path(),
        &config(folder.path()),
        "the log cannot be written",
        // In the middle of a row. Its signal would end the process.
        |process| limit_files(process, Some(5_001)),
        |process| limit_files(process, None),
    );
}

/// A file system of its own in memory, of some size; gone when it is dropped.
struct SmallDisk {
    mount_point: tempfile::TempDir,
}

impl SmallDisk {
    /// Nothing if this user may not have one, which is said.
    fn mount(size: &str) -> Option<SmallDisk> {
        let mount_point = tempfile::tempdir().unwrap();
        let mount = Command::new("mount")
            .args(["-t", "tmpfs", "-o"])
            .arg(format!("size={size}"))
            .arg("status-test")
            .arg(mount_point.path())
            .output();
        match mount {
            Ok(output) if output.status.success() => Some(SmallDisk { mount_point }),
            refused => {
                eprintln!("SKIPPED: this user cannot mount a small file system: {refused:?}");
                None
            }
        }
    }

    fn path(&self) -> &Path {
        self.mount_point.path()
    }

    /// Takes `bytes`, or all that there are.
    fn fill(&self, bytes: usize) {
        let mut file = fs::File::create(self.path().join("filler")).unwrap();
        // That it is full is what is wanted.
        let _ = file.write_all(&vec![0; bytes]);
    }

    fn empty(&self) {
        fs::remove_file(self.path().join("filler")).unwrap();
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        // Lazily: a process that a failed test has left may still have a file open.
        let _ = Command::new("umount").arg("-l").arg(self.path()).status();
    }
}

#[test]
fn a_full_file_system_costs_no_telemetry_and_no_row() {
    let Some(disk) = SmallDisk::mount("256k") else {
        return;
    };
    room_runs_out_and_comes_back(
        disk.path(),
        &config(disk.path()),
        "the log cannot be written",
        |_| disk.fill(1 << 20),
        |_| disk.empty(),
    );
}

#[test]
fn a_file_system_that_is_nearly_full_is_left_alone() {
    let Some(disk) = SmallDisk::mount("16m") else {
        return;
    };
    let configuration = config(disk.path()).replace("min_free_mib = 0", "min_free_mib = 8");
    room_runs_out_and_comes_back(
        disk.path(),
        &configuration,
        "the disk is nearly full",
        |_| disk.fill(9 << 20),
        |_| disk.empty(),
    );
}

#[test]
fn wrong_command_lines_and_configurations_have_their_exit_codes() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        path.display().to_string()
    };
    let right = file("right.toml", "[calibration.sonar]\nm_per_step = 1\n");
    let wrong = file("wrong.toml", "[calibration.sonar]\n\nm_per_stap = 1\n");
    let wild = file("wild.toml", "[calibration.servo]\nhalf_travel_us = 1e9\n");
    let absent = folder.path().join("absent.toml").display().to_string();
    let cases: [(&[&str], i32, &str); 8] = [
        (
            &["--check-config", "--config", &right],
            0,
            "the configuration is right",
        ),
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
        let output = command(&domain).args(arguments).output().unwrap();
        let (code, errors) = code_and_errors(output);
        assert_eq!(code, Some(expected_code), "{arguments:?}: {errors}");
        assert!(errors.contains(expected_text), "{arguments:?}: {errors}");
        assert!(domain.residue().is_empty(), "{:?}", domain.residue());
    }
}
