//! What every way has: two ends, and the mark that a sample carries.

use std::time::Duration;

use anyhow::Result;
use ipc_types::payload::HeroTelemetry;

/// Longest time that a receiver waits for a sample before it gives up.
pub const PATIENCE: Duration = Duration::from_secs(20);

/// What tells one sample from another, whatever else a peer carries of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mark {
    /// Counts from 1; a gap is a loss. It lies in `source_sequence`.
    pub index: u64,
    /// `CLOCK_MONOTONIC` just before the sample was given to the peer, ns. It lies in `published_ns`.
    pub sent_ns: u64,
}

impl Mark {
    /// The mark of `sample`.
    pub fn of(sample: &HeroTelemetry) -> Mark {
        Mark {
            index: sample.source_sequence,
            sent_ns: sample.published_ns,
        }
    }
}

/// The sending end.
pub trait Sender {
    /// Sends `sample`; never waits for the receiver.
    fn send(&mut self, sample: &HeroTelemetry) -> Result<()>;
}

/// The receiving end.
pub trait Receiver {
    /// Waits, in the way of the peer, until there is a sample, and hands on the marks of all that are there, each as soon
    /// as its values can be read.
    fn receive(&mut self, take: &mut dyn FnMut(Mark)) -> Result<()>;
}
