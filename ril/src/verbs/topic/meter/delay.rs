//! [`DelayMeter`], for `ril delay`: how old samples are when they come to this consumer.
//!
//! Three ages, as far as a sample has the times for them. The first two compare host times, which all processes of a
//! machine share. The DSP's clock began at its boot and cannot be compared with the host's; but the quickest samples
//! show how the two stand to each other, and how much later than those a sample came can be said: what the line, the
//! DSP's own queue and this machine added.

use std::fmt;
use std::time::Duration;

use ipc_types::{Losses, MonotonicNs};
use serde::Serialize;

use super::histogram::{Histogram, Summary, Unit};
use super::{Counts, Detail, Meter, Of, Report, rounded};
use crate::render::stamps::{DspClock, Stamps};

/// Name of the JSON object's layout.
pub const SCHEMA: &str = "ril.Delay.v2";

/// For how long the DSP's clock is compared with the quickest sample. Two quartzes drift apart by up to 1 ms in this time,
/// which is the step of the DSP's clock; a longer time would show the drift and not the delay.
const WINDOW: Duration = Duration::from_secs(10);

/// Most samples that are compared: 400 a second in the time of the window. When more come the window ends earlier.
const MAX_WINDOW_SAMPLES: usize = 4096;

/// See the module's documentation.
#[derive(Clone, Debug)]
pub struct DelayMeter {
    first: Option<MonotonicNs>,
    last: MonotonicNs,
    samples: u64,
    since_received: Histogram,
    since_published: Histogram,
    window: Window,
    behind_quickest: Histogram,
}

/// The samples that are being compared by the DSP's clock.
#[derive(Clone, Debug)]
struct Window {
    began: MonotonicNs,
    clock: Option<DspClock>,
    /// Of each sample, when it came minus what the DSP's clock said: the same for all that took the same time.
    offsets_ns: Vec<i128>,
}

/// What `ril delay` says.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DelayReport {
    /// Whose samples, how many, how many were lost.
    #[serde(flatten)]
    pub counts: Counts,
    /// From the last byte that the bridge read to this consumer; `None` for the module's state.
    pub since_received_ms: Option<Summary>,
    /// From the publisher to this consumer; `None` for raw telemetry, which the bridge publishes as it reads it.
    pub since_published_ms: Option<Summary>,
    /// By the DSP's clock, how much later than the quickest sample of the same ten seconds; `None` without that clock.
    pub behind_quickest_ms: Option<Summary>,
    /// Whether the samples come from another machine, so that the first two ages are as true as the comparison of clocks.
    pub relayed: bool,
    /// How far the first two ages may then be from the truth, to either side; `None` if that is not known, and when the
    /// samples are of this machine.
    pub age_uncertainty_ms: Option<f64>,
}

impl Window {
    /// Whether a sample that came at `now` with `clock` has to be compared with others.
    fn is_over(&self, clock: DspClock, now: MonotonicNs) -> bool {
        self.offsets_ns.len() == MAX_WINDOW_SAMPLES
            || now.since(self.began) >= WINDOW
            || self.clock.is_some_and(|last| {
                clock.boots != last.boots || clock.since_boot_ns < last.since_boot_ns
            })
    }

    /// Adds each sample's lag behind the quickest to `histogram`.
    fn compare(&self, histogram: &mut Histogram) {
        let Some(quickest) = self.offsets_ns.iter().min() else {
            return;
        };
        for offset in &self.offsets_ns {
            histogram.record(u64::try_from(offset - quickest).unwrap_or(u64::MAX));
        }
    }
}

impl DelayMeter {
    fn take_clock(&mut self, clock: DspClock, now: MonotonicNs) {
        if self.window.offsets_ns.is_empty() {
            self.window.began = now;
        } else if self.window.is_over(clock, now) {
            self.window.compare(&mut self.behind_quickest);
            self.window.offsets_ns.clear();
            self.window.began = now;
        }
        self.window.clock = Some(clock);
        let offset_ns = i128::from(now.0) - i128::from(clock.since_boot_ns);
        self.window.offsets_ns.push(offset_ns);
    }
}

impl Meter for DelayMeter {
    type Report = DelayReport;
    const SHOWS_AGES: bool = true;

    fn begin(_: usize) -> DelayMeter {
        DelayMeter {
            first: None,
            last: MonotonicNs(0),
            samples: 0,
            since_received: Histogram::new(Unit::Milliseconds),
            since_published: Histogram::new(Unit::Milliseconds),
            window: Window {
                began: MonotonicNs(0),
                clock: None,
                offsets_ns: Vec::with_capacity(MAX_WINDOW_SAMPLES),
            },
            behind_quickest: Histogram::new(Unit::Milliseconds),
        }
    }

    fn take(&mut self, stamps: &Stamps, now: MonotonicNs) {
        self.first.get_or_insert(now);
        self.last = now;
        self.samples += 1;
        for (time, histogram) in [
            (stamps.received, &mut self.since_received),
            (stamps.published, &mut self.since_published),
        ] {
            if let Some(time) = time {
                histogram.record(now.0.saturating_sub(time.0));
            }
        }
        if let Some(clock) = stamps.dsp {
            self.take_clock(clock, now);
        }
    }

    fn report(&self, of: Of, losses: Losses) -> DelayReport {
        let seconds = self
            .first
            .map_or(0.0, |first| self.last.since(first).as_secs_f64());
        let mut behind_quickest = self.behind_quickest.clone();
        self.window.compare(&mut behind_quickest);
        DelayReport {
            counts: Counts::new(SCHEMA, of, self.samples, seconds, losses),
            since_received_ms: self.since_received.summary(),
            since_published_ms: self.since_published.summary(),
            behind_quickest_ms: behind_quickest.summary(),
            relayed: of.relayed.is_some(),
            age_uncertainty_ms: of
                .relayed
                .and_then(|times| times.uncertainty_s)
                .map(|seconds| rounded(seconds * 1e3, 6)),
        }
    }
}

impl Report for DelayReport {
    fn write(&self, detail: Detail, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.counts)?;
        match self.age_uncertainty_ms {
            Some(ms) => writeln!(
                f,
                "relayed from another machine: ages are true within ±{ms:.3} ms"
            )?,
            None if self.relayed => {
                writeln!(
                    f,
                    "relayed from another machine: how true the ages are is not known"
                )?;
            }
            None => {}
        }
        for (summary, title) in [
            (&self.since_received_ms, "bridge's last byte to here"),
            (&self.since_published_ms, "publisher to here"),
            (
                &self.behind_quickest_ms,
                "DSP's clock to here, behind the quickest",
            ),
        ] {
            if let Some(summary) = summary {
                summary.write(title, detail, f)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::RelayedTimes;
    use super::super::rate::tests::{OF, at, sample};
    use super::*;

    /// A sample of the DSP's time `dsp_ms` after the boot number `boots`.
    fn timed(boots: u32, dsp_ms: u64) -> Stamps {
        Stamps {
            dsp: Some(DspClock {
                since_boot_ns: dsp_ms * 1_000_000,
                boots,
            }),
            ..sample(1, 1, 0)
        }
    }

    fn measure(samples: impl IntoIterator<Item = (Stamps, u64)>) -> DelayReport {
        let mut meter = DelayMeter::begin(0);
        for (stamps, came_ms) in samples {
            meter.take(&stamps, at(came_ms));
        }
        assert!(meter.window.offsets_ns.capacity() <= MAX_WINDOW_SAMPLES);
        meter.report(OF, Losses::default())
    }

    /// Whether `value` is right within the thousandth that a histogram keeps.
    fn about(value: f64, expected: f64) -> bool {
        (value - expected).abs() <= expected * 1e-3
    }

    #[test]
    fn each_age_is_from_its_own_time_and_missing_ones_are_nothing() {
        let both = Stamps {
            received: Some(at(100)),
            published: Some(at(103)),
            ..sample(1, 1, 0)
        };
        let report = measure([(both, 104)]);
        assert!(about(report.since_received_ms.unwrap().p50, 4.0));
        assert!(about(report.since_published_ms.unwrap().p50, 1.0));
        assert_eq!(report.behind_quickest_ms, None);
        let report = measure([(timed(0, 0), 1)]);
        assert_eq!(
            (report.since_received_ms, report.since_published_ms),
            (None, None)
        );
    }

    #[test]
    fn the_quickest_sample_is_the_measure_wherever_it_comes() {
        let lags = [5, 7, 0, 2, 9];
        let samples = (0..)
            .zip(lags)
            .map(|(n, lag)| (timed(0, 20 * n), 777 + 20 * n + lag));
        let summary = measure(samples).behind_quickest_ms.unwrap();
        assert_eq!((summary.count, summary.min), (5, 0.0));
        assert!(
            about(summary.p50, 5.0) && about(summary.max, 9.0),
            "{summary:?}"
        );
    }

    #[test]
    fn a_dsp_that_boots_has_another_clock() {
        let rebooted = [(timed(0, 5000), 5000), (timed(1, 10), 6000)];
        // Boots that were not counted show in the clock itself.
        let unseen = [(timed(0, 5000), 5000), (timed(0, 10), 6000)];
        for samples in [rebooted, unseen] {
            let summary = measure(samples).behind_quickest_ms.unwrap();
            assert_eq!((summary.count, summary.max), (2, 0.0));
        }
    }

    #[test]
    fn clocks_that_drift_apart_are_compared_for_ten_seconds_only() {
        // A hundred seconds, in which the DSP's clock loses 100 ms.
        let samples = (0..1000).map(|n| (timed(0, n * 100 - n / 10), n * 100));
        let summary = measure(samples).behind_quickest_ms.unwrap();
        assert_eq!(summary.count, 1000);
        assert!(summary.max <= 10.1, "{summary:?}");
    }

    #[test]
    fn a_flood_is_compared_in_shorter_parts() {
        let count = 3 * MAX_WINDOW_SAMPLES as u64 + 1;
        let report = measure((0..count).map(|n| (timed(0, n / 10), n / 10)));
        assert_eq!(report.behind_quickest_ms.unwrap().count, count);
    }

    #[test]
    fn times_to_come_and_absurd_ones_do_no_harm() {
        let odd = Stamps {
            received: Some(MonotonicNs(u64::MAX)),
            published: Some(MonotonicNs(0)),
            dsp: Some(DspClock {
                since_boot_ns: u64::MAX,
                boots: u32::MAX,
            }),
            ..sample(1, 1, 0)
        };
        let report = measure([(odd, 1), (timed(u32::MAX, 0), 2), (odd, 3)]);
        assert_eq!(report.since_received_ms.unwrap().max, 0.0);
        assert!(report.behind_quickest_ms.is_some());
    }

    #[test]
    fn ages_of_another_machine_are_as_true_as_the_comparison_of_clocks() {
        let report = |uncertainty_s| {
            let of = Of {
                relayed: Some(RelayedTimes { uncertainty_s }),
                ..OF
            };
            DelayMeter::begin(0).report(of, Losses::default())
        };
        let known = report(Some(0.0025));
        assert_eq!((known.relayed, known.age_uncertainty_ms), (true, Some(2.5)));
        let text = known.text(Detail::Figures).to_string();
        assert!(text.contains("ages are true within ±2.500 ms\n"), "{text}");
        let unknown = report(None);
        assert_eq!((unknown.relayed, unknown.age_uncertainty_ms), (true, None));
        let text = unknown.text(Detail::Figures).to_string();
        assert!(
            text.contains("how true the ages are is not known"),
            "{text}"
        );
        let here = DelayMeter::begin(0).report(OF, Losses::default());
        assert_eq!((here.relayed, here.age_uncertainty_ms), (false, None));
        assert!(!here.text(Detail::Figures).to_string().contains("relayed"));
    }

    #[test]
    fn text_and_json_say_the_same() {
        let report = measure([(timed(0, 0), 0), (timed(0, 20), 23)]);
        let text = report.text(Detail::Figures).to_string();
        assert!(text.contains("DSP's clock to here"), "{text}");
        let json = serde_json::to_value(&report).unwrap();
        assert_eq!(json["schema"], "ril.Delay.v2");
        assert!(json["since_received_ms"].is_null());
        assert_eq!(json["behind_quickest_ms"]["count"], 2);
    }
}
