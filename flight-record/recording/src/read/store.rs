//! [`Bytes`]: the bytes of a file.

use std::fs::{self, File};
use std::io::{self, Read};
use std::ops::Deref;
use std::path::Path;

/// The bytes of a file, in memory. They are read, and not mapped: a file that its recorder cuts meanwhile would end a process
/// that has it mapped.
#[derive(Clone, Debug, Default)]
pub struct Bytes(Vec<u8>);

impl Bytes {
    /// Reads a file, which another process may be writing: as many bytes as it has at this moment.
    ///
    /// # Errors
    /// It cannot be read, is no regular file, or does not fit into the memory that is available.
    pub fn open(path: &Path) -> io::Result<Bytes> {
        // Opening a pipe would wait for its writer.
        let metadata = fs::metadata(path)?;
        if !metadata.is_file() {
            return Err(io::Error::other("it is no regular file"));
        }
        let mut bytes = room_for(metadata.len())?;
        let file = File::open(path)?;
        file.take(metadata.len()).read_to_end(&mut bytes)?;
        Ok(Bytes(bytes))
    }
}

/// Where the kernel says how much memory there is.
const MEMORY: &str = "/proc/meminfo";

/// An empty vector with room for `len` bytes of a file. A hole takes no room on the disk, so the length of a file says nothing
/// about what the machine can hold; and the kernel grants more memory than there is.
///
/// # Errors
/// So much memory is not available.
pub(super) fn room_for(len: u64) -> io::Result<Vec<u8>> {
    let lacking = |available: u64| {
        let mb = |bytes: u64| bytes.div_ceil(1_000_000);
        let text = format!(
            "it has {} MB, and {} MB of memory are available",
            mb(len),
            mb(available)
        );
        io::Error::new(io::ErrorKind::OutOfMemory, text)
    };
    if let Some(available) = available_memory().filter(|available| len > *available) {
        return Err(lacking(available));
    }
    let mut bytes = Vec::new();
    let wanted = usize::try_from(len).map_err(|_| lacking(usize::MAX as u64))?;
    bytes.try_reserve_exact(wanted)?;
    Ok(bytes)
}

/// Bytes of memory that processes can still get, as the kernel estimates; `None` if it does not say.
fn available_memory() -> Option<u64> {
    let text = fs::read_to_string(MEMORY).ok()?;
    let mut lines = text.lines();
    let line = lines.find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kib: u64 = line.trim().strip_suffix(" kB")?.parse().ok()?;
    Some(kib.saturating_mul(1024))
}

impl Deref for Bytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.0
    }
}
