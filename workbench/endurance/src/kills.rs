//! `kill -9` of one kind of process at random moments, over and over: does every successor come up, and is anything left?

use std::path::PathBuf;
use std::thread;
use std::time::{Duration, SystemTime};

use dsp_sim::random::Random;
use ipc_types::MonotonicNs;
use ril_tests::Process;
use ril_tests::process::Signal;
use ril_tests::sandbox::{Holdings, Witness};

use crate::outcome::{Outcome, Times};
use crate::plan::{Kind, Plan};
use crate::site::{CLEAN_UP_LIMIT, Site, Survivors};

/// Longest time that a process works before it is killed. Two periods of telemetry and more: every phase of its work.
const WORK: Duration = Duration::from_millis(50);

/// Part of the start-up, as the first start took it, within which a process is killed that is not up yet. A little more
/// than all of it.
const START_UP: f64 = 1.2;

/// For how many samples of telemetry in a row the others must hold the same before it counts.
const SAME_SAMPLES: u32 = 10;

/// Part of the kills during which the survivors warm up: what they hold then at most, they may hold at the end.
const WARM_UP: u32 = 5;

/// Most files that may be left of killed processes while others live: their generation ends when there are more.
const MAX_LEFTOVERS: usize = 256;

/// Kills `victim` as planned, or until `goes_on` says no.
///
/// # Panics
///
/// When a successor does not come up, when no telemetry comes any more, when one of the others ends, or when something is
/// left after all have ended in order.
pub fn run(site: &Site, plan: &Plan, victim: Kind, goes_on: &dyn Fn() -> bool) -> Outcome {
    let kills = plan.count.unwrap_or(1000);
    let mut loops = Loop::new(site, plan, victim);
    let start_up = loops.first_start();
    while loops.kills < kills && goes_on() {
        loops.kill(WORK);
        while loops.kills < kills && loops.chance.uniform() < 0.5 {
            loops.process = site.start_one(victim);
            loops.kill(start_up.mul_f64(START_UP));
            loops.in_start_up += 1;
        }
        loops.succeed();
        if loops.kills <= kills / WARM_UP {
            loops.wait_until_same();
            loops.survivors.warm_up();
        }
    }
    loops.finish()
}

/// The loop at work.
struct Loop<'a> {
    site: &'a Site,
    victim: Kind,
    process: Process,
    others: Vec<(Kind, Process)>,
    survivors: Survivors,
    witness: Witness,
    chance: Random,
    kills: u32,
    in_start_up: u32,
    ready: Times,
    again: Times,
    /// What the domain had before the first kill.
    before: Vec<PathBuf>,
    /// When the last successor was started.
    last_start: SystemTime,
    own_descriptors: usize,
}

impl<'a> Loop<'a> {
    fn new(site: &'a Site, plan: &Plan, victim: Kind) -> Loop<'a> {
        let begun = MonotonicNs::now();
        let mut witness = Witness::new(&site.domain);
        let more = Some(victim).filter(|victim| !Kind::OF_RIL.contains(victim));
        let kinds = Kind::OF_RIL.into_iter().chain(more);
        let mut all: Vec<_> = kinds.map(|kind| (kind, site.start_working(kind))).collect();
        witness.receive_after(begun);
        let index = all.iter().position(|(kind, _)| *kind == victim);
        let (_, process) = all.remove(index.expect("all kinds are there"));
        Loop {
            site,
            victim,
            process,
            others: all,
            survivors: Survivors::default(),
            witness,
            chance: Random::new(plan.seed, victim as u64),
            kills: 0,
            in_start_up: 0,
            ready: Times::default(),
            again: Times::default(),
            before: Vec::new(),
            last_start: SystemTime::now(),
            own_descriptors: 0,
        }
    }

    /// Ends the victim in order and starts it again, so that whatever a start leaves for good is there, and says how long
    /// it took.
    fn first_start(&mut self) -> Duration {
        self.process.signal(Signal::TERM);
        self.process.wait_exit();
        let started = MonotonicNs::now();
        self.process = self.site.start_working(self.victim);
        let start_up = MonotonicNs::now().since(started);
        self.witness.receive_after(started);
        self.wait_until_same();
        self.before = self.site.domain.residue();
        self.own_descriptors = Holdings::of(std::process::id()).descriptors;
        let others = self.others.iter();
        self.survivors = Survivors::of(others.map(|(kind, process)| (kind.name(), process)));
        start_up
    }

    /// Kills the victim at a random moment within `span`.
    fn kill(&mut self, span: Duration) {
        // The moment is what is tried here, not something that is waited for.
        thread::sleep(span.mul_f64(self.chance.uniform()));
        self.process.signal(Signal::KILL);
        self.process.wait_exit();
        self.kills += 1;
    }

    /// Starts the successor, which must get everything going again.
    fn succeed(&mut self) {
        self.last_start = SystemTime::now();
        let started = MonotonicNs::now();
        self.process = self.site.start_working(self.victim);
        self.ready.push(MonotonicNs::now().since(started));
        let received = self.witness.receive_after(started);
        // Nothing depends on consumers.
        if !self.victim.is_consumer() {
            self.again.push(received.since(started));
        }
        for (_, process) in &mut self.others {
            // What they print is not needed, and would fill the pipe's reader.
            process.lines();
        }
    }

    /// Waits until the domain and the others hold the same for some samples: a consumer that is ready may not have slept yet, and only
    /// then has the publisher to connect with its listener. A sample counts when each consumer has printed something since the last that
    /// did: on a busy machine one may stand still for longer than these samples take.
    fn wait_until_same(&mut self) {
        let see = |all: &Loop<'_>| {
            let held = |(_, process): &(Kind, Process)| Holdings::of(process.id()).descriptors;
            let held: usize = all.others.iter().map(held).sum();
            (held, all.site.domain.residue().len())
        };
        let (mut seen, mut same, mut printed) = (see(self), 0, self.printed());
        while same < SAME_SAMPLES {
            self.witness.receive_after(MonotonicNs::now());
            let (now, has_printed) = (see(self), self.printed());
            if now != seen {
                same = 0;
            } else if has_printed
                .iter()
                .zip(&printed)
                .all(|(now, then)| now > then)
            {
                (same, printed) = (same + 1, has_printed);
            }
            seen = now;
        }
    }

    /// How many lines each consumer that is not killed has printed.
    fn printed(&mut self) -> Vec<usize> {
        let others = self.others.iter_mut();
        others
            .filter(|(kind, _)| kind.is_consumer())
            .map(|(_, process)| process.lines().len())
            .collect()
    }

    /// Waits until what was left is removed, ends all processes and says what came of it.
    fn finish(mut self) -> Outcome {
        // A process that was killed while it made its node leaves three files that belong to nobody.
        let may_be_left = (3 * self.in_start_up as usize).min(MAX_LEFTOVERS);
        let domain = &self.site.domain;
        let witness = &mut self.witness;
        let mut left = Vec::new();
        let took = self.survivors.wait_until_flat(
            // The next sample is the occasion.
            || _ = witness.receive_after(MonotonicNs::now()),
            || {
                left = left_of_the_killed(domain.residue(), &self.before, self.last_start);
                left.len() <= may_be_left
            },
        );
        let mut outcome = Outcome::default();
        outcome.cell("killed", self.victim.name());
        outcome.cell("kills", self.kills);
        outcome.cell("of them while it started", self.in_start_up);
        outcome.cell("ready again", &self.ready);
        outcome.cell("telemetry again", &self.again);
        let (before, left_count) = (self.before.len(), left.len());
        let took_s = took.unwrap_or(CLEAN_UP_LIMIT).as_secs_f64();
        outcome.cell(
            "files and segments",
            format!("{before} before, {left_count} left {took_s:.1} s after"),
        );
        self.survivors.report(&mut outcome);
        let now = Holdings::of(std::process::id()).descriptors;
        let own = format!("{} → {now}", self.own_descriptors);
        outcome.cell("descriptors of this process", own);
        outcome.require(
            took.is_some(),
            format!("a survivor holds more descriptors, or this is left of the killed: {left:?}"),
        );
        drop(self.witness);
        match self.victim {
            // SIGTERM kills a program in Python that does not ask for it.
            Kind::PythonConsumer => drop(self.process),
            _ => _ = self.process.end(),
        }
        let others = self.others.into_iter().map(|(_, process)| process);
        self.site.end(others, false);
        outcome
    }
}

/// Which of `things` were not there before the kills, and were last changed before the last successor started. What this one and its
/// partners make is not counted: they may still be at it.
fn left_of_the_killed(
    mut things: Vec<PathBuf>,
    before: &[PathBuf],
    last_start: SystemTime,
) -> Vec<PathBuf> {
    things.retain(|path| {
        let metadata = path.symlink_metadata();
        let modified = metadata.and_then(|metadata| metadata.modified());
        !before.contains(path) && modified.is_ok_and(|then| then < last_start)
    });
    things
}
