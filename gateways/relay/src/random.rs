//! Numbers that no other process has, and how long the machine was suspended: what the pure parts are given from outside.

use std::hash::{BuildHasher, RandomState};

use rustix::time::{ClockId, clock_gettime};

/// A random number that is not 0.
pub fn fresh() -> u64 {
    // The keys of a new state are random.
    RandomState::new().hash_one(0_u8).max(1)
}

/// How long the machine has been suspended since its boot, ns: `CLOCK_BOOTTIME` − `CLOCK_MONOTONIC`.
pub fn suspended_ns() -> u64 {
    let read_ns = |clock| {
        let time = clock_gettime(clock);
        time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
    };
    let monotonic_ns = read_ns(ClockId::Monotonic);
    read_ns(ClockId::Boottime).saturating_sub(monotonic_ns)
}
