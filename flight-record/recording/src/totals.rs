//! [`Totals`]: counts of a recorder.

/// Counts of a recorder since its start. `added = written + waiting + dropped`. Events are not counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// Messages that were added, the dropped ones included.
    pub added: u64,
    /// Messages that the disk has taken.
    pub written: u64,
    /// Messages that were forced onto the disk, of those that were written.
    pub synced: u64,
    /// Messages that wait in memory.
    pub waiting: u64,
    /// Messages that were dropped.
    pub dropped: u64,
    /// Bytes that the disk has taken, endings and indexes included.
    pub bytes: u64,
    /// Files that were begun.
    pub files: u32,
}
