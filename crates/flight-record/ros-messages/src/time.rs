//! Times of messages.

use ipc_types::MonotonicNs;

/// How to turn host monotonic times into Unix times: Unix time minus monotonic time, ns. A step of the wall clock
/// changes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnixOffset(pub i64);

impl UnixOffset {
    /// The Unix time of `time`, ns; at the ends of the range when it lies beyond.
    pub fn unix_ns(self, time: MonotonicNs) -> i64 {
        let monotonic_ns = i64::try_from(time.0).unwrap_or(i64::MAX);
        self.0.saturating_add(monotonic_ns)
    }
}
