//! The input journal of a module: every input of its core in order with its time, so that a recording replays its decisions.
//!
//! ```text
//! core ─▶ entries ─▶ Writer ─▶ pieces ─▶ Port ═▶ topic ═▶ recorder … Reader ─▶ entries ─▶ a core in virtual time
//!              ▲                                                                   ╰─────▶ lines of the log
//! the log ─────╯
//! ```
//!
//! A journal begins with a snapshot of the core, and has another one every ten seconds or so. Inputs and outputs are types of the
//! module: here they are values of serde. `docs/journal.md` has every byte.
//!
//! * [`Record`], [`Entry`], [`LogLine`]: what a journal has;
//! * [`Writer`]: entries to pieces, bounded; a pure value;
//! * [`Port`]: publishes the pieces, while there is a subscriber, and adds the lines of the process's log;
//! * [`Reader`]: pieces to entries, however many were lost; a pure value;
//! * [`raw`]: structs of shared memory as values of serde.

mod codec;
mod port;
pub mod raw;
mod reader;
#[cfg(test)]
mod tests;
mod writer;

pub use codec::{Entry, LogLine, MAX_RECORD, Malformed, Record};
pub use port::Port;
pub use reader::{Break, Reader};
pub use writer::{CHECKPOINT, DELAY, MAX_WAITING, Piece, Writer};
