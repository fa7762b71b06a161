//! The processes of one robot, in shared memory and a folder of their own, and what can be seen of them from outside.
//!
//! Whatever goes wrong, nothing is left: what was started is killed, and then the domain and the folder are removed.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::process::Command;
use std::time::Duration;

use ipc_types::payload::HeroTelemetry;
use ipc_types::{MonotonicNs, Subscriber};
use ril_tests::chain::{PATIENCE, PATIENT};
use ril_tests::languages::{Compiler, python, python_example, skip};
use ril_tests::process::{Finished, Signal, Stream, WAIT_LIMIT};
use ril_tests::{Process, PtyFolder, TestDomain, Watchdog};

/// First argument of a program that is to be `ril` itself.
pub const BE_RIL: &str = "be-ril";

/// Variables of the environment that would change what the processes do.
const VARIABLES: [&str; 5] = [
    "RIL_ROBOT",
    "RIL_CONFIG",
    "RIL_PORT",
    "RIL_LOG",
    "RIL_DEADLINE",
];

/// Lets the children end when this process is killed, and so the domain go.
const WITH_PARENT: &str = "RIL_ENDS_WITH_PARENT";

/// How to start `ril`.
#[derive(Clone, Debug)]
pub struct Program {
    path: PathBuf,
    is_this: bool,
}

// The program is started as itself, its tests as the binary.
#[allow(dead_code)]
impl Program {
    /// The binary at `path`.
    pub fn at(path: &str) -> Program {
        Program {
            path: path.into(),
            is_this: false,
        }
    }

    /// The running program, which is `ril` when its first argument is [`BE_RIL`].
    pub fn this() -> std::io::Result<Program> {
        Ok(Program {
            path: std::env::current_exe()?,
            is_this: true,
        })
    }
}

/// A process that can be killed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The simulator, with the serial port.
    Sim,
    /// The bridge.
    Bridge,
    /// Status.
    Status,
    /// A consumer of telemetry in SI units, which prints it.
    Consumer,
    /// The same in C.
    ConsumerInC,
    /// The same in Python.
    ConsumerInPython,
}

impl Kind {
    /// All, in the order of the data.
    pub const ALL: [Kind; 6] = [
        Kind::Sim,
        Kind::Bridge,
        Kind::Status,
        Kind::Consumer,
        Kind::ConsumerInC,
        Kind::ConsumerInPython,
    ];

    /// Those that need nothing but `ril`.
    pub const CREW: [Kind; 4] = [Kind::Sim, Kind::Bridge, Kind::Status, Kind::Consumer];

    /// As it is named on the command line and in the table.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Sim => "sim",
            Kind::Bridge => "bridge",
            Kind::Status => "status",
            Kind::Consumer => "consumer",
            Kind::ConsumerInC => "c-consumer",
            Kind::ConsumerInPython => "python-consumer",
        }
    }

    /// Whether other processes need nothing of it.
    pub fn is_consumer(self) -> bool {
        matches!(
            self,
            Kind::Consumer | Kind::ConsumerInC | Kind::ConsumerInPython
        )
    }
}

/// Where everything happens: a domain and a folder that nobody else has.
pub struct Site {
    program: Program,
    /// Programs in C, as they are built.
    c_programs: RefCell<BTreeMap<&'static str, PathBuf>>,
    folder: PtyFolder,
    /// Last, because it looks whether anything is left.
    pub domain: TestDomain,
}

impl Site {
    /// A new one. What hangs for longer than `limit` is ended.
    pub fn new(program: &Program, name: &str, limit: Duration) -> Site {
        Site {
            program: program.clone(),
            c_programs: RefCell::default(),
            folder: PtyFolder::new(),
            domain: TestDomain::watched_by(Watchdog::with_limit(name, limit)),
        }
    }

    /// Where something of this name is in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.link(name)
    }

    /// Writes a file into the folder, in which all processes run; `bridge.toml` and `dsp-sim.toml` are found there.
    pub fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).expect("a file in a temporary folder");
    }

    /// Starts `ril` with these arguments.
    pub fn start(&self, args: &str) -> Process {
        let mut command = Command::new(&self.program.path);
        command.env(WITH_PARENT, "1");
        self.spawn_ril(command, args)
    }

    /// Starts `ril` with these arguments by way of another program, which is to run it and to end it with itself.
    pub fn start_by(&self, starter: &str, args: &str) -> Process {
        let mut words = starter.split_whitespace();
        let mut command = Command::new(words.next().expect("a program"));
        command.args(words).arg(&self.program.path);
        self.spawn_ril(command, args)
    }

    fn spawn_ril(&self, mut command: Command, args: &str) -> Process {
        if self.program.is_this {
            command.arg(BE_RIL);
        }
        command.args(args.split_whitespace());
        self.spawn(command)
    }

    fn spawn(&self, mut command: Command) -> Process {
        command.current_dir(self.folder.path());
        command.env(PATIENCE.0, PATIENCE.1);
        for variable in VARIABLES {
            command.env_remove(variable);
        }
        Process::spawn(&self.domain, command)
    }

    /// Runs `ril` with these arguments to its end.
    #[track_caller]
    pub fn run(&self, args: &str) -> Finished {
        self.start(args).wait_exit()
    }

    /// Starts a program of `examples/c`, after [`has`] has said that this can be.
    pub fn start_c(&self, source: &'static str, args: &str) -> Process {
        let mut programs = self.c_programs.borrow_mut();
        let program = programs.entry(source).or_insert_with(|| {
            let program = self.path(source).with_extension("built");
            let compiler = Compiler::c().expect("a compiler");
            compiler.with_shared_library(&format!("c/{source}"), &program);
            program
        });
        let mut command = Command::new(program);
        command.args(args.split_whitespace());
        self.spawn(command)
    }

    /// Starts a program of `examples/python`, after [`has`] has said that this can be.
    pub fn start_python(&self, source: &str) -> Process {
        self.spawn(python_example(python().expect("an interpreter"), source))
    }

    /// Starts one of a kind, which is not ready yet.
    pub fn start_one(&self, kind: Kind) -> Process {
        match kind {
            Kind::Sim => self.start("run sim --link dsp --seed 1"),
            Kind::Bridge => self.start("run bridge --port dsp"),
            Kind::Status => self.start("run status"),
            Kind::Consumer => self.start("echo hero --json --field sequence --timeout 80s"),
            Kind::ConsumerInC => self.start_c("print_telemetry.c", ""),
            Kind::ConsumerInPython => self.start_python("print_telemetry.py"),
        }
    }
}

/// Whether this machine has what the process needs. What it has not is told. The first call may build a library, which can take
/// minutes: call it before a [`Site`] begins to watch the time.
pub fn has(kind: Kind) -> bool {
    let lack = match kind {
        Kind::ConsumerInC => Compiler::c().err(),
        Kind::ConsumerInPython => python().err().map(str::to_owned),
        _ => None,
    };
    if let Some(why) = &lack {
        skip(kind.name(), why);
    }
    lack.is_none()
}

/// Waits until it does its work.
#[track_caller]
pub fn await_ready(kind: Kind, process: &mut Process) {
    match kind.is_consumer() {
        true => process.wait_for_line(|line| line.stream == Stream::Stdout),
        false => process.wait_for_text("ready"),
    };
}

/// Ends a process in order.
#[track_caller]
pub fn end(mut process: Process) {
    process.signal(Signal::TERM);
    let finished = process.wait_exit();
    assert_eq!(finished.code(), Some(0), "{finished:#?}");
}

/// Starts simulator, bridge and status, and returns them in this order when telemetry comes. The simulated clock is fast, and
/// a machine that stalls for seconds ends no flight.
#[track_caller]
pub fn start_chain(site: &Site) -> [Process; 3] {
    start_chain_at(site, 4)
}

/// As [`start_chain`], with so many simulated seconds for one of the host.
#[track_caller]
pub fn start_chain_at(site: &Site, speed: u32) -> [Process; 3] {
    // The program counts each second in which the link was silent; its tests run where a machine may stall for several.
    let rules = match site.program.is_this {
        true => "[link]\npc_timeout_ms = 60000\n",
        false => PATIENT,
    };
    site.write("bridge.toml", rules);
    let sim = format!("run sim --link dsp --seed 1 --speed {speed}");
    let mut chain = [&*sim, "run bridge --port dsp", "run status"].map(|args| {
        let mut process = site.start(args);
        process.wait_for_text("ready");
        process
    });
    chain[1].wait_for_text("to=\"up\"");
    ask(site, "echo hero --count 1");
    chain
}

/// Runs a command of `ril`, which must be done.
#[track_caller]
pub fn ask(site: &Site, args: &str) {
    let finished = site.run(args);
    // What a machine shows that stalls is old.
    let is_done = match finished.code() {
        Some(4) => args == "state" && !finished.stdout.is_empty(),
        code => code == Some(0),
    };
    assert!(is_done, "ril {args}: {finished:#?}");
}

/// Whether the process `id`, a child that nobody has waited for, still runs.
pub fn is_alive(id: u32) -> bool {
    let stat = fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
    // The program's name, in parentheses, may have any character in it.
    let state = stat.rsplit(')').next().unwrap_or_default().trim_start();
    !state.is_empty() && !state.starts_with(['Z', 'X'])
}

/// The end of the chain: it hears what simulator, bridge and status make together.
pub struct Witness {
    telemetry: Subscriber<HeroTelemetry>,
}

impl Witness {
    /// Listens in the site's domain.
    pub fn new(site: &Site) -> Witness {
        let ipc = site.domain.join("witness");
        Witness {
            telemetry: ipc.subscriber().expect("a subscriber"),
        }
    }

    /// Waits for telemetry that the bridge received after `moment`, and says when it was heard.
    #[track_caller]
    pub fn hear_after(&mut self, moment: MonotonicNs) -> MonotonicNs {
        let limit = MonotonicNs::now() + WAIT_LIMIT;
        let mut is_heard = false;
        while !is_heard {
            let now = MonotonicNs::now();
            assert!(now < limit, "no telemetry since {:?}", now.since(moment));
            self.telemetry.wait(limit.since(now)).expect("a wait");
            // What cannot be received now can be by the next call, says the subscriber.
            let _ = self
                .telemetry
                .drain(|sample| is_heard |= sample.received_ns > moment.0);
        }
        MonotonicNs::now()
    }
}

/// What a process holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Holdings {
    /// Open file descriptors.
    pub descriptors: usize,
    /// Resident memory, KiB.
    pub memory_kib: u64,
}

impl Holdings {
    /// Of the process `id`.
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
}
