//! Percentiles of one round, and ratios over rounds. Pure.

use hdrhistogram::Histogram;

/// Longest time that a histogram keeps apart, ns: ten seconds, longer than any wait of a measurement.
const LONGEST_NS: u64 = 10_000_000_000;

/// Times of one case: of one round, or of several merged.
#[derive(Clone, Debug)]
pub struct Times(Histogram<u64>);

impl Times {
    /// No times yet.
    pub fn new() -> Times {
        // Three digits: a hundredth of a microsecond at ten microseconds. The bounds are right by construction.
        Times(Histogram::new_with_bounds(1, LONGEST_NS, 3).expect("valid bounds"))
    }

    /// Adds one time, ns; longer ones than the longest count as that.
    pub fn add(&mut self, ns: u64) {
        self.0.saturating_record(ns.max(1));
    }

    /// Adds all times of `other`.
    pub fn merge(&mut self, other: &Times) {
        // Both have the same bounds, so that everything fits.
        self.0.add(&other.0).expect("equal bounds");
    }

    /// All of these together.
    pub fn merged(all: impl Iterator<Item = Times>) -> Times {
        all.fold(Times::new(), |mut merged, times| {
            merged.merge(&times);
            merged
        })
    }

    /// How many times there are.
    pub fn count(&self) -> u64 {
        self.0.len()
    }

    /// The time, ns, that `fraction` (0 … 1) of the times do not exceed.
    pub fn quantile_ns(&self, fraction: f64) -> f64 {
        self.0.value_at_quantile(fraction) as f64
    }

    /// The median, ns.
    pub fn p50_ns(&self) -> f64 {
        self.quantile_ns(0.5)
    }
}

impl FromIterator<u64> for Times {
    fn from_iter<I: IntoIterator<Item = u64>>(times: I) -> Times {
        let mut all = Times::new();
        for ns in times {
            all.add(ns);
        }
        all
    }
}

/// A ratio, round by round.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ratio {
    /// Median over the rounds: the figure.
    pub median: f64,
    /// Smallest of a round.
    pub least: f64,
    /// Greatest of a round.
    pub most: f64,
}

impl Ratio {
    /// Values that are no ratios but have a bound all the same, one of each round; nothing without rounds.
    pub fn of_values(values: &[f64]) -> Option<Ratio> {
        Ratio::of_rounds(values, &vec![1.0; values.len()])
    }

    /// The ratio of `numerators` to `denominators`, which belong to the same rounds in the same order; nothing without
    /// rounds.
    pub fn of_rounds(numerators: &[f64], denominators: &[f64]) -> Option<Ratio> {
        let ratios: Vec<f64> = numerators
            .iter()
            .zip(denominators)
            .filter(|(_, denominator)| **denominator > 0.0)
            .map(|(numerator, denominator)| numerator / denominator)
            .collect();
        Some(Ratio {
            median: median(&ratios)?,
            least: ratios.iter().copied().fold(f64::INFINITY, f64::min),
            most: ratios.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        })
    }
}

/// The middle of `values`, or the mean of the two middle ones; nothing when there are none.
pub fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    match sorted.len() {
        0 => None,
        odd if odd % 2 == 1 => Some(sorted[middle]),
        _ => Some((sorted[middle - 1] + sorted[middle]) / 2.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_the_middle_whatever_the_order() {
        let cases: [(&[f64], Option<f64>); 4] = [
            (&[], None),
            (&[3.0], Some(3.0)),
            (&[9.0, 1.0, 4.0], Some(4.0)),
            (&[4.0, 1.0, 2.0, 100.0], Some(3.0)),
        ];
        for (values, expected) in cases {
            assert_eq!(median(values), expected, "{values:?}");
        }
    }

    #[test]
    fn a_ratio_is_taken_round_by_round_so_that_a_slow_round_cancels_out() {
        // The machine was ten times slower in the second round; the ratio of the medians would be 1.5.
        let ours = [10.0, 100.0, 30.0];
        let theirs = [5.0, 50.0, 20.0];
        let ratio = Ratio::of_rounds(&ours, &theirs).unwrap();
        assert_eq!((ratio.least, ratio.median, ratio.most), (1.5, 2.0, 2.0));
    }

    #[test]
    fn rounds_without_a_denominator_are_left_out() {
        let ratio = Ratio::of_rounds(&[1.0, 2.0], &[0.0, 1.0]).unwrap();
        assert_eq!(ratio.median, 2.0);
        assert_eq!(Ratio::of_rounds(&[1.0], &[0.0]), None);
        assert_eq!(Ratio::of_rounds(&[], &[]), None);
        assert_eq!(
            Ratio::of_values(&[3.0, 1.0]).map(|ratio| ratio.median),
            Some(2.0)
        );
    }

    #[test]
    fn percentiles_are_those_of_all_times_together() {
        let mut times: Times = (1..=900).map(|us| us * 1000).collect();
        times.merge(&(901..=1000).map(|us| us * 1000).collect());
        assert_eq!(times.count(), 1000);
        for (fraction, expected_us) in [(0.5, 500.0), (0.99, 990.0), (0.999, 999.0)] {
            let us = times.quantile_ns(fraction) / 1000.0;
            assert!((us - expected_us).abs() / expected_us < 1e-3, "{us}");
        }
    }

    #[test]
    fn a_time_beyond_the_longest_counts_as_the_longest() {
        let times: Times = [0, u64::MAX].into_iter().collect();
        assert_eq!(times.count(), 2);
        assert!(times.quantile_ns(1.0) >= LONGEST_NS as f64);
    }
}
