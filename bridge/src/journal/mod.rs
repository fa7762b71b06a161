//! The bridge's input journal: every call of the core in order with its time, what the core said, and snapshots of the whole core
//! from which it can be gone on with. `docs/journal.md` has every byte.
//!
//! * [`Input`], [`Output`], [`Record`]: what a journal has;
//! * [`Encoder`] and [`Decoder`]: records to bytes and back;
//! * [`Snapshot`]: the configuration and the whole core as bytes, bit for bit.
//!
//! [`Journaled`](crate::journaled::Journaled) writes the journal while somebody records it. To read one, give the pieces of the topic
//! `bridge/journal` to a [`Reader`](module_kit::journal::Reader), and each record that it finds to a [`Decoder`].

mod apply;
mod decode;
mod encode;
mod record;
mod state;
#[cfg(test)]
mod tests;

pub use decode::Decoder;
pub use encode::Encoder;
pub use record::{Entry, Input, Kind, Output, Record};
pub use state::Snapshot;
