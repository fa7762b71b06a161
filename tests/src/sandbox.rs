//! [`Sandbox`]: `ril` in a domain and a folder of its own, with real processes to start and to kill, for tests and for
//! programs that measure. This library does not build `ril`: a test says where it is, or [`installed_or_skip`] looks
//! for it.
//!
//! Whatever goes wrong, nothing is left: what was started is killed, and then the domain and the folder are removed.

use std::cell::Cell;
use std::ffi::{OsStr, OsString};
use std::fs;
use std::io::{self, Write as _};
use std::net::{TcpListener, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::{self, Command};
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread;
use std::time::Duration;

use ipc_types::code::LinkState;
use ipc_types::payload::{HeroTelemetry, ModuleState};
use ipc_types::{Ipc, MonotonicNs, RobotId, Subscriber, Topic, Wake};

use crate::domain::TestDomain;
use crate::process::{Finished, Process, Signal, WAIT_LIMIT};
use crate::pty::PtyFolder;
use crate::watchdog::Watchdog;

/// Environment variable that names the binary `ril`.
pub const BINARY_VARIABLE: &str = "RIL_BINARY";

/// Environment variable and value for commands of `ril`: how long each waits for an answer or a sample. A machine that
/// stalls for longer than the usual two seconds must not make it give up.
const LONGEST_WAIT: (&str, &str) = ("RIL_TIMEOUT", "80s");

/// Variables of the environment that would change what the processes do.
const VARIABLES: [&str; 5] = [
    "RIL_ROBOT",
    "RIL_CONFIG",
    "RIL_PORT",
    "RIL_LOG",
    "RIL_DEADLINE",
];

/// A `bridge.toml` with which no machine that stalls for seconds ends a flight, loses the link or lets a request
/// expire.
pub const FOR_SLOW_MACHINES: &str = "\
[link]
pc_timeout_ms = 60000
ack_timeout_ms = 5000
silent_after_ms = 20000
[movement]
begin_within_ms = 60000
";

/// Lets a process of `ril` end when the one that started it is killed.
const WITH_PARENT: &str = "RIL_ENDS_WITH_PARENT";

/// A port on loopback that no other process has, for TCP and for UDP, and that no other test gets: below those that the
/// kernel gives away.
///
/// # Panics
///
/// When there is none.
pub fn free_port() -> u16 {
    static GIVEN: AtomicU32 = AtomicU32::new(0);
    let mut ports = (0..20_000).map(|_| {
        let given = GIVEN.fetch_add(1, Ordering::Relaxed);
        (10_000 + (process::id() * 61 + given) % 20_000) as u16
    });
    let is_free = |port: &u16| {
        let address = ("127.0.0.1", *port);
        TcpListener::bind(address).is_ok() && UdpSocket::bind(address).is_ok()
    };
    ports.find(is_free).expect("a free port")
}

/// The binary `ril` that `RIL_BINARY` names, or the one in a folder of `PATH`. `None` if there is none: a line on
/// standard error then says that the test is skipped, also when tests that pass print nothing.
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

/// As [`installed_or_skip`]; before `PATH` it looks beside `program` and in the folder above, where cargo puts the
/// programs of all crates: for tests and examples of other crates than that of `ril`.
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

/// Where processes run that no other test or measurement sees.
#[derive(Debug)]
pub struct Sandbox {
    ril: Vec<OsString>,
    folder: PtyFolder,
    /// Its processes end when this one is killed, so that the domain can be removed.
    ends_with_parent: bool,
    /// A process was killed that no other one cleans up after.
    has_kills: Cell<bool>,
    /// Last, because it asserts that nothing is left.
    pub domain: TestDomain,
}

impl Sandbox {
    /// A new one in which the words `ril` are the beginning of each command line of `ril`: its path, a program that is
    /// `ril` when its arguments begin with the other words, or words that enter a namespace and then its path. After
    /// `limit` the watchdog ends the program and says `name`.
    pub fn new<W: AsRef<OsStr>>(
        ril: impl IntoIterator<Item = W>,
        name: &str,
        limit: Duration,
    ) -> Sandbox {
        Sandbox {
            ril: ril
                .into_iter()
                .map(|word| word.as_ref().to_owned())
                .collect(),
            folder: PtyFolder::new(),
            ends_with_parent: true,
            has_kills: Cell::new(false),
            domain: TestDomain::watched_by(Watchdog::with_limit(name, limit)),
        }
    }

    /// One with the binary `ril` at this path, for one test, which the usual watchdog watches over.
    pub fn of(ril: impl AsRef<Path>) -> Sandbox {
        Sandbox {
            ril: vec![ril.as_ref().into()],
            folder: PtyFolder::new(),
            ends_with_parent: false,
            has_kills: Cell::new(false),
            domain: TestDomain::new(),
        }
    }

    /// The folder in which all processes run: `bridge.toml` and the like are found there.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Where something of this name is in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.link(name)
    }

    /// Writes a file into the folder, and returns where it is.
    pub fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.path(name);
        fs::write(&path, text).expect("a file in a temporary folder");
        path
    }

    /// The command `ril` with these arguments, in the folder.
    pub fn command(&self, args: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Command {
        let mut command = Command::new(&self.ril[0]);
        command.args(&self.ril[1..]).args(args);
        if self.ends_with_parent {
            command.env(WITH_PARENT, "1");
        }
        self.place(command)
    }

    /// A shell's command line, in which `$0` is `ril`.
    pub fn shell(&self, line: &str) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", line]).args(&self.ril);
        self.place(command)
    }

    /// `command` in the folder, without the variables that change what `ril` does, and with so long a time-out that a
    /// machine that stalls fails nothing.
    pub fn place(&self, mut command: Command) -> Command {
        place(&mut command, self.folder());
        command
    }

    /// Starts a command in the folder and the domain.
    pub fn spawn(&self, command: Command) -> Process {
        Process::spawn(&self.domain, self.place(command))
    }

    /// Starts `ril`; the words of `args` are separated by spaces.
    pub fn start(&self, args: &str) -> Process {
        Process::spawn(&self.domain, self.command(args.split_whitespace()))
    }

    /// Starts `ril` by way of another program, such as `unshare`, which runs it and ends it with itself.
    pub fn start_by(&self, starter: &str, args: &str) -> Process {
        let mut words = starter.split_whitespace();
        let mut command = Command::new(words.next().expect("a program"));
        command
            .args(words)
            .args(&self.ril)
            .args(args.split_whitespace());
        self.spawn(command)
    }

    /// Starts a process of `ril` that says when it is ready.
    #[track_caller]
    pub fn start_ready(&self, args: &str) -> Process {
        let mut process = self.start(args);
        process.wait_for_text("ready");
        process
    }

    /// Runs `ril` to its end, whatever its exit code.
    #[track_caller]
    pub fn finish(&self, args: &str) -> Finished {
        self.start(args).wait_exit()
    }

    /// Runs `ril` to its end, which must have this exit code.
    #[track_caller]
    pub fn run(&self, args: &str, code: i32) -> Finished {
        self.start(args).exits(code)
    }

    /// Kills a process, and returns what it had printed. What it leaves in shared memory is removed when the sandbox is
    /// dropped, as the next start would do.
    #[track_caller]
    pub fn kill(&self, mut process: Process) -> Finished {
        self.has_kills.set(true);
        process.signal(Signal::KILL);
        process.wait_exit()
    }

    /// Starts a simulator with its link `dsp-N`; it is there when this returns.
    #[track_caller]
    pub fn sim(&self, robot: u32, options: &str) -> Process {
        self.start_ready(&format!(
            "run sim --robot {robot} --link dsp-{robot} --seed 1 {options}"
        ))
    }

    /// Starts a bridge at `dsp-N`; it is ready when this returns, its link may not be up yet. Without a `bridge.toml`
    /// in the folder it gets [`FOR_SLOW_MACHINES`].
    #[track_caller]
    pub fn bridge(&self, robot: u32) -> Process {
        let mut options = "";
        if !self.path("bridge.toml").exists() {
            self.write("patient.toml", FOR_SLOW_MACHINES);
            options = "--config patient.toml";
        }
        self.start_ready(&format!(
            "run bridge --robot {robot} --port dsp-{robot} {options}"
        ))
    }

    /// Starts a status; it is ready when this returns.
    #[track_caller]
    pub fn status(&self, robot: u32) -> Process {
        self.start_ready(&format!("run status --robot {robot}"))
    }

    /// Starts simulator, bridge and status of `robot`, and returns when telemetry comes. The simulated clock is `speed`
    /// times as fast.
    #[track_caller]
    pub fn start_robot(&self, robot: u32, speed: u32) -> Robot {
        let processes = Robot {
            sim: self.sim(robot, &format!("--speed {speed}")),
            bridge: self.bridge(robot),
            status: self.status(robot),
            number: robot,
        };
        // Not by a subscriber of this process: the clock of the sandbox may be another one.
        self.run(&format!("echo hero --robot {robot} --count 1"), 0);
        processes
    }

    /// Watches the state of a robot's module.
    pub fn watch(&self, robot: u32) -> TopicWatch<ModuleState> {
        self.subscribe(robot)
    }

    /// Subscribes to a topic of `robot`.
    pub fn subscribe<T: Topic>(&self, robot: u32) -> TopicWatch<T> {
        let robot = RobotId::new(robot).expect("a number of a robot");
        let ipc = self.domain.join_as(robot, "test");
        TopicWatch {
            port: ipc.subscriber().expect("a subscriber"),
            last: None,
            _ipc: ipc,
        }
    }
}

impl Drop for Sandbox {
    fn drop(&mut self) {
        if self.has_kills.get() && !thread::panicking() {
            self.domain.sweep();
        }
    }
}

/// Simulator, bridge and status of one robot in a [`Sandbox`].
#[derive(Debug)]
pub struct Robot {
    /// `ril run sim`
    pub sim: Process,
    /// `ril run bridge`
    pub bridge: Process,
    /// `ril run status`
    pub status: Process,
    number: u32,
}

impl Robot {
    /// Kills the bridge, starts another one, and returns what the killed one had printed.
    #[track_caller]
    pub fn restart_bridge(&mut self, sandbox: &Sandbox) -> Finished {
        sandbox.has_kills.set(true);
        self.bridge.signal(Signal::KILL);
        let killed = self.bridge.wait_exit();
        self.bridge = sandbox.bridge(self.number);
        killed
    }

    /// Ends all three in order. Returns what the bridge and the simulator had printed.
    #[track_caller]
    pub fn end(self) -> [Finished; 2] {
        self.status.end();
        [self.bridge.end(), self.sim.end()]
    }
}

/// A subscriber that waits for what a test wants to see.
pub struct TopicWatch<T: Topic> {
    /// What it reads from.
    pub port: Subscriber<T>,
    last: Option<T>,
    _ipc: Ipc,
}

impl<T: Topic + Copy> TopicWatch<T> {
    /// Waits for a sample for which `is_right`, and returns it. The newest one so far counts, too.
    ///
    /// # Panics
    ///
    /// When none comes for [`WAIT_LIMIT`].
    #[track_caller]
    pub fn until(&mut self, what: &str, mut is_right: impl FnMut(&T) -> bool) -> T {
        loop {
            // What cannot be received now can be by the next call, says the subscriber.
            if let Ok(Some(sample)) = self.port.latest() {
                self.last = Some(sample);
            }
            if let Some(sample) = self.last.filter(|sample| is_right(sample)) {
                return sample;
            }
            let wake = self.port.wait(WAIT_LIMIT).expect("a wait");
            let last = &self.last;
            assert_ne!(wake, Wake::TimedOut, "never: {what}; last: {last:#?}");
        }
    }

    /// Waits for any sample that comes from now on.
    #[track_caller]
    pub fn next_sample(&mut self) -> T {
        let _ = self.port.latest();
        self.last = None;
        self.until("a sample", |_| true)
    }
}

impl TopicWatch<ModuleState> {
    /// Waits until the link is up and the position is known, so that movements are possible.
    #[track_caller]
    pub fn until_ready(&mut self) -> ModuleState {
        self.until("the link is up", |state| {
            state.link.state() == Some(LinkState::Up) && state.link.telemetry_published > 0
        })
    }
}

/// Puts a command of `ril` into `folder`, where it also keeps what outlives it, without the variables that change what
/// it does, and with so long a time-out that a machine that stalls fails nothing.
pub fn place(command: &mut Command, folder: &Path) {
    command
        .current_dir(folder)
        .env("XDG_STATE_HOME", folder.join("state"))
        .env(LONGEST_WAIT.0, LONGEST_WAIT.1);
    for variable in VARIABLES {
        command.env_remove(variable);
    }
}

/// A subscriber at the end of the chain: it receives what simulator, bridge and status make together.
pub struct Witness {
    telemetry: Subscriber<HeroTelemetry>,
    _ipc: Ipc,
}

impl Witness {
    /// Subscribes in the domain.
    pub fn new(domain: &TestDomain) -> Witness {
        let ipc = domain.join("witness");
        Witness {
            telemetry: ipc.subscriber().expect("a subscriber"),
            _ipc: ipc,
        }
    }

    /// Waits for telemetry that the bridge received after `moment`, and says when it came.
    ///
    /// # Panics
    ///
    /// After [`WAIT_LIMIT`].
    #[track_caller]
    pub fn receive_after(&mut self, moment: MonotonicNs) -> MonotonicNs {
        let limit = MonotonicNs::now() + WAIT_LIMIT;
        let mut has_come = false;
        while !has_come {
            let now = MonotonicNs::now();
            assert!(now < limit, "no telemetry since {:?}", now.since(moment));
            self.telemetry.wait(limit.since(now)).expect("a wait");
            // What cannot be received now can be by the next call, says the subscriber.
            let _ = self
                .telemetry
                .drain(|sample| has_come |= sample.received_ns > moment.0);
        }
        MonotonicNs::now()
    }
}

/// What a process holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Holdings {
    /// Open file descriptors.
    pub descriptors: usize,
    /// Resident memory, KiB.
    pub memory_kib: u64,
}

impl Holdings {
    /// Of the process `id`.
    ///
    /// # Panics
    ///
    /// When it has ended.
    pub fn of(id: u32) -> Holdings {
        let descriptors = fs::read_dir(format!("/proc/{id}/fd")).expect("it runs");
        let status = fs::read_to_string(format!("/proc/{id}/status")).expect("it runs");
        let memory_kib = status
            .lines()
            .find_map(|line| line.strip_prefix("VmRSS:")?.trim().strip_suffix(" kB"))
            .and_then(|number| number.trim().parse().ok())
            .expect("the kernel says how much memory a process has");
        Holdings {
            descriptors: descriptors.count(),
            memory_kib,
        }
    }

    /// The larger of both, each by itself.
    pub fn most(self, other: Holdings) -> Holdings {
        Holdings {
            descriptors: self.descriptors.max(other.descriptors),
            memory_kib: self.memory_kib.max(other.memory_kib),
        }
    }
}

/// The recordings in a folder, sorted by name; none if there is no folder. What lies beside them is left out.
///
/// # Panics
///
/// When the folder cannot be read to its end.
pub fn records_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten();
    let paths = entries.map(|entry| entry.expect("an entry").path());
    let mut records: Vec<_> = paths
        .filter(|path| path.extension().is_some_and(|kind| kind == "mcap"))
        .collect();
    records.sort();
    records
}
