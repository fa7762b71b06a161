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

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use ipc_types::configuration::StatusConfiguration;
    use ipc_types::{Domain, RobotId, StatusModule, Waiter};

    use super::*;

    #[test]
    fn who_comes_has_the_whole_text_and_another_one_when_it_changes() {
        let ipc = Ipc::join(&Domain::isolated(), RobotId::DEFAULT, "test").unwrap();
        let text = |value: char| ConfigurationText::new(String::from(value).repeat(60_000));
        let (first, second) = (text('a'), text('b'));
        let mut port = ConfigurationPort::<StatusModule>::open(&ipc, first.clone()).unwrap();
        let mut now = MonotonicNs::now();
        port.publish(now);
        assert_eq!(port.deadline(), None, "nobody reads");
        let mut reader = ipc.subscriber::<StatusConfiguration>().unwrap();
        // The publisher notices it within a wait, which goes on to its limit.
        let limit = Some(Duration::from_millis(20));
        while port.deadline().is_none() {
            Waiter::new()
                .wait(&mut [((), port.source())], limit)
                .unwrap();
            port.publish(now);
        }
        // Which text, as which one it is sent, and whether it is sent.
        for (text, revision, is_sent) in [(&first, 1, true), (&first, 1, false), (&second, 2, true)]
        {
            port.replace(text.clone());
            let mut pieces = Vec::new();
            loop {
                port.publish(now);
                let take = |piece: &StatusConfiguration| {
                    assert!(piece.0.published_ns <= now.0);
                    let mut expected = text.piece(pieces.len(), revision);
                    (expected.sequence, expected.epoch_ns) = (piece.0.sequence, piece.0.epoch_ns);
                    expected.published_ns = piece.0.published_ns;
                    assert_eq!(piece.0, expected);
                    pieces.push(piece.0.published_ns);
                };
                reader.drain(take).unwrap();
                let Some(next) = port.deadline() else { break };
                now = next;
            }
            assert_eq!(pieces.len(), if is_sent { text.pieces() } else { 0 });
            now = now + Duration::from_secs(1);
        }
    }
}
