//! Control requests, stops, and everything that ends a movement early.

use dsp_protocol::Command;
use ipc_types::code::{ControlCommand, ImiError, Reason, Stage};

use super::activity::Activity;
use super::request::Envelope;
use super::trajectory::Trajectory;
use super::{Context, Flight};
use crate::errors::reason_of;
use crate::line::FlightCommand;
use crate::manager::Event;
use crate::outputs::Outputs;

/// The commands of a stop: the DSP hovers with an empty path buffer and an empty error queue.
const STOP: [(Command, FlightCommand); 2] = [
    (Command::InvalidatePath, FlightCommand::InvalidatePath),
    (Command::ClearErrors, FlightCommand::ClearErrors),
];

impl<T: Trajectory> Flight<T> {
    /// Takes a control request, or the reason why it cannot be one.
    pub fn control_request<O: Outputs>(
        &mut self,
        envelope: &Envelope,
        control: Result<ControlCommand, Reason>,
        cx: &mut Context<'_, O>,
    ) {
        if !self.is_new(envelope, cx) {
            return;
        }
        match control {
            Ok(ControlCommand::Start) => self.start(envelope, cx),
            Ok(ControlCommand::Stop) => self.stop(envelope, cx),
            Ok(ControlCommand::ReloadFence) => {
                self.refuse(envelope, Reason::InvalidRequest, ImiError::None, cx)
            }
            Err(reason) => self.refuse(envelope, reason, ImiError::None, cx),
        }
    }

    fn start<O: Outputs>(&mut self, envelope: &Envelope, cx: &mut Context<'_, O>) {
        if !cx.line.is_up() {
            return self.refuse(envelope, Reason::LinkDown, ImiError::None, cx);
        }
        if let Activity::Stopping { .. } = self.activity {
            return self.refuse(envelope, Reason::Busy, ImiError::None, cx);
        }
        match self
            .manager
            .handle(Event::Control(ControlCommand::Start))
            .refused
        {
            Some(error) => self.refuse(envelope, reason_of(error), error, cx),
            None => self.report(envelope, Stage::Done, Reason::None, ImiError::None, cx),
        }
    }

    fn stop<O: Outputs>(&mut self, envelope: &Envelope, cx: &mut Context<'_, O>) {
        if let Activity::Stopping { requester: Some(_) } = self.activity {
            return self.refuse(envelope, Reason::Busy, ImiError::None, cx);
        }
        if let Some(error) = self
            .manager
            .handle(Event::Control(ControlCommand::Stop))
            .refused
        {
            return self.refuse(envelope, reason_of(error), error, cx);
        }
        self.give_up(Stage::Aborted, Reason::Stopped, ImiError::None, cx);
        if !cx.line.is_up() {
            // This side is empty now; the start-up sequence empties the DSP's before it takes anything again.
            return self.report(
                envelope,
                Stage::Aborted,
                Reason::LinkDown,
                ImiError::None,
                cx,
            );
        }
        self.report(envelope, Stage::Accepted, Reason::None, ImiError::None, cx);
        self.empty_dsp(Some(*envelope), cx);
    }

    /// An error transcends: it ends the functionality and empties every buffer.
    pub(super) fn fatal<O: Outputs>(
        &mut self,
        error: ImiError,
        reason: Reason,
        cx: &mut Context<'_, O>,
    ) {
        let decision = self.manager.handle(Event::Fatal(error));
        if !decision.stop {
            return;
        }
        self.transcended = self.transcended.saturating_add(1);
        let stage = self.stage_of_early_end(reason);
        self.give_up(stage, reason, error, cx);
        if cx.line.is_up() {
            self.empty_dsp(None, cx);
        }
    }

    /// The DSP cannot be reached, or is not the one it was: what it was doing has an outcome, and at rest nothing is
    /// lost. The start-up sequence, which runs next, empties its buffers.
    pub(super) fn dsp_vanished<O: Outputs>(
        &mut self,
        error: ImiError,
        reason: Reason,
        cx: &mut Context<'_, O>,
    ) {
        self.break_path(reason, cx);
        if let Activity::Stopping { .. } = self.activity {
            self.finish_activity(Stage::Aborted, reason, error, cx);
        } else if self.activity != Activity::AtRest {
            self.fatal(error, reason, cx);
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
        match command {
            FlightCommand::TakeOffAltitude
            | FlightCommand::TakeOff
            | FlightCommand::Land
            | FlightCommand::CountWaypoints
            | FlightCommand::ConfirmMovement => {
                self.fatal(error, reason, cx);
            }
            FlightCommand::InvalidatePath | FlightCommand::ClearErrors => {
                cx.line.forget_flight();
                self.manager.handle(Event::Fatal(error));
                self.finish_activity(Stage::Unknown, reason, error, cx);
            }
        }
    }

    /// Whether an early end is known to be one. Once the DSP may have the movement, a broken line says nothing about
    /// what it does with it.
    fn stage_of_early_end(&self, reason: Reason) -> Stage {
        let out_of_sight = matches!(
            reason,
            Reason::CommunicationFatalError | Reason::DeadlineExpired | Reason::MovementTimeout
        );
        match self.activity {
            Activity::TakingOff { .. } | Activity::Landing { .. } if out_of_sight => Stage::Unknown,
            Activity::Following { order }
                if order.begun && reason == Reason::CommunicationFatalError =>
            {
                Stage::Unknown
            }
            _ => Stage::Aborted,
        }
    }

    /// Ends what is under way on this side of the line.
    fn give_up<O: Outputs>(
        &mut self,
        stage: Stage,
        reason: Reason,
        error: ImiError,
        cx: &mut Context<'_, O>,
    ) {
        cx.line.forget_flight();
        self.break_path(reason, cx);
        self.finish_activity(stage, reason, error, cx);
    }

    fn empty_dsp<O: Outputs>(&mut self, requester: Option<Envelope>, cx: &mut Context<'_, O>) {
        self.activity = Activity::Stopping { requester };
        for (command, purpose) in STOP {
            if cx.line.command(command, purpose).is_err() {
                return self.undelivered(purpose, cx);
            }
        }
    }
}
