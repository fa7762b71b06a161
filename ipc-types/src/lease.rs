//! [`Lease`]: how the sender of a path says, again and again, that it still follows it.
//!
//! A renewal is one store into the page of the [`Doorbell`](crate::doorbell::Doorbell): it wakes no process. The bridge looks at the page
//! when the lease would be over. A sender that hangs, or was stopped, does not renew.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use crate::session::Session;
use crate::time::MonotonicNs;

/// Shortest and longest lease, ms: a client that waits renews every [`SAFETY_BOUND`](crate::waiter::SAFETY_BOUND), 250 ms.
pub const LEASES_MS: std::ops::RangeInclusive<u32> = 500..=60_000;

/// Paths of a robot that can have a lease at once: one of each client of `movement`.
pub(crate) const PLACES: usize = 16;

/// A place that was not renewed for so long is free: twice the longest lease.
const STALE: Duration = Duration::from_millis(2 * *LEASES_MS.end() as u64);

/// A lease in the page.
#[repr(C)]
pub(crate) struct LeasePlace {
    /// Of which path; 0 if the place is free.
    path_id: AtomicU64,
    /// When it was renewed, host monotonic ns.
    renewed_ns: AtomicU64,
}

/// When the lease of this path was renewed last.
pub(crate) fn renewed(places: &[LeasePlace; PLACES], path_id: u64) -> Option<MonotonicNs> {
    let mut places = places.iter();
    let place = places.find(|place| place.path_id.load(Ordering::Acquire) == path_id)?;
    Some(MonotonicNs(place.renewed_ns.load(Ordering::Relaxed)))
}

/// Takes a place for this path.
fn take(places: &[LeasePlace; PLACES], path_id: u64, now: MonotonicNs) -> Option<usize> {
    places.iter().position(|place| {
        let holder = place.path_id.load(Ordering::Acquire);
        let renewed = MonotonicNs(place.renewed_ns.load(Ordering::Relaxed));
        let is_free = holder == 0 || now.since(renewed) > STALE;
        let order = Ordering::AcqRel;
        let is_taken = is_free
            && (place.path_id)
                .compare_exchange(holder, path_id, order, Ordering::Relaxed)
                .is_ok();
        if is_taken {
            place.renewed_ns.store(now.0, Ordering::Relaxed);
        }
        is_taken
    })
}

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
        // One that was stopped for long may have lost it to another.
        if place.path_id.load(Ordering::Acquire) == self.path_id {
            let now = MonotonicNs::now();
            place.renewed_ns.store(now.0, Ordering::Relaxed);
        }
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        let place = &self.session.doorbell().leases()[self.place];
        let (order, none) = (Ordering::AcqRel, Ordering::Relaxed);
        let _ = (place.path_id).compare_exchange(self.path_id, 0, order, none);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_taken_once_and_is_free_when_its_sender_has_gone_for_long() {
        let places: [LeasePlace; PLACES] = std::array::from_fn(|_| LeasePlace {
            path_id: AtomicU64::new(0),
            renewed_ns: AtomicU64::new(0),
        });
        let now = MonotonicNs(1_000_000_000_000);
        for path in 1..=PLACES as u64 {
            assert_eq!(take(&places, path, now), Some(path as usize - 1));
            assert_eq!(renewed(&places, path), Some(now));
        }
        assert_eq!(take(&places, 99, now + STALE), None);
        places[3]
            .renewed_ns
            .store((now + STALE).0, Ordering::Relaxed);
        let later = now + STALE + Duration::from_nanos(1);
        assert_eq!(take(&places, 99, later), Some(0));
        assert_eq!(renewed(&places, 1), None);
        assert_eq!(renewed(&places, 99), Some(later));
    }
}
