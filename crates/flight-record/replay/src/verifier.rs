//! [`Verifier`]: the journals of a robot to a verdict.

use bridge::BridgeConfig;
use ipc_types::payload::{BridgeJournal, SharedStruct, StatusJournal};
use ipc_types::{MonotonicNs, Topic};
use status::config::Config;
use status::journal::Snapshot;

use crate::bridge_core::BridgeCore;
use crate::kept::{KeptFlight, NotKept, Streams};
use crate::track::Track;
use crate::verdict::Comparison;

/// Drives the cores of one robot from its journals, and compares what they say with what was recorded.
///
/// A pure value: it is given the samples of the journals' topics in the order in which they were recorded.
#[derive(Debug)]
pub struct Verifier {
    bridge: Track<BridgeCore>,
    status: Track<Snapshot>,
}

impl Default for Verifier {
    fn default() -> Self {
        Verifier::new()
    }
}

impl Verifier {
    /// With the configuration that each journal has.
    pub fn new() -> Verifier {
        Verifier {
            bridge: Track::new(None),
            status: Track::new(None),
        }
    }

    /// The bridge with another configuration: the differences are what it would have done. The world around it, the
    /// DSP's answers included, stays as it was recorded.
    #[must_use]
    pub fn against(mut self, config: BridgeConfig) -> Verifier {
        self.bridge = Track::new(Some(config));
        self
    }

    /// Status with another configuration, in the same way.
    #[must_use]
    pub fn against_status(mut self, config: Config) -> Verifier {
        self.status = Track::new(Some(config));
        self
    }

    /// The recording has samples from these moments on, of bridge and status: when the first of each was received.
    #[must_use]
    pub fn since(mut self, [bridge, status]: [MonotonicNs; 2]) -> Verifier {
        self.bridge.since(bridge);
        self.status.since(status);
        self
    }

    /// Takes a sample of the topic with this key, such as `bridge/journal`; one that is no journal, or has another
    /// size, is ignored.
    pub fn take(&mut self, key: &str, sample: &[u8]) {
        if key == BridgeJournal::KEY
            && let Some(piece) = BridgeJournal::from_bytes(sample)
        {
            self.bridge.take(&piece);
        } else if key == StatusJournal::KEY
            && let Some(piece) = StatusJournal::from_bytes(sample)
        {
            self.status.take(&piece);
        }
    }

    /// Takes a whole kept flight.
    ///
    /// # Errors
    /// The bytes are none that this version reads.
    pub fn take_kept(&mut self, file: &[u8]) -> Result<(), NotKept> {
        let kept = KeptFlight::read(file)?;
        let mut streams = Streams::of(kept.received);
        self.bridge.take_kept(kept.bridge, &mut streams);
        self.status.take_kept(kept.status, &mut streams);
        Ok(())
    }

    /// What came of it.
    pub fn finish(self) -> Comparison {
        Comparison {
            bridge: self.bridge.finish(),
            status: self.status.finish(),
        }
    }
}
