//! The input journal of a module: every input of its core in order with its time, so that a recording replays its decisions.
//!
//! ```text
//! core ─▶ records ─▶ Writer ─▶ pieces ─▶ Port ═▶ topic ═▶ recorder … Reader ─▶ records ─▶ a core in virtual time
//! ```
//!
//! A journal begins with a snapshot of the core, and has another one every ten seconds or so. What a record means is the module's
//! own matter; here they are bytes. `docs/journal.md` has every byte.
//!
//! * [`Writer`]: records to pieces, bounded; a pure value;
//! * [`Port`]: publishes the pieces, while there is a subscriber;
//! * [`Reader`]: pieces to records, however many were lost; a pure value;
//! * [`bytes`]: numbers, and structs by what changed in them; [`raw`]: structs of shared memory as values of serde.

pub mod bytes;
mod port;
pub mod raw;
mod reader;
#[cfg(test)]
mod tests;
mod writer;

pub use port::Port;
pub use reader::{Break, Reader};
pub use writer::{CHECKPOINT, DELAY, MAX_RECORD, MAX_WAITING, Piece, Writer};
