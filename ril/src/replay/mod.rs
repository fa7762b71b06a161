//! What `ril replay` makes of keys and of recorded requests: pure values. What is played when is [`recording::play`]'s; files,
//! ports and the terminal are those of [`commands::replay`](crate::commands::replay).
//!
//! * [`keys`]: what a key asks for;
//! * [`request`]: a recorded request, as a line and as JSON;
//! * [`verification`]: what came of a verification, as text and as JSON.

pub mod keys;
pub mod request;
pub mod verification;
