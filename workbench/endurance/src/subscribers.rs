//! Subscribers that never read, read late, are stopped, come and go, and are killed: does the bridge lose a byte, or a
//! healthy consumer a sample?
//!
//! Both ends speak the extended profile, whose numbers and CRC show every byte that is missing.

use std::thread;
use std::time::Duration;

use dsp_sim::random::Random;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use ipc_types::{Ipc, Losses, MonotonicNs, Subscriber};
use ril_tests::Process;
use ril_tests::process::{Signal, WAIT_LIMIT};

use crate::listener::Listener;
use crate::outcome::Outcome;
use crate::plan::{Kind, Plan};
use crate::site::{ECHO_DSP, Site};

/// Longest pause between two disturbances.
const PAUSE: Duration = Duration::from_millis(30);

/// Disturbances between two readings of the slow subscriber: so many samples come meanwhile that its buffer overflows.
const SLOWNESS: u64 = 40;

/// Disturbs as planned, or until `goes_on` says no.
///
/// # Panics
///
/// When a process ends or does not start, or when something is left.
pub fn run(site: &Site, plan: &Plan, goes_on: &dyn Fn() -> bool) -> Outcome {
    let period_ms = plan.period_ms.unwrap_or(2);
    let serial = "[serial]\nbaud_rate = 4000000\n";
    site.write("dsp-sim.toml", &format!("{serial}profile = \"extended\"\n"));
    let link = "[link]\nprofile = \"extended\"\n";
    let parameters = format!("[parameters]\nstatus_period_ms = {period_ms}\n");
    site.write("bridge.toml", &format!("{serial}{link}{parameters}"));
    let chain = [Kind::Sim, Kind::Bridge, Kind::Status].map(|kind| site.start_working(kind));
    let healthy = [
        Listener::start(&site.domain, |sample: &DspTelemetry| sample.epoch_ns),
        Listener::start(&site.domain, |sample: &HeroTelemetry| sample.epoch_ns),
    ];
    let mut crowd = Crowd::new(site, plan.seed);
    let begun = MonotonicNs::now();
    let duration = plan.duration(120);
    while MonotonicNs::now().since(begun) < duration && goes_on() {
        crowd.disturb();
    }
    let lasted_s = MonotonicNs::now().since(begun).as_secs_f64();
    let done = crowd.end();
    let state = last_state(site);
    let mut outcome = Outcome::default();
    outcome.cell("telemetry", format!("{period_ms} ms, {lasted_s:.0} s"));
    // Bytes, or messages, that did not arrive as they were sent.
    let refused = &state.refused;
    let bytes = refused.stray + refused.unknown_header + refused.truncated + refused.checksum;
    let damaged = bytes + refused.padding + refused.value + refused.missed_messages;
    outcome.cell("bytes", state.link.bytes_received);
    outcome.cell("damaged or missed", damaged);
    outcome.require(damaged == 0, format!("damaged: {refused:?}"));
    for (name, listener) in ["samples of the bridge", "of status"]
        .into_iter()
        .zip(healthy)
    {
        let losses = listener.end().losses;
        outcome.cell(name, format!("{}, {} lost", losses.received, losses.lost));
        let is_whole = losses.lost == 0 && losses.received > 0;
        outcome.require(is_whole, format!("{name}: {losses:?}"));
    }
    outcome.cell("came and went", done.churned);
    outcome.cell("killed", done.killed);
    let slow = done.slow;
    outcome.cell(
        "the others",
        format!(
            "{} stops; the slow one got {} and lost {}",
            done.stopped, slow.received, slow.lost
        ),
    );
    site.end(chain, false);
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

/// What the disturbing subscribers did and lost.
#[derive(Clone, Copy, Debug, Default)]
struct Disturbances {
    /// What the slow one got and missed.
    slow: Losses,
    /// How often a subscriber came and went within a process.
    churned: u64,
    /// How often a process that subscribed was killed.
    killed: u64,
    /// How often a process that subscribed was stopped.
    stopped: u64,
}

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
        let mut stopped = site.start(ECHO_DSP);
        stopped.wait_for_text("sequence");
        Crowd {
            site,
            chance: Random::new(seed, 0),
            _stuck: pair(&ipc),
            slow: pair(&ipc),
            churning: None,
            stopped,
            is_stopped: false,
            killed: site.start(ECHO_DSP),
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
                self.killed = self.site.start(ECHO_DSP);
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
        self.stopped.end();
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
