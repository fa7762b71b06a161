//! Logs of chosen groups of the telemetry, several at once, independent of each other.
//!
//! ```text
//! telemetry thread                    thread of each log
//! Logs ─▶ bounded queue ─────────────▶ LogWriter ─▶ Store
//!   never waits, counts what           takes samples only while it can write
//!   the queue refuses
//! ```
//!
//! Telemetry comes first: [`Logs`] offers each sample to the queue of each log, and never waits. A
//! [`LogWriter`](writer::LogWriter) takes samples out of its queue and may wait for its disk as long as that takes.
//! While nothing can be written it takes none. So **the queue is the one bound on memory**, whether the disk is full,
//! slow or hanging, and **what the queue refuses is the one loss count**. Each sample that was offered is a row in a
//! file, or lost: `lost = offered − rows`.
//!
//! [`read`] is the other side: it reads the files again, while they are written or long after.
//!
//! What can be lost without a count:
//!
//! * A kill of the process costs the rows of the last second: they are handed to the operating system every
//!   [`FLUSH_PERIOD`](writer::FLUSH_PERIOD). A partial row that it leaves is truncated at the next start.
//! * A power cut costs those of the last [`SYNC_PERIOD`](writer::SYNC_PERIOD) too: so often they are forced onto the
//!   disk, and whenever a file is closed. More often would be a write of the disk's journal each time, which wears
//!   memory cards; never would leave it to the system, and errors that a disk reports only then would go unnoticed.

pub mod clock;
pub mod config;
pub mod event;
pub mod file_name;
pub mod groups;
pub mod queue;
pub mod read;
pub mod retention;
pub mod store;
pub mod tsv;
pub mod writer;

#[cfg(test)]
mod tests;

pub use queue::Logs;
