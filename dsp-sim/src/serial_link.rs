//! The serial link's pace: which bytes have gone through at a given time.
//!
//! Pure arithmetic on simulated time; it holds no bytes. What damages them on purpose ([`crate::faults`]) gets them
//! at the far end of a [`Lane`].

use std::num::NonZeroU32;
use std::time::Duration;

/// Bits on the serial link for each byte: start, eight data, stop.
const BITS_PER_BYTE: u128 = 10;
/// Bytes that are delivered together when more are on the way: the trigger level of a usual UART's receive queue. The
/// last byte of a burst is on time; those before it come up to 15 bytes late, as they do from the real thing.
const BURST: usize = 16;

/// One direction of the serial link.
///
/// A sender calls [`begin`](Self::begin), then [`through`](Self::through) and [`take`](Self::take) as
/// time goes on, and [`rest`](Self::rest) when it has no more.
#[derive(Clone, Debug)]
pub struct Lane {
    baud: Option<NonZeroU32>,
    /// When the byte began that is counted as the first.
    busy_since: Option<Duration>,
    /// Bytes taken since then.
    taken: u64,
}

impl Lane {
    /// A lane of so many bits a second; without a figure, every byte goes through at once.
    pub fn new(baud: Option<NonZeroU32>) -> Lane {
        Lane {
            baud,
            busy_since: None,
            taken: 0,
        }
    }

    /// Bytes wait from `now` on. Nothing changes when the lane is busy already.
    pub fn begin(&mut self, now: Duration) {
        if self.busy_since.is_none() {
            self.busy_since = Some(now);
            self.taken = 0;
        }
    }

    /// No byte waits any more.
    pub fn rest(&mut self) {
        self.busy_since = None;
    }

    /// How many bytes that were not taken have gone through at `now`; as many as there are when the lane is not paced.
    pub fn through(&self, now: Duration) -> usize {
        let Some(since) = self.busy_since else {
            return 0;
        };
        let Some(baud) = self.baud else {
            return usize::MAX;
        };
        let elapsed_ns = now.saturating_sub(since).as_nanos();
        let bytes = elapsed_ns * u128::from(baud.get()) / (BITS_PER_BYTE * 1_000_000_000);
        usize::try_from(bytes.saturating_sub(self.taken.into())).unwrap_or(usize::MAX)
    }

    /// Counts `count` bytes as taken.
    pub fn take(&mut self, count: usize) {
        self.taken = self.taken.saturating_add(count as u64);
    }

    /// When the next of `waiting` bytes should be taken; `None` if the lane rests or none waits.
    pub fn next_deadline(&self, waiting: usize) -> Option<Duration> {
        self.through_at(waiting.min(BURST).checked_sub(1)?)
    }

    /// When the byte goes through before which `index` others that were not taken do; `None` if the lane rests.
    pub fn through_at(&self, index: usize) -> Option<Duration> {
        let since = self.busy_since?;
        let Some(baud) = self.baud else {
            return Some(since);
        };
        let count = u128::from(self.taken) + index as u128 + 1;
        let baud = u128::from(baud.get());
        let elapsed_ns = (count * BITS_PER_BYTE * 1_000_000_000).div_ceil(baud);
        let elapsed_ns = u64::try_from(elapsed_ns).unwrap_or(u64::MAX);
        Some(since.saturating_add(Duration::from_nanos(elapsed_ns)))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn lane(baud: u32) -> Lane {
        Lane::new(NonZeroU32::new(baud))
    }

    fn us(count: u64) -> Duration {
        Duration::from_micros(count)
    }

    #[test]
    fn a_byte_is_through_ten_bits_after_it_began() {
        let mut lane = lane(10_000);
        assert_eq!(lane.through(us(5)), 0);
        assert_eq!(lane.next_deadline(3), None, "it rests");
        lane.begin(us(500));
        for (now, through) in [(500, 0), (1_499, 0), (1_500, 1), (2_499, 1), (2_500, 2)] {
            assert_eq!(lane.through(us(now)), through, "at {now} µs");
        }
        assert_eq!(lane.next_deadline(1), Some(us(1_500)));
        assert_eq!(lane.next_deadline(3), Some(us(3_500)));
        assert_eq!(lane.next_deadline(500), Some(us(16_500)), "in bursts");
        assert_eq!(lane.next_deadline(0), None);

        lane.take(2);
        assert_eq!(lane.through(us(2_500)), 0);
        assert_eq!(lane.next_deadline(1), Some(us(3_500)));
        // Going on without a pause, time does not start again.
        lane.begin(us(2_600));
        assert_eq!(lane.next_deadline(1), Some(us(3_500)));
        lane.rest();
        lane.begin(us(9_000));
        assert_eq!(lane.next_deadline(1), Some(us(10_000)));
    }

    #[test]
    fn without_a_speed_everything_is_through_at_once() {
        let mut lane = Lane::new(None);
        assert_eq!(lane.through(us(7)), 0, "it rests");
        lane.begin(us(7));
        assert_eq!(lane.through(us(7)), usize::MAX);
        assert_eq!(lane.next_deadline(1), Some(us(7)));
    }

    proptest! {
        /// At its own deadline a lane has let through what the deadline promised, and one nanosecond before it has not.
        #[test]
        fn deadlines_keep_their_word(
            baud in 50_u32..4_000_000,
            start_ns in 0_u64..1 << 40,
            taken in 0_usize..1_000_000,
            waiting in 1_usize..200,
        ) {
            let mut lane = lane(baud);
            lane.begin(Duration::from_nanos(start_ns));
            lane.take(taken);
            let deadline = lane.next_deadline(waiting).unwrap();
            let burst = waiting.min(BURST);
            prop_assert_eq!(lane.through(deadline), burst);
            prop_assert_eq!(lane.through(deadline - Duration::from_nanos(1)), burst - 1);
            for index in 0..burst {
                prop_assert_eq!(lane.through(lane.through_at(index).unwrap()), index + 1);
            }
        }
    }
}
