//! Flights that are kept as tests: the inputs of the cores from the start of their processes, and a digest of each
//! output.
//!
//! A kept flight has no snapshot, as long as the recording has the start of the process: then the cores begin anew from
//! their configuration, and each version that takes the same inputs drives them. `docs/journal.md` has every byte.
//!
//! * [`Keeper`](crate::Keeper): takes the pieces of a recording, and gives the file;
//! * [`Verifier::take_kept`](crate::Verifier::take_kept): drives the cores with it;
//! * [`renew`](crate::renew): the same inputs with what this version says to them.

mod digest;
mod file;
mod streams;

pub use digest::Digest;
pub(crate) use file::{Beginning, KeptFlight};
pub use file::{MAGIC, NotKept, is_kept};
pub(crate) use streams::{SampleTaken, Streams};
