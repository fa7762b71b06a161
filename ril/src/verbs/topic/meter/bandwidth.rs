//! [`BandwidthMeter`], for `ril bw`: how many bytes the samples make.
//!
//! In shared memory no process copies them: a consumer reads where the publisher wrote. The figures say what would have to
//! be carried if it were otherwise, as over a tunnel to another machine, and what a log of everything takes.

use std::fmt;

use ipc_types::{Losses, MonotonicNs};
use serde::Serialize;

use super::histogram::{Histogram, Summary, Unit};
use super::rate::RateMeter;
use super::{Counts, Detail, Meter, Of, Report, rounded};
use crate::render::stamps::Stamps;

/// Name of the JSON object's layout.
pub const SCHEMA: &str = "ril.Bandwidth.v1";

/// The length of a second, ns.
const SECOND_NS: u64 = 1_000_000_000;

/// See the module's documentation.
#[derive(Clone, Debug)]
pub struct BandwidthMeter {
    payload_bytes: u64,
    rate: RateMeter,
    /// The second under way: when it began, and the bytes in it so far.
    second: Option<(MonotonicNs, u64)>,
    seconds: Histogram,
}

/// What `ril bw` says.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BandwidthReport {
    /// Whose samples, how many, how many were lost.
    #[serde(flatten)]
    pub counts: Counts,
    /// Size of one sample.
    pub payload_bytes: u64,
    /// Bytes of all samples that came here.
    pub bytes: u64,
    /// Bytes that came here, per second; `None` before the second sample.
    pub observed_bytes_per_s: Option<f64>,
    /// Bytes that were published, per second; `None` before the second sample.
    pub published_bytes_per_s: Option<f64>,
    /// Bytes of each whole second, counted from the first sample on.
    pub bytes_in_a_second: Option<Summary>,
}

impl BandwidthMeter {
    /// Counts a sample into its second. Seconds in which nothing came count as well.
    fn count(&mut self, now: MonotonicNs) {
        let (began, bytes) = self.second.get_or_insert((now, 0));
        let over = now.0.saturating_sub(began.0) / SECOND_NS;
        if over > 0 {
            self.seconds.record(*bytes);
            self.seconds.record_n(0, over - 1);
            *began = MonotonicNs(began.0 + over * SECOND_NS);
            *bytes = 0;
        }
        *bytes += self.payload_bytes;
    }
}

impl Meter for BandwidthMeter {
    type Report = BandwidthReport;

    fn begin(payload_bytes: usize) -> BandwidthMeter {
        BandwidthMeter {
            payload_bytes: payload_bytes as u64,
            rate: RateMeter::begin(payload_bytes),
            second: None,
            seconds: Histogram::new(Unit::Bytes),
        }
    }

    fn take(&mut self, stamps: &Stamps, now: MonotonicNs) {
        self.rate.take(stamps, now);
        self.count(now);
    }

    fn report(&self, of: Of, losses: Losses) -> BandwidthReport {
        let (samples, size) = (self.rate.samples(), self.payload_bytes);
        let bytes = |rate: f64| rounded(rate * size as f64, 1);
        BandwidthReport {
            counts: Counts::new(SCHEMA, of, samples, self.rate.seconds(), losses),
            payload_bytes: size,
            bytes: samples * size,
            observed_bytes_per_s: self.rate.observed_hz().map(bytes),
            published_bytes_per_s: self.rate.published_hz().map(bytes),
            bytes_in_a_second: self.seconds.summary(),
        }
    }
}

impl Report for BandwidthReport {
    fn write(&self, detail: Detail, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rate = |bytes: Option<f64>| {
            bytes.map_or("-".to_owned(), |bytes| format!("{:.2} kB/s", bytes / 1e3))
        };
        write!(f, "{}", self.counts)?;
        writeln!(
            f,
            "observed {}, published {}\n{} B a sample, {} B in all",
            rate(self.observed_bytes_per_s),
            rate(self.published_bytes_per_s),
            self.payload_bytes,
            self.bytes
        )?;
        match &self.bytes_in_a_second {
            Some(seconds) => seconds.write("in each second", detail, f),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::rate::tests::{OF, at, sample};
    use super::*;

    fn measure(came_ms: impl IntoIterator<Item = u64>) -> BandwidthReport {
        let mut meter = BandwidthMeter::begin(272);
        for (index, ms) in (1..).zip(came_ms) {
            meter.take(&sample(1, index, ms), at(ms));
        }
        meter.report(OF, Losses::default())
    }

    #[test]
    fn bytes_are_samples_times_their_size() {
        let report = measure((0..=100).map(|n| 20 * n));
        assert_eq!((report.payload_bytes, report.bytes), (272, 101 * 272));
        assert_eq!(report.observed_bytes_per_s, Some(50.0 * 272.0));
        assert_eq!(report.published_bytes_per_s, Some(50.0 * 272.0));
        assert!(
            report
                .text(Detail::Figures)
                .to_string()
                .contains("13.60 kB/s"),
            "{report:?}"
        );
    }

    #[test]
    fn only_whole_seconds_are_counted_and_the_empty_ones_too() {
        assert_eq!(measure([0, 500, 999]).bytes_in_a_second, None);
        let seconds = measure([0, 500, 999, 4000, 4500, 5000]).bytes_in_a_second;
        let seconds = seconds.unwrap();
        // Three samples, nothing for three seconds, two samples; the sixth second has just begun.
        assert_eq!(seconds.count, 5);
        assert_eq!((seconds.min, seconds.max), (0.0, 3.0 * 272.0));
        assert_eq!(seconds.p50, 0.0);
    }
}
