//! [`ConfigurationPort`]: the topic `<process>/configuration`: what the process runs with, as the text of its file. The
//! text is made at the start, and by a thread when it changes: a wake of the process costs a look at the number of
//! subscribers.

use ipc_types::configuration::ConfigurationText;
use ipc_types::module::OfModule;
use ipc_types::payload::ConfigurationPiece;
use ipc_types::{Ipc, MonotonicNs, OpenError, Source, Topic};

use crate::pieces::PiecePort;

/// The publisher of the configuration of the module `M`.
pub struct ConfigurationPort<M>
where
    OfModule<M, ConfigurationPiece>: Topic,
{
    port: PiecePort<OfModule<M, ConfigurationPiece>>,
    text: ConfigurationText,
    /// Counts the texts of this process from 1.
    revision: u32,
}

impl<M> ConfigurationPort<M>
where
    OfModule<M, ConfigurationPiece>: Topic,
{
    /// Opens the topic with the text of the start.
    ///
    /// # Errors
    /// See [`OpenError`]; another process may publish it.
    pub fn open(ipc: &Ipc, text: ConfigurationText) -> Result<Self, OpenError> {
        Ok(ConfigurationPort {
            port: PiecePort::open(ipc)?,
            text,
            revision: 1,
        })
    }

    /// What to wait for.
    pub fn source(&mut self) -> &mut dyn Source {
        self.port.source()
    }

    /// The process runs with another configuration now.
    pub fn replace(&mut self, text: ConfigurationText) {
        if text != self.text {
            self.text = text;
            self.revision += 1;
        }
    }

    /// Publishes what is due now.
    pub fn publish(&mut self, now: MonotonicNs) {
        let (text, revision) = (&self.text, self.revision);
        let whole = (u64::from(revision), text.pieces());
        self.port.publish(now, whole, |index| {
            let mut piece = text.piece(index, revision);
            piece.published_ns = now.0;
            Some(OfModule::new(piece))
        });
    }

    /// When [`ConfigurationPort::publish`] has something to do.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.port.deadline()
    }
}
