//! [`Sandbox`]: `ril` in a domain and a folder of its own, for tests and for programs that measure.
//!
//! Whatever goes wrong, nothing is left: what was started is killed, and then the domain and the folder are removed.

use std::cell::Cell;
use std::ffi::{OsStr, OsString};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread;
use std::time::Duration;

use ipc_types::payload::HeroTelemetry;
use ipc_types::{Ipc, MonotonicNs, RobotId, Subscriber, Topic, Wake};

use crate::chain::{FOR_SLOW_MACHINES, place};
use crate::domain::TestDomain;
use crate::process::{Finished, Process, Signal, WAIT_LIMIT};
use crate::pty::PtyFolder;
use crate::watchdog::Watchdog;

/// Lets a process of `ril` end when the one that started it is killed, so that the domain can be removed.
const WITH_PARENT: &str = "RIL_ENDS_WITH_PARENT";

/// Where processes run that no other test or measurement sees.
#[derive(Debug)]
pub struct Sandbox {
    ril: Vec<OsString>,
    folder: PtyFolder,
    /// A process was killed that no other one cleans up after.
    has_kills: Cell<bool>,
    /// Last, because it asserts that nothing is left.
    pub domain: TestDomain,
}

impl Sandbox {
    /// A new one in which the words `ril` are the beginning of each command line of `ril`: its path, a program that is `ril` when its
    /// arguments begin with the other words, or words that enter a namespace and then its path. After `limit` the watchdog ends the program and says `name`.
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
            has_kills: Cell::new(false),
            domain: TestDomain::watched_by(Watchdog::with_limit(name, limit)),
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

    /// Writes a file into the folder.
    pub fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).expect("a file in a temporary folder");
    }

    /// Starts a command in the folder and the domain.
    pub fn spawn(&self, mut command: Command) -> Process {
        place(&mut command, self.folder());
        Process::spawn(&self.domain, command)
    }

    /// Starts `ril`; the words of `args` are separated by spaces.
    pub fn start(&self, args: &str) -> Process {
        let mut command = Command::new(&self.ril[0]);
        command.args(&self.ril[1..]).args(args.split_whitespace());
        command.env(WITH_PARENT, "1");
        self.spawn(command)
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

    /// Runs `ril` to its end.
    #[track_caller]
    pub fn run(&self, args: &str) -> Finished {
        self.start(args).wait_exit()
    }

    /// Runs `ril` to its end, which must have this exit code.
    #[track_caller]
    pub fn expect(&self, args: &str, code: i32) -> Finished {
        let finished = self.run(args);
        assert_eq!(finished.code(), Some(code), "ril {args}: {finished:#?}");
        finished
    }

    /// Kills a process, and returns what it had printed. What it leaves in shared memory is removed when the sandbox is dropped, as the
    /// next start would do.
    #[track_caller]
    pub fn kill(&self, mut process: Process) -> Finished {
        self.has_kills.set(true);
        process.signal(Signal::KILL);
        process.wait_exit()
    }

    /// Starts simulator, bridge and status of `robot`, and returns when telemetry comes. The simulated clock is `speed` times as fast.
    /// Without a `bridge.toml` in the folder the bridge gets one with which no machine that stalls for seconds ends a flight.
    #[track_caller]
    pub fn start_robot(&self, robot: u32, speed: u32) -> Robot {
        if !self.path("bridge.toml").exists() {
            self.write("bridge.toml", FOR_SLOW_MACHINES);
        }
        let sim = format!("run sim --robot {robot} --link dsp --seed 1 --speed {speed}");
        let robot = Robot {
            sim: self.start_ready(&sim),
            bridge: self.start_bridge(robot),
            status: self.start_ready(&format!("run status --robot {robot}")),
            number: robot,
        };
        // Not by a subscriber of this process: the clock of the sandbox may be another one.
        self.expect(&format!("echo hero --robot {} --count 1", robot.number), 0);
        robot
    }

    #[track_caller]
    fn start_bridge(&self, robot: u32) -> Process {
        self.start_ready(&format!("run bridge --robot {robot} --port dsp"))
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
        self.bridge = sandbox.start_bridge(self.number);
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
