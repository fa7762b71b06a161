//! How a process ends: the exit codes of all commands, and the one place where an error is printed.
//!
//! Nothing here ends a process by itself: `main` returns what [`main_with`] gives it, so that every destructor has run.

use std::error::Error;
use std::fmt::Write;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::environment::without_empty_variables;
use crate::output;
use crate::plain::plain;
use crate::signal;

/// Defines [`ExitCode`]: for each its number, its name, and what to do about it.
macro_rules! exit_codes {
    ($($(#[$meta:meta])+ $code:ident = $number:literal, $name:literal, $next_step:literal;)+) => {
        /// The result that a process gives its caller. `docs/reference.md` says what to do about each.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum ExitCode {
            $($(#[$meta])+ $code = $number,)+
        }

        impl ExitCode {
            /// All codes, in ascending order.
            pub const ALL: [ExitCode; [$($number,)+].len()] = [$(ExitCode::$code,)+];

            /// The number that the caller sees.
            pub const fn code(self) -> u8 {
                self as u8
            }

            /// Its name in JSON.
            pub const fn name(self) -> &'static str {
                match self {
                    $(ExitCode::$code => $name,)+
                }
            }

            /// What to do about it when the failure itself does not say more.
            pub const fn next_step(self) -> &'static str {
                match self {
                    $(ExitCode::$code => $next_step,)+
                }
            }
        }
    };
}

exit_codes! {
    /// All went well, or a signal ended the process cleanly.
    Ok = 0, "ok", "nothing";
    /// Trouble that none of the others names; a defect included.
    Internal = 1, "internal", "read the last lines on standard error; `ril doctor` looks at what is around";
    /// A usage error.
    Usage = 2, "usage", "look at the command's --help";
    /// The process that should answer is not there.
    ServiceAbsent = 3, "service-absent", "start the process that should answer; is --robot right?";
    /// No answer in time.
    Timeout = 4, "timeout", "look at `ril status`: is the link silent?";
    /// The request was refused; the reason was printed.
    Refused = 5, "refused", "remove the cause that the message names, then try again";
    /// The line to the DSP is down, or was lost in flight; or the relay's link to a robot on another machine is down.
    LinkDown = 6, "link-down", "look at `ril status` for the state of the link";
    /// The outcome of the request cannot be known.
    OutcomeUnknown = 7, "outcome-unknown", "look at the helicopter, then at `ril status`";
    /// What was examined is not in order; the findings were printed.
    NotInOrder = 8, "not-in-order", "follow the next step of each finding";
    /// The configuration is wrong: a restart does not help (`EX_CONFIG`).
    Configuration = 78, "configuration", "correct the reported line; a restart alone does not help";
}

/// Why a process ends early: an exit code, and an error with its causes.
#[derive(Debug)]
pub struct Failure {
    code: ExitCode,
    /// `None` of a [quiet end](Failure::quiet_end).
    error: Option<Box<dyn Error + Send + Sync>>,
    /// What to do about it, where that is not a part of the error's own text.
    next_step: Option<String>,
    /// The signal by which the process ends after everything was cleaned up.
    signal: Option<i32>,
}

impl Failure {
    /// Ends the process with `code`; `error` and its sources are printed.
    pub fn new(code: ExitCode, error: impl Into<Box<dyn Error + Send + Sync>>) -> Failure {
        Failure {
            code,
            error: Some(error.into()),
            next_step: None,
            signal: None,
        }
    }

    /// Ends the process by the signal that interrupted it, after all destructors: a shell then says 130 for Ctrl+C.
    pub fn interrupted(signal: i32, error: impl Into<Box<dyn Error + Send + Sync>>) -> Failure {
        Failure {
            signal: Some(signal),
            ..Failure::new(ExitCode::Internal, error)
        }
    }

    /// The signal by which the process ends; `None` if it ends with an exit code.
    pub fn signal(&self) -> Option<i32> {
        self.signal
    }

    /// Adds what to do about the failure, which is printed on a line of its own.
    #[must_use]
    pub fn with_next_step(self, next_step: impl Into<String>) -> Failure {
        Failure {
            next_step: Some(next_step.into()),
            ..self
        }
    }

    /// What to do about it; that of the exit code when the failure has none of its own.
    pub fn next_step(&self) -> &str {
        self.next_step.as_deref().unwrap_or(self.code.next_step())
    }

    /// Ends the process with code 1.
    pub fn internal(error: impl Into<Box<dyn Error + Send + Sync>>) -> Failure {
        Failure::new(ExitCode::Internal, error)
    }

    /// Ends the process with code 2.
    pub fn usage(error: impl Into<Box<dyn Error + Send + Sync>>) -> Failure {
        Failure::new(ExitCode::Usage, error)
    }

    /// Ends the process early with code 0 and prints nothing: what was asked for is done, or the reader has gone before
    /// the rest of it.
    pub fn quiet_end() -> Failure {
        Failure {
            code: ExitCode::Ok,
            error: None,
            next_step: None,
            signal: None,
        }
    }

    /// Standard output could not be written. When its reader has gone, as in `ril echo dsp | head`, the process ends
    /// quietly with code 0.
    ///
    /// `println!` panics in that case; a program that prints data uses `writeln!(…).map_err(Failure::output)?`.
    pub fn output(error: io::Error) -> Failure {
        if error.kind() == io::ErrorKind::BrokenPipe {
            Failure::quiet_end()
        } else {
            Failure::internal(Explained {
                what: "standard output cannot be written".to_owned(),
                cause: error.into(),
            })
        }
    }

    /// Has `what` printed before the failure.
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
            next_step: self.next_step,
            signal: self.signal,
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

    /// What is printed: one line `error: …`, one line for each cause, one for the next step.
    fn text(&self) -> String {
        let mut printed = String::new();
        for (depth, text) in self.chain().iter().enumerate() {
            // Writing into a text cannot fail.
            let text = plain(text);
            let _ = match depth {
                0 => writeln!(printed, "error: {text}"),
                _ => writeln!(printed, "  caused by: {text}"),
            };
        }
        if let Some(next_step) = &self.next_step {
            let _ = writeln!(printed, "  next step: {}", plain(next_step));
        }
        printed
    }
}

/// Gives the error of a result its exit code.
pub trait OrFail<T> {
    /// The value, or a [`Failure`] with `code`.
    fn or_fail(self, code: ExitCode) -> Result<T, Failure>;

    /// The value, or a [`Failure`] with `code` that prints `what` before the error.
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

/// The body of `main`: runs `run`, prints its error once on standard error and gives the exit code. What waits for
/// standard error is written before the process ends, for at most [`output::END_LIMIT`]: no reader keeps it from its
/// end.
///
/// A limit on the size of files is an error as others are, see [`signal::survive_file_size_limits`].
///
/// The panic hook has printed a panic; it ends with code 1 after the destructors.
pub fn main_with(run: impl FnOnce() -> Result<(), Failure>) -> std::process::ExitCode {
    main_and_report(run, |_| {})
}

/// As [`main_with`]; `report` gets the failure as well, to give it to programs. A quiet end is none.
pub fn main_and_report(
    run: impl FnOnce() -> Result<(), Failure>,
    report: impl FnOnce(&Failure),
) -> std::process::ExitCode {
    output::bound_panics();
    let run = || {
        signal::survive_file_size_limits()
            .or_fail_with(ExitCode::Internal, "a signal handler cannot be installed")?;
        run()?;
        output::end_standard_output().map_err(Failure::output)
    };
    let code = match catch_unwind(AssertUnwindSafe(run)) {
        Ok(Ok(())) => {
            output::end_standard_error("");
            ExitCode::Ok
        }
        Ok(Err(failure)) => {
            if failure.code != ExitCode::Ok {
                report(&failure);
            }
            // Standard error may be closed; the exit code still says enough.
            output::finish(failure.text());
            if let Some(signal) = failure.signal {
                signal::end_by(signal);
            }
            failure.code
        }
        Err(_panic) => {
            report(&Failure::internal(
                "a defect ended the process; the panic is on standard error",
            ));
            output::finish("");
            ExitCode::Internal
        }
    };
    code.code().into()
}

/// The body of `main` of a program that is its command line: reads that, and then as [`main_with`].
pub fn main_of<A: clap::Parser>(
    run: impl FnOnce(A) -> Result<(), Failure>,
) -> std::process::ExitCode {
    let mut command = without_empty_variables(A::command());
    let read = command.try_get_matches_from_mut(std::env::args_os());
    let read = read.and_then(|matches| {
        A::from_arg_matches(&matches).map_err(|error| error.format(&mut command))
    });
    match read {
        Ok(args) => main_with(|| run(args)),
        Err(error) => usage(&error).into(),
    }
}

/// Prints what the parser of the command line has to print, and gives the exit code: a usage error on standard error,
/// for which it waits no longer than for a failure, or the help that was asked for on standard output.
pub fn usage(error: &clap::Error) -> u8 {
    if error.use_stderr() {
        output::finish(plain(&error.render().to_string()));
    } else if let Err(failure) = error.print().and_then(|()| output::end_standard_output()) {
        let failure = Failure::output(failure);
        output::finish(failure.text());
        return failure.code.code();
    }
    u8::try_from(error.exit_code()).unwrap_or(ExitCode::Usage.code())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn printed(failure: &Failure) -> String {
        failure.text()
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
            printed(&failure),
            "error: the bridge cannot start\n  caused by: /dev/ttyUSB0 cannot be opened\n  caused by: permission denied\n"
        );
    }

    #[test]
    fn the_next_step_is_a_line_of_its_own_and_every_code_has_one() {
        let failure = Failure::new(ExitCode::ServiceAbsent, "there is no bridge");
        assert_eq!(failure.next_step(), ExitCode::ServiceAbsent.next_step());
        let failure = failure.with_next_step("start it").context("land");
        assert_eq!(failure.next_step(), "start it");
        assert_eq!(
            printed(&failure),
            "error: land\n  caused by: there is no bridge\n  next step: start it\n"
        );
    }

    #[test]
    fn a_cause_that_the_error_already_repeats_is_told_once() {
        #[derive(Debug, thiserror::Error)]
        #[error("wrong: {0}")]
        struct Repeats(#[source] io::Error);
        let failure = Failure::internal(Repeats(io::ErrorKind::NotFound.into()));
        assert_eq!(printed(&failure), "error: wrong: entity not found\n");
    }

    #[test]
    fn a_reader_that_has_gone_is_a_quiet_end() {
        let failure = Failure::output(io::ErrorKind::BrokenPipe.into()).context("never printed");
        assert_eq!(failure.code(), ExitCode::Ok);
        assert_eq!(printed(&failure), "");
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
