//! [`RateMeter`], for `ril hz`: how often samples come here, and how often they are published.
//!
//! Both are measured, because they differ when samples are lost: the observed rate counts what came, the published one
//! goes by sequence numbers and the publisher's own times. A sample of another publisher begins anew; the pause between
//! two publishers is the rate of neither.

use std::fmt;

use ipc_types::{Losses, MonotonicNs};
use serde::Serialize;

use super::histogram::{Histogram, Summary, Unit};
use super::{Counts, Detail, Meter, Of, Report, rounded};
use crate::render::stamps::Stamps;

/// Name of the JSON object's layout.
pub const SCHEMA: &str = "ril.Rate.v1";

/// See the module's documentation.
#[derive(Clone, Debug)]
pub struct RateMeter {
    first: Option<MonotonicNs>,
    last: Option<(Stamps, MonotonicNs)>,
    samples: u64,
    /// Steps of the sequence, and the time that they took by the publisher's clock.
    published: u64,
    published_ns: u64,
    came: Histogram,
    sent: Histogram,
}

/// What `ril hz` says.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RateReport {
    /// Whose samples, how many, how many were lost.
    #[serde(flatten)]
    pub counts: Counts,
    /// Samples that came here, per second; `None` before the second.
    pub observed_hz: Option<f64>,
    /// Samples that were published, per second; `None` before the second.
    pub published_hz: Option<f64>,
    /// Time between two samples as they came here.
    pub interval_ms: Option<Summary>,
    /// Time between two samples by the publisher's own stamps, where none was lost between them.
    pub published_interval_ms: Option<Summary>,
}

impl RateMeter {
    /// Samples measured.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// From the first sample to the last, s.
    pub fn seconds(&self) -> f64 {
        match (self.first, self.last) {
            (Some(first), Some((_, last))) => last.since(first).as_secs_f64(),
            _ => 0.0,
        }
    }

    /// Samples that came here, per second; `None` before the second.
    pub fn observed_hz(&self) -> Option<f64> {
        per_second(self.samples.checked_sub(1)?, self.seconds())
    }

    /// Samples that were published, per second; `None` before the second.
    pub fn published_hz(&self) -> Option<f64> {
        per_second(self.published, self.published_ns as f64 / 1e9)
    }
}

impl Meter for RateMeter {
    type Report = RateReport;

    fn begin(_: usize) -> RateMeter {
        RateMeter {
            first: None,
            last: None,
            samples: 0,
            published: 0,
            published_ns: 0,
            came: Histogram::new(Unit::Milliseconds),
            sent: Histogram::new(Unit::Milliseconds),
        }
    }

    fn take(&mut self, stamps: &Stamps, now: MonotonicNs) {
        self.samples += 1;
        self.first.get_or_insert(now);
        if let Some((last, came)) = self.last.replace((*stamps, now)) {
            self.came.record(now.0.saturating_sub(came.0));
            if stamps.epoch_ns == last.epoch_ns {
                let steps = stamps.sequence.saturating_sub(last.sequence);
                let took_ns = stamps.sent.0.saturating_sub(last.sent.0);
                self.published = self.published.saturating_add(steps);
                self.published_ns = self.published_ns.saturating_add(took_ns);
                if steps == 1 {
                    self.sent.record(took_ns);
                }
            }
        }
    }

    fn report(&self, of: Of, losses: Losses) -> RateReport {
        let hz = |rate: f64| rounded(rate, 3);
        RateReport {
            counts: Counts::new(SCHEMA, of, self.samples, self.seconds(), losses),
            observed_hz: self.observed_hz().map(hz),
            published_hz: self.published_hz().map(hz),
            interval_ms: self.came.summary(),
            published_interval_ms: self.sent.summary(),
        }
    }
}

/// So many in so many seconds; `None` if either is nothing.
fn per_second(count: u64, seconds: f64) -> Option<f64> {
    (count > 0 && seconds > 0.0).then(|| count as f64 / seconds)
}

impl Report for RateReport {
    fn write(&self, detail: Detail, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let hz = |rate: Option<f64>| rate.map_or("-".to_owned(), |rate| format!("{rate:.2} Hz"));
        write!(f, "{}", self.counts)?;
        writeln!(
            f,
            "observed {}, published {}",
            hz(self.observed_hz),
            hz(self.published_hz)
        )?;
        if let Some(interval) = &self.interval_ms {
            interval.write("interval here", detail, f)?;
        }
        if let Some(interval) = &self.published_interval_ms {
            interval.write("interval at the publisher", detail, f)?;
        }
        Ok(())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub const OF: Of = Of {
        robot: 1,
        service: "hero_telemetry",
        relayed: None,
    };

    /// Sample `sequence` of publisher `epoch_ns`, sent at so many ms.
    pub fn sample(epoch_ns: u64, sequence: u64, sent_ms: u64) -> Stamps {
        Stamps {
            epoch_ns,
            sequence,
            sent: at(sent_ms),
            received: None,
            published: None,
            dsp: None,
        }
    }

    pub fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    fn measure(samples: &[(Stamps, u64)]) -> RateReport {
        let mut meter = RateMeter::begin(0);
        for (stamps, came_ms) in samples {
            meter.take(stamps, at(*came_ms));
        }
        meter.report(OF, Losses::default())
    }

    #[test]
    fn one_sample_is_no_rate() {
        let report = measure(&[(sample(1, 1, 0), 5)]);
        assert_eq!((report.observed_hz, report.published_hz), (None, None));
        assert_eq!(report.counts.samples, 1);
        assert!(
            report
                .text(Detail::Figures)
                .to_string()
                .contains("observed -, published -")
        );
    }

    #[test]
    fn losses_lower_the_observed_rate_and_not_the_published_one() {
        let every_other: Vec<_> = (0..=50)
            .map(|n| (sample(1, 1 + 2 * n, 40 * n), 3 + 40 * n))
            .collect();
        let report = measure(&every_other);
        assert_eq!(report.observed_hz, Some(25.0));
        assert_eq!(report.published_hz, Some(50.0));
        assert_eq!(report.published_interval_ms, None, "none was without a gap");
        assert_eq!(report.interval_ms.unwrap().count, 50);
    }

    #[test]
    fn samples_that_come_together_are_published_evenly_all_the_same() {
        let report = measure(&[
            (sample(1, 1, 0), 0),
            (sample(1, 2, 20), 60),
            (sample(1, 3, 40), 60),
            (sample(1, 4, 60), 60),
        ]);
        assert_eq!(report.observed_hz, Some(50.0));
        assert_eq!(report.published_hz, Some(50.0));
        let (here, there) = (report.interval_ms, report.published_interval_ms);
        assert_eq!(here.unwrap().min, 0.0);
        assert!((there.unwrap().max - 20.0).abs() < 0.02);
    }

    #[test]
    fn the_pause_between_two_publishers_is_not_in_the_published_rate() {
        let report = measure(&[
            (sample(1, 7, 0), 0),
            (sample(1, 8, 20), 20),
            (sample(2, 1, 1000), 1000),
            (sample(2, 2, 1020), 1020),
        ]);
        assert_eq!(report.published_hz, Some(50.0));
        assert_eq!(report.published_interval_ms.unwrap().count, 2);
    }

    #[test]
    fn programs_get_one_object() {
        let losses = Losses {
            received: 3,
            lost: 1,
            ..Losses::default()
        };
        let mut meter = RateMeter::begin(0);
        meter.take(&sample(1, 1, 0), at(0));
        meter.take(&sample(1, 2, 20), at(20));
        let json = serde_json::to_value(meter.report(OF, losses)).unwrap();
        assert_eq!(json["schema"], "ril.Rate.v1");
        assert_eq!(json["service"], "hero_telemetry");
        assert_eq!(
            (&json["lost"], &json["lost_percent"]),
            (&1.into(), &25.0.into())
        );
        assert_eq!(json["observed_hz"], 50.0);
        assert_eq!(json["interval_ms"]["count"], 1);
        assert_eq!(json["interval_ms"]["histogram"][0]["count"], 1);
        assert_eq!(json["seconds"], 0.02);
    }

    #[test]
    fn absurd_stamps_do_not_overflow() {
        let report = measure(&[
            (sample(1, u64::MAX, 10), 10),
            (sample(1, 0, 0), 0),
            (sample(1, u64::MAX, 10), 10),
            (sample(1, 0, 0), 0),
            (sample(1, u64::MAX, 10), 10),
        ]);
        assert!(report.published_hz.is_some());
    }
}
