//! Processes of every kind that start, and are killed, stopped or crash, so many a second: what do those lose that do nothing wrong?

use std::collections::VecDeque;
use std::fmt;
use std::thread;
use std::time::{Duration, Instant};

use dsp_sim::random::Random;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use ril_tests::Process;
use ril_tests::process::Signal;
use rustix::process::{Resource, Rlimit, setrlimit};

use crate::crew::{Holdings, Kind, Site, ask, end, has, is_alive, start_chain};
use crate::healthy::{Healthy, Heard};

/// What is started. The last ones are modules: one that finds its place taken, one that waits, and one with a topic of its own.
const STARTS: [Start; 9] = [
    Start::Ril("goto 37.4300,-6.0010,25 --preempt"),
    Start::Ril("hold"),
    Start::Ril("echo hero --json --field sequence --timeout 80s"),
    Start::Ril("echo dsp --json --field sequence --timeout 80s"),
    Start::InC("print_telemetry.c", ""),
    Start::InPython("print_telemetry.py"),
    Start::Ril("run bridge --port dsp"),
    Start::Ril("run status --robot 2"),
    Start::InC("voltages.c", "publish 1000"),
];

/// Oldest age at which half of them end: while they start.
const START_UP: Duration = Duration::from_millis(20);

/// Oldest age at which the others end.
const WORK: Duration = Duration::from_millis(300);

/// How long a process stays stopped before it is killed, at most.
const STOP: Duration = Duration::from_secs(2);

/// How long a process that was asked to end has, before it is killed.
const END: Duration = Duration::from_millis(500);

/// Most that are stopped at a time. Each may keep one of the places that a service has for clients and subscribers.
const MAX_STOPPED: usize = 6;

/// Part of the time during which the survivors warm up: what they hold then at most, they may hold at the end.
const WARM_UP: u32 = 5;

/// How often it is looked what there is.
const LOOK: Duration = Duration::from_secs(1);

/// Files that killed processes may leave in the generation of a service before another one begins, and the services.
const MAX_LEFTOVERS: usize = 256 * 7;

/// How long it may take until what was left is removed.
const SETTLE_LIMIT: Duration = Duration::from_secs(30);

/// What a new generation of shared memory is told by, in the log of its provider.
const NEW_GENERATION: &str = "a new generation of shared memory begins";

#[derive(Clone, Copy, Debug)]
enum Start {
    Ril(&'static str),
    InC(&'static str, &'static str),
    InPython(&'static str),
}

/// What to do.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// How many start, and end, a second.
    pub per_second: u32,
    /// How long.
    pub duration: Duration,
    /// Seed of what starts, and how it ends when.
    pub seed: u64,
}

/// How processes ended.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ends {
    /// By `kill -9`.
    pub killed: u32,
    /// As if by a fault of their own.
    pub crashed: u32,
    /// Stopped for a while, then killed; half of them went on in between.
    pub stopped: u32,
    /// In order, or killed half a second after they were asked to.
    pub asked: u32,
}

impl Ends {
    fn all(self) -> u32 {
        self.killed + self.crashed + self.stopped + self.asked
    }
}

/// What came of it.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// How long it was.
    pub duration: Duration,
    /// How many processes started and ended.
    pub ends: Ends,
    /// Of the bridge's telemetry, of that of status, and of the bridge's state.
    pub heard: [Heard; 3],
    /// New generations of the bridge, and of status.
    pub generations: [usize; 2],
    /// How often the bridge lost its link to the DSP, which nothing has touched.
    pub link_losses: usize,
    /// Whether the helicopter could be landed as if nothing had been.
    pub flies_on: bool,
    /// Files and segments of the domain: before, at most, and after what was left had been removed.
    pub things: [usize; 3],
    /// What the bridge and status held at most while they warmed up, and at the end.
    pub holdings: [(Holdings, Holdings); 2],
}

impl Outcome {
    /// Samples that healthy consumers missed.
    pub fn lost(&self) -> u64 {
        self.heard.iter().map(|heard| heard.losses.lost).sum()
    }

    /// Whether nothing was lost, nothing is left beyond what may be, and no survivor holds more descriptors than before.
    pub fn is_clean(&self) -> bool {
        let [before, _, after] = self.things;
        let are_flat =
            |(before, after): &(Holdings, Holdings)| after.descriptors <= before.descriptors;
        self.lost() == 0
            && self.link_losses == 0
            && self.flies_on
            && after <= before + MAX_LEFTOVERS
            && self.holdings.iter().all(are_flat)
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (ends, duration_s) = (self.ends, self.duration.as_secs_f64());
        let per_second = f64::from(ends.all()) / duration_s;
        write!(
            f,
            "| {duration_s:.0} s, {} processes, {per_second:.0} a second: {} killed, {} crashed, {} stopped, {} asked to end | ",
            ends.all(),
            ends.killed,
            ends.crashed,
            ends.stopped,
            ends.asked
        )?;
        let [dsp, hero, state] = &self.heard;
        for (name, heard) in [("dsp", dsp), ("hero", hero)] {
            let losses = heard.losses;
            write!(
                f,
                "{name}: {} samples, {} lost, gaps {}; at new generations {}; ",
                losses.received, losses.lost, heard.gaps, heard.gaps_at_generations
            )?;
        }
        let (states, lost) = (state.losses.received, state.losses.lost);
        write!(f, "{states} states, {lost} lost | ")?;
        let [bridge, status] = self.generations;
        write!(f, "{bridge} of the bridge, {status} of status | ")?;
        let [before, most, after] = self.things;
        write!(f, "{before} before, {most} at most, {after} after | ")?;
        for (name, (before, after)) in ["bridge", "status"].into_iter().zip(self.holdings) {
            write!(
                f,
                "{name}: {} → {} descriptors, {} → {} KiB; ",
                before.descriptors, after.descriptors, before.memory_kib, after.memory_kib
            )?;
        }
        let end = match self.flies_on {
            true => "landed",
            false => "NOT landed",
        };
        write!(f, "link lost {} times, {end} |", self.link_losses)
    }
}

/// Starts and ends processes as planned, or until `goes_on` says no.
///
/// # Panics
///
/// When bridge or status end, when the helicopter cannot be commanded any more, or when something is left.
pub fn run(site: &Site, plan: &Plan, goes_on: &dyn Fn() -> bool) -> Outcome {
    // Crashes leave no images of their memory.
    let _ = setrlimit(
        Resource::Core,
        Rlimit {
            current: Some(0),
            maximum: Some(0),
        },
    );
    let [sim, bridge, status] = start_chain(site);
    ask(site, "start");
    ask(site, "takeoff --altitude 5");
    let mut survivors = [bridge, status];
    let domain = &site.domain;
    let consumers = [
        Healthy::start::<DspTelemetry>(domain),
        Healthy::start::<HeroTelemetry>(domain),
        Healthy::start::<ModuleState>(domain),
    ];
    let before = domain.residue().len();
    let mut most_things = before;
    let mut warm = survivors.each_ref().map(|one| Holdings::of(one.id()));
    let mut crowd = Crowd::new(site, plan.seed);
    let begun = Instant::now();
    let mut looked = begun;
    let period = Duration::from_secs(1) / plan.per_second;
    let mut next_start = begun;
    while begun.elapsed() < plan.duration && goes_on() {
        crowd.start_one();
        // What a busy machine is late by it does not make up for.
        next_start = (next_start + period).max(Instant::now());
        crowd.end_until(next_start);
        if looked.elapsed() > LOOK {
            looked = Instant::now();
            most_things = most_things.max(domain.residue().len());
            for (survivor, warm) in survivors.iter_mut().zip(&mut warm) {
                assert!(
                    is_alive(survivor.id()),
                    "a survivor has ended: {:#?}",
                    survivor.lines()
                );
                if begun.elapsed() < plan.duration / WARM_UP {
                    *warm = most(*warm, Holdings::of(survivor.id()));
                }
            }
        }
    }
    let duration = begun.elapsed();
    let ends = crowd.end();
    let are_flat = |now: &[Holdings; 2]| {
        let pairs = now.iter().zip(&warm);
        pairs
            .into_iter()
            .all(|(now, warm)| now.descriptors <= warm.descriptors)
    };
    let ended = Instant::now();
    let (now, things) = loop {
        let now = survivors.each_ref().map(|one| Holdings::of(one.id()));
        let things = domain.residue().len();
        let is_over = ended.elapsed() > SETTLE_LIMIT;
        if (are_flat(&now) && things <= before + MAX_LEFTOVERS) || is_over {
            break (now, things);
        }
        // Whatever it says: a second of telemetry is the occasion, the survivors clean up by themselves.
        site.run("echo dsp --duration 1s");
    };
    // A path, a hold, or nothing is under way: what the last client that was heard wanted.
    let mut flies_on = site.run("land --preempt").code() == Some(0);
    if !flies_on {
        ask(site, "start");
        flies_on = site.run("land --preempt").code() == Some(0);
    }
    ask(site, "stop");
    let heard = consumers.map(Healthy::end);
    let [bridge, status] = &mut survivors;
    let count = |process: &mut Process, text: &str| {
        let lines = process.lines().iter();
        lines.filter(|line| line.text.contains(text)).count()
    };
    let outcome = Outcome {
        duration,
        ends,
        heard,
        generations: [count(bridge, NEW_GENERATION), count(status, NEW_GENERATION)],
        link_losses: count(bridge, " link from=\"up\""),
        flies_on,
        things: [before, most_things, things],
        holdings: [(warm[0], now[0]), (warm[1], now[1])],
    };
    let [bridge, status] = survivors;
    [status, bridge, sim].into_iter().for_each(end);
    // Robot 2 has had nobody but those that were killed.
    domain.sweep();
    domain.assert_empty();
    outcome
}

fn most(one: Holdings, other: Holdings) -> Holdings {
    Holdings {
        descriptors: one.descriptors.max(other.descriptors),
        memory_kib: one.memory_kib.max(other.memory_kib),
    }
}

/// A process, and the signals that it will get: each with the time from the one before it. The last one ends it.
struct Doomed {
    process: Process,
    at: Instant,
    signal: Signal,
    then: VecDeque<(Duration, Signal)>,
    is_to_be_stopped: bool,
}

/// Those that do not end in peace.
struct Crowd<'a> {
    site: &'a Site,
    chance: Random,
    starts: Vec<Start>,
    alive: Vec<Doomed>,
    ends: Ends,
}

impl<'a> Crowd<'a> {
    fn new(site: &'a Site, seed: u64) -> Crowd<'a> {
        let has_c = has(Kind::ConsumerInC);
        let has_python = has(Kind::ConsumerInPython);
        let is_possible = |start: &Start| match start {
            Start::Ril(_) => true,
            Start::InC(..) => has_c,
            Start::InPython(_) => has_python,
        };
        Crowd {
            site,
            chance: Random::new(seed, 0),
            starts: STARTS.into_iter().filter(is_possible).collect(),
            alive: Vec::new(),
            ends: Ends::default(),
        }
    }

    fn draw(&mut self, longest: Duration) -> Duration {
        longest.mul_f64(self.chance.uniform())
    }

    fn start_one(&mut self) {
        let start = self.starts[self.chance.next_u64() as usize % self.starts.len()];
        let process = match start {
            Start::Ril(args) => self.site.start(args),
            Start::InC(source, args) => self.site.start_c(source, args),
            Start::InPython(source) => self.site.start_python(source),
        };
        let started = Instant::now();
        let oldest = match self.chance.next_u64() % 2 {
            0 => START_UP,
            _ => WORK,
        };
        let age = self.draw(oldest);
        let stopped = self.alive.iter().filter(|one| one.is_to_be_stopped).count();
        let then = VecDeque::new();
        let (signal, then) = match self.chance.next_u64() % 10 {
            0..3 => (Signal::KILL, then),
            // Rust catches the first SIGSEGV that comes from outside.
            3 | 4 => (Signal::ILL, then),
            5 => (Signal::ABORT, then),
            6 | 7 => (Signal::INT, [(END, Signal::KILL)].into()),
            _ if stopped >= MAX_STOPPED => (Signal::KILL, then),
            8 => (Signal::STOP, [(self.draw(STOP), Signal::KILL)].into()),
            _ => {
                let (stop, work) = (self.draw(STOP), self.draw(WORK));
                let then = [(stop, Signal::CONT), (work, Signal::KILL)];
                (Signal::STOP, then.into())
            }
        };
        match signal {
            Signal::KILL => self.ends.killed += 1,
            Signal::STOP => self.ends.stopped += 1,
            Signal::INT => self.ends.asked += 1,
            _ => self.ends.crashed += 1,
        }
        self.alive.push(Doomed {
            process,
            at: started + age,
            signal,
            then,
            is_to_be_stopped: signal == Signal::STOP,
        });
    }

    /// Does what has to be done until `then`. The moments are what is tried here, not something that is waited for.
    fn end_until(&mut self, then: Instant) {
        loop {
            let next = (0..self.alive.len()).min_by_key(|index| self.alive[*index].at);
            let next = next.filter(|index| self.alive[*index].at <= then);
            let at = next.map_or(then, |index| self.alive[index].at);
            thread::sleep(at.saturating_duration_since(Instant::now()));
            let Some(next) = next else {
                return;
            };
            let mut doomed = self.alive.swap_remove(next);
            doomed.process.signal(doomed.signal);
            match doomed.then.pop_front() {
                Some((after, signal)) => self.alive.push(Doomed {
                    at: at + after,
                    signal,
                    ..doomed
                }),
                None => {
                    doomed.process.wait_exit();
                }
            }
        }
    }

    /// Kills those that are left.
    fn end(self) -> Ends {
        self.ends
    }
}
