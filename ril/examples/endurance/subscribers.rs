//! Subscribers that never read, read late, are stopped, come and go, and are killed: does the bridge lose a byte, or a
//! healthy consumer a sample?
//!
//! Both ends speak the extended profile, whose numbers and CRC show every byte that is missing.

use std::fmt;
use std::thread;
use std::time::Duration;

use dsp_sim::random::Random;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState, RefusedCounters};
use ipc_types::{Ipc, Losses, MonotonicNs, Subscriber};
use ril_tests::Process;
use ril_tests::process::{Signal, WAIT_LIMIT};

use crate::crew::{Kind, Site, await_ready, end};
use crate::healthy::Healthy;

/// Longest pause between two disturbances.
const PAUSE: Duration = Duration::from_millis(30);

/// Disturbances between two readings of the slow subscriber: so many samples come meanwhile that its buffer overflows.
const SLOWNESS: u64 = 40;

/// What to do.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// How long the disturbances last.
    pub duration: Duration,
    /// Period of telemetry, ms.
    pub period_ms: u16,
    /// Seed of what happens when.
    pub seed: u64,
}

/// What came of it.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// Period of telemetry, ms.
    pub period_ms: u16,
    /// How long it was.
    pub duration: Duration,
    /// What the bridge received.
    pub bytes: u64,
    /// What it refused of it.
    pub refused: RefusedCounters,
    /// What the healthy consumers of the bridge and of status got and missed.
    pub healthy: [Losses; 2],
    /// What was done to them.
    pub disturbances: Disturbances,
}

/// What the disturbing subscribers did and suffered.
#[derive(Clone, Copy, Debug, Default)]
pub struct Disturbances {
    /// What the slow one got and missed.
    pub slow: Losses,
    /// How often a subscriber came and went within a process.
    pub churned: u64,
    /// How often a process that subscribed was killed.
    pub killed: u64,
    /// How often a process that subscribed was stopped.
    pub stopped: u64,
}

impl Outcome {
    /// Bytes, or messages, that did not arrive as they were sent.
    pub fn damaged(&self) -> u32 {
        let refused = &self.refused;
        let bytes = refused.stray + refused.unknown_header + refused.truncated + refused.checksum;
        bytes + refused.padding + refused.value + refused.missed_messages
    }

    /// Samples that healthy consumers missed.
    pub fn lost(&self) -> u64 {
        self.healthy.iter().map(|losses| losses.lost).sum()
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [raw, hero] = self.healthy;
        let done = self.disturbances;
        write!(
            f,
            "| {} ms, {:.0} s | {} bytes, {} damaged or missed | {} + {} samples, {} lost | \
             {} came and went, {} killed, {} stops; the slow one got {} and lost {} |",
            self.period_ms,
            self.duration.as_secs_f64(),
            self.bytes,
            self.damaged(),
            raw.received,
            hero.received,
            self.lost(),
            done.churned,
            done.killed,
            done.stopped,
            done.slow.received,
            done.slow.lost
        )
    }
}

/// Disturbs as planned, or until `goes_on` says no.
///
/// # Panics
///
/// When a process ends or does not start, or when something is left.
pub fn run(site: &Site, plan: &Plan, goes_on: &dyn Fn() -> bool) -> Outcome {
    let line = "[serial]\nbaud_rate = 4000000\nprofile = \"extended\"\n";
    site.write("dsp-sim.toml", line);
    let (profile, period_ms) = ("profile = \"extended\"", plan.period_ms);
    let text = format!(
        "[serial]\nbaud_rate = 4000000\n[link]\n{profile}\n[parameters]\nstatus_period_ms = {period_ms}\n"
    );
    site.write("bridge.toml", &text);
    let mut crew = Vec::new();
    for kind in [Kind::Sim, Kind::Bridge, Kind::Status] {
        let mut process = site.start_one(kind);
        await_ready(kind, &mut process);
        crew.push(process);
    }
    let raw = Healthy::start::<DspTelemetry>(&site.domain);
    let hero = Healthy::start::<HeroTelemetry>(&site.domain);
    let mut crowd = Crowd::new(site, plan.seed);
    let begun = MonotonicNs::now();
    while MonotonicNs::now().since(begun) < plan.duration && goes_on() {
        crowd.disturb();
    }
    let duration = MonotonicNs::now().since(begun);
    let disturbances = crowd.end();
    let state = last_state(site);
    let outcome = Outcome {
        period_ms,
        duration,
        bytes: state.link.bytes_received,
        refused: state.refused,
        healthy: [raw.end().losses, hero.end().losses],
        disturbances,
    };
    crew.into_iter().rev().for_each(end);
    site.domain.assert_empty();
    outcome
}

/// The next state that the bridge publishes.
fn last_state(site: &Site) -> ModuleState {
    let ipc = site.domain.join("observer");
    let mut states = ipc.subscriber::<ModuleState>().expect("a subscriber");
    let asked = MonotonicNs::now();
    loop {
        states.wait(WAIT_LIMIT).expect("a wait");
        let state = states.latest().expect("states");
        if let Some(state) = state.filter(|state| state.published_ns > asked.0) {
            return state;
        }
        let silence = MonotonicNs::now().since(asked);
        assert!(silence < WAIT_LIMIT, "no state for {silence:?}");
    }
}

/// Subscribers of both topics.
type Pair = (Subscriber<DspTelemetry>, Subscriber<HeroTelemetry>);

/// Those that disturb.
struct Crowd<'a> {
    site: &'a Site,
    chance: Random,
    ipc: Ipc,
    /// Never reads.
    _stuck: Pair,
    /// Reads late.
    slow: Pair,
    /// Comes and goes.
    churning: Option<Pair>,
    /// Is stopped, and sometimes goes on.
    stopped: Process,
    is_stopped: bool,
    /// Is killed, and another comes.
    killed: Process,
    steps: u64,
    done: Disturbances,
}

impl<'a> Crowd<'a> {
    fn new(site: &'a Site, seed: u64) -> Crowd<'a> {
        let ipc = site.domain.join("crowd");
        let mut stopped = consumer(site);
        stopped.wait_for_text("sequence");
        Crowd {
            site,
            chance: Random::new(seed, 0),
            _stuck: pair(&ipc),
            slow: pair(&ipc),
            churning: None,
            stopped,
            is_stopped: false,
            killed: consumer(site),
            steps: 0,
            done: Disturbances::default(),
            ipc,
        }
    }

    /// One thing at a random moment.
    fn disturb(&mut self) {
        // The moment is what is tried here, not something that is waited for.
        thread::sleep(PAUSE.mul_f64(self.chance.uniform()));
        self.steps += 1;
        if self.steps.is_multiple_of(SLOWNESS) {
            // What cannot be received is lost, as what came too early.
            let _ = self.slow.0.drain(|_| {});
            let _ = self.slow.1.drain(|_| {});
        }
        match self.chance.next_u64() % 8 {
            0 => {
                let (signal, is_stopped) = match self.is_stopped {
                    true => (Signal::CONT, false),
                    false => (Signal::STOP, true),
                };
                self.stopped.signal(signal);
                self.is_stopped = is_stopped;
                self.done.stopped += u64::from(is_stopped);
            }
            1..4 => {
                self.killed.signal(Signal::KILL);
                self.killed.wait_exit();
                self.killed = consumer(self.site);
                self.done.killed += 1;
            }
            _ => match self.churning.take() {
                Some(_) => self.done.churned += 1,
                None => self.churning = Some(pair(&self.ipc)),
            },
        }
    }

    fn end(mut self) -> Disturbances {
        let _ = self.slow.0.drain(|_| {});
        let _ = self.slow.1.drain(|_| {});
        let (raw, hero) = (self.slow.0.losses(), self.slow.1.losses());
        self.done.slow = Losses {
            received: raw.received + hero.received,
            lost: raw.lost + hero.lost,
            ..raw
        };
        self.stopped.signal(Signal::CONT);
        end(self.stopped);
        self.killed.signal(Signal::KILL);
        self.killed.wait_exit();
        self.done
    }
}

fn pair(ipc: &Ipc) -> Pair {
    let raw = ipc.subscriber().expect("a subscriber");
    let hero = ipc.subscriber().expect("a subscriber");
    (raw, hero)
}

/// A consumer in a process of its own.
fn consumer(site: &Site) -> Process {
    site.start("echo dsp --json --field sequence --timeout 80s")
}
