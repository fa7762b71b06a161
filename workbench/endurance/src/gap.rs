//! What a consumer of telemetry sees when the bridge is killed and its supervisor starts it again at once.

use std::thread;
use std::time::Duration;

use dsp_sim::random::Random;
use ipc_types::MonotonicNs;
use ipc_types::payload::DspTelemetry;
use ril_tests::process::Signal;

use crate::listener::Listener;
use crate::outcome::{Outcome, Times};
use crate::plan::{Kind, Plan};
use crate::site::Site;

/// Samples that a bridge publishes before it is killed: it works.
const SAMPLES_BEFORE: usize = 5;

/// Restarts as planned, or until `goes_on` says no.
///
/// # Panics
///
/// When no telemetry comes any more, when a process does not start, or when something is left.
pub fn run(site: &Site, plan: &Plan, goes_on: &dyn Fn() -> bool) -> Outcome {
    let period_ms = plan.period_ms.unwrap_or(20);
    // So fast that a frame is over long before the next one.
    let serial = "[serial]\nbaud_rate = 1000000\n";
    let parameters = format!("[parameters]\nstatus_period_ms = {period_ms}\n");
    site.write("dsp-sim.toml", serial);
    site.write("bridge.toml", &format!("{serial}{parameters}"));
    let sim = site.start_working(Kind::Sim);
    let listener = Listener::start(&site.domain, |sample: &DspTelemetry| sample.epoch_ns);
    let mut bridge = site.start_one(Kind::Bridge);
    let mut chance = Random::new(plan.seed, 0);
    let period = Duration::from_millis(period_ms.into());
    let (mut gaps, mut from_start) = (Times::default(), Times::default());
    while gaps.count() < plan.count.unwrap_or(200) as usize && goes_on() {
        let mut last = listener.next();
        for _ in 0..SAMPLES_BEFORE {
            last = listener.next();
        }
        // The moment between two samples is what is tried here, not something that is waited for.
        thread::sleep(period.mul_f64(chance.uniform()));
        bridge.signal(Signal::KILL);
        bridge.wait_status();
        let started = MonotonicNs::now();
        let killed = std::mem::replace(&mut bridge, site.start_one(Kind::Bridge));
        let first = loop {
            let heard = listener.next();
            if heard.publisher_ns != last.publisher_ns {
                break heard;
            }
            last = heard;
        };
        gaps.push(first.at.since(last.at));
        from_start.push(first.at.since(started));
        drop(killed);
    }
    listener.end();
    site.end([sim, bridge], false);
    let mut outcome = Outcome::default();
    outcome.cell("period, ms", period_ms);
    outcome.cell("kills", gaps.count());
    outcome.cell("gap", gaps);
    outcome.cell("from the start of the new bridge", from_start);
    outcome
}
