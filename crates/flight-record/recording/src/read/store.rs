//! [`RecordSource`]: what is read, piece by piece: a file, or bytes in memory. [`CachedSource`] keeps the last piece.

use std::fs::{self, File};
use std::io;
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::sync::Arc;

use rustix::fs::{SeekFrom, seek};

/// What is read of a file at once, bytes. Chunks of a recorder have some ten thousand bytes.
const WINDOW_BYTES: u64 = 256 << 10;

/// A file that is read piece by piece. It is not mapped: a file that its recorder cuts meanwhile would end a process
/// that has it mapped.
#[derive(Clone, Debug)]
pub struct RecordFile {
    file: Arc<File>,
    len: u64,
}

impl RecordFile {
    /// Opens a file, which another process may be writing: it has as many bytes as at this moment.
    ///
    /// # Errors
    /// It cannot be opened, or is no regular file.
    pub fn open(path: &Path) -> io::Result<RecordFile> {
        // Opening a pipe would wait for its writer.
        if !fs::metadata(path)?.is_file() {
            return Err(io::Error::other("it is no regular file"));
        }
        let file = File::open(path)?;
        let len = file.metadata()?.len();
        let file = Arc::new(file);
        Ok(RecordFile { file, len })
    }

    /// Its length, bytes.
    pub fn len(&self) -> u64 {
        self.len
    }

    /// Whether it has no bytes.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// This file with the bytes that it has now.
    ///
    /// # Errors
    /// The system does not say how many these are.
    pub fn refreshed(&self) -> io::Result<RecordFile> {
        let len = self.file.metadata()?.len();
        let file = Arc::clone(&self.file);
        Ok(RecordFile { file, len })
    }
}

/// What is read: a [`RecordFile`], or bytes.
#[derive(Clone, Debug)]
pub enum RecordSource<'a> {
    /// A file.
    File(RecordFile),
    /// Bytes in memory.
    Bytes(&'a [u8]),
}

impl From<&RecordFile> for RecordSource<'_> {
    fn from(file: &RecordFile) -> Self {
        RecordSource::File(file.clone())
    }
}

impl<'a> From<&'a [u8]> for RecordSource<'a> {
    fn from(bytes: &'a [u8]) -> Self {
        RecordSource::Bytes(bytes)
    }
}

impl<'a> From<&'a Vec<u8>> for RecordSource<'a> {
    fn from(bytes: &'a Vec<u8>) -> Self {
        RecordSource::Bytes(bytes)
    }
}

impl RecordSource<'_> {
    /// Length, bytes.
    pub(crate) fn len(&self) -> u64 {
        match self {
            RecordSource::File(file) => file.len,
            RecordSource::Bytes(bytes) => bytes.len() as u64,
        }
    }

    /// Where data lies, at `at` or behind: a hole of a file has none, and can be longer than a disk.
    fn data_from(&self, at: u64) -> u64 {
        match self {
            RecordSource::File(file) => match seek(&file.file, SeekFrom::Data(at)) {
                Ok(data) => data.max(at),
                Err(rustix::io::Errno::NXIO) => file.len,
                // Not every file system can say.
                Err(_) => at,
            },
            RecordSource::Bytes(_) => at,
        }
    }

    /// What the file does not have any more, because its recorder has just finished it, reads as zeros.
    fn read(&self, at: u64, mut bytes: &mut [u8]) -> io::Result<()> {
        match self {
            RecordSource::File(file) => {
                let mut at = at;
                while !bytes.is_empty() {
                    match file.file.read_at(bytes, at) {
                        Ok(0) => {
                            bytes.fill(0);
                            break;
                        }
                        Ok(count) => {
                            at += count as u64;
                            bytes = &mut bytes[count..];
                        }
                        Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                        Err(error) => return Err(error),
                    }
                }
                Ok(())
            }
            RecordSource::Bytes(all) => {
                // The caller keeps to the length.
                let at = at as usize;
                bytes.copy_from_slice(&all[at..at + bytes.len()]);
                Ok(())
            }
        }
    }
}

/// A source with the piece of it that was read last.
#[derive(Debug)]
pub(crate) struct CachedSource<'a> {
    source: RecordSource<'a>,
    at: u64,
    piece: Vec<u8>,
}

impl<'a> CachedSource<'a> {
    pub(crate) fn new(source: RecordSource<'a>) -> CachedSource<'a> {
        let (at, piece) = (0, Vec::new());
        CachedSource { source, at, piece }
    }

    pub(crate) fn len(&self) -> u64 {
        self.source.len()
    }

    pub(crate) fn source(&self) -> &RecordSource<'a> {
        &self.source
    }

    /// The `len` bytes at `at`; `None` if the source does not have them. Meant for few bytes: they stay in memory.
    pub(crate) fn peek(&mut self, at: u64, len: u64) -> io::Result<Option<&[u8]>> {
        let end = at.saturating_add(len);
        if end > self.len() {
            return Ok(None);
        }
        if at < self.at || end > self.at + self.piece.len() as u64 {
            let rest = self.len() - at;
            let wanted = WINDOW_BYTES.max(len).min(rest);
            self.piece.resize(wanted as usize, 0);
            self.at = at;
            let read = self.source.read(at, &mut self.piece);
            if read.is_err() {
                self.piece.clear();
            }
            read?;
        }
        let from = (at - self.at) as usize;
        Ok(self.piece.get(from..from + len as usize))
    }

    /// The `len` bytes at `at`, which the source has, to keep.
    ///
    /// # Errors
    /// They cannot be read, or there is no memory for them.
    pub(crate) fn take(&mut self, at: u64, len: u64) -> io::Result<Vec<u8>> {
        if len <= WINDOW_BYTES
            && let Some(bytes) = self.peek(at, len)?
        {
            return Ok(bytes.to_vec());
        }
        let mut bytes = room_for(len)?;
        bytes.resize(len as usize, 0);
        self.source.read(at, &mut bytes)?;
        Ok(bytes)
    }

    /// Where the byte lies next, at `at` or behind.
    pub(crate) fn find(&mut self, byte: u8, mut at: u64) -> io::Result<Option<u64>> {
        loop {
            let is_read = (self.at..self.at + self.piece.len() as u64).contains(&at);
            if !is_read {
                at = self.source.data_from(at);
            }
            let Some(&first) = self.peek(at, 1)?.and_then(<[u8]>::first) else {
                return Ok(None);
            };
            if first == byte {
                return Ok(Some(at));
            }
            let piece = &self.piece[(at - self.at) as usize..];
            match piece.iter().position(|found| *found == byte) {
                Some(ahead) => return Ok(Some(at + ahead as u64)),
                None => at += piece.len() as u64,
            }
        }
    }
}

/// Where the kernel says how much memory there is.
const MEMORY: &str = "/proc/meminfo";

/// An empty vector with room for `len` bytes of a file. A hole takes no room on the disk, so the length of a file says
/// nothing about what the machine can hold; and the kernel grants more memory than there is.
///
/// # Errors
/// So much memory is not available.
pub(crate) fn room_for(len: u64) -> io::Result<Vec<u8>> {
    let lacking = |available: u64| {
        let mb = |bytes: u64| bytes.div_ceil(1_000_000);
        let text = format!(
            "it has {} MB, and {} MB of memory are available",
            mb(len),
            mb(available)
        );
        io::Error::new(io::ErrorKind::OutOfMemory, text)
    };
    // What is short is there.
    if len > WINDOW_BYTES
        && let Some(available) = available_memory().filter(|available| len > *available)
    {
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
