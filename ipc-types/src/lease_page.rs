//! The places of leases in the page of the [`Doorbell`](crate::doorbell::Doorbell): which paths are renewed, and when
//! each was last.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use crate::time::MonotonicNs;

/// Shortest and longest lease, ms: a client that waits renews every [`SAFETY_BOUND`](crate::waiter::SAFETY_BOUND), 250
/// ms.
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

impl LeasePlace {
    /// The sender of this path still follows it. One that was stopped for long may have lost the place to another.
    pub(crate) fn renew(&self, path_id: u64, now: MonotonicNs) {
        if self.path_id.load(Ordering::Acquire) == path_id {
            self.renewed_ns.store(now.0, Ordering::Relaxed);
        }
    }

    /// This path needs the place no more.
    pub(crate) fn free(&self, path_id: u64) {
        let (order, none) = (Ordering::AcqRel, Ordering::Relaxed);
        let _ = self.path_id.compare_exchange(path_id, 0, order, none);
    }
}

/// When the lease of this path was renewed last.
pub(crate) fn renewed(places: &[LeasePlace; PLACES], path_id: u64) -> Option<MonotonicNs> {
    let mut places = places.iter();
    let place = places.find(|place| place.path_id.load(Ordering::Acquire) == path_id)?;
    Some(MonotonicNs(place.renewed_ns.load(Ordering::Relaxed)))
}

/// Takes a place for this path.
pub(crate) fn take(places: &[LeasePlace; PLACES], path_id: u64, now: MonotonicNs) -> Option<usize> {
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
