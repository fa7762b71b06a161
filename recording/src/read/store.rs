//! [`Bytes`]: the bytes of a file.

use std::io;
use std::ops::Deref;
use std::path::Path;

/// The bytes of a file, in memory. They are read, and not mapped: a file that its recorder cuts meanwhile would end a process
/// that has it mapped.
#[derive(Clone, Debug)]
pub struct Bytes(Vec<u8>);

impl Bytes {
    /// Reads a file, which another process may be writing.
    ///
    /// # Errors
    /// It cannot be read, or does not fit into memory.
    pub fn open(path: &Path) -> io::Result<Bytes> {
        std::fs::read(path).map(Bytes)
    }
}

impl Deref for Bytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.0
    }
}
