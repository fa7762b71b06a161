//! The shared-memory contract of the HERO's Robot Implementation Layer.
//!
//! `docs/ipc.md` is the contract in words; this crate is its executable form:
//!
//! * [`payload`]: the fixed-layout structs that lie in shared memory, with units, frames and validity;
//! * [`code`]: the numbers in them that stand for states, reasons and errors, as typed enums;
//! * [`robot`], [`time`]: the robot id and the host's monotonic time.

pub mod code;
pub mod payload;
pub mod robot;
pub mod time;

pub use robot::RobotId;
pub use time::MonotonicNs;
