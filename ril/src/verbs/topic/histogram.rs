//! [`Histogram`]: a quantity with its percentiles, in bounded memory however long it is measured.

use std::fmt::Write;

use serde::Serialize;

/// Largest value: a day in nanoseconds. What is greater counts as this.
const MAX_VALUE: u64 = 86_400_000_000_000;

/// Four digits: percentiles are right within a ten-thousandth, which is 2 µs of a period of 20 ms. The counters take
/// 5 MB, of which only pages that are used take memory.
const DIGITS: u8 = 4;

/// Bars of a histogram, about: as many as the eye compares at a glance. What lies beyond the 99th percentile shares one
/// more, so that a single late sample does not squeeze all others into one bar.
const BARS: u64 = 10;

/// Longest bar, characters.
const BAR_WIDTH: u64 = 36;

/// How much of a report is shown to people. Programs get everything.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// The figures, which fit a terminal of 80 columns and 24 rows.
    Figures,
    /// The histograms as well.
    Histograms,
}

/// What is measured, which says how it is shown. Values are recorded in the unit's smallest part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Times that are recorded in nanoseconds and shown in milliseconds.
    Milliseconds,
    /// Bytes.
    Bytes,
}

impl Unit {
    /// Recorded steps of one shown.
    const fn steps(self) -> f64 {
        match self {
            Unit::Milliseconds => 1e6,
            Unit::Bytes => 1.0,
        }
    }

    /// Decimals that are shown.
    const fn decimals(self) -> usize {
        match self {
            Unit::Milliseconds => 3,
            Unit::Bytes => 0,
        }
    }

    const fn name(self) -> &'static str {
        match self {
            Unit::Milliseconds => "ms",
            Unit::Bytes => "B",
        }
    }

    fn shown(self, value: f64) -> f64 {
        rounded(value / self.steps(), 3)
    }
}

/// A quantity with its percentiles, in bounded memory.
#[derive(Clone, Debug)]
pub struct Histogram {
    values: hdrhistogram::Histogram<u64>,
    /// Exact, unlike what the histogram says of them.
    min: u64,
    max: u64,
    unit: Unit,
}

impl Histogram {
    /// Nothing yet.
    pub fn new(unit: Unit) -> Histogram {
        let values = hdrhistogram::Histogram::new_with_bounds(1, MAX_VALUE, DIGITS);
        Histogram {
            values: values.expect("bounds and digits are constants that the histogram takes"),
            min: MAX_VALUE,
            max: 0,
            unit,
        }
    }

    /// Counts a value, in the unit's smallest part.
    pub fn record(&mut self, value: u64) {
        self.record_n(value, 1);
    }

    /// Counts a value so many times.
    pub fn record_n(&mut self, value: u64, count: u64) {
        let value = value.min(MAX_VALUE);
        self.values.saturating_record_n(value, count);
        if count > 0 {
            self.min = self.min.min(value);
            self.max = self.max.max(value);
        }
    }

    /// What was counted; `None` if nothing was.
    pub fn summary(&self) -> Option<Distribution> {
        let values = &self.values;
        if values.is_empty() {
            return None;
        }
        let quantile = |quantile| self.unit.shown(self.quantile(quantile) as f64);
        Some(Distribution {
            count: values.len(),
            min: self.unit.shown(self.min as f64),
            mean: self.unit.shown(values.mean()),
            stddev: self.unit.shown(values.stdev()),
            p50: quantile(0.5),
            p90: quantile(0.9),
            p99: quantile(0.99),
            p99_9: quantile(0.999),
            max: self.unit.shown(self.max as f64),
            histogram: self.bins(),
            unit: self.unit,
        })
    }

    fn quantile(&self, quantile: f64) -> u64 {
        let value = self.values.value_at_quantile(quantile);
        value.clamp(self.min, self.max)
    }

    /// Bars of a round width from the smallest value to the 99th percentile, and one for the rest.
    fn bins(&self) -> Vec<Bin> {
        let values = &self.values;
        let (low, high) = (self.min, self.quantile(0.99));
        // Not finer than the histogram can tell.
        let resolution = values.equivalent_range(high);
        let width = round_up_to_125(((high - low) / BARS).max(resolution));
        let first = low / width * width;
        let regular = (high - first) / width + 1;
        let rest = first + regular * width;
        let mut counts = vec![0; regular as usize + 1];
        for step in values.iter_recorded() {
            let value = values.median_equivalent(step.value_iterated_to());
            let value = value.clamp(self.min, self.max);
            let index = (value.saturating_sub(first) / width).min(regular);
            counts[index as usize] += step.count_at_value();
        }
        while counts.last() == Some(&0) {
            counts.pop();
        }
        let shown = |value: u64| self.unit.shown(value as f64);
        (0..)
            .zip(counts)
            .map(|(index, count)| {
                let from = first + index * width;
                let to = if from == rest { self.max } else { from + width };
                Bin {
                    from: shown(from),
                    to: shown(to),
                    count,
                }
            })
            .collect()
    }
}

/// The next of 1, 2, 5, 10, 20, 50 …
fn round_up_to_125(number: u64) -> u64 {
    let mut power = 1;
    loop {
        for digit in [1, 2, 5] {
            if digit * power >= number {
                return digit * power;
            }
        }
        // Values have an upper limit, so that this ends long before it overflows.
        power *= 10;
    }
}

/// What was counted, in the unit in which it is shown.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Distribution {
    /// Values.
    pub count: u64,
    /// Smallest.
    pub min: f64,
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub stddev: f64,
    /// Median.
    pub p50: f64,
    /// 90th percentile.
    pub p90: f64,
    /// 99th percentile.
    pub p99: f64,
    /// 99.9th percentile.
    pub p99_9: f64,
    /// Greatest.
    pub max: f64,
    /// How they are spread.
    pub histogram: Vec<Bin>,
    #[serde(skip)]
    unit: Unit,
}

/// One bar of a histogram.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bin {
    /// From here on.
    pub from: f64,
    /// Up to here, without it; the last bar has the greatest value in it.
    pub to: f64,
    /// So many values.
    pub count: u64,
}

impl Distribution {
    /// Adds the summary to `text` under a title: two lines of figures, and a bar for each part of the histogram if
    /// `detail` wants it. No line is longer than 80 characters.
    pub fn write(&self, title: &str, detail: Detail, text: &mut String) {
        let (digits, unit) = (self.unit.decimals(), self.unit.name());
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{title}, {unit}");
        let _ = writeln!(
            text,
            "  min {:.digits$}  mean {:.digits$}  sd {:.digits$}  max {:.digits$}",
            self.min, self.mean, self.stddev, self.max
        );
        let _ = writeln!(
            text,
            "  p50 {:.digits$}  p90 {:.digits$}  p99 {:.digits$}  p99.9 {:.digits$}",
            self.p50, self.p90, self.p99, self.p99_9
        );
        if detail == Detail::Figures {
            return;
        }
        let most = self.histogram.iter().map(|bin| bin.count).max();
        let most = most.unwrap_or(0).max(1);
        for bin in &self.histogram {
            // What is there is seen, be it ever so little.
            let length = (bin.count * BAR_WIDTH / most).max(u64::from(bin.count > 0));
            let bar = "#".repeat(length as usize);
            let line = format!(
                "  {:>12.digits$} … {:>12.digits$}  {:>8}  {bar}",
                bin.from, bin.to, bin.count
            );
            let _ = writeln!(text, "{}", line.trim_end());
        }
    }
}

/// A number with so many decimals: more would be noise.
pub(super) fn rounded(number: f64, decimals: i32) -> f64 {
    let scale = 10_f64.powi(decimals);
    (number * scale).round() / scale
}

#[cfg(test)]
mod tests {
    use super::*;

    fn histogram(unit: Unit, values: impl IntoIterator<Item = u64>) -> Distribution {
        let mut histogram = Histogram::new(unit);
        values.into_iter().for_each(|value| histogram.record(value));
        histogram.summary().expect("values")
    }

    #[test]
    fn nothing_has_no_percentiles() {
        assert_eq!(Histogram::new(Unit::Bytes).summary(), None);
    }

    #[test]
    fn percentiles_are_right_within_a_ten_thousandth() {
        let summary = histogram(Unit::Milliseconds, (1..=1000).map(|ms| ms * 1_000_000));
        assert_eq!(summary.count, 1000);
        for (value, expected) in [
            (summary.min, 1.0),
            (summary.mean, 500.5),
            (summary.p50, 500.0),
            (summary.p90, 900.0),
            (summary.p99, 990.0),
            (summary.p99_9, 999.0),
            (summary.max, 1000.0),
        ] {
            assert!(
                (value - expected).abs() <= expected * 1e-4,
                "{value} is not {expected}"
            );
        }
    }

    #[test]
    fn every_value_is_in_exactly_one_bar() {
        let cases: [Vec<u64>; 6] = [
            vec![0],
            vec![20_000_000; 500],
            (0..500).map(|n| 20_000_000 + n).collect(),
            (0..997).map(|n| n * n * 1000).collect(),
            vec![5, 5, 5, u64::MAX],
            (0..64).map(|bit| 1 << bit).collect(),
        ];
        for values in cases {
            let count = values.len() as u64;
            let summary = histogram(Unit::Milliseconds, values);
            let bars = &summary.histogram;
            assert_eq!(bars.iter().map(|bar| bar.count).sum::<u64>(), count);
            assert!(bars.len() as u64 <= BARS + 3, "{bars:?}");
            assert!(bars.windows(2).all(|pair| pair[0].to == pair[1].from));
        }
    }

    #[test]
    fn a_single_late_value_leaves_the_others_their_bars() {
        let values = (0..1000).map(|n| 1_000_000 + n * 1000);
        let summary = histogram(Unit::Milliseconds, values.chain([900_000_000]));
        assert!(summary.histogram.len() > 5, "{:?}", summary.histogram);
        let last = summary.histogram.last().unwrap();
        assert!(last.to >= 900.0, "{last:?}");
    }

    #[test]
    fn people_see_bars() {
        let values = [10, 10, 10, 10, 21, 30].map(|ms| ms * 1_000_000);
        let summary = histogram(Unit::Milliseconds, values);
        let mut text = String::new();
        summary.write("interval", Detail::Histograms, &mut text);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "interval, ms");
        assert!(lines[1].starts_with("  min 10.000  mean 15.1"), "{text}");
        assert!(lines[1].ends_with("max 30.000"), "{text}");
        assert!(
            lines[3].ends_with(&format!("4  {}", "#".repeat(36))),
            "{text}"
        );
        assert!(
            lines.iter().any(|line| line.ends_with("       0")),
            "{text}"
        );
        assert!(
            lines.iter().all(|line| line.chars().count() <= 80),
            "{text}"
        );
        assert!(lines.last().unwrap().ends_with("1  #########"), "{text}");
    }

    #[test]
    fn a_day_is_the_longest() {
        let summary = histogram(Unit::Milliseconds, [u64::MAX]);
        assert_eq!((summary.min, summary.max), (86_400_000.0, 86_400_000.0));
    }

    #[test]
    fn widths_are_round() {
        for (number, round) in [(0, 1), (1, 1), (3, 5), (11, 20), (51, 100), (100, 100)] {
            assert_eq!(round_up_to_125(number), round);
        }
        assert_eq!(round_up_to_125(MAX_VALUE), 100_000_000_000_000);
    }
}
