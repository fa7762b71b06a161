//! Numbers that no other process has, and how long the machine was suspended: what the pure parts are given from
//! outside.

use std::hash::{BuildHasher, RandomState};

use ipc_types::MonotonicNs;

/// A random number that is not 0.
pub fn fresh() -> u64 {
    // The keys of a new state are random.
    RandomState::new().hash_one(0_u8).max(1)
}

/// How long the machine has been suspended since its boot, ns.
pub fn suspended_ns() -> u64 {
    MonotonicNs::suspended().as_nanos() as u64
}
