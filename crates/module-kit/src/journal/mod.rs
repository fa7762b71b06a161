//! The input journal of a module: every input of its core in order with its time, so that a recording replays its
//! decisions.
//!
//! ```text
//! core ─▶ entries ─▶ Writer ─▶ pieces ─▶ Port ═▶ topic ═▶ recorder … Reader ─▶ entries ─▶ a core in virtual time
//!              ▲                                                                   ╰─────▶ lines of the log
//! the log ─────╯
//! ```
//!
//! A journal begins with a snapshot of the core, and has another one every ten seconds or so. Inputs and outputs are
//! types of the module: here they are values of serde. `docs/journal.md` has every byte.
//!
//! * [`JournalRecord`], [`Entry`], [`LogLine`]: what a journal has;
//! * [`JournalWriter`]: entries to pieces, bounded; a pure value;
//! * [`JournalPort`]: publishes the pieces, while there is a subscriber, and adds the lines of the process's log;
//! * [`JournalReader`]: pieces to entries, however many were lost; a pure value;
//! * [`raw`]: structs of shared memory as values of serde; [`snapshot`]: a whole core as bytes.

mod codec;
mod port;
pub mod raw;
mod reader;
pub mod snapshot;
#[cfg(test)]
mod tests;
mod writer;

pub use codec::{Entry, JournalRecord, LogLine, MAX_RECORD, Malformed};
pub use port::JournalPort;
pub use reader::{Break, JournalReader};
pub use snapshot::NotASnapshot;
pub use writer::{CHECKPOINT, DELAY, JournalWriter, MAX_WAITING, Piece};
