//! One exchange of time stamps, the two bounds of the offset that it yields, and how fast the offset can change.

use std::fmt;
use std::time::Duration;

use ipc_types::MonotonicNs;
use thiserror::Error;

/// The longest time from request to reply that is accepted, in ns. Messages take up to 2 s each way on a bad radio
/// link; more than twice that in sum says little about the offset, and the sender need not remember its request any
/// longer.
pub const MAX_ROUND_TRIP_NS: u64 = 10_000_000_000;

/// The greatest time stamp that is accepted, in ns: 146 years after boot. Differences of stamps then fit into 64 bits.
pub const MAX_STAMP_NS: u64 = 1 << 62;

/// By how much two readings of the same suspended time differ at most, in ns. The two clocks of a reading are read one
/// after the other, and the kernel may run something else in between. A real suspend takes longer.
pub const SUSPENDED_TOLERANCE_NS: u64 = 5_000_000;

/// Each clock counts whole ns and rounds down; so a difference of two stamps is less than 1 ns off.
const ROUNDING_NS: i128 = 1;

/// A moment of the other machine's `CLOCK_MONOTONIC`, in ns since its zero. Not comparable with [`MonotonicNs`].
#[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RemoteNs(pub u64);

impl fmt::Debug for RemoteNs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "remote {:?}", Duration::from_nanos(self.0))
    }
}

/// How long the two machines have been suspended since their boots: `CLOCK_BOOTTIME` − `CLOCK_MONOTONIC`, in ns. All
/// zero where that is not known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Suspended {
    /// The local machine, read when the request was sent.
    pub at_sent_ns: u64,
    /// The remote machine, read when the reply was sent.
    pub remote_ns: u64,
    /// The local machine, read when the reply was received.
    pub at_received_ns: u64,
}

impl Suspended {
    /// One of the machines was suspended in the meantime.
    pub(super) fn differs_from(&self, earlier: &Suspended) -> bool {
        differ(self.at_received_ns, earlier.at_received_ns)
            || differ(self.remote_ns, earlier.remote_ns)
    }
}

fn differ(one_ns: u64, other_ns: u64) -> bool {
    one_ns.abs_diff(other_ns) > SUSPENDED_TOLERANCE_NS
}

/// The time stamps of a request and of its reply.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Exchange {
    /// The request was sent. Read this clock before sending.
    pub sent: MonotonicNs,
    /// The remote machine received the request.
    pub remote_received: RemoteNs,
    /// The remote machine sent the reply. Read that clock before sending.
    pub remote_sent: RemoteNs,
    /// The reply was received.
    pub received: MonotonicNs,
    /// The suspended times of both machines.
    pub suspended: Suspended,
}

/// Why nothing can be learned from an exchange.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Rejected {
    /// A stamp is above [`MAX_STAMP_NS`].
    #[error("a time stamp lies more than {MAX_STAMP_NS} ns after the boot of its machine")]
    OutOfRange,
    /// `received` is before `sent`.
    #[error("the reply was received before the request was sent, by the local clock")]
    LocalBackwards,
    /// `remote_sent` is before `remote_received`.
    #[error("the reply was sent before the request was received, by the remote clock")]
    RemoteBackwards,
    /// More than [`MAX_ROUND_TRIP_NS`] from `sent` to `received`.
    #[error("the reply came more than {MAX_ROUND_TRIP_NS} ns after the request")]
    TooSlow,
    /// The request was sent before the offset jumped, or before it was known to have jumped.
    #[error("the request was sent before the clocks' offset jumped")]
    Superseded,
    /// The local machine was suspended between `sent` and `received`.
    #[error("the local machine was suspended between request and reply")]
    SuspendedMeanwhile,
    /// The remote machine needed longer to answer than the whole exchange took.
    #[error("the remote machine held the request for longer than the exchange took")]
    HeldTooLong,
}

/// A limit of the offset at one moment of the local clock, both in ns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Bound {
    pub at_ns: i128,
    pub offset_ns: i128,
}

impl Exchange {
    /// Says why such an exchange cannot be, or is of no use.
    pub(super) fn check(&self) -> Result<(), Rejected> {
        let latest = self.received.0.max(self.sent.0);
        let latest_remote = self.remote_sent.0.max(self.remote_received.0);
        if latest.max(latest_remote) > MAX_STAMP_NS {
            return Err(Rejected::OutOfRange);
        }
        if self.received < self.sent {
            return Err(Rejected::LocalBackwards);
        }
        if self.remote_sent < self.remote_received {
            return Err(Rejected::RemoteBackwards);
        }
        if self.received.0 - self.sent.0 > MAX_ROUND_TRIP_NS {
            return Err(Rejected::TooSlow);
        }
        if differ(self.suspended.at_sent_ns, self.suspended.at_received_ns) {
            return Err(Rejected::SuspendedMeanwhile);
        }
        let (ceiling, floor) = (self.ceiling(), self.floor());
        let rise_ns = greatest_rise_ns(i128::from(MAX_DRIFT_PPB), floor.at_ns - ceiling.at_ns);
        if floor.offset_ns > ceiling.offset_ns + rise_ns {
            return Err(Rejected::HeldTooLong);
        }
        Ok(())
    }

    /// The offset was at most this when the request was sent, because the request was not received before.
    pub(super) fn ceiling(&self) -> Bound {
        let at_ns = i128::from(self.sent.0);
        Bound {
            at_ns,
            offset_ns: i128::from(self.remote_received.0) - at_ns + ROUNDING_NS,
        }
    }

    /// The offset was at least this when the reply was received, because the reply was not sent later.
    pub(super) fn floor(&self) -> Bound {
        let at_ns = i128::from(self.received.0);
        Bound {
            at_ns,
            offset_ns: i128::from(self.remote_sent.0) - at_ns - ROUNDING_NS,
        }
    }

    /// How long both messages were under way together, in ns; 0 if drift makes it seem negative.
    pub(super) fn round_trip_ns(&self) -> u64 {
        let held_ns = self.remote_sent.0.saturating_sub(self.remote_received.0);
        let total_ns = self.received.0.saturating_sub(self.sent.0);
        total_ns.saturating_sub(held_ns)
    }
}

/// The greatest relative drift of two clocks, in ns per second: 200 ppm, two quartz clocks of 100 ppm each. Clocks that
/// drift more contradict themselves: the estimate begins anew repeatedly, and the counted resets show it.
pub const MAX_DRIFT_PPB: i64 = 200_000;

/// By how much the drift changes per second at most, in ppb. Quartz clocks change by up to 0.5 ppm per kelvin far from
/// room temperature, and warm up by up to 0.1 K/s after start: 50 ppb/s. In flight it is a few ppb/s.
pub const MAX_DRIFT_CHANGE_PPB_PER_S: i64 = 50;

/// By how much the drift may jump about its slowly changing value at any time, in ppb. An NTP daemon that keeps a clock
/// in step corrects its frequency abruptly, by less than 1 ppm.
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

/// By how many ns an offset can rise in `duration_ns`, which is not negative, when the slow part of the drift at one
/// end of that time is at most `drift_ppb`. Negative if it falls for certain. How far it can fall is the same with
/// `-drift_ppb`.
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

/// The slow part of the drift half way through a time of `duration_ns` > 0 in which the offset rose by at least
/// `rise_ns`: at least this many ppb, when it changes at a steady pace.
pub(super) fn least_drift_ppb(rise_ns: i128, duration_ns: i128) -> i128 {
    (rise_ns * BILLION).div_euclid(duration_ns) - JITTER
}

fn ceil_div(dividend: i128, divisor: i128) -> i128 {
    -(-dividend).div_euclid(divisor)
}
