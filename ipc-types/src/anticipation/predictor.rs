//! [`Predictor`]: when the next sample of a periodic topic is likely to come, and how long it pays to look out for it. A pure
//! value: it is given the times and reads no clock.
//!
//! It fits a straight line through the times of the latest samples, keeps how far each was from it, and chooses the window
//! around the next one that catches most samples for the processor time that it may use.

use std::time::Duration;

use crate::time::MonotonicNs;

/// Samples that the line is fitted through, and whose distances from it are kept.
const MEMORY: usize = 64;

/// Samples that it takes to know how much they jitter.
const FEWEST: usize = 16;

/// A sample farther from its time than this share of the period says nothing of the rhythm: its publisher was held up.
const STRANGE: f64 = 0.4;

/// The mean distance from the line, as a share of the period, beyond which the rhythm is another one. Samples at any time are at
/// 0.25.
const LOST: f64 = 0.18;

/// How much of the newest sample goes into that mean.
const DISTANCE_GAIN: f64 = 1.0 / 16.0;

/// Samples between two choices of the window.
const CHOICE_PERIOD: usize = 8;

/// A window that would catch fewer than this share of the samples is not worth its price: the line jitters too much.
const LEAST_PLANNED: f64 = 0.6;

/// When fewer than this share are caught in truth, looking out rests: the threads wait too long for a processor.
const LEAST_CAUGHT: f64 = 0.4;

/// How much of the newest sample goes into the share that was caught.
const CAUGHT_GAIN: f64 = 1.0 / 128.0;

/// For how long looking out rests.
const REST: Duration = Duration::from_secs(5);

/// Looking out begins at least so long before the earliest time at which a sample is expected [ns].
const HEAD_NS: f64 = 1_000.0;

/// Looking out goes on so long after the latest time at which a sample is expected [ns].
const TAIL_NS: f64 = 3_000.0;

/// Wakes from a timer whose lateness is kept.
const WAKES: usize = 32;

/// The share of the wakes that are in time.
const IN_TIME: f64 = 0.9;

/// How late a timer is thought to wake before any has been measured [ns].
const FIRST_WAKE_NS: f64 = 100_000.0;

/// Timers are set this much earlier at most [ns], however late they are.
const LATEST_WAKE_NS: f64 = 300_000.0;

/// A sample that is so many times as far from the line as half of them are was held up.
const OUTLIER: f64 = 4.0;

/// Unused processor time is kept for so long.
const CREDIT_TIME: Duration = Duration::from_secs(1);

/// When to look out for the next sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Window {
    /// When to ask a timer to wake, if that is not over.
    pub begin: MonotonicNs,
    /// When to go to sleep again.
    pub end: MonotonicNs,
}

/// See the file's first lines.
#[derive(Clone, Debug)]
pub(crate) struct Predictor {
    /// Share of one processor that looking out may use.
    budget: f64,
    /// Processor time that may be used now [ns], as of `credited`.
    credit_ns: f64,
    credited: MonotonicNs,
    line: Option<Line>,
    residuals: Residuals,
    /// Mean distance of the samples from the line, as a share of the period.
    distance: f64,
    /// How much later than asked for a timer woke.
    lateness: Latest<WAKES>,
    /// How much later than asked for a timer usually wakes [ns].
    wake_ns: f64,
    /// Relative to the expected time [ns].
    window_ns: Option<(f64, f64)>,
    /// Share of the samples that were caught, of those that it was looked out for.
    caught: f64,
    rest_until: MonotonicNs,
}

/// Where samples are expected.
#[derive(Clone, Copy, Debug)]
struct Line {
    /// The latest sample, if it had come when it should have.
    last_ns: f64,
    /// Nothing after the first sample.
    period_ns: Option<f64>,
    /// Samples that the line was fitted through, at most [`MEMORY`].
    count: usize,
}

impl Predictor {
    /// `budget` is a share of one processor.
    pub(crate) fn new(budget: f64) -> Predictor {
        Predictor {
            budget,
            credit_ns: 0.0,
            credited: MonotonicNs::default(),
            line: None,
            residuals: Residuals::default(),
            distance: 0.0,
            lateness: Latest::default(),
            wake_ns: 0.0,
            window_ns: None,
            caught: 1.0,
            rest_until: MonotonicNs::default(),
        }
    }

    /// Whether it pays to look out, as far as is known at `now`.
    pub(crate) fn pays(&self, now: MonotonicNs) -> bool {
        self.window_ns.is_some() && now >= self.rest_until
    }

    /// A sample came, which looking out has caught, or not.
    pub(crate) fn arrived(&mut self, at: MonotonicNs, is_caught: bool) {
        if self.pays(at) {
            self.caught += CAUGHT_GAIN * (f64::from(u8::from(is_caught)) - self.caught);
            if self.caught < LEAST_CAUGHT {
                self.caught = 1.0;
                self.rest_until = at + REST;
            }
        }
        let at_ns = at.0 as f64;
        let Some(line) = &mut self.line else {
            self.line = Some(Line::new(at_ns));
            return;
        };
        let Some((periods, period_ns)) = line.extend(at_ns, self.residuals.usual_ns()) else {
            return;
        };
        self.distance += DISTANCE_GAIN * (periods.abs() - self.distance);
        if self.distance > LOST {
            return self.begin_anew(at_ns);
        }
        if line.count < FEWEST || periods.abs() > STRANGE {
            return;
        }
        self.residuals.add(periods * period_ns);
        if self.residuals.added.is_multiple_of(CHOICE_PERIOD) && self.residuals.len() >= FEWEST {
            let most_ns = self.budget * period_ns;
            let late_ns = |share| match self.lateness.len() {
                0 => FIRST_WAKE_NS,
                _ => {
                    let late_ns = self.lateness.quantile(share, |ns| ns);
                    late_ns.min(LATEST_WAKE_NS)
                }
            };
            self.wake_ns = late_ns(0.5);
            let head_ns = HEAD_NS + late_ns(IN_TIME) - self.wake_ns;
            self.window_ns = self.residuals.window(head_ns, most_ns);
        }
    }

    fn begin_anew(&mut self, at_ns: f64) {
        self.line = Some(Line::new(at_ns));
        self.residuals = Residuals::default();
        self.distance = 0.0;
        self.window_ns = None;
    }

    /// When to look out for the next sample after `now`; nothing while that does not pay, or may not be paid.
    pub(crate) fn window(&mut self, now: MonotonicNs) -> Option<Window> {
        let since_ns = now.since(self.credited).as_nanos() as f64;
        let most_ns = self.budget * CREDIT_TIME.as_nanos() as f64;
        self.credit_ns = (self.credit_ns + self.budget * since_ns).min(most_ns);
        self.credited = now;

        let (from_ns, to_ns) = self.window_ns.filter(|_| self.pays(now))?;
        let line = self.line?;
        let period_ns = line.period_ns?;
        let now_ns = now.0 as f64;
        // The first whose window is not over.
        let periods = ((now_ns - to_ns - line.last_ns) / period_ns)
            .floor()
            .max(0.0)
            + 1.0;
        let expected_ns = line.last_ns + periods * period_ns;
        let window = Window {
            begin: MonotonicNs((expected_ns + from_ns - self.wake_ns).max(0.0) as u64),
            end: MonotonicNs((expected_ns + to_ns).max(0.0) as u64),
        };
        let most_ns = to_ns - from_ns + self.wake_ns;
        (self.credit_ns >= most_ns && window.end > now).then_some(window)
    }

    /// A sleep until a window's begin lasted so much longer.
    pub(crate) fn woke_late(&mut self, by: Duration) {
        self.lateness.add(by.as_nanos() as f64);
    }

    /// Looking out took so long.
    pub(crate) fn spent(&mut self, time: Duration) {
        self.credit_ns -= time.as_nanos() as f64;
    }
}

impl Line {
    fn new(at_ns: f64) -> Line {
        Line {
            last_ns: at_ns,
            period_ns: None,
            count: 1,
        }
    }

    /// Goes on with a sample, and says how many periods later it came than expected, and what a period is [ns]; nothing
    /// for the second one, which makes the line. The line follows a sample no farther than `usual_ns`.
    fn extend(&mut self, at_ns: f64, usual_ns: f64) -> Option<(f64, f64)> {
        let Some(period_ns) = self.period_ns else {
            self.period_ns = Some(at_ns - self.last_ns).filter(|period| *period > 0.0);
            self.last_ns = at_ns;
            self.count = 2;
            return None;
        };
        // More than one when samples were missed.
        let periods = ((at_ns - self.last_ns) / period_ns).round().max(1.0);
        let expected_ns = self.last_ns + periods * period_ns;
        let residual_ns = at_ns - expected_ns;
        let late = residual_ns / period_ns;
        if late.abs() > STRANGE {
            return Some((late, period_ns));
        }
        let residual_ns = residual_ns.clamp(-usual_ns, usual_ns);
        self.count = (self.count + 1).min(MEMORY);
        let count = self.count as f64;
        // The gains of a line fitted through `count` points.
        let both = count * (count + 1.0);
        let gain = 2.0 * (2.0 * count - 1.0) / both;
        let period_gain = 6.0 / both;
        self.last_ns = expected_ns + gain * residual_ns;
        self.period_ns = Some(period_ns + period_gain * residual_ns / periods);
        Some((late, period_ns))
    }
}

/// The latest measurements of something [ns].
#[derive(Clone, Debug)]
struct Latest<const N: usize> {
    ring: [f64; N],
    added: usize,
}

impl<const N: usize> Default for Latest<N> {
    fn default() -> Latest<N> {
        Latest {
            ring: [0.0; N],
            added: 0,
        }
    }
}

impl<const N: usize> Latest<N> {
    fn add(&mut self, ns: f64) {
        self.ring[self.added % N] = ns;
        self.added += 1;
    }

    fn len(&self) -> usize {
        self.added.min(N)
    }

    /// All of them after `change`, the least first, in `sorted`.
    fn sort<'s>(&self, change: fn(f64) -> f64, sorted: &'s mut [f64; N]) -> &'s [f64] {
        *sorted = self.ring.map(change);
        let sorted = &mut sorted[..self.len()];
        sorted.sort_unstable_by(f64::total_cmp);
        sorted
    }

    /// What so large a share of them does not exceed; 0 when there are none.
    fn quantile(&self, share: f64, change: fn(f64) -> f64) -> f64 {
        let mut sorted = [0.0; N];
        let sorted = self.sort(change, &mut sorted);
        let place = (share * sorted.len() as f64) as usize;
        sorted.get(place).copied().unwrap_or(0.0)
    }
}

/// How far the latest samples were from the line.
type Residuals = Latest<MEMORY>;

impl Residuals {
    /// How far a sample may be from the line without being held up by something: the line does not follow it farther.
    fn usual_ns(&self) -> f64 {
        match self.len() {
            len if len < FEWEST => f64::INFINITY,
            _ => OUTLIER * self.quantile(0.5, f64::abs) + HEAD_NS,
        }
    }

    /// The window that would have caught most of the samples, of those the cheapest, for at most `most_ns` of looking out per
    /// sample. It begins `head_ns` before the first that it catches.
    ///
    /// A sample before the window costs nothing: it wakes the sleeper. One after it costs the whole window.
    fn window(&self, head_ns: f64, most_ns: f64) -> Option<(f64, f64)> {
        let mut sorted = [0.0; MEMORY];
        let sorted = self.sort(|ns| ns, &mut sorted);
        let len = sorted.len();
        let mut best: Option<(usize, f64, (f64, f64))> = None;
        for first in 0..len {
            let from_ns = sorted[first] - head_ns;
            let mut until_samples_ns = 0.0;
            for (last, last_ns) in sorted.iter().enumerate().skip(first) {
                until_samples_ns += last_ns - from_ns;
                let to_ns = last_ns + TAIL_NS;
                let late = (len - 1 - last) as f64 * (to_ns - from_ns);
                let cost_ns = (until_samples_ns + late) / len as f64;
                let caught = last + 1 - first;
                let is_better = best.is_none_or(|(most, least_ns, _)| {
                    caught > most || caught == most && cost_ns < least_ns
                });
                if cost_ns <= most_ns && is_better {
                    best = Some((caught, cost_ns, (from_ns, to_ns)));
                }
            }
        }
        let (caught, _, window) = best?;
        (caught as f64 >= LEAST_PLANNED * len as f64).then_some(window)
    }
}

#[cfg(test)]
mod tests;
