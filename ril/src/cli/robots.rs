//! The arguments of `ril robots`.

use std::time::Duration;

use clap::Args;
use runtime::args::CommonArgs;

use super::EXIT_CODES;
use super::value::seconds;

/// `ril robots`
///
/// A robot is live when a process of it lives. It lists all robots, whatever --robot says.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct RobotsArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// How long to wait for the state of each robot, in seconds [default: 2, or ril.toml]
    #[arg(long, value_name = "S", env = "RIL_TIMEOUT_S", value_parser = seconds)]
    pub timeout: Option<Duration>,

    /// Print each robot as a JSON object on a line
    #[arg(long)]
    pub json: bool,
}
