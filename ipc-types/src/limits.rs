//! The limits of this process: `ulimit` of a shell, `Limit…=` of a service. iceoryx2 does not say when one of them is the cause of a
//! failure.

use std::fs;

use rustix::event::{EventfdFlags, eventfd};
use rustix::io::Errno;
use rustix::process::{Resource, getrlimit};

/// Files that a process opens to make or enter a service, rounded up.
const FILES: u64 = 32;

/// Longest segment, rounded up, bytes.
const FILE_BYTES: u64 = 16 << 20;

/// What a process needs at least, bytes.
const STACK_BYTES: u64 = 1 << 20;
const DATA_BYTES: u64 = 64 << 20;

/// The limits of this process that are so low that a failure is laid to them, with their values; empty if none is.
pub(crate) fn too_low() -> String {
    let open = fs::read_dir("/proc/self/fd").map_or(u64::MAX, |entries| entries.count() as u64);
    let limits = [
        ("nofile", Resource::Nofile, open.saturating_add(FILES)),
        ("fsize", Resource::Fsize, FILE_BYTES),
        ("stack", Resource::Stack, STACK_BYTES),
        ("data", Resource::Data, DATA_BYTES),
        ("as", Resource::As, DATA_BYTES),
    ];
    let too_low = limits.into_iter().filter_map(|(name, resource, needed)| {
        let limit = getrlimit(resource).current?;
        (limit < needed).then(|| format!("{name} {limit}"))
    });
    too_low.collect::<Vec<_>>().join(", ")
}

/// Whether this process can open no file more.
pub(crate) fn are_files_used_up() -> bool {
    let one_more = eventfd(0, EventfdFlags::CLOEXEC);
    matches!(one_more, Err(Errno::MFILE | Errno::NFILE))
}
