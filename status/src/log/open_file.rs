//! A log's file while it is being written: its first line, then whole rows.
//!
//! Rows of which the file took only a part are truncated, so that a file ends with a whole row even when the disk was
//! full in the middle of one.

use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use ipc_types::MonotonicNs;

use super::store::LogFile;
use super::tsv::{count_rows, whole_rows};

/// How long rows may be known to the operating system alone. A power cut costs no more than this and what
/// [`FLUSH_PERIOD`](super::writer::FLUSH_PERIOD) allows. Common file systems write their journals as often by
/// themselves, so that it wears a memory card hardly more than no forcing at all.
pub const SYNC_PERIOD: Duration = Duration::from_secs(5);

/// A file that takes rows.
pub struct OpenFile<F> {
    path: PathBuf,
    file: F,
    /// Its length.
    bytes: u64,
    has_rows: bool,
    /// Rows that were not yet forced onto the disk.
    unsynced: u64,
    /// When those are to be forced onto the disk.
    sync_at: Option<MonotonicNs>,
}

impl<F: LogFile> OpenFile<F> {
    /// The new and empty `file` at `path` with its first line.
    ///
    /// # Errors
    /// The line was not taken, or a part of it; the file is of no use.
    pub fn begin(path: PathBuf, mut file: F, header: &[u8]) -> io::Result<OpenFile<F>> {
        write_counted(&mut file, header).1?;
        Ok(OpenFile {
            path,
            file,
            bytes: header.len() as u64,
            has_rows: false,
            unsynced: 0,
            sync_at: None,
        })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its length, bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Whether it has rows besides the first line.
    pub fn has_rows(&self) -> bool {
        self.has_rows
    }

    /// Rows that may not be on the disk yet.
    pub fn unsynced(&self) -> u64 {
        self.unsynced
    }

    /// Appends `rows` at `now`; gives how many of them the file took whole. After an error it must not be used for more
    /// than [`sync`](Self::sync).
    pub fn append(&mut self, rows: &[u8], now: MonotonicNs) -> (usize, io::Result<()>) {
        let (taken, result) = write_counted(&mut self.file, rows);
        let whole = whole_rows(&rows[..taken]);
        let count = count_rows(&rows[..whole]);
        self.bytes += whole as u64;
        self.unsynced += count as u64;
        if whole < taken {
            // A full disk can still truncate. If this fails the disk is broken, which `result` says already.
            let _ = self.file.truncate(self.bytes);
        }
        if count > 0 {
            self.has_rows = true;
            self.sync_at.get_or_insert(now + SYNC_PERIOD);
        }
        (count, result)
    }

    /// When [`sync`](Self::sync) is due.
    pub fn sync_at(&self) -> Option<MonotonicNs> {
        self.sync_at
    }

    /// Forces the rows onto the disk.
    ///
    /// # Errors
    /// Those that are [`unsynced`](Self::unsynced) may be lost. A retry would not help: the system forgets what it
    /// could not write.
    pub fn sync(&mut self) -> io::Result<()> {
        if self.unsynced > 0 {
            self.file.sync()?;
        }
        self.unsynced = 0;
        self.sync_at = None;
        Ok(())
    }
}

/// Writes `bytes`; gives how many of them were taken.
fn write_counted(file: &mut impl LogFile, bytes: &[u8]) -> (usize, io::Result<()>) {
    let mut taken = 0;
    while taken < bytes.len() {
        match file.write(&bytes[taken..]) {
            Ok(0) => return (taken, Err(io::ErrorKind::WriteZero.into())),
            Ok(count) => taken += count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return (taken, Err(error)),
        }
    }
    (taken, Ok(()))
}
