//! Ids and names that no other process chooses as well, and the hash of names and layouts.

use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};
use std::sync::atomic::{AtomicU64, Ordering};

use crate::time::MonotonicNs;

/// Letters and digits that file names of every kind may have.
const LETTERS: &[u8; 32] = b"abcdefghijklmnopqrstuvwxyz234567";

/// A random name of `len` letters, five bits each, at most ten.
pub(crate) fn name(len: usize) -> String {
    letters(fresh_request_id(), len)
}

/// The lowest `5 · len` bits of `number` as letters.
pub(crate) fn letters(number: u64, len: usize) -> String {
    (0..len)
        .map(|index| {
            let bits = number.checked_shr(5 * index as u32).unwrap_or(0) & 31;
            char::from(LETTERS[bits as usize])
        })
        .collect()
}

/// Offset basis of 64-bit FNV-1a: the hash of nothing.
pub(crate) const FNV_BASIS: u64 = 0xcbf2_9ce4_8422_2325;

/// 64-bit FNV-1a: the hash that begins with `hash` and goes on with `bytes`.
pub(crate) fn fnv(hash: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(hash, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3)
    })
}

/// A hash of `bytes`, of whose lowest bits every one depends on all of them.
pub(crate) fn hash(bytes: &[u8]) -> u64 {
    let hash = fnv(FNV_BASIS, bytes);
    hash ^ (hash >> 32)
}

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
