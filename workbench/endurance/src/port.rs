//! The serial port goes and comes back, sometimes as another device under the same link: is there telemetry again?
//!
//! The DSP knows nothing of it: it runs on, here on a thread of this process, which notes when the port is back.

use std::io;
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread;
use std::time::Duration;

use dsp_sim::faults::{self, Fault, PortState, Script};
use dsp_sim::port::{Terminal, VirtualPort};
use dsp_sim::pty::PtyPort;
use dsp_sim::random::Random;
use dsp_sim::simulator::{Setup, Simulator};
use ipc_types::MonotonicNs;
use ipc_types::payload::DspTelemetry;
use ril_tests::process::WAIT_LIMIT;
use runtime::notify::Notifier;
use runtime::signal::Termination;

use crate::outcome::{Outcome, Times};
use crate::plan::{Kind, Plan};
use crate::site::{Site, count_lines};

/// When the port is hung up for the first time: the bridge has started by then.
const FIRST: Duration = Duration::from_secs(2);

/// How long the port is there at least, and how much longer at most.
const THERE: (Duration, Duration) = (Duration::from_millis(400), Duration::from_millis(300));

/// How long it is gone at least, and how much longer at most: through all of the pauses before it is opened again.
const GONE: (Duration, Duration) = (Duration::from_millis(1), Duration::from_millis(700));

/// Takes the port away as planned, or until `goes_on` says no.
///
/// # Panics
///
/// When the bridge ends, when no telemetry comes any more, or when something is left.
pub fn run(site: &Site, plan: &Plan, goes_on: &dyn Fn() -> bool) -> Outcome {
    let times = plan.count.unwrap_or(200);
    let script = script(times, plan.seed);
    let is_elsewhere =
        |fault: &&Fault| matches!(fault, Fault::HangUp { elsewhere, .. } if *elsewhere);
    let elsewhere = script.faults.iter().filter(is_elsewhere).count();
    let (sender, returns) = mpsc::channel();
    let mut port = NotedPort {
        port: PtyPort::new(&site.path("dsp-1")).expect("a pseudo-terminal under a link"),
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
    let mut bridge = site.start_working(Kind::Bridge);
    let again = listen(site, times, &returns, goes_on);
    let openings = count_lines(&mut bridge, "port open");
    site.end([bridge], false);
    request.request();
    line.join().expect("it ends in order");
    let mut outcome = Outcome::default();
    outcome.cell("port gone and back", again.count());
    outcome.cell("of them as another device", elsewhere);
    outcome.cell("telemetry again", again);
    outcome.cell("openings", openings);
    outcome
}

/// Receives telemetry until the port has come back as often as planned, and then once more. From each moment that the port was back
/// until a consumer had telemetry that came through it.
fn listen(
    site: &Site,
    times: u32,
    returns: &Receiver<MonotonicNs>,
    goes_on: &dyn Fn() -> bool,
) -> Times {
    let ipc = site.domain.join("consumer");
    let mut telemetry = ipc.subscriber::<DspTelemetry>().expect("a subscriber");
    let mut again = Times::default();
    // A port that goes again before anything came through it has come back when something does.
    let mut open = Vec::new();
    let mut silent_since = MonotonicNs::now();
    while again.count() < times as usize && goes_on() {
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
                    again.push(silent_since.since(*back));
                }
                !is_new
            });
        });
    }
    again
}

fn script(times: u32, seed: u64) -> Script {
    let mut chance = Random::new(seed, 0);
    let mut draw = |(least, more): (Duration, Duration)| least + more.mul_f64(chance.uniform());
    let mut at = FIRST;
    let mut faults = Vec::new();
    for index in 0..times {
        let length = draw(GONE);
        faults.push(Fault::HangUp {
            times: faults::Times::once(at),
            length,
            elsewhere: index % 2 == 1,
        });
        at += length + draw(THERE);
    }
    Script { seed, faults }
}

/// The simulator's port, and a note of when it came back.
struct NotedPort {
    port: PtyPort,
    seen: PortState,
    returns: Sender<MonotonicNs>,
}

impl VirtualPort for NotedPort {
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
