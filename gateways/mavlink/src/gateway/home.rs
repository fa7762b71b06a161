//! What of home outlives the gateway, so that a restart in flight does not forget where the flight began.

use std::time::Duration;

use ipc_types::MonotonicNs;

use super::Gateway;
use crate::event::Event;
use crate::home::{Home, KeptHome};

/// Homes are kept at most so often: a station may set one after another, and each is a write to the disk.
const KEEP_PERIOD: Duration = Duration::from_secs(1);

impl Gateway {
    /// The home that an earlier gateway has kept, while the same bridge was running.
    pub fn restore_home(&mut self, kept: KeptHome) {
        self.keeper.kept = Some(kept);
        match kept.ground_altitude_m {
            None => self.home = Home::Operator(kept.position),
            Some(_) => self.keeper.before = Some(kept),
        }
    }

    /// The first position has come: in flight, and from the same ground, it is the same flight. The bridge says the altitude of the
    /// ground in millimetres, anew at each landing.
    pub(super) fn restore_home_in_flight(&mut self) {
        let (Some(known), Some(before)) = (self.vehicle.now(), self.keeper.before.take()) else {
            return;
        };
        let ground_m = (known.state.ground_valid != 0).then_some(known.state.ground_altitude_m);
        if self.home == Home::Unknown && known.is_flying() && ground_m == before.ground_altitude_m {
            self.home = Home::TakeOff(before.position);
            let text = "home is where this flight began, before the gateway was started again";
            self.note(Event::Note(text.to_owned()));
        }
    }

    /// What is to be kept of home.
    fn home_to_keep(&self) -> Option<KeptHome> {
        let state = self.vehicle.last_state()?;
        let (position, ground_altitude_m) = match self.home {
            Home::Operator(position) => (position, None),
            Home::TakeOff(position) if state.ground_valid != 0 => {
                (position, Some(state.ground_altitude_m))
            }
            _ => return None,
        };
        Some(KeptHome {
            position,
            ground_altitude_m,
        })
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
        let is_kept = self.home == Home::Unknown || self.home_to_keep() == self.keeper.kept;
        let next = self.keeper.at.map_or(self.moment, |at| at + KEEP_PERIOD);
        (!is_kept).then_some(next)
    }
}
