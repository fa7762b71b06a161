//! Fixtures for programs that speak with the HERO's Robot Implementation Layer.
//!
//! * [`domain`]: shared memory of a test's own, and the proof that nothing of it is left;
//! * [`process`]: child processes in that domain, their lines, signals and exits;
//! * [`pty`]: a folder for links to pseudo-terminals;
//! * [`watchdog`]: ends a test that hangs.

pub mod domain;
pub mod process;
pub mod pty;
pub mod watchdog;

pub use domain::TestDomain;
pub use process::Process;
pub use pty::PtyFolder;
pub use watchdog::Watchdog;
