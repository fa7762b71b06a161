//! `kill -9` of one kind of process at random moments, over and over: does every successor come up, and is anything left?

use std::fmt;
use std::path::PathBuf;
use std::thread;
use std::time::{Duration, SystemTime};

use dsp_sim::random::Random;
use ipc_types::MonotonicNs;
use ril_tests::Process;
use ril_tests::process::Signal;

use crate::crew::{Holdings, Kind, Site, Witness, await_ready, end};
use crate::spread::Spread;

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

/// Files that may be left of so many processes that were killed while they started: one that was killed while it made its node
/// leaves three that belong to nobody.
fn may_be_left(in_start_up: u32) -> usize {
    (3 * in_start_up as usize).min(MAX_LEFTOVERS)
}

/// How long what killed processes left may take to be removed: their providers look twice a second, and count files every ten
/// seconds.
const SETTLE_LIMIT: Duration = Duration::from_secs(30);

/// What to do.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// Who is killed.
    pub victim: Kind,
    /// How often.
    pub kills: u32,
    /// Seed of the moments.
    pub seed: u64,
}

/// What a survivor held at most while it warmed up, and at the end.
#[derive(Clone, Copy, Debug)]
pub struct Survivor {
    /// Which one.
    pub kind: Kind,
    /// While it warmed up.
    pub before: Holdings,
    /// At the end.
    pub after: Holdings,
}

/// What came of it.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Who was killed.
    pub victim: Kind,
    /// How often.
    pub kills: u32,
    /// How many of these while it started.
    pub in_start_up: u32,
    /// From the start of a successor until it was ready.
    pub ready: Spread,
    /// From the start of a successor until the whole chain delivered new telemetry. Of consumers nothing depends.
    pub again: Spread,
    /// Files and segments of the domain before, and after the remains were removed.
    pub things: (usize, usize),
    /// What is left of the killed, if anything is: no survivor's, and older than the last successor.
    pub left: Vec<PathBuf>,
    /// How long that took after the last kill.
    pub settled: Duration,
    /// The others.
    pub survivors: Vec<Survivor>,
    /// Descriptors of this process, before and after.
    pub own_descriptors: (usize, usize),
}

impl Outcome {
    /// Whether nothing was left and no survivor holds more descriptors than before.
    pub fn is_clean(&self) -> bool {
        let are_flat =
            |survivor: &Survivor| survivor.after.descriptors <= survivor.before.descriptors;
        self.things.1 <= self.things.0 + may_be_left(self.in_start_up)
            && self.survivors.iter().all(are_flat)
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (kills, in_start_up) = (self.kills, self.in_start_up);
        write!(
            f,
            "| {} | {kills}, {in_start_up} of them while it started | {} | ",
            self.victim.name(),
            self.ready
        )?;
        if self.again.count() > 0 {
            write!(f, "{} | ", self.again)?;
        } else {
            f.write_str("– | ")?;
        }
        let (before, after) = self.things;
        let settled_s = self.settled.as_secs_f64();
        write!(f, "{before} before, {after} {settled_s:.1} s after")?;
        for path in &self.left {
            write!(f, ", left: {}", path.display())?;
        }
        f.write_str(" | ")?;
        for survivor in &self.survivors {
            let (before, after) = (survivor.before, survivor.after);
            write!(
                f,
                "{}: {} → {} descriptors, {} → {} KiB; ",
                survivor.kind.name(),
                before.descriptors,
                after.descriptors,
                before.memory_kib,
                after.memory_kib
            )?;
        }
        let (before, after) = self.own_descriptors;
        write!(f, "this: {before} → {after} descriptors |")
    }
}

/// Kills as planned, or until `goes_on` says no.
///
/// # Panics
///
/// When the machine has not what the victim needs, when a successor does not come up, when no telemetry comes any more, when one of the others ends, or when something is
/// left after all have ended in order.
pub fn run(site: &Site, plan: &Plan, goes_on: &dyn Fn() -> bool) -> Outcome {
    let mut loops = Loop::new(site, plan);
    let start_up = loops.first_start();
    while loops.kills < plan.kills && goes_on() {
        loops.kill(Life::Working, WORK);
        while loops.kills < plan.kills && loops.chance.uniform() < 0.5 {
            loops.process = site.start_one(plan.victim);
            loops.kill(Life::Starting, start_up.mul_f64(START_UP));
        }
        loops.succeed();
        if loops.kills <= plan.kills / WARM_UP || loops.warm.is_empty() {
            loops.warm_up();
        }
    }
    loops.settle()
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Life {
    Starting,
    Working,
}

/// The loop at work.
struct Loop<'a> {
    site: &'a Site,
    victim: Kind,
    process: Process,
    others: Vec<(Kind, Process)>,
    witness: Witness,
    chance: Random,
    kills: u32,
    in_start_up: u32,
    ready: Spread,
    again: Spread,
    /// Things of the domain before the first kill.
    things: Vec<PathBuf>,
    /// When the last successor was started.
    last_start: SystemTime,
    own_descriptors: usize,
    warm: Vec<(Kind, Holdings)>,
}

impl<'a> Loop<'a> {
    fn new(site: &'a Site, plan: &Plan) -> Loop<'a> {
        let begun = MonotonicNs::now();
        let mut witness = Witness::new(site);
        let mut crew = Vec::new();
        let more = Some(plan.victim).filter(|victim| !Kind::CREW.contains(victim));
        for kind in Kind::CREW.into_iter().chain(more) {
            let mut process = site.start_one(kind);
            await_ready(kind, &mut process);
            crew.push((kind, process));
        }
        witness.hear_after(begun);
        let index = crew.iter().position(|(kind, _)| *kind == plan.victim);
        let (_, process) = crew.remove(index.expect("all kinds are there"));
        Loop {
            site,
            victim: plan.victim,
            process,
            others: crew,
            witness,
            chance: Random::new(plan.seed, plan.victim as u64),
            kills: 0,
            in_start_up: 0,
            ready: Spread::default(),
            again: Spread::default(),
            things: Vec::new(),
            last_start: SystemTime::now(),
            own_descriptors: 0,
            warm: Vec::new(),
        }
    }

    /// Ends the victim in order and starts it again, so that whatever a start leaves for good is there, and says how long
    /// it took.
    fn first_start(&mut self) -> Duration {
        self.process.signal(Signal::TERM);
        self.process.wait_exit();
        let started = MonotonicNs::now();
        self.process = self.site.start_one(self.victim);
        await_ready(self.victim, &mut self.process);
        let start_up = MonotonicNs::now().since(started);
        self.witness.hear_after(started);
        self.things = self.settled(|of| of.site.domain.residue(), Vec::len);
        self.own_descriptors = Holdings::of(std::process::id()).descriptors;
        start_up
    }

    /// Kills the victim at a random moment within `span`.
    fn kill(&mut self, life: Life, span: Duration) {
        // The moment is what is tried here, not something that is waited for.
        thread::sleep(span.mul_f64(self.chance.uniform()));
        self.process.signal(Signal::KILL);
        self.process.wait_exit();
        self.kills += 1;
        self.in_start_up += u32::from(life == Life::Starting);
    }

    /// Starts the successor, which must get everything going again.
    fn succeed(&mut self) {
        self.last_start = SystemTime::now();
        let started = MonotonicNs::now();
        self.process = self.site.start_one(self.victim);
        await_ready(self.victim, &mut self.process);
        self.ready.push(MonotonicNs::now().since(started));
        let heard = self.witness.hear_after(started);
        if !self.victim.is_consumer() {
            self.again.push(heard.since(started));
        }
        for (_, process) in &mut self.others {
            // What they print is not needed, and would fill the pipe's reader.
            process.lines();
        }
    }

    fn warm_up(&mut self) {
        let now = self.settled_holdings();
        if self.warm.is_empty() {
            self.warm = now;
            return;
        }
        for ((_, most), (_, now)) in self.warm.iter_mut().zip(now) {
            most.descriptors = most.descriptors.max(now.descriptors);
            most.memory_kib = most.memory_kib.max(now.memory_kib);
        }
    }

    /// What the others hold, once that stays the same.
    fn settled_holdings(&mut self) -> Vec<(Kind, Holdings)> {
        self.settled(Loop::holdings, |all| {
            all.iter().map(|(_, held)| held.descriptors).sum()
        })
    }

    /// What there is to `see`, once its `size` stays the same: a consumer that is ready may not have slept yet, and only then
    /// has the publisher to connect with its listener.
    fn settled<T>(&mut self, see: impl Fn(&Self) -> T, size: impl Fn(&T) -> usize) -> T {
        let (mut seen, mut same) = (see(self), 0);
        while same < SAME_SAMPLES {
            self.witness.hear_after(MonotonicNs::now());
            let now = see(self);
            same = match size(&now) == size(&seen) {
                true => same + 1,
                false => 0,
            };
            seen = now;
        }
        seen
    }

    fn holdings(&self) -> Vec<(Kind, Holdings)> {
        let of = |(kind, process): &(Kind, Process)| (*kind, Holdings::of(process.id()));
        self.others.iter().map(of).collect()
    }

    /// What of the domain was not there before the kills, and was last changed before the last successor started.
    fn left_of_the_killed(&self, mut things: Vec<PathBuf>) -> Vec<PathBuf> {
        things.retain(|path| {
            let metadata = path.symlink_metadata();
            let modified = metadata.and_then(|metadata| metadata.modified());
            !self.things.contains(path) && modified.is_ok_and(|then| then < self.last_start)
        });
        things
    }

    /// Whether there is more in the domain than may be left, or a survivor holds more descriptors than while it warmed up.
    fn is_more(&self, things: &[PathBuf], now: &[(Kind, Holdings)]) -> bool {
        let mut survivors = self.warm.iter().zip(now);
        things.len() > self.things.len() + may_be_left(self.in_start_up)
            || survivors.any(|((_, before), (_, after))| after.descriptors > before.descriptors)
    }

    /// Waits until what was left is removed, ends everybody and says what came of it.
    fn settle(mut self) -> Outcome {
        let begun = MonotonicNs::now();
        let (mut things, mut now) = (self.site.domain.residue(), self.holdings());
        while self.is_more(&things, &now) && MonotonicNs::now().since(begun) < SETTLE_LIMIT {
            // The next sample is the occasion: the processes clean up by themselves, this one does not.
            self.witness.hear_after(MonotonicNs::now());
            (things, now) = (self.site.domain.residue(), self.holdings());
        }
        let settled = MonotonicNs::now().since(begun);
        let count = things.len();
        let left = match count > self.things.len() {
            true => self.left_of_the_killed(things),
            false => Vec::new(),
        };
        let survivors = self.warm.iter().zip(&now);
        let outcome = Outcome {
            victim: self.victim,
            kills: self.kills,
            in_start_up: self.in_start_up,
            ready: self.ready,
            again: self.again,
            things: (self.things.len(), count),
            left,
            settled,
            survivors: survivors
                .map(|((kind, before), (_, after))| Survivor {
                    kind: *kind,
                    before: *before,
                    after: *after,
                })
                .collect(),
            own_descriptors: (
                self.own_descriptors,
                Holdings::of(std::process::id()).descriptors,
            ),
        };
        drop(self.witness);
        match self.victim {
            // SIGTERM kills a program in Python that does not ask for it.
            Kind::ConsumerInPython => drop(self.process),
            _ => end(self.process),
        }
        self.others
            .into_iter()
            .for_each(|(_, process)| end(process));
        self.site.domain.assert_empty();
        outcome
    }
}
