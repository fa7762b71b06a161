//! Diagnostics: `tracing` to standard error, so that standard output carries data alone. [`LogLines`] has the same lines for a
//! recorder.

mod lines;

use std::io;

use tracing::level_filters::LevelFilter;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::{EnvFilter, fmt};

use crate::exit::{ExitCode, Failure};

pub use lines::{LogLine, LogLines};

/// The environment variable that chooses what is logged, in the syntax of `tracing_subscriber::EnvFilter`, such as
/// `info,bridge=trace`. `-v` and `-q` rule over it.
pub const LOG_VARIABLE: &str = "RIL_LOG";

/// How much is logged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verbosity {
    /// What `RIL_LOG` says; without it, info and above.
    Default,
    /// This level and above, whatever `RIL_LOG` says.
    Level(LevelFilter),
}

impl Verbosity {
    /// The level for that many `-v` and `-q`.
    pub fn from_counts(verbose: u8, quiet: u8) -> Verbosity {
        match (verbose, quiet) {
            (0, 0) => Verbosity::Default,
            (1, _) => Verbosity::Level(LevelFilter::DEBUG),
            (2.., _) => Verbosity::Level(LevelFilter::TRACE),
            (0, 1) => Verbosity::Level(LevelFilter::WARN),
            (0, 2) => Verbosity::Level(LevelFilter::ERROR),
            (0, 3..) => Verbosity::Level(LevelFilter::OFF),
        }
    }
}

/// Starts logging. Only the first call of a process has an effect, so that commands which contain others need not care.
///
/// # Errors
/// `RIL_LOG` cannot be understood (exit code 78).
pub fn init(verbosity: Verbosity) -> Result<(), Failure> {
    let filter = filter(verbosity, std::env::var(LOG_VARIABLE).ok().as_deref())?;
    let standard_error = fmt::layer()
        .with_writer(io::stderr)
        // Plain text everywhere: a journal, a file and a terminal show the same.
        .with_ansi(false)
        // A closed standard error must not become a panic.
        .log_internal_errors(false);
    let subscriber = tracing_subscriber::registry()
        .with(filter)
        .with(standard_error)
        .with(lines::LineLayer);
    let _ = tracing::subscriber::set_global_default(subscriber);
    Ok(())
}

/// This level, and of the network library only its errors: it warns about each connection that an unknown peer tries, and such a peer
/// can try without end.
fn quietened(level: LevelFilter) -> String {
    format!("{level},zenoh={}", level.min(LevelFilter::ERROR))
}

/// The filter for `verbosity` when the environment says `variable`.
fn filter(verbosity: Verbosity, variable: Option<&str>) -> Result<EnvFilter, Failure> {
    let directives = match (verbosity, variable) {
        (Verbosity::Level(level), _) if level >= LevelFilter::DEBUG => level.to_string(),
        (Verbosity::Level(level), _) => quietened(level),
        (Verbosity::Default, None | Some("")) => quietened(LevelFilter::INFO),
        (Verbosity::Default, Some(variable)) => variable.to_owned(),
    };
    EnvFilter::try_new(&directives).map_err(|error| {
        Failure::new(ExitCode::Configuration, error).context(format!(
            "{LOG_VARIABLE}=`{directives}` is not a log filter: try `info`, or `warn,bridge=debug`"
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_rules_over_the_environment() {
        for (verbose, quiet, variable, expected) in [
            (0, 0, None, "zenoh=error,info"),
            (0, 0, Some(""), "zenoh=error,info"),
            (0, 0, Some("bridge=trace"), "bridge=trace"),
            (1, 0, Some("error"), "debug"),
            (2, 0, None, "trace"),
            (9, 0, None, "trace"),
            (0, 1, Some("trace"), "zenoh=error,warn"),
            (0, 2, None, "zenoh=error,error"),
            (0, 3, None, "zenoh=off,off"),
        ] {
            let filter = filter(Verbosity::from_counts(verbose, quiet), variable).unwrap();
            assert_eq!(
                filter.to_string(),
                expected,
                "{verbose} {quiet} {variable:?}"
            );
        }
    }

    #[test]
    fn a_filter_that_makes_no_sense_is_a_configuration_error() {
        let failure = filter(Verbosity::Default, Some("bridge=loud")).unwrap_err();
        assert_eq!(failure.code(), ExitCode::Configuration);
        assert!(failure.chain()[0].contains("RIL_LOG"));
    }
}
