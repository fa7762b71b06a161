//! What of home outlives the gateway: what an operator has set.

use std::time::Duration;

use ipc_types::MonotonicNs;

use super::Gateway;
use crate::home::{Home, KeptHome};

/// Homes are kept at most so often: a station may set one after another, and each is a write to the disk.
const KEEP_PERIOD: Duration = Duration::from_secs(1);

impl Gateway {
    /// The home that an earlier gateway has kept, while the same bridge was running.
    pub fn restore_home(&mut self, kept: KeptHome) {
        self.keeper.kept = Some(kept);
        self.home = Home::Operator(kept.position);
    }

    /// What is to be kept of home.
    fn home_to_keep(&self) -> Option<KeptHome> {
        match self.home {
            Home::Operator(position) => Some(KeptHome { position }),
            _ => None,
        }
    }

    /// A home to be kept for the next start, or none, if that has changed.
    pub fn poll_home(&mut self, now: MonotonicNs) -> Option<Option<KeptHome>> {
        if self.deadline_of_home().is_none_or(|at| now < at) {
            return None;
        }
        (self.keeper.kept, self.keeper.at) = (self.home_to_keep(), Some(now));
        Some(self.keeper.kept)
    }

    /// When a home is to be kept.
    pub(super) fn deadline_of_home(&self) -> Option<MonotonicNs> {
        let is_kept = self.home_to_keep() == self.keeper.kept;
        let next = self.keeper.at.map_or(self.moment, |at| at + KEEP_PERIOD);
        (!is_kept).then_some(next)
    }
}
