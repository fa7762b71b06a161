//! The arguments of `ril relay`.

use std::ffi::OsString;
use std::time::Duration;

use clap::{ArgAction, Args, Subcommand};
use runtime::args::CommonArgs;

use crate::cli::exit_codes::EXIT_CODES;
use crate::cli::value::duration;

/// `ril relay`
///
/// Everything but `status` goes to the program `ril-relay` as it is, `--help` too.
#[derive(Args, Clone, Debug)]
#[command(
    args_conflicts_with_subcommands = true,
    disable_help_flag = true,
    disable_help_subcommand = true
)]
pub struct RelayArgs {
    /// What to do beside relaying.
    #[command(subcommand)]
    pub command: Option<RelayCommand>,

    /// Arguments of `ril-relay`; its --help lists them
    #[arg(
        trailing_var_arg = true,
        allow_hyphen_values = true,
        value_name = "ARGS"
    )]
    pub args: Vec<OsString>,
}

/// `ril relay …`
#[derive(Clone, Debug, Subcommand)]
pub enum RelayCommand {
    /// Show the links of the relay that runs on this machine, its clock, losses and orders
    Status(RelayStatusArgs),
}

/// `ril relay status`
///
/// On a station's machine it shows the link to the robot, on a robot's machine the stations. It ends with exit code 0 when
/// the link is up, or at least one station is, and with 6 when not.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct RelayStatusArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// How long to wait for a sample, such as 5s or 200ms [default: 2s, or ril.toml]
    #[arg(long, value_name = "DURATION", env = "RIL_TIMEOUT", value_parser = duration)]
    pub timeout: Option<Duration>,

    /// Print one JSON object
    #[arg(long)]
    pub json: bool,

    /// Print help
    // That of `ril relay` is off, because it is the program's own, and with it those of all verbs below.
    #[arg(short, long, action = ArgAction::Help)]
    help: Option<bool>,
}
