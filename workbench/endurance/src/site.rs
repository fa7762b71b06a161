//! [`Site`]: the processes of one robot, in shared memory and a folder of their own, and what can be seen of them from
//! outside.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};

use fastrand::Rng;
use ipc_types::MonotonicNs;
use ril_tests::languages::{Compiler, python, python_example, skip};
use ril_tests::process::{Finished, Signal, Stream};
use ril_tests::sandbox::{FOR_SLOW_MACHINES, Holdings, Robot};
use ril_tests::{Process, Sandbox};
use runtime::usage::Usage;

use crate::plan::{Kind, Plan};
use measure::{Outcome, Table};

/// How long it may take until what killed processes left is removed: their providers look twice a second, and count
/// files every ten seconds.
pub const CLEAN_UP_LIMIT: Duration = Duration::from_secs(30);

/// What a consumer that is to be killed, stopped or left alone prints.
pub const ECHO_DSP: &str = "echo dsp --json --field sequence --timeout 80s";
/// What a consumer of telemetry in SI units that is to be killed, stopped or left alone prints.
pub const ECHO_HERO: &str = "echo hero --json --field sequence --timeout 80s";

/// A measurement: what it finds it shows, row by row.
pub type Measure = fn(&Site);

/// Where everything happens: a domain and a folder that no other process has.
pub struct Site {
    /// What is to be done.
    pub plan: Plan,
    sandbox: Sandbox,
    ril: PathBuf,
    name: String,
    limit: Duration,
    table: RefCell<Table>,
    /// Programs in C, as they are built.
    c_programs: RefCell<BTreeMap<&'static str, PathBuf>>,
}

impl Deref for Site {
    type Target = Sandbox;

    fn deref(&self) -> &Sandbox {
        &self.sandbox
    }
}

impl Site {
    /// A new one for what is planned, with the program `ril`. A measurement that takes longer than `limit` hangs.
    pub fn new(ril: &Path, name: &str, plan: Plan, limit: Duration) -> Site {
        Site {
            plan,
            sandbox: Sandbox::new([ril], name, limit),
            ril: ril.to_owned(),
            name: name.to_owned(),
            limit,
            table: RefCell::default(),
            c_programs: RefCell::default(),
        }
    }

    /// Another machine of the same measurement, whose commands begin with these words.
    pub fn machine(&self, starter: impl IntoIterator<Item = String>) -> Sandbox {
        let ril = self.ril.display().to_string();
        Sandbox::new(starter.into_iter().chain([ril]), &self.name, self.limit)
    }

    /// Random numbers; `stream` tells those apart that are drawn side by side.
    pub fn chance(&self, stream: u64) -> Rng {
        Rng::with_seed(self.plan.seed ^ stream << 32)
    }

    /// Whether a measurement goes on: it ends early, with what there is, when the program is asked to end.
    pub fn goes_on(&self) -> bool {
        !self.plan.is_over.is_some_and(|is_over| is_over())
    }

    /// Prints a row of the table.
    pub fn show(&self, outcome: Outcome) {
        self.table.borrow_mut().show(outcome);
    }

    /// Says why this machine cannot measure it.
    pub fn skip(&self, why: &str) {
        skip(&self.name, why);
    }

    /// The rows that were shown.
    pub fn rows(&self) -> Vec<Outcome> {
        self.table.borrow().rows.clone()
    }

    /// Starts a program of `examples/c`, after [`Kind::is_possible`] has said that this can be.
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

    /// Starts a program of `examples/python`, after [`Kind::is_possible`] has said that this can be.
    pub fn start_python(&self, source: &str) -> Process {
        self.spawn(python_example(python().expect("an interpreter"), source))
    }

    /// Starts one of a kind, which is not ready yet.
    pub fn start_one(&self, kind: Kind) -> Process {
        match kind {
            Kind::Sim => self.start("run sim --link dsp-1 --seed 1"),
            Kind::Bridge => self.start("run bridge --port dsp-1"),
            Kind::Status => self.start("run status"),
            Kind::Consumer => self.start(ECHO_HERO),
            Kind::CConsumer => self.start_c("print_telemetry.c", ""),
            Kind::PythonConsumer => self.start_python("print_telemetry.py"),
        }
    }

    /// Starts one of a kind, waits until it does its work, and says how long that took.
    #[track_caller]
    pub fn start_working(&self, kind: Kind) -> (Process, Duration) {
        let started = MonotonicNs::now();
        let mut process = self.start_one(kind);
        match kind.is_consumer() {
            true => process.wait_for_line(|line| line.stream == Stream::Stdout),
            false => process.wait_for_text("ready"),
        };
        (process, MonotonicNs::now().since(started))
    }

    /// Starts simulator, bridge and status, and returns them in this order when telemetry comes. The simulated clock is
    /// `speed` times as fast, and a machine that stalls for seconds ends no flight. The long form counts each second in
    /// which the link was silent.
    #[track_caller]
    pub fn start_chain(&self, speed: u32) -> [Process; 3] {
        let long = "[link]\npc_timeout_ms = 60000\n";
        self.write("bridge.toml", self.plan.either(FOR_SLOW_MACHINES, long));
        let Robot {
            sim,
            mut bridge,
            status,
            ..
        } = self.start_robot(1, speed);
        bridge.wait_for_text("to=\"up\"");
        [sim, bridge, status]
    }

    /// Starts the chain four times as fast, and has the helicopter take off.
    #[track_caller]
    pub fn start_flight(&self) -> [Process; 3] {
        let chain = self.start_chain(4);
        self.ask("start");
        self.ask("takeoff --altitude 5");
        chain
    }

    /// Runs a command of `ril`, which must be done.
    #[track_caller]
    pub fn ask(&self, args: &str) {
        let finished = self.finish(args);
        assert!(is_done(args, &finished), "ril {args}: {finished:#?}");
    }

    /// Whether the helicopter can be landed as if nothing had been. A path, a hold, or nothing is under way: what the
    /// last client that was served wanted.
    #[track_caller]
    pub fn lands(&self) -> bool {
        let land = || self.finish("land --preempt").code() == Some(0);
        land() || {
            self.ask("start");
            land()
        }
    }

    /// Ends processes in order, the last one first. Then nothing may be left; `is_swept` when some were killed that no
    /// other process cleans up after.
    #[track_caller]
    pub fn end(&self, processes: impl IntoIterator<Item = Process>, is_swept: bool) {
        let processes: Vec<Process> = processes.into_iter().collect();
        processes.into_iter().rev().for_each(|process| {
            process.end();
        });
        if is_swept {
            self.domain.sweep();
        }
        self.domain.assert_empty();
    }
}

/// Whether a command of `ril` was done.
pub fn is_done(args: &str, finished: &Finished) -> bool {
    match finished.code() {
        // What a machine shows that stalls is old.
        Some(4) => args == "status" && !finished.stdout.is_empty(),
        code => code == Some(0),
    }
}

/// Notes what a command of `ril` said that must be done; gives whether it was.
pub fn require_done(outcome: &mut Outcome, args: &str, finished: &Finished) -> bool {
    let is_done = is_done(args, finished);
    let (code, words) = (finished.code(), finished.stderr.join(", "));
    outcome.require(is_done, format!("{args}: {code:?} {words}"));
    is_done
}

/// Lets a random time within `span` pass: the moment is what is tried then, not something that is waited for.
pub fn pass(chance: &mut Rng, span: Duration) {
    thread::sleep(span.mul_f64(chance.f64()));
}

/// `kill -9`; the process has ended when this returns.
pub fn kill(process: &mut Process) {
    process.signal(Signal::KILL);
    process.wait_exit();
}

/// How many lines with `text` a process has printed.
pub fn count_lines(process: &mut Process, text: &str) -> usize {
    let lines = process.lines().iter();
    lines.filter(|line| line.text.contains(text)).count()
}

/// What a process that runs has used.
///
/// # Panics
///
/// When it has ended, or the kernel does not say.
pub fn usage_of(process: &Process) -> Usage {
    Usage::of(process.id()).expect("it runs")
}

/// Resident memory of a process that runs, MB.
pub fn memory_mb(process: &Process) -> f64 {
    Holdings::of(process.id()).memory_kib as f64 / 1024.0
}

/// What processes that are not killed held at most while they warmed up. They may hold no more at the end.
#[derive(Default)]
pub struct Survivors {
    warm: Vec<(&'static str, u32, Holdings)>,
}

impl Survivors {
    /// These processes, as they are now.
    pub fn of<'a>(processes: impl IntoIterator<Item = (&'static str, &'a Process)>) -> Survivors {
        let held = |(name, process): (_, &Process)| {
            let id = process.id();
            (name, id, Holdings::of(id))
        };
        Survivors {
            warm: processes.into_iter().map(held).collect(),
        }
    }

    /// They are still warming up.
    pub fn warm_up(&mut self) {
        for (_, id, held) in &mut self.warm {
            *held = held.most(Holdings::of(*id));
        }
    }

    /// Whether they hold no more descriptors than while they warmed up.
    fn are_flat(&self) -> bool {
        let is_flat =
            |(_, id, held): &(_, u32, Holdings)| Holdings::of(*id).descriptors <= held.descriptors;
        self.warm.iter().all(is_flat)
    }

    /// Waits until they are flat and nothing else is left, with something to do on each `occasion`: the processes clean
    /// up by themselves. Says how long that took; `None` if it was not so within [`CLEAN_UP_LIMIT`]. It is judged once:
    /// later they may be at work again.
    pub fn wait_until_flat(
        &self,
        mut occasion: impl FnMut(),
        mut is_clean: impl FnMut() -> bool,
    ) -> Option<Duration> {
        let begun = Instant::now();
        while begun.elapsed() < CLEAN_UP_LIMIT {
            if self.are_flat() && is_clean() {
                return Some(begun.elapsed());
            }
            occasion();
        }
        None
    }

    /// How many descriptors more than before the one holds that grew most.
    pub fn rise(&self) -> usize {
        let rises = self.warm.iter().map(|(_, id, before)| {
            let now = Holdings::of(*id).descriptors;
            now.saturating_sub(before.descriptors)
        });
        rises.max().unwrap_or_default()
    }

    /// What they hold now.
    pub fn report(&self, outcome: &mut Outcome) {
        let mut text = String::new();
        for (name, id, before) in &self.warm {
            let after = Holdings::of(*id);
            text += &format!(
                "{name}: {} → {} descriptors, {} → {} KiB; ",
                before.descriptors, after.descriptors, before.memory_kib, after.memory_kib
            );
            if after.descriptors > before.descriptors {
                text += &format!("{name} holds {}; ", open_files(*id).join(", "));
            }
        }
        outcome.cell("what the others hold", text);
    }
}

/// What a process has open, by name. The kernel marks what was removed meanwhile.
fn open_files(id: u32) -> Vec<String> {
    let links = fs::read_dir(format!("/proc/{id}/fd")).into_iter().flatten();
    let target = |link: fs::DirEntry| Some(fs::read_link(link.path()).ok()?.display().to_string());
    links.flatten().filter_map(target).collect()
}
