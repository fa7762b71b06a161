//! The arguments of `ril robots`.

use std::time::Duration;

use clap::Args;
use runtime::args::CommonArgs;

use super::exit_codes::EXIT_CODES;
use crate::cli::value::duration;

/// `ril robots`
///
/// A robot is live when a process of it lives. It lists all robots, whatever --robot says.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct RobotsArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// How long to wait for the state of each robot, such as 5s or 200ms [default: 2s, or ril.toml]
    #[arg(long, value_name = "DURATION", env = "RIL_TIMEOUT", value_parser = duration)]
    pub timeout: Option<Duration>,

    /// Print each robot as a JSON object on a line
    #[arg(long)]
    pub json: bool,
}
