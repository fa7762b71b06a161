//! [`Times`]: how long something took, many times.

use std::fmt::{self, Display};
use std::time::Duration;

/// How long something took, many times.
#[derive(Clone, Debug, Default)]
pub struct Times(pub Vec<Duration>);

impl Times {
    /// Adds one.
    pub fn push(&mut self, time: Duration) {
        self.0.push(time);
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// The longest; zero if there are none.
    pub fn worst(&self) -> Duration {
        self.quantile(1.0)
    }

    /// What this share of them does not exceed, 0 … 1; zero if there are none.
    pub fn quantile(&self, share: f64) -> Duration {
        let mut sorted = self.0.clone();
        sorted.sort_unstable();
        let last = sorted.len().saturating_sub(1);
        let index = (last as f64 * share).ceil() as usize;
        sorted.get(index).copied().unwrap_or_default()
    }

    /// What this share of them does not exceed, 0 … 1, in ns.
    pub fn quantile_ns(&self, share: f64) -> f64 {
        self.quantile(share).as_nanos() as f64
    }

    /// What these shares of them do not exceed, 0 … 1, in ms.
    pub fn quantiles_ms(&self, shares: &[f64]) -> String {
        let shown = |share: &f64| format!("{:.1}", self.quantile(*share).as_secs_f64() * 1e3);
        shares.iter().map(shown).collect::<Vec<_>>().join(", ")
    }

    /// What these shares of them do not exceed, 0 … 1, in s.
    pub fn quantiles_s(&self, shares: &[f64]) -> String {
        let shown = |share: &f64| format!("{:.2}", self.quantile(*share).as_secs_f64());
        shares.iter().map(shown).collect::<Vec<_>>().join(", ")
    }
}

impl Extend<Duration> for Times {
    fn extend<I: IntoIterator<Item = Duration>>(&mut self, times: I) {
        self.0.extend(times);
    }
}

impl FromIterator<Duration> for Times {
    fn from_iter<I: IntoIterator<Item = Duration>>(times: I) -> Times {
        Times(times.into_iter().collect())
    }
}

/// With one decimal; with two by `{:.2}`, for times that may be shorter than 0.1 ms.
impl Display for Times {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() {
            return f.write_str("–");
        }
        let ms = |share| self.quantile(share).as_secs_f64() * 1e3;
        let (median, most, worst) = (ms(0.5), ms(0.99), ms(1.0));
        let (count, digits) = (self.count(), f.precision().unwrap_or(1));
        write!(
            f,
            "median {median:.digits$} ms, 99 % within {most:.digits$} ms, worst {worst:.digits$} ms of {count}"
        )
    }
}

/// The middle of `values`, or the mean of the two middle ones; `None` when there are none.
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
    fn quantiles_are_those_of_all_times() {
        let times: Times = (0..=1000).rev().map(Duration::from_micros).collect();
        for (share, us) in [(0.0, 0.0), (0.5, 500.0), (0.99, 990.0), (1.0, 1000.0)] {
            assert_eq!(times.quantile_ns(share), us * 1000.0);
        }
        assert_eq!(Times::default().worst(), Duration::ZERO);
    }
}
