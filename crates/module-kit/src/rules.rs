//! The manager's rules: what a start and a stop do, and what is published (requirements B3, D8). Pure values.
//!
//! | the module | status | blocked | start | stop | fatal error |
//! |---|---|---|---|---|---|
//! | rests, waiting | waiting-data-to-start | yes | → ready | → stopped | noted |
//! | rests, ready | running | no | error 1 | → stopped | → aborted |
//! | rests, done | ended | no | → ready | → stopped | → aborted |
//! | rests, stopped | ended | yes | → ready | → stopped | noted |
//! | rests, aborted | aborted | yes | → ready | → aborted | noted |
//! | works, a stop aborts it | running | no | error 1 | → aborted | → aborted |
//! | works, a stop ends it | running | no | error 1 | → stopped | → aborted |
//! | works, cannot be stopped | running | no | error 1 | error 2 | → aborted |
//! | is stopping | as it will rest | yes | busy | busy | noted |
//!
//! Error 1 is module-running-to-restart-stop-it-before, error 2 is impossible-to-stop-module. "Noted" publishes the
//! error and changes nothing else: nothing is running that could be ended.

use ipc_types::code::{ImiCode, ImiError, ModuleStatus, Reason, Stage};
use ipc_types::payload::RequestReport;

/// A module's error: the bridge's are those of the interface, other modules have numbers of their own.
pub trait ErrorCode: Copy + PartialEq {
    /// No error.
    const NONE: Self;
}

impl ErrorCode for ImiError {
    const NONE: ImiError = ImiError::None;
}

impl ErrorCode for ImiCode {
    const NONE: ImiCode = ImiCode(0);
}

/// How a module that is not working came to rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Rest<E> {
    /// Never started; a fatal error may have been noted.
    Waiting(E),
    /// Started, and no work has ended as it should since.
    Ready,
    /// The last work ended as it should.
    Done,
    /// Stopped without work; a fatal error may have been noted since.
    Stopped(E),
    /// A stop or an error ended the work early.
    Aborted(E),
}

/// What a stop does to work.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum OnStop {
    /// The work ends early: the module is aborted.
    Aborts,
    /// The work may end at any time: the module is stopped, as if it had rested.
    Ends,
    /// The work cannot be stopped (`unable2abort`): the stop is refused.
    Refused,
}

/// What the manager needs to know of a module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Standing<E> {
    /// It does not work.
    Resting(Rest<E>),
    /// It works.
    Working(OnStop),
    /// A stop is being carried out.
    Stopping {
        /// How it rests afterwards.
        then: Rest<E>,
    },
}

/// Why a control request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refused {
    /// A start while the module runs.
    Running,
    /// A stop while the module cannot be stopped.
    UnableToAbort,
    /// A stop is under way.
    Busy,
    /// The command is none that this module has.
    UnknownCommand,
}

impl Refused {
    /// The error of the source, which the state shows.
    pub const fn error(self) -> ImiError {
        match self {
            Refused::Running => ImiError::ModuleRunningToRestartStopItBefore,
            Refused::UnableToAbort => ImiError::ImpossibleToStopModule,
            Refused::Busy | Refused::UnknownCommand => ImiError::None,
        }
    }

    /// The reason in the report.
    pub const fn reason(self) -> Reason {
        match self {
            Refused::Running => Reason::AlreadyRunning,
            Refused::UnableToAbort => Reason::UnableToAbort,
            Refused::Busy => Reason::Busy,
            Refused::UnknownCommand => Reason::InvalidRequest,
        }
    }

    /// The final report.
    pub fn report(self) -> RequestReport {
        RequestReport {
            imi_error: self.error().code(),
            ..RequestReport::new(Stage::Refused, self.reason())
        }
    }
}

impl<E: ErrorCode> Rest<E> {
    /// The published status.
    pub fn status(self) -> ModuleStatus {
        match self {
            Rest::Waiting(_) => ModuleStatus::WaitingDataToStart,
            Rest::Ready => ModuleStatus::Running,
            Rest::Done | Rest::Stopped(_) => ModuleStatus::Ended,
            Rest::Aborted(_) => ModuleStatus::Aborted,
        }
    }

    /// The error that holds as long as the module rests like this.
    pub fn error(self) -> E {
        match self {
            Rest::Waiting(error) | Rest::Stopped(error) | Rest::Aborted(error) => error,
            Rest::Ready | Rest::Done => E::NONE,
        }
    }

    /// Whether the module does not work until the next start.
    pub fn is_blocked(self) -> bool {
        matches!(self, Rest::Waiting(_) | Rest::Stopped(_) | Rest::Aborted(_))
    }

    /// After a fatal error.
    #[must_use]
    pub fn with_fatal(self, error: E) -> Rest<E> {
        match self {
            Rest::Waiting(_) => Rest::Waiting(error),
            Rest::Stopped(_) => Rest::Stopped(error),
            Rest::Ready | Rest::Done | Rest::Aborted(_) => Rest::Aborted(error),
        }
    }
}

impl<E: ErrorCode> Standing<E> {
    /// How the module rests after a start.
    ///
    /// # Errors
    /// Why it is refused.
    pub fn start(self) -> Result<Rest<E>, Refused> {
        match self {
            Standing::Stopping { .. } => Err(Refused::Busy),
            Standing::Working(_) | Standing::Resting(Rest::Ready) => Err(Refused::Running),
            Standing::Resting(_) => Ok(Rest::Ready),
        }
    }

    /// How the module rests after a stop.
    ///
    /// # Errors
    /// Why it is refused.
    pub fn stop(self) -> Result<Rest<E>, Refused> {
        match self {
            Standing::Stopping { .. } => Err(Refused::Busy),
            Standing::Working(OnStop::Refused) => Err(Refused::UnableToAbort),
            Standing::Working(OnStop::Aborts) => Ok(Rest::Aborted(E::NONE)),
            Standing::Resting(Rest::Aborted(error)) => Ok(Rest::Aborted(error)),
            Standing::Working(OnStop::Ends) | Standing::Resting(_) => Ok(Rest::Stopped(E::NONE)),
        }
    }

    /// The published status.
    pub fn status(self) -> ModuleStatus {
        match self {
            Standing::Resting(rest) | Standing::Stopping { then: rest } => rest.status(),
            Standing::Working(_) => ModuleStatus::Running,
        }
    }

    /// The error that holds as long as the module stands like this.
    pub fn error(self) -> E {
        match self {
            Standing::Resting(rest) | Standing::Stopping { then: rest } => rest.error(),
            Standing::Working(_) => E::NONE,
        }
    }

    /// Whether the module begins no work until the next start.
    pub fn is_blocked(self) -> bool {
        match self {
            Standing::Resting(rest) => rest.is_blocked(),
            Standing::Working(_) => false,
            Standing::Stopping { .. } => true,
        }
    }

    /// Whether a stop is refused because of the work (`unable2abort`).
    pub fn unable_to_abort(self) -> bool {
        matches!(self, Standing::Working(OnStop::Refused))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ERROR: ImiError = ImiError::HeroDspFatalError;
    const NONE: ImiError = ImiError::None;

    #[test]
    fn every_standing_and_control() {
        use Refused::{Busy, Running, UnableToAbort};
        use Rest::{Aborted, Done, Ready, Stopped, Waiting};
        let stopping = Standing::Stopping {
            then: Stopped(NONE),
        };
        let (resting, working) = (Standing::Resting, Standing::Working);
        let table = [
            (resting(Waiting(ERROR)), Ok(Ready), Ok(Stopped(NONE))),
            (resting(Ready), Err(Running), Ok(Stopped(NONE))),
            (resting(Done), Ok(Ready), Ok(Stopped(NONE))),
            (resting(Stopped(ERROR)), Ok(Ready), Ok(Stopped(NONE))),
            (resting(Aborted(ERROR)), Ok(Ready), Ok(Aborted(ERROR))),
            (working(OnStop::Aborts), Err(Running), Ok(Aborted(NONE))),
            (working(OnStop::Ends), Err(Running), Ok(Stopped(NONE))),
            (working(OnStop::Refused), Err(Running), Err(UnableToAbort)),
            (stopping, Err(Busy), Err(Busy)),
        ];
        for (standing, started, stopped) in table {
            assert_eq!(standing.start(), started, "{standing:?}");
            assert_eq!(standing.stop(), stopped, "{standing:?}");
        }
    }

    #[test]
    fn a_standing_is_published_as_the_sources_four_states() {
        use ModuleStatus as S;
        use Rest::{Aborted, Done, Ready, Stopped, Waiting};
        let (resting, working) = (Standing::Resting, Standing::Working);
        let stopping = Standing::Stopping {
            then: Aborted(ERROR),
        };
        let table = [
            (resting(Waiting(NONE)), S::WaitingDataToStart, true, NONE),
            (resting(Ready), S::Running, false, NONE),
            (resting(Done), S::Ended, false, NONE),
            (resting(Stopped(ERROR)), S::Ended, true, ERROR),
            (resting(Aborted(ERROR)), S::Aborted, true, ERROR),
            (working(OnStop::Aborts), S::Running, false, NONE),
            (working(OnStop::Refused), S::Running, false, NONE),
            (stopping, S::Aborted, true, ERROR),
        ];
        for (standing, status, is_blocked, error) in table {
            assert_eq!(standing.status(), status, "{standing:?}");
            assert_eq!(standing.is_blocked(), is_blocked, "{standing:?}");
            assert_eq!(standing.error(), error, "{standing:?}");
            let is_refused = standing == working(OnStop::Refused);
            assert_eq!(standing.unable_to_abort(), is_refused, "{standing:?}");
        }
    }

    #[test]
    fn a_fatal_error_is_noted_where_nothing_runs_and_aborts_else() {
        for (rest, after) in [
            (Rest::Waiting(NONE), Rest::Waiting(ERROR)),
            (Rest::Stopped(NONE), Rest::Stopped(ERROR)),
            (Rest::Ready, Rest::Aborted(ERROR)),
            (Rest::Done, Rest::Aborted(ERROR)),
            (
                Rest::Aborted(ImiError::MovementTimeout),
                Rest::Aborted(ERROR),
            ),
        ] {
            assert_eq!(rest.with_fatal(ERROR), after, "{rest:?}");
        }
    }

    #[test]
    fn a_refusal_has_the_sources_error_and_a_reason() {
        for (refused, error, reason) in [
            (Refused::Running, 1, Reason::AlreadyRunning),
            (Refused::UnableToAbort, 2, Reason::UnableToAbort),
            (Refused::Busy, 0, Reason::Busy),
            (Refused::UnknownCommand, 0, Reason::InvalidRequest),
        ] {
            let report = refused.report();
            assert_eq!(report.stage(), Some(Stage::Refused));
            assert_eq!(
                (report.imi_error().0, report.reason()),
                (error, Some(reason))
            );
        }
    }
}
