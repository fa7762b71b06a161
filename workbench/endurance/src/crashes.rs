//! Processes of every kind that start, and are killed, stopped or crash, so many a second. Measures the samples that healthy consumers
//! lose meanwhile.

use std::collections::VecDeque;
use std::thread;
use std::time::{Duration, Instant};

use dsp_sim::random::Random;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use ril_tests::Process;
use ril_tests::process::Signal;
use rustix::process::{Resource, Rlimit, setrlimit};

use crate::listener::Listener;
use crate::outcome::Outcome;
use crate::plan::{Kind, Plan};
use crate::site::{ECHO_DSP, ECHO_HERO, Site, Survivors, count_lines};

/// What is started. The last ones are modules: one that finds its place taken, one that waits, and one with a topic of its own.
const STARTS: [Start; 9] = [
    Start::Ril("goto 37.4300,-6.0010,25 --preempt"),
    Start::Ril("hold"),
    Start::Ril(ECHO_HERO),
    Start::Ril(ECHO_DSP),
    Start::InC("print_telemetry.c", ""),
    Start::InPython("print_telemetry.py"),
    Start::Ril("run bridge --port dsp-1"),
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

/// How often the survivors and the domain are looked at.
const LOOK_PERIOD: Duration = Duration::from_secs(1);

/// Files that killed processes may leave in the generation of a service before another one begins, and the services.
const MAX_LEFTOVERS: usize = 256 * 7;

/// Less than a subscriber's buffer holds at the rate of the chain: 128 samples, 200 a second.
const BUFFERED: Duration = Duration::from_millis(500);

/// What the log of a provider says of a new generation of shared memory.
const NEW_GENERATION: &str = "a new generation of shared memory begins";

#[derive(Clone, Copy, Debug)]
enum Start {
    Ril(&'static str),
    InC(&'static str, &'static str),
    InPython(&'static str),
}

/// Starts and ends processes as planned, or until `goes_on` says no.
///
/// # Panics
///
/// When bridge or status end, when the helicopter cannot be commanded any more, or when something is left.
pub fn run(site: &Site, plan: &Plan, goes_on: &dyn Fn() -> bool) -> Outcome {
    // Crashes leave no images of their memory.
    let none = Rlimit {
        current: Some(0),
        maximum: Some(0),
    };
    let _ = setrlimit(Resource::Core, none);
    let duration = plan.duration(600);
    let [sim, mut bridge, mut status] = site.start_flight();
    let domain = &site.domain;
    let healthy = [
        Listener::start(domain, |sample: &DspTelemetry| sample.epoch_ns),
        Listener::start(domain, |sample: &HeroTelemetry| sample.epoch_ns),
        Listener::start(domain, |state: &ModuleState| state.epoch_ns),
    ];
    let before = domain.residue().len();
    let mut most = before;
    let mut survivors = Survivors::of([("bridge", &bridge), ("status", &status)]);
    let mut crowd = Crowd::new(site, plan.seed);
    let begun = Instant::now();
    let (mut looked, mut next_start) = (begun, begun);
    let period = Duration::from_secs(1) / plan.per_second;
    while begun.elapsed() < duration && goes_on() {
        crowd.start_one();
        // What a busy machine is late by it does not make up for.
        next_start = (next_start + period).max(Instant::now());
        crowd.end_until(next_start);
        if looked.elapsed() > LOOK_PERIOD {
            looked = Instant::now();
            most = most.max(domain.residue().len());
            for survivor in [&mut bridge, &mut status] {
                let lives = survivor.is_running();
                assert!(lives, "a survivor has ended: {:#?}", survivor.lines());
            }
            if begun.elapsed() < duration / WARM_UP {
                survivors.warm_up();
            }
        }
    }
    let lasted_s = begun.elapsed().as_secs_f64();
    let ends = crowd.end();
    let took = survivors.wait_until_flat(
        // Whatever it says: a second of telemetry is the occasion.
        || _ = site.finish("echo dsp --duration 1s"),
        || domain.residue().len() <= before + MAX_LEFTOVERS,
    );
    let after = domain.residue().len();
    let lands = site.lands();
    site.ask("stop");
    let healthy = healthy.map(Listener::end);

    let mut outcome = Outcome::default();
    let all: u32 = ends.iter().sum();
    let [killed, crashed, stopped, asked] = ends;
    let per_second = f64::from(all) / lasted_s;
    outcome.cell(
        "crashes",
        format!(
            "{lasted_s:.0} s, {all} processes, {per_second:.0} a second: {killed} killed, {crashed} crashed, {stopped} stopped, \
             {asked} asked to end"
        ),
    );
    for (name, summary) in ["dsp", "hero", "states"].into_iter().zip(&healthy) {
        let losses = summary.losses;
        outcome.cell(
            name,
            format!(
                "{} samples, {} lost, gaps {}; at new generations {}",
                losses.received, losses.lost, summary.gaps, summary.gaps_at_generations
            ),
        );
        let is_harmed = match plan.is_short {
            true => summary.is_harmed(BUFFERED),
            false => losses.lost > 0,
        };
        outcome.require(!is_harmed, format!("{name}: {} lost", losses.lost));
        outcome.require(losses.received > 0, format!("no samples of {name}"));
    }
    let generations = [&mut bridge, &mut status].map(|one| count_lines(one, NEW_GENERATION));
    outcome.cell(
        "new generations of bridge, status",
        format!("{generations:?}"),
    );
    outcome.cell(
        "files and segments",
        format!("{before} before, {most} at most, {after} after"),
    );
    survivors.report(&mut outcome);
    let link_losses = count_lines(&mut bridge, " link from=\"up\"");
    outcome.require(link_losses == 0, format!("link lost {link_losses} times"));
    outcome.require(lands, "NOT landed");
    if !plan.is_short {
        // In a short time the survivors do not come to hold all that they need.
        outcome.require(
            took.is_some(),
            "a survivor holds more descriptors, or too much is left",
        );
    }
    // Robot 2 has had only processes that were killed.
    site.end([sim, bridge, status], true);
    outcome
}

/// A process, and the signals that it will get: each with the time from the one before it. The last one ends it.
struct Doomed {
    process: Process,
    at: Instant,
    signal: Signal,
    then: VecDeque<(Duration, Signal)>,
    is_to_be_stopped: bool,
}

/// The processes that do not end in peace.
struct Crowd<'a> {
    site: &'a Site,
    chance: Random,
    starts: Vec<Start>,
    alive: Vec<Doomed>,
    /// Killed; crashed as if by a fault of their own; stopped for a while, then killed, and half of them went on in between; ended in
    /// order, or killed half a second after they were asked to.
    ends: [u32; 4],
}

impl<'a> Crowd<'a> {
    fn new(site: &'a Site, seed: u64) -> Crowd<'a> {
        let is_possible = |start: &Start| match start {
            Start::Ril(_) => true,
            Start::InC(..) => Kind::CConsumer.is_possible(),
            Start::InPython(_) => Kind::PythonConsumer.is_possible(),
        };
        Crowd {
            site,
            chance: Random::new(seed, 0),
            starts: STARTS.into_iter().filter(is_possible).collect(),
            alive: Vec::new(),
            ends: [0; 4],
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
        self.ends[match signal {
            Signal::KILL => 0,
            Signal::STOP => 2,
            Signal::INT => 3,
            _ => 1,
        }] += 1;
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
    fn end(self) -> [u32; 4] {
        self.ends
    }
}
