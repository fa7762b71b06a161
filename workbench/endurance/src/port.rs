//! The serial port goes and comes back, sometimes as another device under the same link: is there telemetry again?
//!
//! The DSP knows nothing of it: it runs on, here on a thread of this process, which notes when the port is back.

use std::io;
use std::sync::mpsc::{self, Sender};
use std::thread;
use std::time::Duration;

use dsp_sim::faults::{self, Fault, PortState, Script};
use dsp_sim::port::{Terminal, VirtualPort};
use dsp_sim::pty::PtyPort;
use dsp_sim::simulator::{Setup, Simulator};
use ipc_types::payload::DspTelemetry;
use ipc_types::{MonotonicNs, RobotId};
use runtime::notify::Notifier;
use runtime::signal::Termination;

use crate::listener::Listener;
use crate::plan::Kind;
use crate::site::{Site, count_lines};
use measure::{Outcome, Times};

/// When the port is hung up for the first time: the bridge has started by then.
const FIRST: Duration = Duration::from_secs(2);

/// How long the port is there at least, and how much longer at most.
const THERE: (Duration, Duration) = (Duration::from_millis(400), Duration::from_millis(300));

/// How long it is gone at least, and how much longer at most: through all of the pauses before it is opened again.
const GONE: (Duration, Duration) = (Duration::from_millis(1), Duration::from_millis(700));

/// Takes the port away as planned, half of the times to bring another device.
pub fn run(site: &Site) {
    let times = site.plan.count(200);
    let (sender, returns) = mpsc::channel();
    let mut port = NotedPort {
        port: PtyPort::new(&site.path("dsp-1")).expect("a pseudo-terminal under a link"),
        seen: PortState::default(),
        returns: sender,
    };
    let script = script(site, times);
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
    let (mut bridge, _) = site.start_working(Kind::Bridge);
    let received = |sample: &DspTelemetry| sample.received_ns;
    let telemetry = Listener::start(&site.domain, RobotId::DEFAULT, received);
    // From each moment that the port was back until a consumer had telemetry that came through it. A port that goes
    // again before anything came through it has come back when something does.
    let (mut again, mut open) = (Times::default(), Vec::<MonotonicNs>::new());
    while again.count() < times as usize && site.goes_on() {
        let heard = telemetry.next();
        open.extend(returns.try_iter());
        let through = open.extract_if(.., |back| heard.kept > back.0);
        again.extend(through.map(|back| heard.at.since(back)));
    }
    telemetry.end();
    let openings = count_lines(&mut bridge, "port open");
    site.end([bridge], false);
    request.request();
    line.join().expect("it ends in order");
    let mut outcome = Outcome::default();
    outcome.cell("port gone and back", again.count());
    outcome.cell("of them as another device", times / 2);
    outcome.cell("telemetry again", again);
    outcome.cell("openings", openings);
    site.show(outcome);
}

fn script(site: &Site, times: u32) -> Script {
    let mut chance = site.chance(0);
    let mut draw = |(least, more): (Duration, Duration)| least + more.mul_f64(chance.f64());
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
    let seed = site.plan.seed;
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
