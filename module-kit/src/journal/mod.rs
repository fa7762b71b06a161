//! The input journal of a module: every input of its core in order with its time, so that a recording replays its decisions.
//!
//! ```text
//! core ─▶ records ─▶ Writer ─▶ pieces ─▶ Port ═▶ topic ═▶ recorder … Reader ─▶ records ─▶ a core in virtual time
//!              ▲                                                                   ╰─────▶ lines of the log
//! the log ─────╯
//! ```
//!
//! A journal begins with a snapshot of the core, and has another one every ten seconds or so. What a record means is the module's
//! own matter; here they are bytes. `docs/journal.md` has every byte.
//!
//! * [`Writer`]: records to pieces, bounded; a pure value;
//! * [`Port`]: publishes the pieces, while there is a subscriber, and adds the lines of the process's log;
//! * [`Reader`]: pieces to records, however many were lost; a pure value;
//! * [`LogLine`]: a line of the log as a record;
//! * [`bytes`]: numbers, and structs by what changed in them; [`raw`]: structs of shared memory as values of serde.

pub mod bytes;
mod log_line;
mod port;
pub mod raw;
mod reader;
#[cfg(test)]
mod tests;
mod writer;

pub use log_line::{LOG_LINE, LogLine};
pub use port::Port;
pub use reader::{Break, Reader};
pub use writer::{CHECKPOINT, DELAY, MAX_RECORD, MAX_WAITING, Piece, Writer};
