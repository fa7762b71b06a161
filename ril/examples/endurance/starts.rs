//! Very many starts after `kill -9`: each process is killed, half of the time its successors are killed as they start, and then one
//! must be ready. Now and then everything is killed at the same moment, and very many others with it.

use std::fmt;
use std::thread;
use std::time::Duration;

use dsp_sim::random::Random;
use ipc_types::MonotonicNs;
use ril_tests::Process;
use ril_tests::process::Signal;

use crate::crew::{Kind, Site, Witness, await_ready, has};
use crate::spread::Spread;

/// Longest time that a process works before it is killed: every phase of its work.
const WORK: Duration = Duration::from_millis(50);

/// Oldest age at which a process is killed while it starts, after the longest that a start of its kind has taken at the beginning.
const START_UP: f64 = 1.2;

/// Longest time that so many processes have before all are killed at once.
const CROWD_WORK: Duration = Duration::from_millis(1500);

/// What is started of each robot but the first, whose starts are counted.
const CROWD: [&str; 16] = [
    "run sim --link dsp-N --robot N",
    "run bridge --port dsp-N --robot N",
    "run status --robot N",
    "echo dsp --json --timeout 80s --robot N",
    "echo dsp --json --timeout 80s --robot N",
    "echo dsp --json --timeout 80s --robot N",
    "echo hero --json --timeout 80s --robot N",
    "echo hero --json --timeout 80s --robot N",
    "echo hero --json --timeout 80s --robot N",
    "echo state --json --timeout 80s --robot N",
    "status --robot N",
    "goto 37.4300,-6.0010,25 --robot N",
    "hold --robot N",
    "takeoff --altitude 5 --robot N",
    "topic list --robot N",
    "start --robot N",
];

/// What to do.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// How many starts are to be ready.
    pub starts: u32,
    /// After how many of them everything is killed at once.
    pub together: u32,
    /// How many robots there are then, beside the first.
    pub robots: u32,
    /// Seed of what is killed when.
    pub seed: u64,
}

/// What came of it.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// From the start until it was ready, of each kind.
    pub ready: Vec<(Kind, Spread)>,
    /// The same right after everything had been killed at once.
    pub after_all: Spread,
    /// Processes that were killed while they started.
    pub in_start_up: u32,
    /// How often everything was killed at once, and how many processes those were.
    pub together: (u32, usize),
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all: Spread = self
            .ready
            .iter()
            .flat_map(|(_, spread)| spread.iter())
            .collect();
        write!(f, "| {all} | {} | ", self.in_start_up)?;
        for (kind, spread) in &self.ready {
            write!(f, "{}: {spread}; ", kind.name())?;
        }
        let (times, processes) = self.together;
        write!(
            f,
            "| {times} times, {processes} processes; then ready: {} |",
            self.after_all
        )
    }
}

/// Kills and starts as planned, or until `goes_on` says no.
///
/// # Panics
///
/// When a process does not come up, when no telemetry comes any more, or when something is left.
pub fn run(site: &Site, plan: &Plan, goes_on: &dyn Fn() -> bool) -> Outcome {
    let mut loops = Loop::new(site, plan);
    let mut since_all = 0;
    while loops.starts() < plan.starts as usize && goes_on() {
        loops.kill_and_start();
        since_all += 1;
        if since_all == plan.together {
            since_all = 0;
            loops.kill_all(plan.robots);
        }
    }
    let Loop {
        crew,
        witness,
        outcome,
        ..
    } = loops;
    drop(witness);
    drop(crew);
    site.domain.sweep();
    site.domain.assert_empty();
    outcome
}

struct Member {
    kind: Kind,
    process: Process,
    start_up: Duration,
}

struct Loop<'a> {
    site: &'a Site,
    crew: Vec<Member>,
    witness: Witness,
    chance: Random,
    outcome: Outcome,
}

impl<'a> Loop<'a> {
    fn new(site: &'a Site, plan: &Plan) -> Loop<'a> {
        let witness = Witness::new(site);
        let mut loops = Loop {
            site,
            crew: Vec::new(),
            witness,
            chance: Random::new(plan.seed, 0),
            outcome: Outcome::default(),
        };
        let begun = MonotonicNs::now();
        for kind in Kind::ALL.into_iter().filter(|kind| has(*kind)) {
            let (process, start_up) = loops.start(kind);
            loops.crew.push(Member {
                kind,
                process,
                start_up,
            });
            loops.outcome.ready.push((kind, Spread::default()));
        }
        loops.witness.hear_after(begun);
        loops
    }

    fn starts(&self) -> usize {
        let counts = self.outcome.ready.iter().map(|(_, spread)| spread.count());
        counts.sum()
    }

    /// Starts one and says how long it took to be ready.
    fn start(&self, kind: Kind) -> (Process, Duration) {
        let started = MonotonicNs::now();
        let mut process = self.site.start_one(kind);
        await_ready(kind, &mut process);
        (process, MonotonicNs::now().since(started))
    }

    /// Kills at a random moment within `span`, which is what is tried here, not something that is waited for.
    fn kill(&mut self, process: &mut Process, span: Duration) {
        thread::sleep(span.mul_f64(self.chance.uniform()));
        process.signal(Signal::KILL);
        process.wait_exit();
    }

    fn kill_and_start(&mut self) {
        let index = self.chance.next_u64() as usize % self.crew.len();
        let mut member = self.crew.remove(index);
        self.kill(&mut member.process, WORK);
        while self.chance.uniform() < 0.5 {
            let mut starting = self.site.start_one(member.kind);
            self.kill(&mut starting, member.start_up.mul_f64(START_UP));
            self.outcome.in_start_up += 1;
        }
        let begun = MonotonicNs::now();
        let (process, ready) = self.start(member.kind);
        let member = Member { process, ..member };
        self.outcome.ready[index].1.push(ready);
        self.crew.insert(index, member);
        self.witness.hear_after(begun);
        for member in &mut self.crew {
            // What they print is not needed, and would fill the pipe's reader.
            member.process.lines();
        }
    }

    /// Starts very many at once, kills all of them and the crew, and starts the crew again.
    fn kill_all(&mut self, robots: u32) {
        let mut crowd: Vec<Process> = (2..2 + robots)
            .flat_map(|robot| CROWD.map(|args| args.replace('N', &robot.to_string())))
            .map(|args| self.site.start(&args))
            .collect();
        thread::sleep(CROWD_WORK.mul_f64(self.chance.uniform()));
        let mut kinds = Vec::new();
        for member in self.crew.drain(..) {
            kinds.push((member.kind, member.start_up));
            crowd.push(member.process);
        }
        crowd
            .iter()
            .for_each(|process| process.signal(Signal::KILL));
        for process in &mut crowd {
            process.wait_exit();
        }
        self.outcome.together.0 += 1;
        self.outcome.together.1 += crowd.len();
        let begun = MonotonicNs::now();
        for (index, (kind, start_up)) in kinds.into_iter().enumerate() {
            let (process, ready) = self.start(kind);
            self.outcome.ready[index].1.push(ready);
            self.outcome.after_all.push(ready);
            self.crew.push(Member {
                kind,
                process,
                start_up,
            });
        }
        self.witness.hear_after(begun);
    }
}
