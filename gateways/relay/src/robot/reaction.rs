//! [`Reaction`]: what the robot does when a station is lost whose request is under way.

use ipc_types::payload::MovementData;
use ipc_types::{Client, Ipc, OpenError, Source, fresh_request_id};

use crate::config::LinkLoss;

/// Holds or lands, as it was configured.
pub struct Reaction {
    link_loss: LinkLoss,
    client: Client<MovementData>,
}

impl Reaction {
    /// Nothing where nothing is to be done.
    ///
    /// # Errors
    ///
    /// When there is a bridge, and its service cannot be opened.
    pub fn open(ipc: &Ipc, link_loss: LinkLoss) -> Result<Option<Reaction>, OpenError> {
        match link_loss {
            LinkLoss::Continue => Ok(None),
            LinkLoss::Hold | LinkLoss::Land => Ok(Some(Reaction {
                link_loss,
                client: ipc.client()?,
            })),
        }
    }

    /// What to wait for.
    pub fn client(&mut self) -> &mut dyn Source {
        &mut self.client
    }

    /// Ends the movement that is under way.
    pub fn act(&mut self) {
        let id = fresh_request_id();
        let request = match self.link_loss {
            LinkLoss::Land => MovementData::land(id).preempting(),
            LinkLoss::Hold | LinkLoss::Continue => MovementData::hold(id),
        };
        tracing::warn!(reaction = ?self.link_loss, "the movement is ended");
        if let Err(error) = self.client.send(&request) {
            tracing::error!(%error, "the movement could not be ended");
        }
    }

    /// Takes what the bridge reports.
    pub fn drain(&mut self) {
        self.client.drain(|report| {
            if report.is_final() {
                tracing::warn!(stage = ?report.stage(), reason = ?report.reason(), "the movement was ended");
            }
        });
    }
}
