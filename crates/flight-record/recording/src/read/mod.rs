//! Reading recordings: whole ones, those that a kill or a power cut has ended, and any other bytes.
//!
//! * [`messages`]: all messages in the order of the file;
//! * [`check`]: what is complete and what is missing;
//! * [`recover`]: a whole file out of a damaged one; [`extract`]: a part of a file as a file of its own;
//! * [`summary_of`]: what the file says of itself, without reading the messages.
//!
//! No bytes make these panic. A file is read piece by piece: in memory are one chunk and what is found, however long
//! the file is. Records are read by this module and not by the crate `mcap`, which copies every message, and panics at
//! some records that cannot be.

mod check;
mod expand;
mod message;
mod record;
mod recover;
pub(crate) mod store;
mod summary;
mod walk;

pub use check::{RecordCheck, RecordedEvent, TopicCheck, check};
pub use message::{ReadError, RecordedMessage};
pub use recover::{RECOVERED_METADATA, Recovered, extract, recover};
pub use store::{RecordFile, RecordSource};
pub use summary::{RecordSummary, summary_of};
pub use walk::{FileMark, Messages, messages};
