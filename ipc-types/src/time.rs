//! Host time: nanoseconds of `CLOCK_MONOTONIC`, comparable between the processes of one machine.

use std::fmt;
use std::ops::{Add, Sub};
use std::time::Duration;

/// A moment of the host's `CLOCK_MONOTONIC`, in nanoseconds since boot. Not affected by changes of the wall clock.
#[derive(
    Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
)]
pub struct MonotonicNs(pub u64);

impl MonotonicNs {
    /// The present moment. The only place where this crate reads a clock; pure code is given its result.
    pub fn now() -> MonotonicNs {
        let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
        MonotonicNs(now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64)
    }

    /// How long the machine has been suspended since its boot: `CLOCK_BOOTTIME` − `CLOCK_MONOTONIC`, which stands still
    /// meanwhile. Never more than it truly was; less by the time for which the process had no processor between two
    /// looks at a clock.
    pub fn suspended() -> Duration {
        let boot = rustix::time::clock_gettime(rustix::time::ClockId::Boottime);
        let boot = Duration::new(boot.tv_sec as u64, boot.tv_nsec as u32);
        boot.saturating_sub(Duration::from_nanos(MonotonicNs::now().0))
    }

    /// This time in the kernel's form.
    pub(crate) fn timespec(self) -> rustix::time::Timespec {
        rustix::time::Timespec {
            tv_sec: (self.0 / 1_000_000_000) as i64,
            tv_nsec: (self.0 % 1_000_000_000) as i64,
        }
    }

    /// How long ago `earlier` was; zero if it lies in the future.
    pub fn since(self, earlier: MonotonicNs) -> Duration {
        Duration::from_nanos(self.0.saturating_sub(earlier.0))
    }
}

/// As nanoseconds: more than a `u64` has are as many as it has.
fn nanos(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

/// Stops at the largest moment.
impl Add<Duration> for MonotonicNs {
    type Output = MonotonicNs;

    fn add(self, duration: Duration) -> MonotonicNs {
        MonotonicNs(self.0.saturating_add(nanos(duration)))
    }
}

/// Stops at the boot.
impl Sub<Duration> for MonotonicNs {
    type Output = MonotonicNs;

    fn sub(self, duration: Duration) -> MonotonicNs {
        MonotonicNs(self.0.saturating_sub(nanos(duration)))
    }
}

impl fmt::Debug for MonotonicNs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}", Duration::from_nanos(self.0))
    }
}
