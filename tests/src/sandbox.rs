//! [`Sandbox`]: `ril` in a domain and a folder of its own, for tests and for programs that measure.
//!
//! Whatever goes wrong, nothing is left: what was started is killed, and then the domain and the folder are removed.

use std::ffi::{OsStr, OsString};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::payload::HeroTelemetry;
use ipc_types::{Ipc, Subscriber};

use crate::chain::place;
use crate::domain::TestDomain;
use crate::process::{Finished, Process, WAIT_LIMIT};
use crate::pty::PtyFolder;
use crate::watchdog::Watchdog;

/// Lets a process of `ril` end when the one that started it is killed, so that the domain can be removed.
const WITH_PARENT: &str = "RIL_ENDS_WITH_PARENT";

/// Where processes run that no other test or measurement sees.
#[derive(Debug)]
pub struct Sandbox {
    ril: Vec<OsString>,
    folder: PtyFolder,
    /// Last, because it asserts that nothing is left.
    pub domain: TestDomain,
}

impl Sandbox {
    /// A new one in which the words `ril` are the beginning of each command line of `ril`: its path, or a program that is `ril` when its
    /// arguments begin with the other words. After `limit` the watchdog ends the program and says `name`.
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
