//! [`Samples`]: samples that wait for one client: all in order while its line is good, else the newest of each channel,
//! but lines of logs, which go first and in order.

use std::collections::{BTreeMap, VecDeque};
use std::ops::Bound;
use std::time::Duration;

use ipc_types::MonotonicNs;

use super::channels::Sample;
use crate::event::ChannelId;

/// Bytes that wait in order. With the 16 KiB that are ready and as many in the kernel it is half a second at 200 kB/s.
pub const MAX_BYTES: usize = 64 << 10;

/// How long the oldest waits in order.
pub const MAX_WAIT: Duration = Duration::from_millis(250);

/// Lines of logs that wait. At the bound the oldest is left out.
pub const MAX_LINES: usize = 256;

/// Samples that wait for one client: in order while its line is good, else the newest of each channel.
#[derive(Debug, Default)]
pub(crate) struct Samples {
    lines: VecDeque<Sample>,
    ordered: VecDeque<(Sample, MonotonicNs)>,
    bytes: usize,
    /// The newest of each channel, while the line is too slow: as many as there are channels at most.
    newest: BTreeMap<ChannelId, Sample>,
    /// The channel of the one that was taken last, so that each has its turn.
    last: Option<ChannelId>,
    /// How many were replaced by newer ones.
    left_out: u64,
}

impl Samples {
    /// Takes a sample.
    pub fn push(&mut self, sample: Sample, now: MonotonicNs) {
        if sample.is_line {
            if self.lines.len() == MAX_LINES {
                self.lines.pop_front();
                self.left_out += 1;
            }
            self.lines.push_back(sample);
            return;
        }
        let waits = self.ordered.front().map(|(_, since)| now.since(*since));
        let is_slow = !self.newest.is_empty()
            || self.bytes + sample.bytes.len() > MAX_BYTES && !self.ordered.is_empty()
            || waits.is_some_and(|waits| waits > MAX_WAIT);
        if !is_slow {
            self.bytes += sample.bytes.len();
            self.ordered.push_back((sample, now));
            return;
        }
        for (old, _) in std::mem::take(&mut self.ordered) {
            self.replace(old);
        }
        self.bytes = 0;
        self.replace(sample);
    }

    fn replace(&mut self, sample: Sample) {
        let replaced = self.newest.insert(sample.channel, sample);
        self.left_out += u64::from(replaced.is_some());
    }

    /// The sample to send next.
    pub fn next(&mut self) -> Option<Sample> {
        if let Some(line) = self.lines.pop_front() {
            return Some(line);
        }
        if let Some((sample, _)) = self.ordered.pop_front() {
            self.bytes -= sample.bytes.len();
            return Some(sample);
        }
        let after = self.last.map_or(Bound::Unbounded, Bound::Excluded);
        let mut behind = self.newest.range((after, Bound::Unbounded));
        let channel = *behind.next().or_else(|| self.newest.iter().next())?.0;
        self.last = Some(channel);
        self.newest.remove(&channel)
    }

    /// Drops those of a channel.
    pub fn forget(&mut self, channel: ChannelId) {
        self.newest.remove(&channel);
        self.lines.retain(|sample| sample.channel != channel);
        self.ordered.retain(|(sample, _)| sample.channel != channel);
        self.bytes = self
            .ordered
            .iter()
            .map(|(sample, _)| sample.bytes.len())
            .sum();
    }

    /// How many were left out.
    pub fn left_out(&self) -> u64 {
        self.left_out
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    fn sample(channel: u32, number: u64, bytes: usize) -> Sample {
        Sample {
            channel: ChannelId(channel),
            log_time_unix_ns: number,
            bytes: Arc::from(vec![0; bytes]),
            is_line: false,
        }
    }

    fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    fn drain(samples: &mut Samples) -> Vec<(u32, u64)> {
        std::iter::from_fn(|| samples.next())
            .map(|one| (one.channel.0, one.log_time_unix_ns))
            .collect()
    }

    #[test]
    fn all_come_in_order_up_to_64_kib() {
        let mut samples = Samples::default();
        for number in 0..64 {
            samples.push(sample(number as u32 % 2, number, 1 << 10), at(0));
        }
        let expected: Vec<_> = (0..64).map(|number| (number as u32 % 2, number)).collect();
        assert_eq!(drain(&mut samples), expected);
        for number in 0..65 {
            samples.push(sample(number as u32 % 2, number, 1 << 10), at(0));
        }
        assert_eq!(samples.left_out(), 63);
        assert_eq!(drain(&mut samples), [(0, 64), (1, 63)]);
        // Then in order again.
        samples.push(sample(0, 65, 1), at(0));
        samples.push(sample(0, 66, 1), at(0));
        assert_eq!(drain(&mut samples), [(0, 65), (0, 66)]);
        // A large one by itself is one.
        samples.push(sample(0, 1, MAX_BYTES + 1), at(0));
        assert_eq!(drain(&mut samples), [(0, 1)]);
    }

    #[test]
    fn all_come_in_order_up_to_250_ms() {
        let mut samples = Samples::default();
        for (number, ms) in [(1, 0), (2, 100), (3, 250)] {
            samples.push(sample(1, number, 1), at(ms));
        }
        assert_eq!(samples.left_out(), 0);
        samples.push(sample(1, 4, 1), at(251));
        samples.push(sample(2, 5, 1), at(251));
        assert_eq!(
            (samples.left_out(), drain(&mut samples)),
            (3, vec![(1, 4), (2, 5)])
        );
    }

    #[test]
    fn each_channel_has_its_turn_on_a_slow_line() {
        let mut samples = Samples::default();
        samples.push(sample(1, 0, 1), at(0));
        let mut got = Vec::new();
        for number in 1..=6 {
            for channel in 1..=3 {
                samples.push(sample(channel, number, 1), at(1000 * number));
            }
            got.push(samples.next().unwrap().channel.0);
        }
        assert_eq!(got, [1, 2, 3, 1, 2, 3]);
    }

    #[test]
    fn lines_come_in_order_though_the_line_is_slow() {
        let mut samples = Samples::default();
        let line = |number| Sample {
            is_line: true,
            ..sample(2, number, 1)
        };
        for number in 0..4 {
            samples.push(sample(1, number, 1), at(1000 * number));
            samples.push(line(number), at(1000 * number));
        }
        samples.push(sample(3, 0, 1), at(4000));
        let expected = [(2, 0), (2, 1), (2, 2), (2, 3), (1, 3), (3, 0)];
        assert_eq!(drain(&mut samples), expected);
        let left_out = samples.left_out();
        for number in 0..=MAX_LINES as u64 {
            samples.push(line(number), at(0));
        }
        let lines = drain(&mut samples);
        assert_eq!((lines.len(), lines[0]), (MAX_LINES, (2, 1)));
        assert_eq!(samples.left_out(), left_out + 1);
        samples.push(line(1), at(0));
        samples.forget(ChannelId(2));
        assert!(drain(&mut samples).is_empty());
    }

    #[test]
    fn a_channel_can_be_forgotten() {
        let mut samples = Samples::default();
        samples.push(sample(1, 1, 10), at(0));
        samples.push(sample(2, 2, 20), at(0));
        samples.forget(ChannelId(1));
        assert_eq!(samples.bytes, 20);
        samples.push(sample(1, 3, 1), at(1000));
        samples.forget(ChannelId(2));
        assert_eq!(drain(&mut samples), [(1, 3)]);
    }
}
