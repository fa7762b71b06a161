//! The options that every process takes. They are checked once, here; what comes out needs no further check.

use std::num::NonZeroU32;
use std::path::PathBuf;

use clap::{ArgAction, Args};

use crate::logging::Verbosity;

/// Options common to all processes; `#[command(flatten)]` them into a parser.
///
/// Precedence: command line, environment (`RIL_ROBOT`, `RIL_CONFIG`), built-in default.
#[derive(Args, Clone, Debug)]
pub struct CommonArgs {
    /// Which robot: an integer greater than 0 [default: 1]
    #[arg(long, value_name = "N", env = "RIL_ROBOT", value_parser = robot)]
    pub robot: Option<NonZeroU32>,

    /// Configuration and log.
    #[command(flatten)]
    pub settings: SettingsArgs,
}

/// Which configuration a process reads and how much it logs: for processes that take several robots,
/// `#[command(flatten)]` this into their own options.
#[derive(Args, Clone, Debug, Default)]
pub struct SettingsArgs {
    /// Configuration file; it must exist when it is named here
    #[arg(long, value_name = "FILE", env = "RIL_CONFIG")]
    pub config: Option<PathBuf>,

    /// Log more: -v debug, -vv trace
    #[arg(short, long, action = ArgAction::Count)]
    pub verbose: u8,

    /// Log less: -q warnings, -qq errors, -qqq nothing
    #[arg(short, long, action = ArgAction::Count, conflicts_with = "verbose")]
    pub quiet: u8,

    /// Check the configuration, print each value with its origin and end: exit code 0, or 78 with line and reason
    #[arg(long)]
    pub check_config: bool,
}

impl CommonArgs {
    /// The robot that was named, or else robot 1.
    pub fn robot(&self) -> NonZeroU32 {
        self.robot.unwrap_or(NonZeroU32::MIN)
    }

    /// How much the log says.
    pub fn verbosity(&self) -> Verbosity {
        self.settings.verbosity()
    }
}

impl SettingsArgs {
    /// How much the log says.
    pub fn verbosity(&self) -> Verbosity {
        Verbosity::from_counts(self.verbose, self.quiet)
    }
}

/// Reads a robot id, for `value_parser`.
///
/// # Errors
///
/// What a robot id is.
pub fn robot(text: &str) -> Result<NonZeroU32, String> {
    text.parse()
        .map_err(|_| "a robot id is an integer from 1 to 4294967295".to_owned())
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory, FromArgMatches, Parser};

    use super::*;

    #[derive(Debug, Parser)]
    struct Example {
        #[command(flatten)]
        common: CommonArgs,
    }

    #[test]
    fn the_robot_is_one_unless_told() {
        // Independent of the environment in which the tests run.
        let command = Example::command()
            .mut_arg("robot", |robot| robot.env(clap::builder::Resettable::Reset));
        let robot = |args: &[&str]| {
            let matches = command.clone().get_matches_from(args);
            Example::from_arg_matches(&matches)
                .unwrap()
                .common
                .robot()
                .get()
        };
        assert_eq!(robot(&["x"]), 1);
        assert_eq!(robot(&["x", "--robot", "4294967295"]), u32::MAX);
    }

    #[test]
    fn robot_zero_is_a_usage_error_that_says_what_is_expected() {
        for text in ["0", "-1", "one", "4294967296", ""] {
            let error = Example::try_parse_from(["x", &format!("--robot={text}")]).unwrap_err();
            assert_eq!(error.exit_code(), 2, "{text}");
            assert!(error.to_string().contains("from 1 to"), "{text}: {error}");
        }
    }

    #[test]
    fn verbose_and_quiet_exclude_each_other() {
        let error = Example::try_parse_from(["x", "-v", "-q"]).unwrap_err();
        assert_eq!(error.exit_code(), 2);
    }
}
