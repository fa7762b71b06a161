//! What every module of the robot has, so that its author writes its work alone: inputs, decision, outputs.
//!
//! `docs/modules.md` is the way to a module of one's own; `examples/module` is one.
//!
//! * [`Work`]: what the author writes, and [`main`], which runs it;
//! * [`Manager`]: starts and stops the module and says how it is, by the [`rules`] that the bridge keeps as well;
//! * [`Requests`]: serves a request of the module's own, each executed once;
//! * [`process`]: the start ([`SetUp`]) and the loop of every process, those of bridge and status too: one wait,
//!   deadlines, watchdog, the end;
//! * [`configuration`]: what a process runs with, on a topic of its own; [`pieces`]: a topic of what is larger than one
//!   sample;
//! * [`journal`]: the inputs of a module's core in order, from which a recording replays its decisions;
//! * [`answers`]: which requests are under way, and final reports that are remembered.
//!
//! [`runtime`] is what it stands on, and is there under this name too: options, [`ranged!`] values of a configuration,
//! exit codes.
//!
//! Nothing here knows the helicopter; the id and the name of a module are its own, and the contract's structs are those
//! of `ipc-types`.

pub mod answers;
pub mod configuration;
pub mod journal;
mod manager;
pub mod pieces;
pub mod process;
pub mod requests;
pub mod rules;
mod work;

pub use manager::{Manager, STATE_PERIOD, StateSchedule};
pub use process::{SetUp, Sources};
pub use requests::Requests;
pub use rules::OnStop;
pub use runtime::{self, ranged};
pub use work::{Work, main, options, run, run_with};

/// The configuration of a module that has none: an empty file.
#[derive(Clone, Copy, Debug, Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoConfig {}
