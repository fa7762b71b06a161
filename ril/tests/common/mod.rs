//! What the end-to-end tests share: `ril` in a shared-memory domain and a folder of the test's own, and waiting for what
//! the bridge publishes.

// Each test file uses a part of it.
#![allow(dead_code)]

pub mod flight;

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use ipc_types::payload::{ModuleState, MovementData};
use ipc_types::{Ipc, RobotId, Subscriber, Wake};
pub use ril_tests::chain::FOR_SLOW_MACHINES;
use ril_tests::chain::LONGEST_WAIT;
use ril_tests::process::{Finished, Signal, WAIT_LIMIT};
use ril_tests::{Process, PtyFolder, Received, TestDomain};

/// Variables of the environment that would change what the commands do.
const VARIABLES: [&str; 5] = [
    "RIL_ROBOT",
    "RIL_CONFIG",
    "RIL_PORT",
    "RIL_LOG",
    "RIL_DEADLINE",
];

/// A domain, a folder, and `ril` in both. The domain's guard checks at the end that nothing is left.
pub struct Rig {
    pub domain: TestDomain,
    folder: PtyFolder,
}

impl Rig {
    pub fn new() -> Rig {
        Rig {
            domain: TestDomain::new(),
            folder: PtyFolder::new(),
        }
    }

    /// The folder in which the commands run.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Writes a file into the folder.
    pub fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.folder.link(name);
        fs::write(&path, text).unwrap();
        path
    }

    /// The command `ril` with these arguments, as [`Process::spawn`] takes it.
    pub fn command(&self, args: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_ril"));
        command.args(args);
        self.place(command)
    }

    /// A shell's command line, in which `$0` is `ril`.
    pub fn shell(&self, line: &str) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", line, env!("CARGO_BIN_EXE_ril")]);
        self.place(command)
    }

    /// `command` in the folder, patient, and without what would change what `ril` does.
    pub fn place(&self, mut command: Command) -> Command {
        command.current_dir(self.folder());
        command.env(LONGEST_WAIT.0, LONGEST_WAIT.1);
        for variable in VARIABLES {
            command.env_remove(variable);
        }
        command
    }

    /// Starts `ril`; the words of `args` are separated by spaces.
    pub fn start(&self, args: &str) -> Process {
        Process::spawn(&self.domain, self.command(args.split_whitespace()))
    }

    /// Runs `ril` to its end, which must have this exit code.
    #[track_caller]
    pub fn run(&self, args: &str, code: i32) -> Finished {
        let finished = self.start(args).wait_exit();
        assert_eq!(finished.code(), Some(code), "ril {args}: {finished:#?}");
        finished
    }

    /// What `ril status --json` shows of a robot. Its exit code says whether the link is up and the data is new, which a machine that
    /// stalls decides as well.
    #[track_caller]
    pub fn state(&self, robot: u32) -> serde_json::Value {
        let finished = self.state_of(&format!("state --json --robot {robot}"));
        json(&finished.stdout[0])
    }

    /// Runs `ril status` with these words, which must find a bridge. Unless they say how long, it waits a few seconds for what is new:
    /// in some tests nothing new comes.
    #[track_caller]
    pub fn state_of(&self, args: &str) -> Finished {
        let limit = match args.contains("--timeout") {
            true => "",
            false => "--timeout 5s",
        };
        let finished = self.start(&format!("{args} {limit}")).wait_exit();
        assert!(
            matches!(finished.code(), Some(0 | 4 | 6)),
            "ril {args}: {finished:#?}"
        );
        finished
    }

    /// Starts a simulator with its link `dsp-N`; it is there when this returns.
    pub fn sim(&self, robot: u32, options: &str) -> Process {
        let mut sim = self.start(&format!(
            "run sim --robot {robot} --link dsp-{robot} --seed 1 {options}"
        ));
        sim.wait_for_text("ready");
        sim
    }

    /// Starts a bridge at `dsp-N`; it is ready when this returns, its link may not be up yet. Without a `bridge.toml` of the
    /// test it is patient.
    pub fn bridge(&self, robot: u32) -> Process {
        let is_configured = self.folder().join("bridge.toml").exists();
        let options = if is_configured {
            ""
        } else {
            self.write("patient.toml", FOR_SLOW_MACHINES);
            "--config patient.toml"
        };
        let mut bridge = self.start(&format!(
            "run bridge --robot {robot} --port dsp-{robot} {options}"
        ));
        bridge.wait_for_text("ready");
        bridge
    }

    /// Starts a status; it is ready when this returns.
    pub fn status(&self, robot: u32) -> Process {
        let mut status = self.start(&format!("run status --robot {robot}"));
        status.wait_for_text("ready");
        status
    }

    /// Watches the state of a robot's module.
    pub fn watch(&self, robot: u32) -> Watch {
        let ipc = self.domain.join_as(RobotId::new(robot).unwrap(), "test");
        Watch {
            states: ipc.subscriber().unwrap(),
            last: None,
            _ipc: ipc,
        }
    }
}

/// The published states of a module.
pub struct Watch {
    states: Subscriber<ModuleState>,
    last: Option<ModuleState>,
    _ipc: Ipc,
}

impl Watch {
    /// Waits for a state for which `is_right`, and returns it. The last one counts, too.
    #[track_caller]
    pub fn until(
        &mut self,
        what: &str,
        mut is_right: impl FnMut(&ModuleState) -> bool,
    ) -> ModuleState {
        loop {
            if let Some(state) = self.states.latest().unwrap() {
                self.last = Some(state);
            }
            if let Some(state) = self.last.filter(|state| is_right(state)) {
                return state;
            }
            let wake = self.states.wait(WAIT_LIMIT).unwrap();
            assert_ne!(
                wake,
                Wake::TimedOut,
                "never: {what}; last: {:#?}",
                self.last
            );
        }
    }

    /// Waits until the link is up and the position is known, so that movements are possible.
    #[track_caller]
    pub fn until_ready(&mut self) -> ModuleState {
        use ipc_types::code::LinkState;
        self.until("the link is up", |state| {
            state.link.state() == Some(LinkState::Up) && state.link.telemetry_published > 0
        })
    }
}

/// Ends a process with `signal`; it must end with exit code 0.
#[track_caller]
pub fn end(mut process: Process, signal: Signal) -> Finished {
    process.signal(signal);
    let finished = process.wait_exit();
    assert_eq!(finished.code(), Some(0), "{finished:#?}");
    finished
}

/// Whether one of the lines contains `text`.
pub fn says(lines: &[String], text: &str) -> bool {
    lines.iter().any(|line| line.contains(text))
}

/// A line of JSON.
#[track_caller]
pub fn json(line: &str) -> serde_json::Value {
    serde_json::from_str(line).unwrap_or_else(|error| panic!("{line}: {error}"))
}

/// The movement that was received.
pub fn movement(received: Received) -> MovementData {
    match received {
        Received::Movement(movement) => movement,
        other => panic!("a movement was expected: {other:?}"),
    }
}
