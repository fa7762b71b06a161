//! [`Envelope`]: a value over time in bounded memory. It keeps the first, last, least and greatest value of each of at
//! most [`MAX_BUCKETS`] equal spans of time; when they do not suffice, each two become one. A plot with fewer columns
//! than buckets shows the same line as one of all values would.
//!
//! [`Bins`]: how often something happened, over time, in bounded memory: at most [`MAX_BINS`] equal spans of time; when
//! they do not suffice, each two become one.

/// Most buckets. A plot is at most 1,000 columns wide, so each column has at least two buckets of a long flight.
pub const MAX_BUCKETS: usize = 4096;

/// Length of a bucket at first, s: a sample each at 50 samples a second.
const FIRST_WIDTH_S: f64 = 1.0 / 64.0;

/// A value at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Since the beginning of the flight, s.
    pub at_s: f64,
    /// In the unit of the plot.
    pub value: f64,
}

/// What became of one span of time.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bucket {
    /// The span, counted from the beginning in units of the width.
    index: u64,
    first: Point,
    last: Point,
    least: Point,
    greatest: Point,
    /// Nothing came for longer than a line may go on without a value.
    is_after_gap: bool,
}

impl Bucket {
    fn join(&mut self, later: &Bucket) {
        self.last = later.last;
        if later.least.value < self.least.value {
            self.least = later.least;
        }
        if later.greatest.value > self.greatest.value {
            self.greatest = later.greatest;
        }
    }

    /// The points that a line through the bucket needs, in the order of time.
    fn points(&self) -> impl Iterator<Item = Point> {
        let (one, other) = if self.least.at_s <= self.greatest.at_s {
            (self.least, self.greatest)
        } else {
            (self.greatest, self.least)
        };
        let mut last: Option<Point> = None;
        [self.first, one, other, self.last]
            .into_iter()
            .filter(move |point| {
                let is_new = last != Some(*point);
                last = Some(*point);
                is_new
            })
    }
}

/// A value over time in bounded memory: first, last, least and greatest value of each span of time.
#[derive(Clone, Debug, PartialEq)]
pub struct Envelope {
    width_s: f64,
    gap_s: f64,
    buckets: Vec<Bucket>,
}

impl Envelope {
    /// Without a value. The line is interrupted where no value came for more than `gap_s`, s.
    pub fn new(gap_s: f64) -> Envelope {
        Envelope {
            width_s: FIRST_WIDTH_S,
            gap_s,
            buckets: Vec::new(),
        }
    }

    /// Takes the value at a time, s since the beginning. One that is not finite, or earlier than the one before, is
    /// passed over.
    pub fn push(&mut self, at_s: f64, value: f64) {
        if !(at_s.is_finite() && at_s >= 0.0 && value.is_finite()) {
            return;
        }
        let point = Point { at_s, value };
        let mut is_after_gap = false;
        if let Some(last) = self.buckets.last() {
            if at_s < last.last.at_s {
                return;
            }
            is_after_gap = at_s - last.last.at_s > self.gap_s;
        }
        let bucket = Bucket {
            index: (at_s / self.width_s) as u64,
            first: point,
            last: point,
            least: point,
            greatest: point,
            is_after_gap,
        };
        match self.buckets.last_mut() {
            Some(last) if last.index == bucket.index && !is_after_gap => last.join(&bucket),
            _ => {
                self.buckets.push(bucket);
                self.thin();
            }
        }
    }

    /// Doubles the width of the buckets until there are not too many. Gaps between two buckets that become one are not
    /// kept: they are shorter than a column of a plot.
    fn thin(&mut self) {
        while self.buckets.len() > MAX_BUCKETS {
            self.width_s *= 2.0;
            let mut kept: Vec<Bucket> = Vec::with_capacity(MAX_BUCKETS + 1);
            for mut bucket in self.buckets.drain(..) {
                bucket.index /= 2;
                match kept.last_mut() {
                    Some(last) if last.index == bucket.index => last.join(&bucket),
                    _ => kept.push(bucket),
                }
            }
            self.buckets = kept;
        }
    }

    /// Whether no value came.
    pub fn is_empty(&self) -> bool {
        self.buckets.is_empty()
    }

    /// The lines that a plot of `span_s` in `columns` columns shows: at most four points a column, and another line
    /// after each gap.
    pub fn lines(&self, span_s: f64, columns: usize) -> Vec<Vec<Point>> {
        let mut lines: Vec<Vec<Point>> = Vec::new();
        let mut add = |bucket: &Bucket| {
            if lines.is_empty() || bucket.is_after_gap {
                lines.push(Vec::new());
            }
            if let Some(line) = lines.last_mut() {
                line.extend(bucket.points());
            }
        };
        let column_of = |bucket: &Bucket| (bucket.first.at_s / span_s * columns as f64) as usize;
        let mut open: Option<Bucket> = None;
        for bucket in &self.buckets {
            match &mut open {
                Some(open) if column_of(open) == column_of(bucket) && !bucket.is_after_gap => {
                    open.join(bucket);
                }
                _ => {
                    open.iter().for_each(&mut add);
                    open = Some(*bucket);
                }
            }
        }
        open.iter().for_each(&mut add);
        lines
    }
}

/// Most bins: about as many as bars that can be seen in a plot.
pub const MAX_BINS: usize = 480;

/// Length of a bin at first, s.
const FIRST_BIN_S: f64 = 1.0;

/// How often something happened, over time, in bounded memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Bins {
    width_s: f64,
    counts: Vec<f64>,
}

impl Default for Bins {
    fn default() -> Self {
        Bins {
            width_s: FIRST_BIN_S,
            counts: Vec::new(),
        }
    }
}

impl Bins {
    /// Counts `count` at a time, s since the beginning. A count or a time that is not finite or negative is passed
    /// over.
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
    use proptest::prelude::*;

    use super::*;

    impl Envelope {
        /// The least and the greatest value; `None` without one.
        fn range(&self) -> Option<(f64, f64)> {
            let least = self.buckets.iter().map(|bucket| bucket.least.value);
            let greatest = self.buckets.iter().map(|bucket| bucket.greatest.value);
            Some((least.reduce(f64::min)?, greatest.reduce(f64::max)?))
        }
    }

    fn of(points: impl IntoIterator<Item = (f64, f64)>) -> Envelope {
        let mut envelope = Envelope::new(1.0);
        for (at_s, value) in points {
            envelope.push(at_s, value);
        }
        envelope
    }

    #[test]
    fn an_hour_at_50_hz_is_bounded_and_no_peak_is_lost() {
        let envelope = of((0..180_000).map(|index| {
            let value = if index == 77_777 {
                99.0
            } else {
                f64::from(index % 7)
            };
            (f64::from(index) / 50.0, value)
        }));
        assert!(envelope.buckets.len() <= MAX_BUCKETS && envelope.buckets.len() > MAX_BUCKETS / 4);
        assert_eq!(envelope.range(), Some((0.0, 99.0)));
        let lines = envelope.lines(3600.0, 900);
        assert_eq!(lines.len(), 1);
        assert!(lines[0].len() <= 3600, "{}", lines[0].len());
        let peak = lines[0].iter().find(|point| point.value == 99.0);
        assert_eq!(peak.map(|point| point.at_s), Some(77_777.0 / 50.0));
    }

    #[test]
    fn a_gap_interrupts_the_line_and_what_is_no_value_is_passed_over() {
        let envelope = of([
            (0.0, 1.0),
            (0.5, f64::NAN),
            (0.6, 2.0),
            (3.0, 3.0),
            (2.0, 9.0),
            (f64::INFINITY, 9.0),
        ]);
        let lines = envelope.lines(3.0, 100);
        let values: Vec<Vec<f64>> = lines
            .iter()
            .map(|line| line.iter().map(|point| point.value).collect())
            .collect();
        assert_eq!(values, [vec![1.0, 2.0], vec![3.0]]);
        assert_eq!(Envelope::new(1.0).range(), None);
        assert!(Envelope::new(1.0).lines(1.0, 10).is_empty());
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn time_goes_on_and_the_extremes_stay(steps in proptest::collection::vec((0.0..2.0_f64, -1e6..1e6_f64), 1..3000)) {
            let mut at_s = 0.0;
            let mut envelope = Envelope::new(0.5);
            for (step_s, value) in &steps {
                at_s += step_s * step_s * step_s;
                envelope.push(at_s, *value);
            }
            let values = steps.iter().map(|(_, value)| *value);
            let least = values.clone().reduce(f64::min).unwrap();
            let greatest = values.reduce(f64::max).unwrap();
            prop_assert_eq!(envelope.range(), Some((least, greatest)));
            let points: Vec<Point> = envelope.lines(at_s.max(1.0), 300).concat();
            prop_assert!(points.windows(2).all(|pair| pair[0].at_s <= pair[1].at_s));
            prop_assert!(points.iter().any(|point| point.value == least));
            prop_assert!(points.iter().any(|point| point.value == greatest));
        }
    }
}

#[cfg(test)]
mod bins_tests {
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
