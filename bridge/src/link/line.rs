//! [`Line`]: what is known of the line between the DSP and the bridge, and from it [`Sent`]: when a byte left the DSP.

use std::time::Duration;

use ipc_types::MonotonicNs;
use serde::{Deserialize, Serialize};

/// The line of an open port; all zero when nothing is known of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Line {
    /// How long it takes for a byte.
    pub byte: Duration,
    /// For how long its adapter keeps bytes back at most.
    pub adapter: Duration,
}

/// When a byte left the DSP.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sent {
    /// At the latest.
    pub by: MonotonicNs,
    /// By how much earlier it may have been, unless the bridge was held up.
    pub uncertainty: Duration,
}

impl Line {
    /// How long it takes for so many bytes.
    pub fn time_of(self, len: usize) -> Duration {
        self.byte * u32::try_from(len).unwrap_or(u32::MAX)
    }

    /// When the byte left the DSP that was read at `now` with `after` bytes behind it, which the line carried after it.
    /// What was read before, at `before`, did not have it: a line that is faster than it says, such as a
    /// pseudo-terminal, makes no byte older than that.
    pub(super) fn sent(self, now: MonotonicNs, after: usize, before: MonotonicNs) -> Sent {
        Sent {
            by: (now - self.time_of(after)).max(before.min(now)),
            uncertainty: self.adapter,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_read_behind_a_byte_left_the_dsp_after_it_and_the_read_before_did_not_have_it() {
        let line = Line {
            byte: Duration::from_micros(100),
            adapter: Duration::from_millis(1),
        };
        let us = |us: u64| MonotonicNs(us * 1_000);
        for (after, before, by) in [
            (0, 0, 20_000),
            (30, 0, 17_000),
            (30, 18_500, 18_500),
            (4_000, 0, 0),
            (0, 30_000, 20_000),
        ] {
            let sent = line.sent(us(20_000), after, us(before));
            assert_eq!(sent.by, us(by), "{after} after {before}");
            assert_eq!(sent.uncertainty, Duration::from_millis(1));
        }
        assert_eq!(Line::default().sent(us(7), 90, us(0)).by, us(7));
    }
}
