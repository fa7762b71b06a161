//! What every way has: a sending and a receiving end, and the mark that a sample carries.

use std::time::Duration;

use anyhow::Result;
use ipc_types::payload::HeroTelemetry;

/// Longest time that a receiver waits for a sample before it gives up.
pub const TIMEOUT: Duration = Duration::from_secs(20);

/// The Unix socket of a way that has one, in the folder that both processes run in and no other process uses.
pub const SOCKET: &str = "socket";

/// Sends one sample; never waits for the receiver.
pub type Send = Box<dyn FnMut(&HeroTelemetry) -> Result<()>>;

/// Waits, in the way of the peer, until there is a sample, and hands on the marks of all that are there, each as soon
/// as its values can be read.
pub type Receive = Box<dyn FnMut(&mut dyn FnMut(Mark)) -> Result<()>>;

/// What tells one sample from another, whatever else a peer carries of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mark {
    /// Counts from 1; a gap is a loss.
    pub index: u64,
    /// `CLOCK_MONOTONIC` just before the sample was given to the peer, ns.
    pub sent_ns: u64,
}

impl Mark {
    /// Writes the mark into `sample`. The moment lies in `dsp_time_s`, the one moment that a relay does not translate;
    /// a double is right to two nanoseconds for months.
    pub fn stamp(self, sample: &mut HeroTelemetry) {
        sample.source_sequence = self.index;
        sample.dsp_time_s = self.sent_ns as f64 * 1e-9;
    }

    /// The mark of `sample`.
    pub fn of(sample: &HeroTelemetry) -> Mark {
        Mark {
            index: sample.source_sequence,
            sent_ns: (sample.dsp_time_s * 1e9).round() as u64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_moment_in_a_sample_is_right_to_two_nanoseconds_for_months() {
        for sent_ns in [1, 1_234_567_891, 90 * 86_400 * 1_000_000_000 + 1] {
            let mut sample = HeroTelemetry::default();
            Mark { index: 7, sent_ns }.stamp(&mut sample);
            let mark = Mark::of(&sample);
            assert!(mark.index == 7 && mark.sent_ns.abs_diff(sent_ns) <= 2);
        }
    }
}
