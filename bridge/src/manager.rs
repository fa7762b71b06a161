//! The module manager (`CBridgeModManager`, requirement D8): from control, functionality and errors to block, stop and
//! the state of the module.
//!
//! | phase (published as) | start | stop | movement began | movement ended | fatal error |
//! |---|---|---|---|---|---|
//! | Waiting (waiting-data-to-start), blocked | unblock → Ready | → Stopped | – | – | noted |
//! | Ready (running) | error 1 | block, stop → Stopped | → Moving | – | block, stop → Aborted |
//! | Moving, abortable (running) | error 1 | block, stop → Aborted | → Moving | → Done | block, stop → Aborted |
//! | Moving, unable to abort (running) | error 1 | error 2 | → Moving | → Done | block, stop → Aborted |
//! | Done (ended) | → Ready | block, stop → Stopped | → Moving | – | block, stop → Aborted |
//! | Stopped (ended), blocked | unblock → Ready | stop | – | – | noted |
//! | Aborted (aborted), blocked | unblock → Ready | stop | – | – | noted |
//!
//! Error 1 is module-running-to-restart-stop-it-before, error 2 is impossible-to-stop-module. "Noted" publishes the error
//! and changes nothing else: nothing is running that could be ended. "–" does nothing; a blocked module begins no
//! movement. A stop in a blocked phase still empties the DSP's buffer: the operator who presses it twice means it.

use ipc_types::code::{ControlCommand, ImiError, ModuleStatus};

/// Where the module is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Never started.
    Waiting,
    /// Started, no movement yet.
    Ready,
    /// A movement is under way.
    Moving {
        /// It cannot be aborted (`unable2abort`).
        unable_to_abort: bool,
    },
    /// The last movement ended as it should.
    Done,
    /// Stopped at rest.
    Stopped,
    /// Ended early by a stop or an error.
    Aborted,
}

/// What happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// The operator's control.
    Control(ControlCommand),
    /// `FUNCTIONALITY_RUNNING`.
    MovementBegan {
        /// It cannot be aborted.
        unable_to_abort: bool,
    },
    /// `FUNCTIONALITY_ENDED` as it should.
    MovementEnded,
    /// An error that transcends.
    Fatal(ImiError),
}

/// What to do about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Decision {
    /// What to do with the functionality.
    pub action: Action,
    /// End the functionality and empty every buffer (`STOP`), or leave it (`NO_STOP`).
    pub stop: bool,
    /// The error that a control request is refused with.
    pub refused: Option<ImiError>,
}

/// Whether the functionality may take movements from now on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// `BLOCK_MODULE_FUNCTIONALITY`
    Block,
    /// `UNBLOCK_MODULE_FUNCTIONALITY`
    Unblock,
    /// `NOTHING_TO_DO`
    Nothing,
}

/// The state machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Manager {
    phase: Phase,
    error: ImiError,
}

impl Default for Manager {
    fn default() -> Self {
        Manager {
            phase: Phase::Waiting,
            error: ImiError::None,
        }
    }
}

impl Manager {
    /// Takes an event, changes the phase and says what to do.
    pub fn handle(&mut self, event: Event) -> Decision {
        match event {
            Event::Control(ControlCommand::Start) => self.start(),
            Event::Control(ControlCommand::Stop) => self.stop(),
            Event::Control(ControlCommand::ReloadFence) => Decision::NOTHING,
            Event::MovementBegan { unable_to_abort } => {
                if !self.blocked() {
                    self.enter(Phase::Moving { unable_to_abort }, ImiError::None);
                }
                Decision::NOTHING
            }
            Event::MovementEnded => {
                if matches!(self.phase, Phase::Moving { .. }) {
                    self.phase = Phase::Done;
                }
                Decision::NOTHING
            }
            Event::Fatal(error) if self.blocked() => {
                self.error = error;
                Decision::NOTHING
            }
            Event::Fatal(error) => {
                self.enter(Phase::Aborted, error);
                Decision::BLOCK_AND_STOP
            }
        }
    }

    fn start(&mut self) -> Decision {
        match self.phase {
            Phase::Ready | Phase::Moving { .. } => {
                self.refuse(ImiError::ModuleRunningToRestartStopItBefore)
            }
            Phase::Waiting | Phase::Done | Phase::Stopped | Phase::Aborted => {
                self.enter(Phase::Ready, ImiError::None);
                Decision {
                    action: Action::Unblock,
                    ..Decision::NOTHING
                }
            }
        }
    }

    fn stop(&mut self) -> Decision {
        match self.phase {
            Phase::Moving {
                unable_to_abort: true,
            } => self.refuse(ImiError::ImpossibleToStopModule),
            Phase::Moving {
                unable_to_abort: false,
            } => {
                self.enter(Phase::Aborted, ImiError::None);
                Decision::BLOCK_AND_STOP
            }
            Phase::Waiting | Phase::Ready | Phase::Done | Phase::Stopped => {
                self.enter(Phase::Stopped, ImiError::None);
                Decision::BLOCK_AND_STOP
            }
            Phase::Aborted => Decision::BLOCK_AND_STOP,
        }
    }

    fn enter(&mut self, phase: Phase, error: ImiError) {
        self.phase = phase;
        self.error = error;
    }

    fn refuse(&mut self, error: ImiError) -> Decision {
        self.error = error;
        Decision {
            refused: Some(error),
            ..Decision::NOTHING
        }
    }

    /// Where the module is.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// The error to publish: why the module was aborted, or why the last control request was refused.
    pub fn error(&self) -> ImiError {
        self.error
    }

    /// Whether no movement may begin.
    pub fn blocked(&self) -> bool {
        matches!(self.phase, Phase::Waiting | Phase::Stopped | Phase::Aborted)
    }

    /// The state to publish.
    pub fn status(&self) -> ModuleStatus {
        match self.phase {
            Phase::Waiting => ModuleStatus::WaitingDataToStart,
            Phase::Ready | Phase::Moving { .. } => ModuleStatus::Running,
            Phase::Done | Phase::Stopped => ModuleStatus::Ended,
            Phase::Aborted => ModuleStatus::Aborted,
        }
    }
}

impl Decision {
    const NOTHING: Decision = Decision {
        action: Action::Nothing,
        stop: false,
        refused: None,
    };
    const BLOCK_AND_STOP: Decision = Decision {
        action: Action::Block,
        stop: true,
        refused: None,
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: Event = Event::Control(ControlCommand::Start);
    const STOP: Event = Event::Control(ControlCommand::Stop);
    const BEGAN: Event = Event::MovementBegan {
        unable_to_abort: false,
    };
    const BEGAN_CRITICAL: Event = Event::MovementBegan {
        unable_to_abort: true,
    };
    const ENDED: Event = Event::MovementEnded;
    const FATAL: Event = Event::Fatal(ImiError::HeroDspFatalError);
    const MOVING: Phase = Phase::Moving {
        unable_to_abort: false,
    };
    const CRITICAL: Phase = Phase::Moving {
        unable_to_abort: true,
    };

    const UNBLOCK: Decision = Decision {
        action: Action::Unblock,
        stop: false,
        refused: None,
    };
    const BLOCK: Decision = Decision::BLOCK_AND_STOP;
    const NOTHING: Decision = Decision::NOTHING;

    const fn refused(error: ImiError) -> Decision {
        Decision {
            refused: Some(error),
            ..NOTHING
        }
    }

    #[test]
    fn every_phase_and_event() {
        use ImiError::{
            HeroDspFatalError, ImpossibleToStopModule, ModuleRunningToRestartStopItBefore, None,
        };
        use Phase::{Aborted, Done, Ready, Stopped, Waiting};
        let running = refused(ModuleRunningToRestartStopItBefore);
        let table = [
            // Before, event, after, decision, published error.
            (Waiting, START, Ready, UNBLOCK, None),
            (Waiting, STOP, Stopped, BLOCK, None),
            (Waiting, BEGAN, Waiting, NOTHING, None),
            (Waiting, BEGAN_CRITICAL, Waiting, NOTHING, None),
            (Waiting, ENDED, Waiting, NOTHING, None),
            (Waiting, FATAL, Waiting, NOTHING, HeroDspFatalError),
            (
                Ready,
                START,
                Ready,
                running,
                ModuleRunningToRestartStopItBefore,
            ),
            (Ready, STOP, Stopped, BLOCK, None),
            (Ready, BEGAN, MOVING, NOTHING, None),
            (Ready, BEGAN_CRITICAL, CRITICAL, NOTHING, None),
            (Ready, ENDED, Ready, NOTHING, None),
            (Ready, FATAL, Aborted, BLOCK, HeroDspFatalError),
            (
                MOVING,
                START,
                MOVING,
                running,
                ModuleRunningToRestartStopItBefore,
            ),
            (MOVING, STOP, Aborted, BLOCK, None),
            (MOVING, BEGAN, MOVING, NOTHING, None),
            (MOVING, BEGAN_CRITICAL, CRITICAL, NOTHING, None),
            (MOVING, ENDED, Done, NOTHING, None),
            (MOVING, FATAL, Aborted, BLOCK, HeroDspFatalError),
            (
                CRITICAL,
                START,
                CRITICAL,
                running,
                ModuleRunningToRestartStopItBefore,
            ),
            (
                CRITICAL,
                STOP,
                CRITICAL,
                refused(ImpossibleToStopModule),
                ImpossibleToStopModule,
            ),
            (CRITICAL, BEGAN, MOVING, NOTHING, None),
            (CRITICAL, BEGAN_CRITICAL, CRITICAL, NOTHING, None),
            (CRITICAL, ENDED, Done, NOTHING, None),
            (CRITICAL, FATAL, Aborted, BLOCK, HeroDspFatalError),
            (Done, START, Ready, UNBLOCK, None),
            (Done, STOP, Stopped, BLOCK, None),
            (Done, BEGAN, MOVING, NOTHING, None),
            (Done, BEGAN_CRITICAL, CRITICAL, NOTHING, None),
            (Done, ENDED, Done, NOTHING, None),
            (Done, FATAL, Aborted, BLOCK, HeroDspFatalError),
            (Stopped, START, Ready, UNBLOCK, None),
            (Stopped, STOP, Stopped, BLOCK, None),
            (Stopped, BEGAN, Stopped, NOTHING, None),
            (Stopped, BEGAN_CRITICAL, Stopped, NOTHING, None),
            (Stopped, ENDED, Stopped, NOTHING, None),
            (Stopped, FATAL, Stopped, NOTHING, HeroDspFatalError),
            (Aborted, START, Ready, UNBLOCK, None),
            (Aborted, STOP, Aborted, BLOCK, None),
            (Aborted, BEGAN, Aborted, NOTHING, None),
            (Aborted, BEGAN_CRITICAL, Aborted, NOTHING, None),
            (Aborted, ENDED, Aborted, NOTHING, None),
            (Aborted, FATAL, Aborted, NOTHING, HeroDspFatalError),
        ];
        for (before, event, after, decision, error) in table {
            let mut manager = Manager {
                phase: before,
                error: None,
            };
            assert_eq!(manager.handle(event), decision, "{before:?} {event:?}");
            assert_eq!(manager.phase(), after, "{before:?} {event:?}");
            assert_eq!(manager.error(), error, "{before:?} {event:?}");
        }
    }

    #[test]
    fn phases_are_published_as_the_sources_four_states() {
        let table = [
            (Phase::Waiting, ModuleStatus::WaitingDataToStart, true),
            (Phase::Ready, ModuleStatus::Running, false),
            (MOVING, ModuleStatus::Running, false),
            (CRITICAL, ModuleStatus::Running, false),
            (Phase::Done, ModuleStatus::Ended, false),
            (Phase::Stopped, ModuleStatus::Ended, true),
            (Phase::Aborted, ModuleStatus::Aborted, true),
        ];
        for (phase, status, blocked) in table {
            let manager = Manager {
                phase,
                error: ImiError::None,
            };
            assert_eq!(
                (manager.status(), manager.blocked()),
                (status, blocked),
                "{phase:?}"
            );
        }
    }
}
