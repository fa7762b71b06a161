//! What every process of the RIL does alike at its edges, so that a user who knows one knows them all.
//!
//! * [`args`]: the options that every process takes: robot, configuration, verbosity;
//! * [`config`]: TOML files whose mistakes are refused with file, line and reason;
//! * [`datagrams`]: a UDP socket that says when each datagram came;
//! * [`durable`]: files that a kill and a power cut leave whole;
//! * [`duration`]: times as people write them, such as `1m30s`;
//! * [`exit`]: exit codes, and how an error is printed once;
//! * [`finding`]: one thing that a check found, with what to do about it;
//! * [`helper`]: a thread that does for a loop what may take long;
//! * [`logging`]: diagnostics on standard error;
//! * [`manual`]: pages of the manual from the definition of the command line;
//! * [`notify`]: readiness and watchdog for a supervisor;
//! * [`output`]: standard error and standard output that no caller waits for;
//! * [`plain`]: texts of others, which a terminal would obey;
//! * [`realtime`]: locked memory, priority and processors of a loop, for those that ask for them;
//! * [`session`]: the session that a process belongs to;
//! * [`signal`]: Ctrl+C and SIGTERM as a file descriptor to wait on; limits on file sizes as errors;
//! * [`usage`]: what a process uses of processors, memory and files;
//! * [`wall_clock`]: whether anybody has set the clock of this machine.
//!
//! Nothing here knows the helicopter, the serial line or shared memory.
//!
//! # Example
//!
//! A process with a configuration of its own:
//!
//! ```
//! use std::path::Path;
//!
//! use clap::Parser;
//! use runtime::args::CommonArgs;
//! use runtime::exit::{self, Failure};
//! use runtime::{config, logging};
//!
//! runtime::ranged! {
//!     /// Bits per second.
//!     fn baud_rate(u32) in 50..=4_000_000;
//! }
//!
//! #[derive(Debug, serde::Deserialize)]
//! #[serde(default, deny_unknown_fields)]
//! struct Config {
//!     #[serde(deserialize_with = "baud_rate")]
//!     baud_rate: u32,
//! }
//!
//! impl Default for Config {
//!     fn default() -> Self {
//!         Config { baud_rate: 115_200 }
//!     }
//! }
//!
//! #[derive(Parser)]
//! struct Args {
//!     #[command(flatten)]
//!     common: CommonArgs,
//! }
//!
//! fn run(args: Args) -> Result<(), Failure> {
//!     logging::init(args.common.verbosity())?;
//!     let config = config::load::<Config>(args.common.settings.config.as_deref(), Path::new("example.toml"))?;
//!     assert_eq!(config.value.baud_rate, 115_200);
//!     Ok(())
//! }
//!
//! fn main() -> std::process::ExitCode {
//!     let args = Args::parse_from(["example", "--robot", "7"]);
//!     exit::main_with(|| run(args))
//! }
//! ```

pub mod args;
pub mod config;
pub mod datagrams;
pub mod durable;
pub mod duration;
pub mod environment;
pub mod exit;
pub mod finding;
pub mod helper;
pub mod logging;
pub mod manual;
pub mod notify;
pub mod output;
pub mod plain;
pub mod realtime;
pub mod session;
pub mod signal;
pub mod usage;
pub mod wall_clock;
