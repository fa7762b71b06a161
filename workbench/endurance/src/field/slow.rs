//! A slow link: how old samples are when they come, by priority.

use std::time::{Duration, Instant};

use ipc_types::payload::{DspTelemetry, HeroTelemetry, RelayLink};
use ipc_types::{MonotonicNs, Topic};
use ril_tests::sandbox::TopicWatch;

use super::air::Weather;
use super::site::{Plan, Site};
use crate::outcome::{Outcome, Times};

/// Priorities of both topics of telemetry, of which each has 50 samples a second.
pub const RELAY_TOML: &str = "[topics]\nrules = [{ key = \"hero_telemetry\", priority = \"high\" }, { key = \"dsp_telemetry\", priority = \"low\" }]\n";

/// How long what was under way in fine weather is not counted.
const START_UP: Duration = Duration::from_secs(3);

/// How often the observer looks.
const LOOK_PERIOD: Duration = Duration::from_millis(10);

/// Takes what has come, and notes how old it is if that counts.
fn take<T: Topic>(
    topic: &mut TopicWatch<T>,
    received_ns: impl Fn(&T) -> u64,
    ages: &mut Times,
    counts: bool,
) {
    let now = MonotonicNs::now();
    // What cannot be received now can be by the next call, says the subscriber.
    let _ = topic.port.drain(|sample| {
        if counts {
            ages.push(now.since(MonotonicNs(received_ns(sample))));
        }
    });
}

/// Watches for `duration` a link of this speed, in which so many packets may wait.
///
/// # Errors
///
/// Why this machine cannot do it.
pub fn run(
    plan: &Plan,
    rate_bps: u64,
    packets: usize,
    duration: Duration,
) -> Result<Outcome, String> {
    let mut site = Site::start(plan)?;
    let station = &site.rig.station;
    let mut hero = station.subscribe::<HeroTelemetry>(1);
    let mut dsp = station.subscribe::<DspTelemetry>(1);
    site.air.set(Weather {
        rate_bps: Some(rate_bps),
        packets,
        ..Weather::loss(plan.loss)
    });
    let begin = MonotonicNs::now() + START_UP;
    let (mut high, mut low) = (Times::default(), Times::default());
    while MonotonicNs::now() < begin + duration {
        hero.port.wait(LOOK_PERIOD).expect("a wait");
        let counts = MonotonicNs::now() >= begin;
        take(&mut hero, |sample| sample.received_ns, &mut high, counts);
        take(&mut dsp, |sample| sample.received_ns, &mut low, counts);
    }
    // A verb on the same link.
    let asked = Instant::now();
    let verb = station.run("start");
    let verb_ms = asked.elapsed().as_millis();
    let link = station.subscribe::<RelayLink>(1).next_sample();
    site.end();
    let mut outcome = Outcome::default();
    outcome.cell("link, kbit/s", rate_bps / 1000);
    outcome.cell("queue, packets", packets);
    outcome.cell("age when they come, high priority", high);
    outcome.cell("low priority", low);
    outcome.cell("samples lost on the air", link.samples_lost_on_air);
    let round_trip_ms = format!("{:.0}", link.round_trip_s * 1e3);
    outcome.cell("round trip, ms", round_trip_ms);
    outcome.cell("outages", link.outages);
    outcome.cell("a verb, ms", format!("{verb_ms} ({:?})", verb.code()));
    Ok(outcome)
}
