//! [`Bins`]: how often something happened, over time, in bounded memory: at most [`MAX_BINS`] equal spans of time; when they do not
//! suffice, each two become one.

/// Most bins: about as many as bars that can be seen in a plot.
pub const MAX_BINS: usize = 480;

/// Length of a bin at first, s.
const FIRST_WIDTH_S: f64 = 1.0;

/// See the module's documentation.
#[derive(Clone, Debug, PartialEq)]
pub struct Bins {
    width_s: f64,
    counts: Vec<f64>,
}

impl Default for Bins {
    fn default() -> Self {
        Bins {
            width_s: FIRST_WIDTH_S,
            counts: Vec::new(),
        }
    }
}

impl Bins {
    /// Counts `count` at a time, s since the beginning. A count or a time that is not finite or negative is passed over.
    pub fn add(&mut self, at_s: f64, count: f64) {
        if !(at_s.is_finite() && at_s >= 0.0 && count.is_finite() && count >= 0.0) {
            return;
        }
        while at_s / self.width_s >= MAX_BINS as f64 {
            self.width_s *= 2.0;
            self.counts = self
                .counts
                .chunks(2)
                .map(|pair| pair.iter().sum())
                .collect();
        }
        let index = (at_s / self.width_s) as usize;
        if self.counts.len() <= index {
            self.counts.resize(index + 1, 0.0);
        }
        self.counts[index] += count;
    }

    /// The spans, s, each with how often it happened a second. The last one ends with the flight, after `span_s`.
    pub fn rates(&self, span_s: f64) -> impl Iterator<Item = ([f64; 2], f64)> {
        self.counts.iter().enumerate().map(move |(index, count)| {
            let from_s = index as f64 * self.width_s;
            let to_s = (from_s + self.width_s).min(span_s).max(from_s);
            // A last span of milliseconds has no rate.
            let length_s = (to_s - from_s).max(self.width_s / 4.0);
            ([from_s, to_s], count / length_s)
        })
    }

    /// How often it happened in all.
    pub fn total(&self) -> f64 {
        self.counts.iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_hour_is_bounded_and_nothing_is_lost() {
        let mut bins = Bins::default();
        for index in 0..180_000 {
            bins.add(f64::from(index) / 50.0, 1.0);
        }
        assert!(bins.counts.len() <= MAX_BINS);
        assert_eq!(bins.total(), 180_000.0);
        let rates: Vec<f64> = bins.rates(3600.0).map(|(_, rate)| rate).collect();
        assert!(
            rates.iter().all(|rate| (rate - 50.0).abs() < 1e-6),
            "{rates:?}"
        );
    }

    #[test]
    fn what_cannot_be_is_passed_over() {
        let mut bins = Bins::default();
        bins.add(-1.0, 1.0);
        bins.add(f64::NAN, 1.0);
        bins.add(1.0, -5.0);
        assert_eq!(bins.total(), 0.0);
        bins.add(1e12, 3.0);
        assert!(bins.counts.len() <= MAX_BINS && bins.total() == 3.0);
    }
}
