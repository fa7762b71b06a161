//! Everything that ends a movement early: errors, lost commands, a DSP that is gone.

use ipc_types::code::{ImiError, Reason, Stage};

use super::motion::{DspOrder, Motion, PathStep, Rest};
use super::report::{Verdict, too_late};
use super::{Context, Flight, FlightTimer};
use crate::link::FlightCommand;
use crate::outputs::Outputs;

impl Flight {
    /// A fatal error: it ends the functionality and empties every buffer (requirement D8).
    pub(super) fn fatal<O: Outputs>(
        &mut self,
        error: ImiError,
        reason: Reason,
        cx: &mut Context<'_, O>,
    ) {
        self.is_changed = true;
        self.refusal = ImiError::None;
        match &mut self.motion {
            Motion::Stopping { then, .. } => {
                *then = then.with_fatal(error);
                return;
            }
            Motion::Idle(rest) => {
                let was_blocked = rest.is_blocked();
                *rest = rest.with_fatal(error);
                if was_blocked {
                    return;
                }
            }
            _ => {}
        }
        self.escalated = self.escalated.saturating_add(1);
        self.break_path(reason, cx);
        let stage = self.stage_of_early_end(reason);
        let verdict = Verdict::ended(stage, reason, error);
        self.give_up_movement(&verdict, Rest::Aborted(error), cx);
        cx.link.forget_path();
        // When there is no room, the DSP's errors stay: they are counted, and nothing else.
        self.clear_errors(cx);
    }

    /// Ends the movement under way on this side of the link, if there is one. What the DSP may hold of it is emptied.
    pub(super) fn give_up_movement<O: Outputs>(
        &mut self,
        verdict: &Verdict,
        rest: Rest,
        cx: &mut Context<'_, O>,
    ) {
        if let Motion::Idle(_) | Motion::Stopping { .. } = self.motion {
            return;
        }
        cx.link.forget_movement();
        cx.link.forget_path();
        self.finish(verdict, rest, cx);
    }

    /// The DSP cannot be reached, or is not the one it was: what it was doing has an outcome, and at rest nothing is
    /// lost. The start-up sequence, which runs next, empties its path buffer.
    pub(super) fn dsp_vanished<O: Outputs>(
        &mut self,
        error: ImiError,
        reason: Reason,
        cx: &mut Context<'_, O>,
    ) {
        self.break_path(reason, cx);
        self.end_parameter_requests(reason, cx);
        match self.motion {
            Motion::Idle(_) | Motion::Wanted { .. } => {}
            Motion::Stopping { then, .. } => {
                self.finish(&Verdict::ended(Stage::Aborted, reason, error), then, cx);
            }
            Motion::Following(_) | Motion::Holding { .. } => {
                self.safety.movement_lost(reason, cx.now);
                self.fatal(error, reason, cx);
            }
            Motion::TakingOff(_) | Motion::Landing(_) => self.fatal(error, reason, cx),
        }
    }

    /// A command was not acknowledged in three attempts.
    pub(super) fn undelivered<O: Outputs>(
        &mut self,
        command: FlightCommand,
        cx: &mut Context<'_, O>,
    ) {
        let (error, reason) = (
            ImiError::CommunicationFatalError,
            Reason::CommunicationFatalError,
        );
        match (command, self.motion) {
            (FlightCommand::Parameter, _) => self.parameter_failed(reason, cx),
            (FlightCommand::ClearErrors, Motion::Stopping { then, .. }) => {
                let verdict = Verdict::ended(Stage::Unknown, reason, error);
                self.finish(&verdict, then.with_fatal(error), cx);
            }
            // It was sent because of another error, which is shown.
            (FlightCommand::ClearErrors, _) => {}
            _ => self.fatal(error, reason, cx),
        }
    }

    /// The DSP did not acknowledge that it empties its path buffer. The link goes on trying; the sender of the stop or hold gets its final report.
    pub(super) fn path_not_emptied<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        let (error, reason) = (
            ImiError::CommunicationFatalError,
            Reason::CommunicationFatalError,
        );
        let verdict = Verdict::ended(Stage::Unknown, reason, error);
        match self.motion {
            Motion::Stopping { then, .. } => self.finish(&verdict, then.with_fatal(error), cx),
            Motion::Holding { .. } => self.finish(&verdict, Rest::Aborted(error), cx),
            Motion::Following(_) => self.fatal(error, reason, cx),
            Motion::Idle(_) | Motion::TakingOff(_) | Motion::Landing(_) | Motion::Wanted { .. } => {
            }
        }
    }

    /// The DSP may take the bridge for gone and stop by itself: the path is not under way any more.
    pub(super) fn path_dropped<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        if let Motion::Following(_) = self.motion {
            self.fatal(
                ImiError::CommunicationFatalError,
                Reason::CommunicationFatalError,
                cx,
            );
        }
    }

    /// The movement is about to begin on the DSP. False when a later order has come since it was accepted, or its moment has
    /// passed: it then ends.
    pub(super) fn begins_in_time<O: Outputs>(&mut self, cx: &mut Context<'_, O>) -> bool {
        let Some(requester) = self.motion.requester().copied() else {
            return true;
        };
        let judged = self.may_begin(&requester, cx.now);
        if let Err(refusal) = judged {
            self.give_up_movement(&refusal.at(Stage::Aborted), Rest::Ready, cx);
        }
        judged.is_ok()
    }

    /// The movement has not begun on the DSP in time, or a hold or stop has not ended in time.
    pub(super) fn begin_expired<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        let late = match self.motion.requester() {
            Some(requester) => too_late(requester, cx.now),
            None => Reason::TooLate.into(),
        };
        let (aborted, unknown) = (late.at(Stage::Aborted), late.at(Stage::Unknown));
        match self.motion {
            Motion::TakingOff(_) | Motion::Landing(_) => {
                let command = match self.motion {
                    Motion::TakingOff(_) => FlightCommand::TakeOff,
                    _ => FlightCommand::Land,
                };
                let is_prepared = matches!(self.dsp_order(), Some(step) if step.may_be_begun());
                // An order that is on its way is decided by its acknowledgement, which comes or fails soon.
                if !is_prepared || cx.link.withdraw(command) {
                    self.give_up_movement(&aborted, Rest::Ready, cx);
                }
            }
            Motion::Following(following) => match following.step {
                PathStep::AwaitingEmpty | PathStep::Ready => {
                    self.give_up_movement(&aborted, Rest::Ready, cx);
                }
                PathStep::Flying
                | PathStep::Settling
                | PathStep::Finishing
                | PathStep::BridgeEnding => {}
            },
            Motion::Holding { .. } => self.finish(&unknown, Rest::Ready, cx),
            Motion::Stopping { then, .. } => self.finish(&unknown, then, cx),
            // The DSP was not heard: it has nothing of it.
            Motion::Wanted { .. } => self.finish(&aborted, Rest::Ready, cx),
            Motion::Idle(_) => {}
        }
    }

    /// Whether an early end is known to be one. Once the DSP may have the movement, a broken link says nothing about
    /// what it does with it.
    fn stage_of_early_end(&self, reason: Reason) -> Stage {
        let out_of_sight = matches!(
            reason,
            Reason::CommunicationFatalError | Reason::MovementTimeout
        );
        let may_go_on = match self.motion {
            Motion::TakingOff(_) | Motion::Landing(_) => {
                self.dsp_order().is_some_and(DspOrder::may_be_begun) && out_of_sight
            }
            Motion::Following(following) => {
                !matches!(following.step, PathStep::AwaitingEmpty | PathStep::Ready)
                    && reason == Reason::CommunicationFatalError
            }
            Motion::Holding { .. } => out_of_sight,
            Motion::Idle(_) | Motion::Wanted { .. } | Motion::Stopping { .. } => false,
        };
        if may_go_on {
            Stage::Unknown
        } else {
            Stage::Aborted
        }
    }

    /// The movement has begun on the DSP: from now on it has the time that its length takes.
    pub(super) fn movement_begun<O>(&mut self, length_m: f64, cx: &Context<'_, O>) {
        let limit = self.config.movement.time_limit(length_m);
        self.timers.stop(FlightTimer::Begin);
        self.timers.arm(FlightTimer::Limit, cx.now + limit);
        self.is_changed = true;
    }
}
