//! Replays recorded flights: drives the cores of bridge and status from their input journals, in virtual time and at
//! full speed, and compares every sample, state, report and byte sent with what was recorded, bit for bit.
//!
//! * [`Verifier`]: takes the samples of the topics `bridge/journal` and `status/journal` in the order of a recording,
//!   and gives a [`Comparison`];
//! * [`Keeper`]: makes a test of a recorded flight, a [`kept`] one, of inputs and digests;
//! * [`Difference`]: when, which topic, which field, and both values.
//!
//! A journal in which pieces are missing is verified up to each loss, and again from the next snapshot.
//!
//! A pure crate: no file, no clock, no shared memory. Cores are the same code that flew; the arithmetic of floating
//! point is that of the machine, so a recording is verified by the version that made it, on the same kind of machine.

mod bridge_core;
mod difference;
mod keeper;
pub mod kept;
mod renewed;
mod status_core;
mod tally;
mod track;
mod verdict;
mod verifier;

pub use difference::Difference;
pub use keeper::{Keeper, Kept};
pub use renewed::renew;
pub use verdict::{BreakAt, Comparison, JournalSpan, JournalVerdict, MAX_LISTED};
pub use verifier::Verifier;
