//! What the tests of the process share: the two ends that it stands between, the binary itself, its logs.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, ChildStderr, Command, Stdio};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use ipc_types::payload::{DspTelemetry, HeroTelemetry};
use ipc_types::{
    Domain, Ipc, Publisher, RobotId, Source, Subscriber, TelemetryGroup, Waiter, Wake, files,
};
use rustix::process::{Pid, Signal, kill_process};
use tempfile::TempDir;

/// Only a watchdog: no answer in this time is a failure. Far longer than anything takes, on a machine that stalls as
/// well.
pub const TIMEOUT: Duration = Duration::from_secs(90);

/// The two ends that the status process stands between.
pub struct Ends {
    bridge: Publisher<DspTelemetry>,
    consumer: Subscriber<HeroTelemetry>,
}

impl Ends {
    pub fn join(domain: &Domain) -> Ends {
        let ipc = Ipc::join(domain, RobotId::DEFAULT, "test").unwrap();
        Ends {
            bridge: ipc.publisher().unwrap(),
            consumer: ipc.subscriber().unwrap(),
        }
    }

    /// Publishes a sample of the sonar and gives what comes out for it.
    pub fn through(&mut self, sonar_adc: u32) -> HeroTelemetry {
        self.through_with(|dsp| {
            dsp.valid_groups = TelemetryGroup::Sonar.bit();
            dsp.sonar_adc = sonar_adc;
        })
    }

    /// Publishes a sample that `fill` fills and gives what comes out for it.
    pub fn through_with(&mut self, fill: impl FnOnce(&mut DspTelemetry)) -> HeroTelemetry {
        let sequence = self.bridge.publish(fill).unwrap();
        let mut hero = None;
        while hero.is_none() {
            // Status may join after the sample was published: the publisher then gives it to status in the wait.
            let ports: &mut [((), &mut dyn Source)] =
                &mut [((), &mut self.consumer), ((), &mut self.bridge)];
            let wake = Waiter::new().wait(ports, Some(TIMEOUT));
            assert_ne!(wake.unwrap(), Wake::TimedOut, "no telemetry came out");
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

/// A temporary folder. Other tests of this program open ports meanwhile.
pub fn folder() -> TempDir {
    files::while_no_port_opens(tempfile::tempdir).unwrap()
}

pub fn config(directory: &Path) -> String {
    format!(
        "[calibration.sonar]\nm_per_step = 0.5\n[[log]]\ndirectory = '{}'\ngroups = ['sonar', 'xy']\nmin_free_mib = 0\n",
        directory.display()
    )
}

/// The texts of all logs in `directory`, which need not exist yet.
pub fn log_texts(directory: &Path) -> Vec<String> {
    let entries = fs::read_dir(directory).into_iter().flatten();
    let paths = entries.map(|entry| entry.unwrap().path());
    let logs = paths.filter(|path| path.extension().is_some_and(|extension| extension == "tsv"));
    logs.map(|path| fs::read_to_string(path).unwrap()).collect()
}

/// The one log in `directory`.
pub fn log_text(directory: &Path) -> String {
    let [text] = <[String; 1]>::try_from(log_texts(directory)).expect("one log");
    text
}

/// A command for the binary that sees nothing of this process's environment that could matter.
pub fn command(domain: &Domain) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_status"));
    command
        .envs(domain.environment())
        .env_remove("RIL_CONFIG")
        .env_remove("RIL_ROBOT")
        .env_remove("RIL_LOG")
        .env_remove("NOTIFY_SOCKET");
    command
}

/// The binary, at work. Killed when a test fails.
pub struct Process {
    child: Child,
    errors: BufReader<ChildStderr>,
    /// The messages that were read so far.
    pub messages: Vec<String>,
}

impl Process {
    /// Starts the process and waits until it logs that it is ready.
    pub fn start(domain: &Domain, config: &Path) -> Process {
        let mut command = command(domain);
        command
            .arg("--config")
            .arg(config)
            .stderr(Stdio::piped())
            .stdout(Stdio::null());
        // It inherits the umask.
        let mut child = files::while_no_port_opens(|| command.spawn()).unwrap();
        let errors = BufReader::new(child.stderr.take().unwrap());
        let mut process = Process {
            child,
            errors,
            messages: Vec::new(),
        };
        process.wait_for_message("ready");
        process
    }

    /// Waits until a message of the process contains `text`, or one has. Killed when that takes too long.
    pub fn wait_for_message(&mut self, text: &str) {
        let process = self.id();
        let (found, waiting) = mpsc::channel::<()>();
        thread::scope(|scope| {
            scope.spawn(move || {
                if waiting.recv_timeout(TIMEOUT) == Err(RecvTimeoutError::Timeout) {
                    kill_process(process, Signal::KILL).unwrap();
                }
            });
            // Dropped when the message was found, and when it never will be.
            let _found = found;
            while !self.messages.iter().any(|line| line.contains(text)) {
                let mut line = String::new();
                let length = self.errors.read_line(&mut line).unwrap();
                assert_ne!(length, 0, "ended without `{text}`: {:#?}", self.messages);
                self.messages.push(line);
            }
        });
    }

    pub fn id(&self) -> Pid {
        Pid::from_child(&self.child)
    }

    /// Sends `signal`; gives the exit code and the rest of its messages.
    pub fn end(&mut self, signal: Signal) -> (Option<i32>, Vec<String>) {
        kill_process(self.id(), signal).unwrap();
        let messages = self.errors.by_ref().lines().map(Result::unwrap).collect();
        (self.child.wait().unwrap().code(), messages)
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It has ended already unless a test failed.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
