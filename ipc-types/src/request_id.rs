//! Ids for requests and paths that no other process chooses as well.

use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};
use std::sync::atomic::{AtomicU64, Ordering};

use crate::time::MonotonicNs;

/// Ids fit in 53 bits, so that they survive a JSON reader that keeps numbers as doubles.
const ID_BITS: u32 = 53;

/// A new id for a request or a path: never 0, and different from any other, in this process or another.
///
/// It is a keyed hash with a random key of the process, its moment and a count: two ids are equal with a probability of
/// one in 10¹⁵.
pub fn fresh_request_id() -> u64 {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    loop {
        // The key is random in each process and differs from call to call.
        let mut hasher = RandomState::new().build_hasher();
        hasher.write_u32(std::process::id());
        hasher.write_u64(MonotonicNs::now().0);
        hasher.write_u64(COUNT.fetch_add(1, Ordering::Relaxed));
        let id = hasher.finish() & ((1 << ID_BITS) - 1);
        if id != 0 {
            return id;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_not_zero_fit_in_a_double_and_differ() {
        let mut ids: Vec<_> = (0..10_000).map(|_| fresh_request_id()).collect();
        assert!(ids.iter().all(|id| *id != 0 && *id < 1 << 53));
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), 10_000);
    }
}
