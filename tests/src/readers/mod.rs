//! Programs that others wrote and that read recordings: `mcap` and `rosbags` in Python, `@mcap/core` in JavaScript.
//!
//! * [`readers_or_skip`]: those that this machine can have; [`Reader`]: one of them, as a program;
//! * [`expected`]: what was recorded and what a reader found; [`sums`]: the same in few bytes.

mod environment;
pub mod expected;
mod reader;
pub mod sums;

pub use environment::readers_or_skip;
pub use reader::{Reader, package};
