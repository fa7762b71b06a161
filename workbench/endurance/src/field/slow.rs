//! A slow link: how old samples are when they come, by priority.

use std::time::Duration;

use ipc_types::payload::{DspTelemetry, HeroTelemetry, RelayLink};
use ipc_types::{MonotonicNs, Topic};

use crate::air::Weather;
use crate::machine::Listener;
use crate::site::{Plan, Site};

/// Priorities of both topics of telemetry, of which each has 50 samples a second.
pub const RELAY_TOML: &str = "[topics]\nrules = [{ key = \"hero_telemetry\", priority = \"high\" }, { key = \"dsp_telemetry\", priority = \"low\" }]\n";

/// How long what was under way in fine weather is not counted.
const SETTLE: Duration = Duration::from_secs(3);

/// How often the observer looks.
const LOOK_PERIOD: Duration = Duration::from_millis(10);

/// Ages of a topic's samples.
#[derive(Default)]
struct Ages(Vec<Duration>);

impl Ages {
    fn note<T: Topic>(
        &mut self,
        listener: &mut Listener<T>,
        received_ns: impl Fn(&T) -> u64,
        counts: bool,
    ) {
        let now = MonotonicNs::now();
        // What cannot be received now can be by the next call, says the subscriber.
        let _ = listener.port.drain(|sample| {
            if counts {
                self.0.push(now.since(MonotonicNs(received_ns(sample))));
            }
        });
    }

    /// Median and worst, ms, and how many.
    fn text(&self) -> String {
        let mut sorted = self.0.clone();
        sorted.sort();
        let ms = |index: usize| sorted.get(index).copied().unwrap_or_default().as_secs_f64() * 1e3;
        let last = sorted.len().saturating_sub(1);
        format!(
            "{} samples, {:.0} / {:.0} / {:.0} ms",
            sorted.len(),
            ms(last / 2),
            ms(last * 99 / 100),
            ms(last)
        )
    }
}

/// What came of it.
pub struct Outcome {
    rate_bps: u64,
    duration: Duration,
    high: Ages,
    low: Ages,
    link: RelayLink,
    packets: usize,
    verb_ms: f64,
    verb_code: Option<i32>,
}

impl std::fmt::Display for Outcome {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "link of {} kbit/s with a queue of {} packets, {:?}; age when they come, median / 99 % / worst | high priority: {}; low priority: {}; {} samples lost on the \
             air; round trip {:.0} ms, outages {}; a verb took {:.0} ms (exit code {})",
            self.rate_bps / 1000,
            self.packets,
            self.duration,
            self.high.text(),
            self.low.text(),
            self.link.samples_lost_on_air,
            self.link.round_trip_s * 1e3,
            self.link.outages,
            self.verb_ms,
            self.verb_code.unwrap_or(-1),
        )
    }
}

/// Watches for `duration`.
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
    let mut hero = site.station.subscribe::<HeroTelemetry>(1);
    let mut dsp = site.station.subscribe::<DspTelemetry>(1);
    site.air.set(Weather {
        rate_bps: Some(rate_bps),
        packets,
        ..Weather::default()
    });
    let begin = MonotonicNs::now() + SETTLE;
    let end = begin + duration;
    let (mut high, mut low) = (Ages::default(), Ages::default());
    let mut watch_until = |end: MonotonicNs| {
        while MonotonicNs::now() < end {
            hero.port.wait(LOOK_PERIOD).expect("a wait");
            let counts = MonotonicNs::now() >= begin;
            high.note(&mut hero, |sample| sample.received_ns, counts);
            low.note(&mut dsp, |sample| sample.received_ns, counts);
        }
    };
    watch_until(end);
    // A verb on the same link.
    let asked = MonotonicNs::now();
    let verb = site.station.start("start").wait_exit();
    let verb_ms = MonotonicNs::now().since(asked).as_secs_f64() * 1e3;
    let link = site.station.subscribe::<RelayLink>(1).next();
    site.end();
    Ok(Outcome {
        rate_bps,
        duration,
        high,
        low,
        packets,
        link,
        verb_ms,
        verb_code: verb.code(),
    })
}
