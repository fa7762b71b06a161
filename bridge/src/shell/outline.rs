//! The topic `bridge/outline`: the pieces that are [due](Rounds) go out.

use ipc_types::payload::BridgeOutline;
use ipc_types::{Ipc, MonotonicNs, OpenError, Publisher, Source};

use crate::outline::{Outline, Rounds};

/// The publisher of the outline.
pub struct OutlinePort {
    /// Its place for former generations makes it large, as that of a journal.
    publisher: Box<Publisher<BridgeOutline>>,
    rounds: Rounds,
}

impl OutlinePort {
    /// Opens the topic.
    pub fn open(ipc: &Ipc) -> Result<OutlinePort, OpenError> {
        Ok(OutlinePort {
            publisher: Box::new(ipc.publisher()?),
            rounds: Rounds::default(),
        })
    }

    /// What to wait for.
    pub fn source(&mut self) -> &mut dyn Source {
        &mut *self.publisher
    }

    /// Publishes what is due now.
    pub fn publish(&mut self, outline: &Outline<'_>, now: MonotonicNs) {
        let listeners = (self.publisher.subscribers(), self.publisher.joins());
        let held = (outline.number, outline.pieces());
        let due = self.rounds.due(now, held, listeners);
        for mut piece in due.filter_map(|index| outline.piece(index)) {
            piece.published_ns = now.0;
            let published = self.publisher.publish_batched(|sample| *sample = piece);
            if let Err(error) = published {
                // It comes again with the next round.
                tracing::warn!(%error, "a piece of the outline was not published");
                break;
            }
        }
        self.publisher.end_batch();
    }

    /// When [`OutlinePort::publish`] has something to do.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.rounds.deadline()
    }
}
