//! The tests that need more than one crate, but for those that call cargo (`examples`) or read the whole workspace
//! (`architecture`).

// The program `figures` and the fuzz targets use the rest of what they share with these tests.
#[allow(dead_code)]
#[path = "../examples/figures/bytes/mod.rs"]
mod bytes;
mod comments;
mod consumers;
mod dialogues;
mod fleet;
mod hostile_values;
mod hot_path;
mod imports;
mod missions;
mod modules;
mod names;
mod plausible;
mod random_bytes;
mod requirements;
mod serial;

/// Counts for each thread: what a test allocates is its own.
#[global_allocator]
static ALLOCATOR: bytes::heap::Counting = bytes::heap::Counting;
