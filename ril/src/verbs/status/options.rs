//! The arguments of `ril status`.

use std::time::Duration;

use clap::Args;
use runtime::args::CommonArgs;

use crate::cli::exit_codes::EXIT_CODES;
use crate::cli::value::duration;

/// `ril status`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct StatusArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// How long to wait for a sample, such as 5s or 200ms [default: 2s, or ril.toml]
    #[arg(long, value_name = "DURATION", env = "RIL_TIMEOUT", value_parser = duration)]
    pub timeout: Option<Duration>,

    /// Print one JSON object
    #[arg(long)]
    pub json: bool,

    /// Go on until a signal: on a terminal show all anew in its place, elsewhere print a line at every change
    #[arg(long)]
    pub watch: bool,
}
