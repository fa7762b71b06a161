//! [`Chain`]: the real simulator, bridge and status as processes of their own, for tests that want the real thing.
//!
//! They are commands of the one binary `ril`, which this library does not build: a test says where it is, or
//! [`installed_or_skip`] looks for it.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use ipc_types::code::LinkState;
use ipc_types::payload::ModuleState;
use ipc_types::{Domain, Ipc, RobotId, Wake};

use crate::process::{Process, WAIT_LIMIT};
use crate::pty::PtyFolder;

/// Environment variable that names the binary `ril`.
pub const BINARY_VARIABLE: &str = "RIL_BINARY";

/// Environment variable and value for commands of `ril`: how long each waits for an answer or a sample. A machine that stalls for
/// longer than the usual two seconds must not make it give up.
pub const LONGEST_WAIT: (&str, &str) = ("RIL_TIMEOUT", "80s");

/// A `bridge.toml` with which no machine that stalls for seconds ends a flight, loses the link or lets a request expire.
pub const FOR_SLOW_MACHINES: &str = "\
[link]
pc_timeout_ms = 60000
ack_timeout_ms = 5000
silent_after_ms = 20000
[movement]
begin_within_ms = 60000
";

/// The processes of robot 1, in the order in which they are started. Any of them may be killed, replaced or taken away.
#[derive(Debug)]
pub struct Chain {
    /// Where the pseudo-terminal's link lies, and files that the test wants there; dropped last.
    pub folder: PtyFolder,
    /// `ril run sim`
    pub sim: Process,
    /// `ril run bridge`
    pub bridge: Process,
    /// `ril run status`
    pub status: Process,
    binary: PathBuf,
}

/// The binary `ril` that `RIL_BINARY` names, or the one in a folder of `PATH`. `None` if there is none: a line on standard
/// error then says that the test is skipped, also when tests that pass print nothing.
pub fn installed_or_skip() -> Option<PathBuf> {
    let installed = installed();
    if installed.is_none() {
        // Not `eprintln`, which is shown only if a test fails.
        let _ = writeln!(
            io::stderr(),
            "SKIPPED: no `ril` in PATH, and {BINARY_VARIABLE} names none"
        );
    }
    installed
}

/// As [`installed_or_skip`]; before `PATH` it looks beside `program` and in the folder above, where cargo puts the programs of all
/// crates: for tests and examples of other crates than that of `ril`.
pub fn beside_or_skip(program: &Path) -> Option<PathBuf> {
    let folders = program.ancestors().skip(1).take(2);
    let beside = folders
        .map(|folder| folder.join("ril"))
        .find(|candidate| candidate.is_file());
    match beside {
        Some(beside) if std::env::var_os(BINARY_VARIABLE).is_none() => Some(beside),
        _ => installed_or_skip(),
    }
}

fn installed() -> Option<PathBuf> {
    if let Some(binary) = std::env::var_os(BINARY_VARIABLE) {
        return Some(binary.into());
    }
    let folders = std::env::var_os("PATH")?;
    let mut candidates = std::env::split_paths(&folders).map(|folder| folder.join("ril"));
    candidates.find(|candidate| candidate.is_file())
}

impl Chain {
    /// Starts the three with the binary `ril` at `binary`, and returns when the DSP's telemetry comes.
    ///
    /// # Panics
    ///
    /// When one of them ends, or nothing comes for [`WAIT_LIMIT`], with what was printed.
    #[track_caller]
    pub fn start(domain: &Domain, binary: &Path) -> Chain {
        Chain::hurried(domain, binary, 1)
    }

    /// As [`Chain::start`], with the simulator's clock so many times as fast as the host's.
    ///
    /// # Panics
    ///
    /// As [`Chain::start`].
    #[track_caller]
    pub fn hurried(domain: &Domain, binary: &Path, speed: u32) -> Chain {
        let speed = speed.to_string();
        let folder = PtyFolder::new();
        let sim = spawn(
            domain,
            binary,
            &folder,
            &[
                "run", "sim", "--link", "dsp", "--seed", "1", "--speed", &speed,
            ],
        );
        std::fs::write(folder.link("bridge.toml"), FOR_SLOW_MACHINES)
            .expect("a file in the test's folder");
        let bridge = spawn(domain, binary, &folder, &["run", "bridge", "--port", "dsp"]);
        let status = spawn(domain, binary, &folder, &["run", "status"]);
        wait_for_telemetry(domain);
        Chain {
            folder,
            sim,
            bridge,
            status,
            binary: binary.to_owned(),
        }
    }

    /// Starts another bridge in the place of one that was killed, and returns when telemetry comes.
    #[track_caller]
    pub fn restart_bridge(&mut self, domain: &Domain) {
        self.bridge = spawn(
            domain,
            &self.binary,
            &self.folder,
            &["run", "bridge", "--port", "dsp"],
        );
        wait_for_telemetry(domain);
    }

    /// Starts another status in the place of one that was killed, and returns when it is ready.
    #[track_caller]
    pub fn restart_status(&mut self, domain: &Domain) {
        self.status = spawn(domain, &self.binary, &self.folder, &["run", "status"]);
    }

    /// Runs an operator's command of `ril` to its end, such as `["takeoff", "--altitude", "5"]`.
    #[track_caller]
    pub fn run(&self, domain: &Domain, args: &[&str]) -> crate::process::Finished {
        command(domain, &self.binary, &self.folder, args).wait_exit()
    }

    /// Ends all three in order.
    ///
    /// # Panics
    ///
    /// When one of them does not end with exit code 0.
    #[track_caller]
    pub fn end(self) {
        for process in [self.status, self.bridge, self.sim] {
            process.end();
        }
    }
}

/// Variables of the environment that would change what the processes do.
const VARIABLES: [&str; 5] = [
    "RIL_ROBOT",
    "RIL_CONFIG",
    "RIL_PORT",
    "RIL_LOG",
    "RIL_DEADLINE",
];

/// Puts a command of `ril` into `folder`, without the variables that change what it does, and with so long a time-out that a machine that
/// stalls fails nothing.
pub fn place(command: &mut std::process::Command, folder: &Path) {
    command
        .current_dir(folder)
        .env(LONGEST_WAIT.0, LONGEST_WAIT.1);
    for variable in VARIABLES {
        command.env_remove(variable);
    }
}

fn command(domain: &Domain, binary: &Path, folder: &PtyFolder, args: &[&str]) -> Process {
    let mut command = std::process::Command::new(binary);
    command.args(args);
    place(&mut command, folder.path());
    Process::spawn(domain, command)
}

/// Starts a process that says when it is ready.
#[track_caller]
fn spawn(domain: &Domain, binary: &Path, folder: &PtyFolder, args: &[&str]) -> Process {
    let mut process = command(domain, binary, folder, args);
    process.wait_for_text("ready");
    process
}

#[track_caller]
fn wait_for_telemetry(domain: &Domain) {
    let ipc = Ipc::join(domain, RobotId::DEFAULT, "test").expect("a part in the domain");
    let mut states = ipc.subscriber::<ModuleState>().expect("a subscriber");
    loop {
        if let Some(state) = states.latest().expect("states")
            && state.link.state() == Some(LinkState::Up)
            && state.link.telemetry_published > 0
        {
            return;
        }
        let wake = states.wait(WAIT_LIMIT).expect("a wait");
        assert_ne!(wake, Wake::TimedOut, "the link to the DSP never came up");
    }
}
