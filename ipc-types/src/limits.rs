//! The limits of this process: `ulimit` of a shell, `Limit…=` of a service; and what is free in `/dev/shm`. iceoryx2
//! does not say when one of them is the cause of a failure.

use std::fs;
use std::io;

use rustix::event::{EventfdFlags, eventfd};
use rustix::io::Errno;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

use crate::domain::SHM_DIR;

/// Files that a process opens to make or enter a service, rounded up.
const FILES: u64 = 32;

/// Longest segment, rounded up, bytes.
const FILE_BYTES: u64 = 16 << 20;

/// What a process needs at least, bytes.
const STACK_BYTES: u64 = 1 << 20;
const DATA_BYTES: u64 = 64 << 20;

/// Without so much, bytes, memory for a port is refused where nothing can say so.
pub(crate) const LEAST_MEMORY: u64 = 16 << 20;

/// Files that a bridge has open with its consumers, rounded up: [`FILES`] for each of its services, and its log.
const ROBOT_FILES: u64 = 512;

/// Longest file of a robot: a flight record, at the size at which another one is begun unless the operator says
/// otherwise.
const ROBOT_FILE_BYTES: u64 = 2 << 30;

/// A limit that is less than what may be needed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LowLimit {
    /// The name that a shell and a service give the limit.
    pub name: &'static str,
    /// What it is.
    pub value: u64,
    /// What may be needed.
    pub needed: u64,
}

/// The limits of this process that are less than the processes of a robot may need. How much memory may be locked
/// matters to who asks for that alone, in `[realtime]`, and it says so itself.
pub fn low_limits() -> Vec<LowLimit> {
    lower([
        ("nofile", Resource::Nofile, ROBOT_FILES),
        ("fsize", Resource::Fsize, ROBOT_FILE_BYTES),
        ("stack", Resource::Stack, STACK_BYTES),
        ("data", Resource::Data, DATA_BYTES),
        ("as", Resource::As, DATA_BYTES),
    ])
}

fn lower(limits: [(&'static str, Resource, u64); 5]) -> Vec<LowLimit> {
    let low = limits.into_iter().filter_map(|(name, resource, needed)| {
        let value = getrlimit(resource).current?;
        (value < needed).then_some(LowLimit {
            name,
            value,
            needed,
        })
    });
    low.collect()
}

/// The limits of this process that are so low that a failure is laid to them, with their values; empty if none is.
pub(crate) fn too_low() -> String {
    let open = fs::read_dir("/proc/self/fd").map_or(u64::MAX, |entries| entries.count() as u64);
    let too_low = lower([
        ("nofile", Resource::Nofile, open.saturating_add(FILES)),
        ("fsize", Resource::Fsize, FILE_BYTES),
        ("stack", Resource::Stack, STACK_BYTES),
        ("data", Resource::Data, DATA_BYTES),
        ("as", Resource::As, DATA_BYTES),
    ]);
    let named = too_low
        .iter()
        .map(|low| format!("{} {}", low.name, low.value));
    named.collect::<Vec<_>>().join(", ")
}

/// How many bytes this process may have, if that is less than [`LEAST_MEMORY`].
pub(crate) fn too_little_memory() -> Option<u64> {
    let limits = [Resource::Data, Resource::As].map(|resource| getrlimit(resource).current);
    let least = limits.into_iter().flatten().min()?;
    (least < LEAST_MEMORY).then_some(least)
}

/// What is free in `/dev/shm`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FreeMemory {
    /// Bytes.
    pub bytes: u64,
    /// Inodes: each file, folder, segment and socket takes one. `None` if their number is not limited.
    pub inodes: Option<u64>,
}

impl FreeMemory {
    /// Whether so much is free.
    pub(crate) fn has(self, bytes: u64, inodes: u64) -> bool {
        self.bytes >= bytes && self.inodes.is_none_or(|free| free >= inodes)
    }
}

/// What is free in `/dev/shm`.
///
/// # Errors
///
/// When the operating system does not say.
pub fn free_memory() -> io::Result<FreeMemory> {
    let status = rustix::fs::statvfs(SHM_DIR)?;
    Ok(FreeMemory {
        bytes: status.f_bavail.saturating_mul(status.f_frsize),
        // A file system without a limit of inodes has none in all.
        inodes: (status.f_files > 0).then_some(status.f_favail),
    })
}

/// Raises the limit of open files, usually 1,024, to what the system allows: for a process with more services than one
/// robot has.
pub fn allow_many_files() {
    let maximum = getrlimit(Resource::Nofile).maximum;
    let limit = Rlimit {
        current: maximum,
        maximum,
    };
    if let Err(error) = setrlimit(Resource::Nofile, limit) {
        crate::log::debug!(%error, "the limit of open files stays as it is");
    }
}

/// Whether this process can open no file more.
pub(crate) fn are_files_used_up() -> bool {
    let one_more = eventfd(0, EventfdFlags::CLOEXEC);
    matches!(one_more, Err(Errno::MFILE | Errno::NFILE))
}
