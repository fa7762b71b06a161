//! `kill -9` at random moments, over and over: does every successor come up, how soon, what does a consumer miss, and
//! is anything left?
//!
//! | measurement | what is killed |
//! |---|---|
//! | [`run`] | one kind of process; the others may hold no more in the end |
//! | [`starts`] | any process, and now and then everything at the same moment, and very many others with it |
//! | [`gap`] | the bridge, which its supervisor starts again at once |

use std::path::PathBuf;
use std::time::{Duration, SystemTime};

use clap::ValueEnum;
use fastrand::Rng;
use ipc_types::payload::DspTelemetry;
use ipc_types::{MonotonicNs, RobotId};
use ril_tests::Process;
use ril_tests::process::Signal;
use ril_tests::sandbox::{Holdings, Witness};

use crate::listener::Listener;
use crate::plan::Kind;
use crate::site::{CLEAN_UP_LIMIT, Site, Survivors, kill, pass};
use measure::{Outcome, Times};

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

/// Samples that a bridge publishes before it is killed: it works.
const SAMPLES_BEFORE: usize = 5;

/// A process, what its first start has taken, and what its starts took since.
struct Member {
    kind: Kind,
    process: Process,
    start_up: Duration,
    ready: Times,
}

impl Member {
    fn start(site: &Site, kind: Kind) -> Member {
        let (process, start_up) = site.start_working(kind);
        Member {
            kind,
            process,
            start_up,
            ready: Times::default(),
        }
    }

    /// Starts the successor, and waits until it works.
    fn start_again(&mut self, site: &Site) -> Duration {
        let (process, ready) = site.start_working(self.kind);
        self.process = process;
        self.ready.push(ready);
        ready
    }
}

/// One process of each kind, which are killed, and a witness to whom telemetry must come again.
struct Members<'a> {
    site: &'a Site,
    all: Vec<Member>,
    witness: Witness,
    chance: Rng,
    kills: u32,
    in_start_up: u32,
    again: Times,
    /// When the last successor was started.
    last_start: SystemTime,
}

impl<'a> Members<'a> {
    fn start(site: &'a Site, kinds: impl IntoIterator<Item = Kind>, stream: u64) -> Members<'a> {
        let begun = MonotonicNs::now();
        let mut witness = Witness::new(&site.domain);
        let all = kinds.into_iter().map(|kind| Member::start(site, kind));
        let all = all.collect();
        witness.receive_after(begun);
        Members {
            site,
            all,
            witness,
            chance: site.chance(stream),
            kills: 0,
            in_start_up: 0,
            again: Times::default(),
            last_start: SystemTime::now(),
        }
    }

    /// Kills a member at work, half of the time its successors as they start, and then one must get everything going
    /// again. No more than `most` are killed in all.
    fn kill(&mut self, index: usize, most: u32) {
        let member = &mut self.all[index];
        pass(&mut self.chance, WORK);
        kill(&mut member.process);
        self.kills += 1;
        while self.kills < most && self.chance.bool() {
            let mut starting = self.site.start_one(member.kind);
            pass(&mut self.chance, member.start_up.mul_f64(START_UP));
            kill(&mut starting);
            self.kills += 1;
            self.in_start_up += 1;
        }
        self.last_start = SystemTime::now();
        let started = MonotonicNs::now();
        member.start_again(self.site);
        // Nothing depends on consumers.
        let is_consumer = member.kind.is_consumer();
        let received = self.witness.receive_after(started);
        if !is_consumer {
            self.again.push(received.since(started));
        }
        self.take_lines();
    }

    /// What they print is not needed, and would fill the pipe's reader.
    fn take_lines(&mut self) {
        for member in &mut self.all {
            member.process.lines();
        }
    }
}

/// Kills each kind of process that is planned.
pub fn run(site: &Site) {
    let kinds = Kind::value_variants().iter().copied();
    let chosen = kinds.filter(|kind| site.plan.victim.is_none_or(|victim| victim == *kind));
    for victim in chosen.filter(|kind| kind.is_possible()) {
        site.show(kill_over_and_over(site, victim));
    }
}

fn kill_over_and_over(site: &Site, victim: Kind) -> Outcome {
    let most = site.plan.count(1000);
    let mut loops = Loop::start(site, victim);
    while loops.members.kills < most && site.goes_on() {
        loops.members.kill(loops.victim, most);
        if loops.members.kills <= most / WARM_UP {
            loops.wait_until_same();
            loops.survivors.warm_up();
        }
    }
    loops.finish()
}

/// The loop at work.
struct Loop<'a> {
    members: Members<'a>,
    /// The place of the one that is killed.
    victim: usize,
    survivors: Survivors,
    /// What the domain had before the first kill.
    before: Vec<PathBuf>,
    own_descriptors: usize,
}

impl<'a> Loop<'a> {
    /// Starts all. Ends the victim in order and starts it again, so that whatever a start leaves for good is there.
    fn start(site: &'a Site, victim: Kind) -> Loop<'a> {
        let more = Some(victim).filter(|victim| !Kind::OF_RIL.contains(victim));
        let kinds = Kind::OF_RIL.into_iter().chain(more);
        let mut members = Members::start(site, kinds, victim as u64);
        let is_victim = |member: &Member| member.kind == victim;
        let index = members.all.iter().position(is_victim);
        let index = index.expect("all kinds are there");
        members.all[index].process.signal(Signal::TERM);
        members.all[index].process.wait_exit();
        let started = MonotonicNs::now();
        members.all[index] = Member::start(site, victim);
        members.witness.receive_after(started);
        let mut loops = Loop {
            members,
            victim: index,
            survivors: Survivors::default(),
            before: Vec::new(),
            own_descriptors: 0,
        };
        loops.wait_until_same();
        loops.before = site.domain.residue();
        loops.own_descriptors = Holdings::of(std::process::id()).descriptors;
        let others = loops.others();
        loops.survivors = Survivors::of(others.map(|member| (member.kind.name(), &member.process)));
        loops
    }

    fn others(&self) -> impl Iterator<Item = &Member> {
        let members = self.members.all.iter().enumerate();
        let others = members.filter(|(index, _)| *index != self.victim);
        others.map(|(_, member)| member)
    }

    /// Waits until the domain and the others hold the same for some samples: a consumer that is ready may not have
    /// slept yet, and only then has the publisher to connect with its listener. A sample counts when each consumer has
    /// printed something since the last that did: on a busy machine one may stand still for longer than these samples
    /// take.
    fn wait_until_same(&mut self) {
        let see = |all: &Loop<'_>| {
            let held = |member: &Member| Holdings::of(member.process.id()).descriptors;
            let held: usize = all.others().map(held).sum();
            (held, all.members.site.domain.residue().len())
        };
        let (mut seen, mut same, mut printed) = (see(self), 0, self.printed());
        while same < SAME_SAMPLES {
            self.members.witness.receive_after(MonotonicNs::now());
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
        let members = self.members.all.iter_mut().enumerate();
        let consumers =
            members.filter(|(index, member)| *index != self.victim && member.kind.is_consumer());
        consumers
            .map(|(_, member)| member.process.lines().len())
            .collect()
    }

    /// Waits until what was left is removed, ends all processes and says what came of it.
    fn finish(self) -> Outcome {
        let Loop {
            mut members,
            victim,
            survivors,
            before,
            own_descriptors,
        } = self;
        // A process that was killed while it made its node leaves three files that belong to nobody.
        let may_be_left = (3 * members.in_start_up as usize).min(MAX_LEFTOVERS);
        let (site, last_start) = (members.site, members.last_start);
        let mut left = Vec::new();
        let took = survivors.wait_until_flat(
            // The next sample is the occasion.
            || _ = members.witness.receive_after(MonotonicNs::now()),
            || {
                left = left_of_the_killed(site.domain.residue(), &before, last_start);
                left.len() <= may_be_left
            },
        );
        let mut outcome = Outcome::default();
        let killed = members.all.remove(victim);
        outcome.cell("killed", killed.kind.name());
        outcome.cell("kills", members.kills);
        outcome.cell("of them while it started", members.in_start_up);
        outcome.cell("ready again", &killed.ready);
        outcome.cell("telemetry again", &members.again);
        let (before, left_count) = (before.len(), left.len());
        let took_s = took.unwrap_or(CLEAN_UP_LIMIT).as_secs_f64();
        outcome.cell(
            "files and segments",
            format!("{before} before, {left_count} left {took_s:.1} s after"),
        );
        survivors.report(&mut outcome);
        let now = Holdings::of(std::process::id()).descriptors;
        let own = format!("{own_descriptors} → {now}");
        outcome.cell("descriptors of this process", own);
        outcome.require(
            took.is_some(),
            format!("a survivor holds more descriptors, or this is left of the killed: {left:?}"),
        );
        drop(members.witness);
        match killed.kind {
            // SIGTERM kills a program in Python that does not ask for it.
            Kind::PythonConsumer => drop(killed.process),
            _ => _ = killed.process.end(),
        }
        site.end(members.all.into_iter().map(|member| member.process), false);
        outcome
    }
}

/// Which of `things` were not there before the kills, and were last changed before the last successor started. What
/// this one and its partners make is not counted: they may still be at it.
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

/// Kills and starts any process, very many times.
pub fn starts(site: &Site) {
    // How many starts there are until everything is killed at once, and robots then, beside the first.
    let (together, robots) = site.plan.either((20, 2), (250, 12));
    let mut members = Members::start(site, Kind::possible(), 0);
    let (mut times, mut processes, mut after_all) = (0, 0, Times::default());
    for number in 1..=site.plan.count(10_000) {
        if !site.goes_on() {
            break;
        }
        let index = members.chance.usize(..members.all.len());
        members.kill(index, u32::MAX);
        if number % together == 0 {
            times += 1;
            processes += kill_all(&mut members, robots);
            let begun = MonotonicNs::now();
            let again = members
                .all
                .iter_mut()
                .map(|member| member.start_again(site));
            after_all.extend(again);
            members.witness.receive_after(begun);
        }
    }
    let Members {
        all,
        witness,
        in_start_up,
        ..
    } = members;
    let mut outcome = Outcome::default();
    let ready = all.iter().flat_map(|member| &member.ready.0);
    outcome.cell("ready", ready.copied().collect::<Times>());
    outcome.cell("killed while they started", in_start_up);
    let each = all
        .iter()
        .map(|member| format!("{}: {}", member.kind.name(), member.ready));
    outcome.cell("each", each.collect::<Vec<_>>().join("; "));
    outcome.cell("times all at once", times);
    let ready = format!("{processes} processes; then ready: {after_all}");
    outcome.cell("all at once", ready);
    drop((witness, all));
    site.end([], true);
    site.show(outcome);
}

/// Starts very many at once, kills them and all members, and says how many those were.
fn kill_all(members: &mut Members<'_>, robots: u32) -> usize {
    let robots = 2..2 + robots;
    let args = robots.flat_map(|robot| CROWD.map(|args| args.replace('N', &robot.to_string())));
    let mut crowd: Vec<Process> = args.map(|args| members.site.start(&args)).collect();
    pass(&mut members.chance, CROWD_WORK);
    let members = members.all.iter_mut().map(|member| &mut member.process);
    let mut all: Vec<&mut Process> = crowd.iter_mut().chain(members).collect();
    all.iter().for_each(|process| process.signal(Signal::KILL));
    for process in &mut all {
        process.wait_exit();
    }
    all.len()
}

/// What a consumer of telemetry sees when the bridge is killed and started again at once.
pub fn gap(site: &Site) {
    let period_ms = site.plan.period_ms.unwrap_or(20);
    // So fast that a frame is over long before the next one.
    let serial = "[serial]\nbaud_rate = 1000000\n";
    let parameters = format!("[parameters]\nstatus_period_ms = {period_ms}\n");
    site.write("dsp-sim.toml", serial);
    site.write("bridge.toml", &format!("{serial}{parameters}"));
    let (sim, _) = site.start_working(Kind::Sim);
    let epoch = |sample: &DspTelemetry| sample.epoch_ns;
    let listener = Listener::start(&site.domain, RobotId::DEFAULT, epoch);
    let mut bridge = site.start_one(Kind::Bridge);
    let mut chance = site.chance(0);
    let period = Duration::from_millis(period_ms.into());
    let (mut gaps, mut from_start) = (Times::default(), Times::default());
    while gaps.count() < site.plan.count(200) as usize && site.goes_on() {
        listener.gaps(SAMPLES_BEFORE - 1);
        let mut last = listener.next();
        pass(&mut chance, period);
        kill(&mut bridge);
        let started = MonotonicNs::now();
        bridge = site.start_one(Kind::Bridge);
        let first = loop {
            let heard = listener.next();
            if heard.kept != last.kept {
                break heard;
            }
            last = heard;
        };
        gaps.push(first.at.since(last.at));
        from_start.push(first.at.since(started));
    }
    listener.end();
    site.end([sim, bridge], false);
    let mut outcome = Outcome::default();
    outcome.cell("period, ms", period_ms);
    outcome.cell("kills", gaps.count());
    outcome.cell("gap", gaps);
    outcome.cell("from the start of the new bridge", from_start);
    site.show(outcome);
}
