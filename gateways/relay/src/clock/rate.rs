//! How fast the offset of two clocks can change.

/// The greatest relative drift of two clocks, in ns per second: 200 ppm, two quartz clocks of 100 ppm each. Clocks that drift
/// more contradict themselves: the estimate begins anew again and again, and the counted resets show it.
pub const MAX_DRIFT_PPB: i64 = 200_000;

/// By how much the drift changes per second at most, in ppb. Quartz clocks change by up to 0.5 ppm per kelvin far from room
/// temperature, and warm up by up to 0.1 K/s after start: 50 ppb/s. In flight it is a few ppb/s.
pub const MAX_DRIFT_CHANGE_PPB_PER_S: i64 = 50;

/// By how much the drift may jump about its slowly changing value at any time, in ppb. An NTP daemon that keeps a clock in
/// step corrects its frequency abruptly, by less than 1 ppm.
pub const DRIFT_JITTER_PPB: i64 = 1_000;

/// Nanoseconds per second, which is also what a rate of 1 is in ppb.
const BILLION: i128 = 1_000_000_000;

const MAX: i128 = MAX_DRIFT_PPB as i128;
const CHANGE: i128 = MAX_DRIFT_CHANGE_PPB_PER_S as i128;
const JITTER: i128 = DRIFT_JITTER_PPB as i128;

/// Numbers from `low` to `high`, both included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Range {
    pub low: i128,
    pub high: i128,
}

impl Range {
    /// Every drift that two clocks can have, in ppb.
    pub const ANY_DRIFT: Range = Range {
        low: -MAX,
        high: MAX,
    };

    /// What lies in both; `None` if nothing does.
    pub fn and(self, other: Range) -> Option<Range> {
        let low = self.low.max(other.low);
        let high = self.high.min(other.high);
        (low <= high).then_some(Range { low, high })
    }

    /// The middle, rounded down.
    pub fn middle(self) -> i128 {
        (self.low + self.high).div_euclid(2)
    }

    /// The greatest distance of a number in the range from its [`middle`](Self::middle).
    pub fn half_width(self) -> i128 {
        self.high - self.middle()
    }
}

/// By how many ns an offset can rise in `duration_ns`, which is not negative, when the slow part of the drift at one end of
/// that time is at most `drift_ppb`. Negative if it falls for certain. How far it can fall is the same with `-drift_ppb`.
pub(super) fn greatest_rise_ns(drift_ppb: i128, duration_ns: i128) -> i128 {
    // The drift grows from `start_ppb` at the greatest pace, until it reaches the greatest drift and stays there.
    let start_ppb = (drift_ppb + JITTER).min(MAX);
    let growing_ns = ((MAX - start_ppb) * BILLION / CHANGE).min(duration_ns);
    let at_start = start_ppb * growing_ns;
    let by_growth = ceil_div(CHANGE * growing_ns * growing_ns, 2 * BILLION);
    let at_greatest = MAX * (duration_ns - growing_ns);
    ceil_div(at_start + by_growth + at_greatest, BILLION)
}

/// By how many ppb the slow part of the drift can change in half of `double_duration_ns`, which is not negative.
pub(super) fn greatest_drift_change_ppb(double_duration_ns: i128) -> i128 {
    ceil_div(CHANGE * double_duration_ns, 2 * BILLION)
}

/// The slow part of the drift half way through a time of `duration_ns` > 0 in which the offset rose by at least `rise_ns`:
/// at least this many ppb, when it changes at a steady pace.
pub(super) fn least_drift_ppb(rise_ns: i128, duration_ns: i128) -> i128 {
    (rise_ns * BILLION).div_euclid(duration_ns) - JITTER
}

fn ceil_div(dividend: i128, divisor: i128) -> i128 {
    -(-dividend).div_euclid(divisor)
}
