//! A log's file while it is being written: its first line, then whole rows.
//!
//! Rows of which the file took only a part are cut off again, so that a file ends with a whole row even when the disk
//! was full in the middle of one.

use std::io;
use std::path::PathBuf;
use std::time::Duration;

use ipc_types::MonotonicNs;

use super::gathered::whole_rows;
use super::store::LogFile;

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
    /// Rows in it.
    rows: u64,
    /// Of the rows, those that were not yet forced onto the disk.
    unsure: u64,
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
            rows: 0,
            unsure: 0,
            sync_at: None,
        })
    }

    /// Where it is.
    pub fn path(&self) -> &PathBuf {
        &self.path
    }

    /// How many bytes there are until it has `limit`.
    pub fn room(&self, limit: u64) -> u64 {
        limit.saturating_sub(self.bytes)
    }

    /// Whether it has no row.
    pub fn is_empty(&self) -> bool {
        self.rows == 0
    }

    /// Rows that may not be on the disk yet.
    pub fn unsure(&self) -> u64 {
        self.unsure
    }

    /// Appends `rows` at `now`; says how many bytes of whole rows the file took. After an error it must not be used
    /// for more than [`sync`](Self::sync).
    pub fn append(&mut self, rows: &[u8], now: MonotonicNs) -> (usize, io::Result<()>) {
        let (taken, result) = write_counted(&mut self.file, rows);
        let whole = whole_rows(&rows[..taken]);
        let count = rows[..whole].iter().filter(|byte| **byte == b'\n').count() as u64;
        self.bytes += whole as u64;
        self.rows += count;
        self.unsure += count;
        if whole < taken {
            // A disk that is full still cuts. One that does not is broken, which the result says already.
            let _ = self.file.cut(self.bytes);
        }
        if count > 0 {
            self.sync_at.get_or_insert(now + SYNC_PERIOD);
        }
        (whole, result)
    }

    /// When [`sync`](Self::sync) is due.
    pub fn sync_at(&self) -> Option<MonotonicNs> {
        self.sync_at
    }

    /// Forces the rows onto the disk.
    ///
    /// # Errors
    /// Those that are [`unsure`](Self::unsure) may be lost. Trying again would not help: the system forgets what it
    /// could not write.
    pub fn sync(&mut self) -> io::Result<()> {
        if self.unsure > 0 {
            self.file.sync()?;
        }
        self.unsure = 0;
        self.sync_at = None;
        Ok(())
    }
}

/// Writes `bytes`; says how many of them were taken.
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
