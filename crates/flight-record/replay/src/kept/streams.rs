//! [`Streams`]: what the inputs of a kept flight refer to, so that it is there once.

use ipc_types::payload::{DspTelemetry, SharedStruct};
use serde::{Deserialize, Serialize};

/// Samples of the bridge among which the one is looked for that status took: 20 s of a flight.
const AHEAD: usize = 1000;

/// The bytes of the line, and the samples that the bridge made of them.
#[derive(Debug, Default)]
pub struct Streams {
    received: Vec<u8>,
    /// How many of these were taken.
    taken: usize,
    samples: Vec<DspTelemetry>,
    /// The sample that status takes next, if it loses none.
    next: usize,
    /// Samples that status took and the bridge has not made.
    unknown: u64,
}

/// A sample of the bridge as status took it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SampleTaken {
    /// Samples of the bridge before it that were not taken.
    skipped: u64,
    /// `sequence` without the number of the sample.
    offset: u64,
    epoch_ns: u64,
}

impl Streams {
    /// The streams of a kept file.
    pub fn of(received: Vec<u8>) -> Streams {
        Streams {
            received,
            ..Streams::default()
        }
    }

    /// The bytes of the line.
    pub fn into_received(self) -> Vec<u8> {
        self.received
    }

    /// The line had these bytes.
    pub fn receive(&mut self, bytes: &[u8]) {
        self.received.extend_from_slice(bytes);
    }

    /// The next bytes of the line; `None` if there are not so many.
    pub fn take_received(&mut self, len: usize) -> Option<&[u8]> {
        let rest = self.received.get(self.taken..)?;
        let bytes = rest.get(..len)?;
        self.taken += len;
        Some(bytes)
    }

    /// The bridge made a sample, without `sequence` and `epoch_ns`.
    pub fn made(&mut self, sample: &DspTelemetry) {
        self.samples.push(*sample);
    }

    /// What stands for a sample that status took; `None` if the bridge has not made it.
    pub fn find(&mut self, taken: &DspTelemetry) -> Option<SampleTaken> {
        let bare = DspTelemetry {
            sequence: 0,
            epoch_ns: 0,
            ..*taken
        };
        let is_it = |made: &DspTelemetry| made.bytes() == bare.bytes();
        let rest = self.samples.get(self.next..).unwrap_or_default();
        let Some(skipped) = rest.iter().take(AHEAD).position(is_it) else {
            self.unknown += 1;
            return None;
        };
        let index = self.next + skipped;
        self.next = index + 1;
        Some(SampleTaken {
            skipped: skipped as u64,
            offset: taken.sequence.wrapping_sub(index as u64),
            epoch_ns: taken.epoch_ns,
        })
    }

    /// How many samples the bridge has not made.
    pub fn unknown(&self) -> u64 {
        self.unknown
    }

    /// The sample that it stands for; `None` if the bridge has not made it.
    pub fn take_sample(&mut self, taken: SampleTaken) -> Option<DspTelemetry> {
        let index = self
            .next
            .checked_add(usize::try_from(taken.skipped).ok()?)?;
        let made = self.samples.get(index)?;
        self.next = index + 1;
        Some(DspTelemetry {
            sequence: taken.offset.wrapping_add(index as u64),
            epoch_ns: taken.epoch_ns,
            ..*made
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(number: u64, sequence: u64, epoch_ns: u64) -> DspTelemetry {
        DspTelemetry {
            received_ns: number,
            sequence,
            epoch_ns,
            ..DspTelemetry::default()
        }
    }

    #[test]
    fn samples_are_found_after_losses_and_restarts_and_a_foreign_one_is_not() {
        let (mut keeping, mut reading) = (Streams::default(), Streams::default());
        for number in 1..=5 {
            keeping.made(&sample(number, 0, 0));
            reading.made(&sample(number, 0, 0));
        }
        assert_eq!(keeping.find(&sample(9, 1, 7)), None);
        for taken in [sample(1, 1, 7), sample(4, 4, 7), sample(5, 1, 8)] {
            let stands = keeping.find(&taken).unwrap();
            assert_eq!(reading.take_sample(stands), Some(taken));
        }
        assert_eq!(keeping.find(&sample(1, 1, 7)), None, "it is taken");
        assert_eq!(keeping.unknown(), 2);
        let beyond = SampleTaken {
            skipped: u64::MAX,
            offset: 0,
            epoch_ns: 0,
        };
        assert_eq!(reading.take_sample(beyond), None);
    }

    #[test]
    fn bytes_are_taken_as_they_were_received() {
        let mut streams = Streams::of(b"abcde".to_vec());
        assert_eq!(streams.take_received(2), Some(&b"ab"[..]));
        assert_eq!(streams.take_received(usize::MAX), None);
        assert_eq!(streams.take_received(3), Some(&b"cde"[..]));
        assert_eq!(streams.take_received(1), None);
    }
}
