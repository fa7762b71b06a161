//! [`Machine`]: the processes of one machine, with shared memory and a folder of its own.
//!
//! Tests have a robot's machine and a station's, which are one machine to the operating system, or not even that: a machine of
//! `gateways/relay/examples/field` has a network and a clock of its own.

// The tests and the examples each use a part of it.
#![allow(dead_code)]

use std::cell::Cell;
use std::fs;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread;
use std::time::Duration;

use ipc_types::code::{LinkState, RelayLinkState};
use ipc_types::payload::{ModuleState, RelayLink};
use ipc_types::{Ipc, RobotId, Subscriber, Topic, Wake};
use ril_tests::chain::{PATIENCE, PATIENT};
use ril_tests::process::{Finished, Signal, WAIT_LIMIT};
use ril_tests::{Process, PtyFolder, TestDomain, Watchdog};

/// A test with two relays that takes longer hangs. It lasts some 20 s alone, and all of them run at the same time.
const TEST_LIMIT: Duration = Duration::from_secs(300);

/// Variables of the environment that would change what the processes do.
const VARIABLES: [&str; 5] = [
    "RIL_ROBOT",
    "RIL_CONFIG",
    "RIL_PORT",
    "RIL_LOG",
    "RIL_DEADLINE",
];

/// Twice the real clock: the relay's times are real ones, and a machine that is busy keeps up.
const SPEED: u32 = 2;

/// The processes of one machine.
pub struct Machine {
    ril: PathBuf,
    /// The words before each command, such as those that enter a network namespace.
    starter: Vec<String>,
    /// What the processes log; the usual when there is nothing.
    pub log: Option<String>,
    /// How fast the simulator's clock is.
    pub speed: u32,
    folder: PtyFolder,
    is_swept: Cell<bool>,
    /// Last, because it looks whether anything is left.
    pub domain: TestDomain,
}

impl Machine {
    /// A machine whose programs are `ril` and what lies beside it. `name` is said when it hangs.
    pub fn new(ril: &Path, name: &str) -> Machine {
        Machine::within(ril, name, Vec::new(), TEST_LIMIT)
    }

    /// The same with words before each command, for at most `limit`.
    pub fn within(ril: &Path, name: &str, starter: Vec<String>, limit: Duration) -> Machine {
        Machine {
            ril: ril.to_owned(),
            starter,
            log: None,
            speed: SPEED,
            folder: PtyFolder::new(),
            is_swept: Cell::new(false),
            domain: TestDomain::watched_by(Watchdog::with_limit(name, limit)),
        }
    }

    /// Where something of this name is in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.link(name)
    }

    /// Writes a file into the folder in which all commands run: `bridge.toml` and `relay.toml` are found there.
    pub fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).expect("a file in a temporary folder");
    }

    /// Starts `ril`; the words of `args` are separated by spaces.
    pub fn start(&self, args: &str) -> Process {
        let ril = self.ril.to_str().expect("a path in UTF-8");
        let mut words = self.starter.iter().map(String::as_str).chain([ril]);
        let mut command = Command::new(words.next().expect("a program"));
        command.args(words).args(args.split_whitespace());
        command.current_dir(self.folder.path());
        command.env(PATIENCE.0, PATIENCE.1);
        for variable in VARIABLES {
            command.env_remove(variable);
        }
        if let Some(log) = &self.log {
            command.env("RIL_LOG", log);
        }
        Process::spawn(&self.domain, command)
    }

    /// Starts a process that says when it is ready.
    #[track_caller]
    pub fn start_ready(&self, args: &str) -> Process {
        let mut process = self.start(args);
        process.wait_for_text("ready");
        process
    }

    /// Runs `ril` to its end, which must have this exit code.
    #[track_caller]
    pub fn run(&self, args: &str, code: i32) -> Finished {
        let finished = self.start(args).wait_exit();
        assert_eq!(finished.code(), Some(code), "ril {args}: {finished:#?}");
        finished
    }

    /// Subscribes to a topic of `robot` here.
    pub fn subscribe<T: Topic>(&self, robot: u32) -> Listener<T> {
        let robot = RobotId::new(robot).expect("a number of a robot");
        let ipc = self.domain.join_as(robot, "test");
        Listener {
            port: ipc.subscriber().expect("a subscriber"),
            last: None,
            _ipc: ipc,
        }
    }

    /// Waits until a station's link to `robot` is up, and everything of a bridge and a status is provided here.
    #[track_caller]
    pub fn await_link(&self, robot: u32) {
        let mut links = self.subscribe::<RelayLink>(robot);
        links.until("the link is up", |link| {
            link.state == RelayLinkState::Up.code()
        });
        self.subscribe::<ModuleState>(robot)
            .until("the bridge's link is up", is_ready);
    }

    /// A process of this machine is killed: what it leaves in shared memory is removed at the end, as the next start would do.
    pub fn has_kills(&self) {
        self.is_swept.set(true);
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        if self.is_swept.get() && !thread::panicking() {
            self.domain.sweep();
        }
    }
}

fn is_ready(state: &ModuleState) -> bool {
    state.link.state() == Some(LinkState::Up) && state.link.telemetry_published > 0
}

/// Simulator, bridge and status of one robot.
pub struct Crew {
    pub sim: Process,
    pub bridge: Process,
    pub status: Process,
    robot: u32,
}

impl Crew {
    /// Starts the three, and returns when telemetry comes.
    #[track_caller]
    pub fn start(machine: &Machine, robot: u32) -> Crew {
        machine.write("bridge.toml", PATIENT);
        let speed = machine.speed;
        let sim = format!("run sim --robot {robot} --link dsp --seed 1 --speed {speed}");
        let crew = Crew {
            sim: machine.start_ready(&sim),
            bridge: bridge(machine, robot),
            status: machine.start_ready(&format!("run status --robot {robot}")),
            robot,
        };
        // Not by a subscriber of this process: the machine's clock may be another one.
        machine.run(&format!("echo hero --robot {robot} --count 1"), 0);
        crew
    }

    /// Kills the bridge, starts another one, and returns what the former had logged.
    #[track_caller]
    pub fn restart_bridge(&mut self, machine: &Machine) -> Finished {
        machine.has_kills();
        self.bridge.signal(Signal::KILL);
        let killed = self.bridge.wait_exit();
        self.bridge = bridge(machine, self.robot);
        killed
    }

    /// Ends all three in order. Returns the logs of the bridge and the simulator.
    #[track_caller]
    pub fn end(self) -> [Finished; 2] {
        end(self.status);
        [end(self.bridge), end(self.sim)]
    }
}

#[track_caller]
fn bridge(machine: &Machine, robot: u32) -> Process {
    machine.start_ready(&format!("run bridge --robot {robot} --port dsp"))
}

/// Ends a process in order.
#[track_caller]
pub fn end(mut process: Process) -> Finished {
    process.signal(Signal::TERM);
    let finished = process.wait_exit();
    assert_eq!(finished.code(), Some(0), "{finished:#?}");
    finished
}

/// Kills a process of `machine`, and returns what it had logged.
#[track_caller]
pub fn kill(machine: &Machine, mut process: Process) -> Finished {
    machine.has_kills();
    process.signal(Signal::KILL);
    process.wait_exit()
}

/// A subscriber that waits for what a test wants to see.
pub struct Listener<T: Topic> {
    pub port: Subscriber<T>,
    last: Option<T>,
    _ipc: Ipc,
}

impl<T: Topic + Copy> Listener<T> {
    /// Waits for a sample for which `is_right`, and returns it. The newest one so far counts, too.
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
            assert_ne!(
                wake,
                Wake::TimedOut,
                "never: {what}; last: {:#?}",
                self.last
            );
        }
    }

    /// Waits for any sample that comes from now on.
    #[track_caller]
    pub fn next(&mut self) -> T {
        let _ = self.port.latest();
        self.last = None;
        self.until("a sample", |_| true)
    }
}

/// An endpoint on loopback that no other process has at this moment.
pub fn free_endpoint() -> String {
    let listener = TcpListener::bind(("127.0.0.1", 0)).expect("a free port");
    let port = listener.local_addr().expect("an address").port();
    format!("tcp/127.0.0.1:{port}")
}

/// Whether one of the lines contains `text`.
pub fn says(lines: &[String], text: &str) -> bool {
    lines.iter().any(|line| line.contains(text))
}
