//! Crowds of processes that do not end in peace, beside healthy ones that must not notice.
//!
//! | measurement | what becomes of the crowd |
//! |---|---|
//! | [`crashes`] | processes of every kind start, and are killed, stopped or crash, so many a second |
//! | [`clients`] | groups of operator's commands end at the same moment with their requests open |
//! | [`joiners`] | processes are stopped while they start: they may hold whatever a start needs |
//! | [`subscribers`] | subscribers never read, read late, are stopped, come and go, and are killed |

use std::collections::VecDeque;
use std::fs;
use std::thread;
use std::time::{Duration, Instant};

use fastrand::Rng;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use ipc_types::{Ipc, Losses, MonotonicNs, RobotId, Subscriber, Topic};
use ril_tests::Process;
use ril_tests::process::Signal;
use rustix::process::{Resource, Rlimit, setrlimit};

use crate::listener::{Heard, Listener, gaps};
use crate::plan::Kind;
use crate::site::{ECHO_DSP, ECHO_HERO, Site, Survivors, count_lines, kill, pass};
use measure::{Outcome, Times};

/// What is started. The last ones are modules: one that finds its place taken, one that waits, and one with a topic of
/// its own.
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

/// Oldest age at which a process ends or is stopped while it starts.
const START_UP: Duration = Duration::from_millis(20);

/// Oldest age at which the others end.
const WORK: Duration = Duration::from_millis(300);

/// How long a process stays stopped before it is killed, at most.
const STOP: Duration = Duration::from_secs(2);

/// How long a process that was asked to end has, before it is killed.
const END: Duration = Duration::from_millis(500);

/// Most that are stopped at a time. Each may keep one of the places that a service has for clients and subscribers.
const MAX_STOPPED: usize = 6;

/// The survivors of crashes warm up in one part in this many of the time: what they hold then at most, they may hold at
/// the end.
const WARM_UP: u32 = 5;

/// How often the survivors and the domain are looked at.
const LOOK_PERIOD: Duration = Duration::from_secs(1);

/// Files that killed processes may leave in the generation of a service before another one begins, and the services.
const MAX_LEFTOVERS: usize = 256 * 7;

/// Less than a subscriber's buffer holds at the rate of the chain: 128 samples, 200 a second.
const BUFFERED: Duration = Duration::from_millis(500);

/// What the log of a provider says of a new generation of shared memory.
const NEW_GENERATION: &str = "a new generation of shared memory begins";

/// What the bridge's log says when the link is lost.
const LINK_LOST: &str = " link from=\"up\"";

#[derive(Clone, Copy, Debug)]
enum Start {
    Ril(&'static str),
    InC(&'static str, &'static str),
    InPython(&'static str),
}

impl Start {
    fn is_possible(&self) -> bool {
        match self {
            Start::Ril(_) => true,
            Start::InC(..) => Kind::CConsumer.is_possible(),
            Start::InPython(_) => Kind::PythonConsumer.is_possible(),
        }
    }

    fn at(self, site: &Site) -> Process {
        match self {
            Start::Ril(args) => site.start(args),
            Start::InC(source, args) => site.start_c(source, args),
            Start::InPython(source) => site.start_python(source),
        }
    }
}

/// A healthy consumer, which notes the generation of shared memory that was in use when a sample came.
fn healthy<T: Topic>(site: &Site) -> Listener<String> {
    let robot = site.domain.root().join(RobotId::DEFAULT.to_string());
    let current = robot.join(T::KEY).join("current");
    let generation = move |_: &T| fs::read_to_string(&current).unwrap_or_default();
    Listener::start(&site.domain, RobotId::DEFAULT, generation)
}

/// Between two samples with another generation in between, or right after it.
fn gaps_at_generations(heard: &[Heard<String>]) -> Times {
    let is_near = |index: usize| {
        let mut near = heard[index.saturating_sub(1)..index + 2].windows(2);
        near.any(|pair| pair[0].kept != pair[1].kept)
    };
    let gaps = gaps(heard).enumerate();
    gaps.filter_map(|(index, gap)| is_near(index).then_some(gap))
        .collect()
}

/// Notes what a healthy consumer got. One that the machine has not let run for longer than `excused` may lose what its
/// buffer cannot hold: no other process has cost it that.
fn report(outcome: &mut Outcome, name: &'static str, healthy: Listener<String>, excused: Duration) {
    let (heard, losses) = healthy.end();
    let all: Times = gaps(&heard).collect();
    let Losses { received, lost, .. } = losses;
    let at_generations = gaps_at_generations(&heard);
    outcome.cell(
        name,
        format!("{received} samples, {lost} lost, gaps {all}; at new generations {at_generations}"),
    );
    outcome.require(
        lost == 0 || all.worst() > excused,
        format!("{name}: {lost} lost"),
    );
    outcome.require(received > 0, format!("no samples of {name}"));
}

/// Processes that start, and are killed, stopped or crash, so many a second. Measures the samples that healthy
/// consumers lose meanwhile.
pub fn crashes(site: &Site) {
    // Crashes leave no images of their memory.
    let none = Rlimit {
        current: Some(0),
        maximum: Some(0),
    };
    let _ = setrlimit(Resource::Core, none);
    let duration = site.plan.duration(600);
    let [sim, mut bridge, mut status] = site.start_flight();
    let domain = &site.domain;
    let healthy = [
        ("dsp", healthy::<DspTelemetry>(site)),
        ("hero", healthy::<HeroTelemetry>(site)),
        ("states", healthy::<ModuleState>(site)),
    ];
    let before = domain.residue().len();
    let mut most = before;
    let mut survivors = Survivors::of([("bridge", &bridge), ("status", &status)]);
    let mut crowd = Crowd::new(site);
    let begun = Instant::now();
    let (mut looked, mut next_start) = (begun, begun);
    let period = Duration::from_secs(1) / site.plan.per_second;
    while begun.elapsed() < duration && site.goes_on() {
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
    let ends = crowd.ends;
    // Those that are left are killed.
    drop(crowd);
    let took = survivors.wait_until_flat(
        // Whatever it says: a second of telemetry is the occasion.
        || _ = site.finish("echo dsp --duration 1s"),
        || domain.residue().len() <= before + MAX_LEFTOVERS,
    );
    let after = domain.residue().len();
    let lands = site.lands();
    site.ask("stop");

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
    let excused = site.plan.either(BUFFERED, Duration::MAX);
    for (name, healthy) in healthy {
        report(&mut outcome, name, healthy, excused);
    }
    let generations = [&mut bridge, &mut status].map(|one| count_lines(one, NEW_GENERATION));
    let [of_bridge, of_status] = generations;
    outcome.cell(
        "new generations of bridge, status",
        format!("{of_bridge}, {of_status}"),
    );
    outcome.cell(
        "files and segments",
        format!("{before} before, {most} at most, {after} after"),
    );
    survivors.report(&mut outcome);
    let link_losses = count_lines(&mut bridge, LINK_LOST);
    outcome.require(link_losses == 0, format!("link lost {link_losses} times"));
    outcome.require(lands, "NOT landed");
    // In a short time the survivors do not come to hold all that they need.
    let is_flat = took.is_some() || site.plan.is_short;
    outcome.require(
        is_flat,
        "a survivor holds more descriptors, or too much is left",
    );
    // Robot 2 has had only processes that were killed.
    site.end([sim, bridge, status], true);
    site.show(outcome);
}

/// A process, and the signals that it will get: each with the time from the one before it. The last one ends it.
struct Doomed {
    process: Process,
    at: Instant,
    signals: VecDeque<(Duration, Signal)>,
    is_to_be_stopped: bool,
}

/// The processes that crash.
struct Crowd<'a> {
    site: &'a Site,
    chance: Rng,
    starts: Vec<Start>,
    alive: Vec<Doomed>,
    /// Killed; crashed as if by a fault of their own; stopped for a while, then killed, and half of them went on in
    /// between; ended in order, or killed half a second after they were asked to.
    ends: [u32; 4],
}

impl<'a> Crowd<'a> {
    fn new(site: &'a Site) -> Crowd<'a> {
        Crowd {
            site,
            chance: site.chance(0),
            starts: STARTS.into_iter().filter(Start::is_possible).collect(),
            alive: Vec::new(),
            ends: [0; 4],
        }
    }

    fn draw(&mut self, longest: Duration) -> Duration {
        longest.mul_f64(self.chance.f64())
    }

    fn start_one(&mut self) {
        let start = self
            .chance
            .choice(&self.starts)
            .expect("some can be started");
        let process = start.at(self.site);
        let at = Instant::now();
        let oldest = if self.chance.bool() { START_UP } else { WORK };
        let age = self.draw(oldest);
        let stopped = self.alive.iter().filter(|one| one.is_to_be_stopped).count();
        let (end, signals) = match self.chance.u8(..10) {
            0..3 => (0, vec![(age, Signal::KILL)]),
            // Rust catches the first SIGSEGV that comes from outside.
            3 | 4 => (1, vec![(age, Signal::ILL)]),
            5 => (1, vec![(age, Signal::ABORT)]),
            6 | 7 => (3, vec![(age, Signal::INT), (END, Signal::KILL)]),
            _ if stopped >= MAX_STOPPED => (0, vec![(age, Signal::KILL)]),
            8 => {
                let stop = self.draw(STOP);
                (2, vec![(age, Signal::STOP), (stop, Signal::KILL)])
            }
            _ => {
                let (stop, work) = (self.draw(STOP), self.draw(WORK));
                let goes_on = [(stop, Signal::CONT), (work, Signal::KILL)];
                (2, [&[(age, Signal::STOP)][..], &goes_on].concat())
            }
        };
        self.ends[end] += 1;
        self.alive.push(Doomed {
            process,
            at: at + age,
            signals: signals.into(),
            is_to_be_stopped: end == 2,
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
            let doomed = &mut self.alive[next];
            if let Some((_, signal)) = doomed.signals.pop_front() {
                doomed.process.signal(signal);
            }
            match doomed.signals.front() {
                Some((after, _)) => doomed.at += *after,
                None => _ = self.alive.swap_remove(next).process.wait_exit(),
            }
        }
    }
}

/// What the clients ask. Each `--preempt` replaces the path before it, so that many of them have a request open.
const REQUESTS: [&str; 4] = [
    "goto 37.4300,-6.0010,25 --preempt",
    "goto 37.4310,-6.0010,25 --preempt --json",
    "goto 37.4300,-6.0010,25",
    "takeoff --altitude 5",
];

/// Sizes of a group; the greatest takes all places that a service has for clients.
const GROUP: std::ops::RangeInclusive<u32> = 2..=16;

/// Least age at which a group ends, or its time after the first client was heard, and how much more it may be.
const AGE: [Duration; 2] = [Duration::from_millis(10), Duration::from_millis(30)];

/// How clients ended.
#[derive(Default)]
struct Ended {
    clients: u32,
    groups: u32,
    killed: u32,
    /// Interrupted clients that ended by themselves, with an exit code.
    in_order: u32,
}

/// Groups of operator's commands that end at the same moment with their requests open: does the bridge live on, and
/// does it hold any more than before?
///
/// The bridge warms up during half of the clients: it keeps open what a group that died last has left until it cleans
/// up, and the largest group may come late. What leaks still grows with the other half.
pub fn clients(site: &Site) {
    let count = site.plan.count(20_000);
    let [sim, mut bridge, mut status] = site.start_flight();
    let mut chance = site.chance(0);
    let mut ended = Ended::default();
    let mut survivors = Survivors::of([("bridge", &bridge)]);
    while ended.clients < count && bridge.is_running() && site.goes_on() {
        end_a_group(site, &mut chance, &mut ended);
        if ended.clients <= count / 2 || ended.groups == 1 {
            // Whatever it says: it is the occasion to clean up, and the bridge may have died by now.
            site.finish("echo dsp --count 1");
            if bridge.is_running() {
                survivors.warm_up();
            }
        }
    }
    let mut outcome = Outcome::default();
    outcome.cell("clients", ended.clients);
    outcome.cell("groups", ended.groups);
    outcome.cell("killed", ended.killed);
    outcome.cell("ended in order", ended.in_order);
    // No process has touched it.
    outcome.none("link lost", count_lines(&mut bridge, LINK_LOST));
    // The buffer of status holds more than half a second of samples.
    let losses = status.lines().iter().filter_map(|line| {
        let is_it = line.text.contains("samples were lost on the way");
        let (_, total) = line.text.rsplit_once("total=").filter(|_| is_it)?;
        total.parse::<u64>().ok()
    });
    outcome.cell("samples lost", losses.max().unwrap_or_default());
    if !bridge.is_running() {
        outcome.require(false, "the bridge DIED");
        drop((status, bridge, sim));
        site.end([], true);
        return site.show(outcome);
    }
    // Whatever it says: a second of telemetry is the occasion.
    let took = survivors.wait_until_flat(|| _ = site.finish("echo dsp --duration 1s"), || true);
    survivors.report(&mut outcome);
    // In a short run the largest group may come late; what leaks costs one with each client of the second half.
    let is_flat =
        took.is_some() || site.plan.is_short && survivors.rise() < (ended.groups / 4) as usize;
    outcome.require(is_flat, "the bridge holds more descriptors");
    outcome.require(site.lands(), "NOT landed");
    for request in [
        "status",
        "stop",
        "start",
        "takeoff --altitude 5",
        "land",
        "stop",
    ] {
        site.ask(request);
    }
    site.end([sim, bridge, status], false);
    site.show(outcome);
}

fn end_a_group(site: &Site, chance: &mut Rng, ended: &mut Ended) {
    let size = chance.u32(GROUP);
    let requests = (0..size).map(|_| chance.choice(REQUESTS).expect("there are some"));
    let mut group: Vec<_> = requests.map(|request| site.start(request)).collect();
    // Half of the groups end as they are served, the others while they start and later.
    if chance.bool() {
        group[0].wait_for_line(|_| true);
    }
    thread::sleep(AGE[0]);
    pass(chance, AGE[1]);
    let is_kill = chance.bool();
    let signal = if is_kill { Signal::KILL } else { Signal::INT };
    group.iter().for_each(|client| client.signal(signal));
    for client in &mut group {
        let is_in_order = client.wait_exit().code().is_some();
        ended.in_order += u32::from(!is_kill && is_in_order);
    }
    ended.clients += size;
    ended.groups += 1;
    ended.killed += if is_kill { size } else { 0 };
}

/// What is stopped while it starts.
const JOINERS: [&str; 5] = [
    "echo hero --json",
    "status",
    "run bridge --port dsp-1",
    "run status",
    "takeoff --altitude 5",
];

/// Processes that are stopped while they start: they may hold whatever a start needs, and must keep no other process
/// waiting.
pub fn joiners(site: &Site) {
    let chain = site.start_chain(4);
    let mut chance = site.chance(0);
    let mut stopped: VecDeque<Process> = VecDeque::new();
    let (mut count, mut done, mut interrupted) = (0, 0, 0);
    while count < site.plan.count(2000) && site.goes_on() {
        let joiner = site.start(JOINERS[count as usize % JOINERS.len()]);
        pass(&mut chance, START_UP);
        joiner.signal(Signal::STOP);
        stopped.push_back(joiner);
        count += 1;
        for args in ["status", "echo hero --count 1"] {
            site.ask(args);
        }
        // Whatever it finds; it takes note of those that are stopped.
        let doctor = site.finish("doctor").code();
        assert!(matches!(doctor, Some(0 | 8)), "{doctor:?}");
        done += 3;
        for (args, signal) in [
            ("echo hero", Signal::INT),
            ("run status --robot 2", Signal::TERM),
        ] {
            let mut process = site.start(args);
            pass(&mut chance, 2 * START_UP);
            process.signal(signal);
            process.wait_exit();
            interrupted += 1;
        }
        if stopped.len() > MAX_STOPPED
            && let Some(mut oldest) = stopped.pop_front()
        {
            // One in two goes on where it was, the other never does.
            let goes_on = chance.bool();
            let signals = [Signal::CONT, Signal::TERM];
            let signals = if goes_on {
                &signals[..]
            } else {
                &[Signal::KILL]
            };
            signals.iter().for_each(|signal| oldest.signal(*signal));
            oldest.wait_exit();
        }
    }
    drop(stopped);
    site.end(chain, true);
    let mut outcome = Outcome::default();
    outcome.cell("stopped", count);
    outcome.cell("commands done meanwhile", done);
    outcome.cell("ended at a signal meanwhile", interrupted);
    site.show(outcome);
}

/// Longest pause between two disturbances by a subscriber.
const PAUSE: Duration = Duration::from_millis(30);

/// Disturbances between two readings of the slow subscriber: so many samples come meanwhile that its buffer overflows.
const SLOWNESS: u32 = 40;

/// Subscribers of both topics.
type Pair = (Subscriber<DspTelemetry>, Subscriber<HeroTelemetry>);

fn pair(ipc: &Ipc) -> Pair {
    let raw = ipc.subscriber().expect("a subscriber");
    (raw, ipc.subscriber().expect("a subscriber"))
}

/// Subscribers that never read, read late, are stopped, come and go, and are killed: does the bridge lose a byte, or a
/// healthy consumer a sample? Both ends speak the extended profile, whose numbers and CRC show every byte that is
/// missing.
pub fn subscribers(site: &Site) {
    let period_ms = site.plan.period_ms.unwrap_or(2);
    let serial = "[serial]\nbaud_rate = 4000000\n";
    site.write("dsp-sim.toml", &format!("{serial}profile = \"extended\"\n"));
    let link = "[link]\nprofile = \"extended\"\n";
    let parameters = format!("[parameters]\nstatus_period_ms = {period_ms}\n");
    site.write("bridge.toml", &format!("{serial}{link}{parameters}"));
    let chain = [Kind::Sim, Kind::Bridge, Kind::Status].map(|kind| site.start_working(kind).0);
    let healthy = [
        ("samples of the bridge", healthy::<DspTelemetry>(site)),
        ("of status", healthy::<HeroTelemetry>(site)),
    ];
    let ipc = site.domain.join("crowd");
    let _never_reads = pair(&ipc);
    let (mut slow, mut coming_and_going) = (pair(&ipc), None);
    let mut stopped = site.start(ECHO_DSP);
    stopped.wait_for_text("sequence");
    let mut killed = site.start(ECHO_DSP);
    let (mut steps, mut kills, mut stops, mut churned) = (0_u32, 0, 0, 0);
    let mut is_stopped = false;
    let mut chance = site.chance(0);
    let begun = Instant::now();
    while begun.elapsed() < site.plan.duration(120) && site.goes_on() {
        pass(&mut chance, PAUSE);
        steps += 1;
        if steps.is_multiple_of(SLOWNESS) {
            // What cannot be received is lost, as what came too early.
            let _ = (slow.0.latest(), slow.1.latest());
        }
        match chance.u8(..8) {
            0 => {
                is_stopped = !is_stopped;
                stopped.signal(if is_stopped {
                    Signal::STOP
                } else {
                    Signal::CONT
                });
                stops += u32::from(is_stopped);
            }
            1..4 => {
                kill(&mut killed);
                killed = site.start(ECHO_DSP);
                kills += 1;
            }
            _ => match coming_and_going.take() {
                Some(_) => churned += 1,
                None => coming_and_going = Some(pair(&ipc)),
            },
        }
    }
    let lasted_s = begun.elapsed().as_secs_f64();
    let _ = (slow.0.latest(), slow.1.latest());
    let (raw, hero) = (slow.0.losses(), slow.1.losses());
    stopped.signal(Signal::CONT);
    stopped.end();
    kill(&mut killed);
    let asked = MonotonicNs::now();
    let mut states = site.watch(1);
    let state = states.until("a state", |state| state.published_ns > asked.0);
    let mut outcome = Outcome::default();
    outcome.cell("telemetry", format!("{period_ms} ms, {lasted_s:.0} s"));
    // Bytes, or messages, that did not arrive as they were sent.
    let refused = &state.refused;
    let bytes = refused.stray + refused.unknown_header + refused.truncated + refused.checksum;
    let damaged = bytes + refused.padding + refused.value + refused.missed_messages;
    outcome.cell("bytes", state.link.bytes_received);
    outcome.none("damaged or missed", damaged as usize);
    for (name, healthy) in healthy {
        report(&mut outcome, name, healthy, Duration::MAX);
    }
    outcome.cell("came and went", churned);
    outcome.cell("killed", kills);
    let (received, lost) = (raw.received + hero.received, raw.lost + hero.lost);
    outcome.cell(
        "the others",
        format!("{stops} stops; the slow one got {received} and lost {lost}"),
    );
    drop((states, slow, coming_and_going, _never_reads, ipc));
    site.end(chain, false);
    site.show(outcome);
}
