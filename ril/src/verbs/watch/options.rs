//! The arguments of `ril watch`.

use std::num::NonZeroU32;
use std::path::PathBuf;

use clap::{ArgAction, Args};
use runtime::args::{CommonArgs, robot};

use crate::cli::exit_codes::EXIT_CODES;

/// `ril watch`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct WatchArgs {
    /// Which robot; can be given up to nine times, or as 1,2,5 [default: all robots that are alive, or robot 1]
    #[arg(long = "robot", value_name = "N", env = "RIL_ROBOT", value_delimiter = ',', value_parser = robot)]
    pub robots: Vec<NonZeroU32>,

    /// Configuration of the bridge, of which the geofence is drawn [default: bridge.toml, if it is there]
    #[arg(long, value_name = "FILE")]
    pub bridge: Option<PathBuf>,

    /// Draw the path of this plan on the map; a file as for `ril plan`
    #[arg(long, value_name = "FILE")]
    pub plan: Option<PathBuf>,

    /// Do not ring the terminal's bell when an alarm begins
    #[arg(long)]
    pub no_bell: bool,

    /// Draw with ASCII characters only
    #[arg(long)]
    pub ascii: bool,

    /// Configuration file; it must exist when it is named here
    #[arg(long, value_name = "FILE", env = "RIL_CONFIG")]
    pub config: Option<PathBuf>,

    /// Say more: -v debug, -vv trace; only when standard error is not the terminal
    #[arg(short, long, action = ArgAction::Count)]
    pub verbose: u8,

    /// Say less: -q warnings, -qq errors, -qqq nothing
    #[arg(short, long, action = ArgAction::Count, conflicts_with = "verbose")]
    pub quiet: u8,

    /// Check the configuration and end: exit code 0, or 78 with file, line and reason
    #[arg(long)]
    pub check_config: bool,
}

impl WatchArgs {
    /// What every process takes. `is_quiet` says that a log would be written across the screen.
    pub fn common(&self, is_quiet: bool) -> CommonArgs {
        /// As many `-q` as it takes to say nothing.
        const NOTHING: u8 = 3;
        CommonArgs {
            robot: self.robots.first().copied().unwrap_or(NonZeroU32::MIN),
            config: self.config.clone(),
            verbose: if is_quiet { 0 } else { self.verbose },
            quiet: if is_quiet { NOTHING } else { self.quiet },
            check_config: self.check_config,
        }
    }
}
