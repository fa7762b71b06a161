//! [`VirtualTime`]: drives a core that is given the time, without a clock and without waiting.

use std::time::Duration;

use ipc_types::MonotonicNs;

/// The present of a core whose every call gets the time and whose every answer is when it wants to be called next.
///
/// ```
/// use std::time::Duration;
/// use ipc_fixtures::VirtualTime;
/// use ipc_types::MonotonicNs;
///
/// // A belt that reports once a second.
/// let mut reports = Vec::new();
/// let (mut time, mut due) = (VirtualTime::new(), MonotonicNs(0));
/// let begin = time.now();
/// time.run(Duration::from_secs(3600), |now| {
///     if now >= due {
///         reports.push(now.since(begin));
///         due = now + Duration::from_secs(1);
///     }
///     Some(due)
/// });
/// assert_eq!(reports.len(), 3600); // an hour, at once
/// ```
#[derive(Clone, Copy, Debug)]
pub struct VirtualTime {
    now: MonotonicNs,
}

impl VirtualTime {
    /// Begins long after the machine's start, so that a core may look back.
    pub fn new() -> VirtualTime {
        let begin = MonotonicNs::default() + Duration::from_secs(100_000);
        VirtualTime { now: begin }
    }

    /// The present.
    pub fn now(&self) -> MonotonicNs {
        self.now
    }

    /// Lets time pass without calling anybody.
    pub fn pass(&mut self, length: Duration) -> MonotonicNs {
        self.now = self.now + length;
        self.now
    }

    /// Lets `length` pass: calls `core` now, and then each time that it has asked for before the end. A core that wants
    /// to be called at once is called a nanosecond later.
    pub fn run(
        &mut self,
        length: Duration,
        mut core: impl FnMut(MonotonicNs) -> Option<MonotonicNs>,
    ) {
        let end = self.now + length;
        while let Some(next) = core(self.now) {
            let next = next.max(MonotonicNs(self.now.0.saturating_add(1)));
            if next >= end {
                break;
            }
            self.now = next;
        }
        self.now = end;
    }
}

impl Default for VirtualTime {
    fn default() -> Self {
        VirtualTime::new()
    }
}
