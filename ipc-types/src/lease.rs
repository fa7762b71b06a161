//! `Lease`: how the sender of a path says periodically that it still follows it.
//!
//! A renewal is one store into the page of the `Doorbell`: it wakes no process. The bridge looks at the page
//! when the lease would be over. A sender that hangs, or was stopped, does not renew.

use std::sync::Arc;

pub use crate::lease_page::LEASES_MS;
use crate::lease_page::take;
use crate::session::Session;
use crate::time::MonotonicNs;

/// The lease of a path, held by its sender.
pub(crate) struct Lease {
    session: Arc<Session>,
    place: usize,
    path_id: u64,
}

impl Lease {
    /// `None` when all places are taken.
    pub(crate) fn take(session: &Arc<Session>, path_id: u64) -> Option<Lease> {
        let place = take(session.doorbell().leases(), path_id, MonotonicNs::now())?;
        Some(Lease {
            session: Arc::clone(session),
            place,
            path_id,
        })
    }

    pub(crate) fn path_id(&self) -> u64 {
        self.path_id
    }

    /// The sender still follows the path.
    pub(crate) fn renew(&self) {
        let place = &self.session.doorbell().leases()[self.place];
        place.renew(self.path_id, MonotonicNs::now());
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        let place = &self.session.doorbell().leases()[self.place];
        place.free(self.path_id);
    }
}
