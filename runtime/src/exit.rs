//! How a process ends: the exit codes of all commands, and the one place where an error is told.
//!
//! Nothing here ends a process by itself: `main` returns what [`main_with`] gives it, so that every destructor has run.

use std::error::Error;
use std::io::{self, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::config::ConfigError;
use crate::signal;

/// What a process tells its caller. `docs/operations.md` says what to do about each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum ExitCode {
    /// All went well, or a signal ended the process cleanly.
    Ok = 0,
    /// Trouble that none of the others names; a defect included.
    Internal = 1,
    /// The command line makes no sense.
    Usage = 2,
    /// The process that should answer is not there.
    ServiceAbsent = 3,
    /// No answer in time.
    Timeout = 4,
    /// The request was refused; the reason was told.
    Refused = 5,
    /// The line to the DSP is down, or was lost in flight; or the relay's link to a robot on another machine is down.
    LinkDown = 6,
    /// Nobody can know whether the request was carried out.
    OutcomeUnknown = 7,
    /// What was examined is not in order; the findings were told.
    NotInOrder = 8,
    /// The configuration is wrong: a restart does not help (`EX_CONFIG`).
    Configuration = 78,
}

impl ExitCode {
    /// All codes, in ascending order.
    pub const ALL: [ExitCode; 10] = [
        ExitCode::Ok,
        ExitCode::Internal,
        ExitCode::Usage,
        ExitCode::ServiceAbsent,
        ExitCode::Timeout,
        ExitCode::Refused,
        ExitCode::LinkDown,
        ExitCode::OutcomeUnknown,
        ExitCode::NotInOrder,
        ExitCode::Configuration,
    ];

    /// The number that the caller sees.
    pub const fn code(self) -> u8 {
        self as u8
    }
}

/// Why a process ends early: an exit code, and an error with its causes.
#[derive(Debug)]
pub struct Failure {
    code: ExitCode,
    /// Nothing to tell: whoever read our standard output has gone, which is how pipelines end.
    error: Option<Box<dyn Error + Send + Sync>>,
}

impl Failure {
    /// Ends the process with `code`; `error` and its sources are told.
    pub fn new(code: ExitCode, error: impl Into<Box<dyn Error + Send + Sync>>) -> Failure {
        Failure {
            code,
            error: Some(error.into()),
        }
    }

    /// Ends the process with code 1.
    pub fn internal(error: impl Into<Box<dyn Error + Send + Sync>>) -> Failure {
        Failure::new(ExitCode::Internal, error)
    }

    /// Ends the process with code 2.
    pub fn usage(error: impl Into<Box<dyn Error + Send + Sync>>) -> Failure {
        Failure::new(ExitCode::Usage, error)
    }

    /// Standard output could not be written. When its reader has gone, as in `ril echo dsp | head`, the process ends
    /// quietly with code 0.
    ///
    /// `println!` panics in that case; whoever prints data uses `writeln!(…).map_err(Failure::output)?`.
    pub fn output(error: io::Error) -> Failure {
        if error.kind() == io::ErrorKind::BrokenPipe {
            Failure {
                code: ExitCode::Ok,
                error: None,
            }
        } else {
            Failure::internal(Explained {
                what: "standard output cannot be written".to_owned(),
                cause: error.into(),
            })
        }
    }

    /// The same failure with `what` told before it.
    #[must_use]
    pub fn context(self, what: impl Into<String>) -> Failure {
        Failure {
            code: self.code,
            error: self.error.map(|cause| {
                Explained {
                    what: what.into(),
                    cause,
                }
                .into()
            }),
        }
    }

    /// The exit code.
    pub fn code(&self) -> ExitCode {
        self.code
    }

    /// The error and its causes, outermost first; empty for a quiet end.
    pub fn chain(&self) -> Vec<String> {
        let mut chain: Vec<String> = Vec::new();
        let mut next: Option<&dyn Error> = self.error.as_deref().map(|error| error as &dyn Error);
        while let Some(error) = next {
            let text = error.to_string();
            // Some libraries repeat the cause in their own text.
            if !chain.last().is_some_and(|outer| outer.contains(&text)) {
                chain.push(text);
            }
            next = error.source();
        }
        chain
    }

    /// Tells the error on `to`: one line `error: …`, one line for each cause.
    fn tell(&self, to: &mut impl Write) -> io::Result<()> {
        for (depth, text) in self.chain().iter().enumerate() {
            match depth {
                0 => writeln!(to, "error: {text}")?,
                _ => writeln!(to, "  caused by: {text}")?,
            }
        }
        Ok(())
    }
}

impl From<ConfigError> for Failure {
    fn from(error: ConfigError) -> Failure {
        Failure::new(ExitCode::Configuration, error)
    }
}

/// Gives the error of a result its exit code.
pub trait OrFail<T> {
    /// The value, or a [`Failure`] with `code`.
    fn or_fail(self, code: ExitCode) -> Result<T, Failure>;

    /// The value, or a [`Failure`] with `code` that tells `what` before the error.
    fn or_fail_with(self, code: ExitCode, what: impl Into<String>) -> Result<T, Failure>;
}

impl<T, E: Into<Box<dyn Error + Send + Sync>>> OrFail<T> for Result<T, E> {
    fn or_fail(self, code: ExitCode) -> Result<T, Failure> {
        self.map_err(|error| Failure::new(code, error))
    }

    fn or_fail_with(self, code: ExitCode, what: impl Into<String>) -> Result<T, Failure> {
        self.map_err(|error| Failure::new(code, error).context(what))
    }
}

/// An error with an explanation before it.
#[derive(Debug, thiserror::Error)]
#[error("{what}")]
struct Explained {
    what: String,
    #[source]
    cause: Box<dyn Error + Send + Sync>,
}

/// The body of `main`: runs `run`, tells its error once on standard error and gives the exit code.
///
/// A limit on the size of files is an error as others are, see [`signal::survive_file_size_limits`].
///
/// A panic has been told by the panic hook; it ends with code 1 after the destructors.
pub fn main_with(run: impl FnOnce() -> Result<(), Failure>) -> std::process::ExitCode {
    let run = || {
        signal::survive_file_size_limits()
            .or_fail_with(ExitCode::Internal, "a signal handler cannot be installed")?;
        run()
    };
    let code = match catch_unwind(AssertUnwindSafe(run)) {
        Ok(Ok(())) => ExitCode::Ok,
        Ok(Err(failure)) => {
            // Standard error may be closed; the exit code still says enough.
            let _ = failure.tell(&mut io::stderr().lock());
            failure.code
        }
        Err(_panic) => ExitCode::Internal,
    };
    code.code().into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(failure: &Failure) -> String {
        let mut text = Vec::new();
        failure.tell(&mut text).unwrap();
        String::from_utf8(text).unwrap()
    }

    #[test]
    fn the_codes_are_those_of_the_documentation() {
        let codes = ExitCode::ALL.map(ExitCode::code);
        assert_eq!(codes, [0, 1, 2, 3, 4, 5, 6, 7, 8, 78]);
    }

    #[test]
    fn an_error_is_told_with_its_causes() {
        let cause = io::Error::from(io::ErrorKind::PermissionDenied);
        let failure = Err::<(), _>(cause)
            .or_fail_with(ExitCode::LinkDown, "/dev/ttyUSB0 cannot be opened")
            .unwrap_err()
            .context("the bridge cannot start");
        assert_eq!(failure.code(), ExitCode::LinkDown);
        assert_eq!(
            told(&failure),
            "error: the bridge cannot start\n  caused by: /dev/ttyUSB0 cannot be opened\n  caused by: permission denied\n"
        );
    }

    #[test]
    fn a_cause_that_the_error_already_repeats_is_told_once() {
        #[derive(Debug, thiserror::Error)]
        #[error("wrong: {0}")]
        struct Repeats(#[source] io::Error);
        let failure = Failure::internal(Repeats(io::ErrorKind::NotFound.into()));
        assert_eq!(told(&failure), "error: wrong: entity not found\n");
    }

    #[test]
    fn a_reader_that_has_gone_is_a_quiet_end() {
        let failure = Failure::output(io::ErrorKind::BrokenPipe.into()).context("never told");
        assert_eq!(failure.code(), ExitCode::Ok);
        assert_eq!(told(&failure), "");
        let full = Failure::output(io::ErrorKind::StorageFull.into());
        assert_eq!(full.code(), ExitCode::Internal);
    }

    #[test]
    fn main_gives_the_code_of_success_failure_and_panic() {
        let shown = |code: std::process::ExitCode| format!("{code:?}");
        let code = |number: u8| shown(number.into());
        assert_eq!(shown(main_with(|| Ok(()))), code(0));
        let refused = main_with(|| Err(Failure::new(ExitCode::Refused, "tested on purpose")));
        assert_eq!(shown(refused), code(5));
        assert_eq!(shown(main_with(|| panic!("tested on purpose"))), code(1));
    }
}
