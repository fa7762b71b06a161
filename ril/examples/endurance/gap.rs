//! What a consumer of telemetry sees when the bridge is killed and its supervisor starts it again at once.

use std::fmt;
use std::os::fd::AsFd;
use std::sync::mpsc::{self, Receiver};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use dsp_sim::random::Random;
use ipc_types::payload::DspTelemetry;
use ipc_types::{Descriptor, Domain, Ipc, MonotonicNs, RobotId, Waiter};
use ril_tests::process::{Signal, WAIT_LIMIT};
use runtime::signal::{Termination, TerminationRequest};

use crate::crew::{Kind, Site, await_ready, end};
use crate::spread::Spread;

/// Samples that a bridge publishes before it is killed: it works.
const SAMPLES_BEFORE: usize = 5;

/// What to do.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// How often the bridge is killed.
    pub kills: u32,
    /// Period of telemetry, ms.
    pub period_ms: u16,
    /// Seed of the moments.
    pub seed: u64,
}

/// What came of it.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Period of telemetry, ms.
    pub period_ms: u16,
    /// Between the last sample of the old bridge and the first of the new one, at a consumer that was there all the time.
    pub gap: Spread,
    /// The part of it from the start of the new bridge.
    pub from_start: Spread,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "| {} ms | {} | {} |",
            self.period_ms, self.gap, self.from_start
        )
    }
}

/// A sample as a consumer got it.
struct Heard {
    epoch_ns: u64,
    at: MonotonicNs,
}

/// Restarts as planned, or until `goes_on` says no.
///
/// # Panics
///
/// When no telemetry comes any more, when a process does not start, or when something is left.
pub fn run(site: &Site, plan: &Plan, goes_on: &dyn Fn() -> bool) -> Outcome {
    // So fast that a frame is over long before the next one.
    site.write("dsp-sim.toml", "[serial]\nbaud_rate = 1000000\n");
    site.write(
        "bridge.toml",
        &format!(
            "[serial]\nbaud_rate = 1000000\n[parameters]\nstatus_period_ms = {}\n",
            plan.period_ms
        ),
    );
    let mut sim = site.start_one(Kind::Sim);
    await_ready(Kind::Sim, &mut sim);
    let consumer = Consumer::start(&site.domain);
    let mut bridge = site.start_one(Kind::Bridge);
    let mut chance = Random::new(plan.seed, 0);
    let period = Duration::from_millis(plan.period_ms.into());
    let mut outcome = Outcome {
        period_ms: plan.period_ms,
        ..Outcome::default()
    };
    while outcome.gap.count() < plan.kills as usize && goes_on() {
        let mut last = consumer.next();
        for _ in 0..SAMPLES_BEFORE {
            last = consumer.next();
        }
        // The moment between two samples is what is tried here, not something that is waited for.
        thread::sleep(period.mul_f64(chance.uniform()));
        bridge.signal(Signal::KILL);
        bridge.wait_status();
        let started = MonotonicNs::now();
        let killed = std::mem::replace(&mut bridge, site.start_one(Kind::Bridge));
        let first = loop {
            let heard = consumer.next();
            if heard.epoch_ns != last.epoch_ns {
                break heard;
            }
            last = heard;
        };
        outcome.gap.push(first.at.since(last.at));
        outcome.from_start.push(first.at.since(started));
        drop(killed);
    }
    consumer.end();
    end(bridge);
    end(sim);
    site.domain.assert_empty();
    outcome
}

/// A consumer on a thread of its own, which hands on when it got what.
struct Consumer {
    heard: Receiver<Heard>,
    request: TerminationRequest,
    thread: JoinHandle<()>,
}

impl Consumer {
    fn start(domain: &Domain) -> Consumer {
        let (sender, heard) = mpsc::channel();
        let (termination, request) = Termination::by_hand().expect("a socket");
        let domain = domain.clone();
        let thread = thread::spawn(move || {
            let ipc = Ipc::join(&domain, RobotId::DEFAULT, "consumer").expect("a part");
            let mut telemetry = ipc.subscriber::<DspTelemetry>().expect("a subscriber");
            let waiter = Waiter::new();
            while !termination.requested() {
                let mut ending = Descriptor::new(termination.as_fd());
                waiter
                    .wait(&mut [((), &mut telemetry), ((), &mut ending)], None)
                    .expect("a wait");
                // What cannot be received now can be by the next call, says the subscriber.
                let _ = telemetry.drain(|sample| {
                    let heard = Heard {
                        epoch_ns: sample.epoch_ns,
                        at: MonotonicNs::now(),
                    };
                    // At the end nobody listens any more.
                    let _ = sender.send(heard);
                });
            }
        });
        Consumer {
            heard,
            request,
            thread,
        }
    }

    fn next(&self) -> Heard {
        self.heard.recv_timeout(WAIT_LIMIT).expect("telemetry")
    }

    fn end(self) {
        self.request.request();
        self.thread.join().expect("it ends in order");
    }
}
