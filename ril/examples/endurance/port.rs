//! The serial port goes and comes back, sometimes as another device under the same link: is there telemetry again?
//!
//! The DSP knows nothing of it: it runs on, here on a thread of this process, which notes when the port is back.

use std::fmt;
use std::io;
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread;
use std::time::Duration;

use dsp_sim::faults::{Fault, PortState, Script, Times};
use dsp_sim::port::{Port, Terminal};
use dsp_sim::pty_port::PtyPort;
use dsp_sim::random::Random;
use dsp_sim::simulator::{Setup, Simulator};
use ipc_types::MonotonicNs;
use ipc_types::payload::DspTelemetry;
use ril_tests::process::WAIT_LIMIT;
use runtime::notify::Notifier;
use runtime::signal::Termination;

use crate::crew::{Kind, Site, end};
use crate::spread::Spread;

/// When the port is hung up for the first time: the bridge has started by then.
const FIRST: Duration = Duration::from_secs(2);

/// How long the port is there at least, and how much longer at most.
const THERE: (Duration, Duration) = (Duration::from_millis(400), Duration::from_millis(300));

/// How long it is gone at least, and how much longer at most: through all of the pauses before it is opened again.
const GONE: (Duration, Duration) = (Duration::from_millis(1), Duration::from_millis(700));

/// What to do.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// How often the port goes.
    pub times: u32,
    /// Seed of the moments.
    pub seed: u64,
}

/// What came of it.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// How often it came back as another device.
    pub elsewhere: u32,
    /// From the moment the port was back until a consumer had telemetry that came through it.
    pub again: Spread,
    /// How often the bridge opened it.
    pub openings: usize,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (times, elsewhere, openings) = (self.again.count(), self.elsewhere, self.openings);
        write!(
            f,
            "| {times}, {elsewhere} of them as another device | {} | {openings} |",
            self.again
        )
    }
}

/// Takes the port away as planned. The first line that is not `goes_on` ends it early.
///
/// # Panics
///
/// When the bridge ends, when no telemetry comes any more, or when something is left.
pub fn run(site: &Site, plan: &Plan, goes_on: &dyn Fn() -> bool) -> Outcome {
    let mut chance = Random::new(plan.seed, 0);
    let script = script(plan, &mut chance);
    let is_elsewhere =
        |fault: &&Fault| matches!(fault, Fault::HangUp { elsewhere, .. } if *elsewhere);
    let elsewhere = script.faults.iter().filter(is_elsewhere).count() as u32;
    let (sender, returns) = mpsc::channel();
    let mut port = NotedPort {
        port: PtyPort::new(&site.path("dsp")).expect("a pseudo-terminal under a link"),
        seen: PortState::default(),
        returns: sender,
    };
    let (termination, request) = Termination::by_hand().expect("a socket");
    let line = thread::spawn(move || {
        let mut simulator = Simulator::new(Setup {
            faults: Some(script),
            ..Setup::default()
        });
        let supervisor = Notifier::from_env();
        dsp_sim::shell::run(&mut simulator, &mut port, 1.0, &termination, &supervisor)
            .expect("the simulator's loop");
    });
    let mut bridge = site.start_one(Kind::Bridge);
    bridge.wait_for_text("ready");
    let mut outcome = listen(site, plan, &returns, goes_on);
    outcome.elsewhere = elsewhere;
    let is_opening = |line: &&ril_tests::process::Line| line.text.contains("port open");
    outcome.openings = bridge.lines().iter().filter(is_opening).count();
    end(bridge);
    request.request();
    line.join().expect("it ends in order");
    site.domain.assert_empty();
    outcome
}

/// Hears telemetry until the port has come back as often as planned, and then once more.
fn listen(
    site: &Site,
    plan: &Plan,
    returns: &Receiver<MonotonicNs>,
    goes_on: &dyn Fn() -> bool,
) -> Outcome {
    let ipc = site.domain.join("consumer");
    let mut telemetry = ipc.subscriber::<DspTelemetry>().expect("a subscriber");
    let mut outcome = Outcome::default();
    // A port that goes again before anything was heard is heard when something is.
    let mut open = Vec::new();
    let mut silent_since = MonotonicNs::now();
    while outcome.again.count() < plan.times as usize && goes_on() {
        let silence = MonotonicNs::now().since(silent_since);
        assert!(silence < WAIT_LIMIT, "no telemetry for {silence:?}");
        telemetry.wait(WAIT_LIMIT).expect("a wait");
        // What cannot be received now can be by the next call, says the subscriber.
        let _ = telemetry.drain(|sample| {
            silent_since = MonotonicNs::now();
            open.extend(returns.try_iter());
            open.retain(|back: &MonotonicNs| {
                let is_new = sample.received_ns > back.0;
                if is_new {
                    outcome.again.push(silent_since.since(*back));
                }
                !is_new
            });
        });
    }
    outcome
}

fn script(plan: &Plan, chance: &mut Random) -> Script {
    let mut draw = |(least, more): (Duration, Duration)| least + more.mul_f64(chance.uniform());
    let mut at = FIRST;
    let mut faults = Vec::new();
    for index in 0..plan.times {
        let length = draw(GONE);
        faults.push(Fault::HangUp {
            times: Times::once(at),
            length,
            elsewhere: index % 2 == 1,
        });
        at += length + draw(THERE);
    }
    Script {
        seed: plan.seed,
        faults,
    }
}

/// The simulator's port, and a note of when it came back.
struct NotedPort {
    port: PtyPort,
    seen: PortState,
    returns: Sender<MonotonicNs>,
}

impl Port for NotedPort {
    fn follow(&mut self, state: PortState) -> io::Result<()> {
        self.port.follow(state)?;
        if state != self.seen && !state.is_gone {
            // Who has heard enough does not listen any more.
            let _ = self.returns.send(MonotonicNs::now());
        }
        self.seen = state;
        Ok(())
    }

    fn terminal(&mut self) -> Option<&mut dyn Terminal> {
        self.port.terminal()
    }
}
