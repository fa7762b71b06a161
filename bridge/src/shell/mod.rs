//! The thin shell around the core: it moves bytes, samples, requests and deadlines, and decides nothing.
//!
//! One thread, one wait. Whatever wakes it, everything is drained: the signal pipe, both request services, the serial
//! port, the core's deadlines. That is also the safety net for a wake-up that the shared-memory library can lose.
//!
//! * [`run`]: the loop; [`serial`]: the port; `publish`: the core's outputs on shared memory; `audit`: what the log has.

mod audit;
mod publish;
mod run;
pub mod serial;

pub use run::{ShellError, run};
