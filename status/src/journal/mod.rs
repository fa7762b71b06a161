//! Status' input journal: every call of the core in order with its time, what it published, and snapshots of the core from which it
//! can be gone on with. `docs/journal.md` has every byte. Logs are not of it: nothing that is published follows from them.
//!
//! * [`Input`], [`Output`], [`Record`]: what a journal has;
//! * [`Encoder`] and [`Decoder`]: records to bytes and back;
//! * [`Snapshot`]: the configuration and the core as bytes, bit for bit.
//!
//! [`Journaled`](crate::journaled::Journaled) writes the journal while somebody records it.

mod code;
mod record;
mod state;

pub use code::{Decoder, Encoder};
pub use record::{Entry, Input, Kind, Output, Record};
pub use state::{NotASnapshot, Snapshot};
