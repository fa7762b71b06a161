//! Movements: take-off, landing, and paths from their waypoints to the DSP.

use dsp_protocol::downlink::Geographic;
use dsp_protocol::{Command, port};
use ipc_types::code::{ImiError, MovementKind, Reason, Stage};
use ipc_types::payload::MovementState;

use super::activity::{Activity, Order};
use super::arrival::ground_distance_m;
use super::path::{Outcome, Segment};
use super::request::{Envelope, Movement};
use super::trajectory::Trajectory;
use super::{Context, Flight};
use crate::line::FlightCommand;
use crate::manager::Event;
use crate::outputs::Outputs;

impl<T: Trajectory> Flight<T> {
    /// Takes a movement request, or the reason why it cannot be one.
    pub fn movement_request<O: Outputs>(
        &mut self,
        envelope: &Envelope,
        movement: Result<Movement, Reason>,
        cx: &mut Context<'_, O>,
    ) {
        if !self.is_new(envelope, cx) {
            return;
        }
        let outcome = movement.and_then(|movement| match movement {
            Movement::TakeOff { altitude_m } => self.take_off(envelope, altitude_m, cx),
            Movement::Land => self.land(envelope, cx),
            Movement::Waypoint(segment) => self.waypoint(envelope, &segment, cx),
        });
        if let Err(reason) = outcome {
            // A path with a hole is never flown: a refused waypoint takes its open path along.
            let belongs_to_open_path = self.assembler.open_path() == Some(envelope.path_id);
            if belongs_to_open_path {
                self.break_path(Reason::PathBroken, cx);
            }
            self.refuse(envelope, reason, ImiError::None, cx);
        }
    }

    /// What every movement needs: a started module at rest, and a DSP that listens.
    fn ready_to_move<O>(&self, cx: &Context<'_, O>) -> Result<(), Reason> {
        if self.manager.blocked() {
            Err(Reason::NotStarted)
        } else if !cx.line.is_up() {
            Err(Reason::LinkDown)
        } else if self.activity != Activity::AtRest {
            Err(Reason::Busy)
        } else {
            Ok(())
        }
    }

    fn known_position<O>(&self, cx: &Context<'_, O>) -> Result<Geographic, Reason> {
        self.observation.position(cx.now).ok_or(Reason::NoPosition)
    }

    fn known_flying<O>(&self, cx: &Context<'_, O>) -> Result<bool, Reason> {
        self.observation.flying(cx.now).ok_or(Reason::NoPosition)
    }

    fn take_off<O: Outputs>(
        &mut self,
        envelope: &Envelope,
        altitude_m: f32,
        cx: &mut Context<'_, O>,
    ) -> Result<(), Reason> {
        self.ready_to_move(cx)?;
        if self.known_flying(cx)? {
            return Err(Reason::AlreadyFlying);
        }
        let position = self.known_position(cx)?;
        self.order(
            cx,
            &[
                (
                    Command::Write32 {
                        port: port::TAKE_OFF_ALTITUDE_M,
                        value: altitude_m,
                    },
                    FlightCommand::TakeOffAltitude,
                ),
                (write_one(port::TAKE_OFF), FlightCommand::TakeOff),
            ],
        )?;
        let target_altitude_m = position.altitude_m + f64::from(altitude_m);
        self.begin(envelope, MovementKind::TakeOff, 0, cx, |order| {
            Activity::TakingOff {
                order,
                target_altitude_m,
                at_altitude: false,
            }
        });
        Ok(())
    }

    fn land<O: Outputs>(
        &mut self,
        envelope: &Envelope,
        cx: &mut Context<'_, O>,
    ) -> Result<(), Reason> {
        self.ready_to_move(cx)?;
        if !self.known_flying(cx)? {
            return Err(Reason::NotFlying);
        }
        self.order(cx, &[(write_one(port::LAND), FlightCommand::Land)])?;
        self.begin(envelope, MovementKind::Land, 0, cx, |order| {
            Activity::Landing { order }
        });
        Ok(())
    }

    /// Queues the commands of a movement: all of them, or none.
    fn order<O>(
        &self,
        cx: &mut Context<'_, O>,
        commands: &[(Command, FlightCommand)],
    ) -> Result<(), Reason> {
        for (command, purpose) in commands {
            if cx.line.command(*command, *purpose).is_err() {
                cx.line.forget_flight();
                return Err(Reason::TooManyRequests);
            }
        }
        Ok(())
    }

    /// Begins a movement. Another one that was still being sent, waypoint by waypoint, is thereby given up.
    fn begin<O: Outputs>(
        &mut self,
        envelope: &Envelope,
        kind: MovementKind,
        waypoints: usize,
        cx: &mut Context<'_, O>,
        activity: impl FnOnce(Order) -> Activity,
    ) {
        self.break_path(Reason::PathReplaced, cx);
        self.activity = activity(Order {
            envelope: *envelope,
            begun: false,
            deadline: cx.now + envelope.begin_within,
        });
        self.movement = MovementState {
            request_id: envelope.request_id,
            path_id: envelope.path_id,
            kind: kind.code(),
            waypoints_total: waypoints as u32,
            ..MovementState::default()
        };
        self.manager.handle(Event::MovementBegan {
            unable_to_abort: self.activity.unable_to_abort(),
        });
        self.report(envelope, Stage::Accepted, Reason::None, ImiError::None, cx);
    }

    fn waypoint<O: Outputs>(
        &mut self,
        envelope: &Envelope,
        segment: &Segment,
        cx: &mut Context<'_, O>,
    ) -> Result<(), Reason> {
        self.ready_to_move(cx)?;
        if !self.known_flying(cx)? {
            return Err(Reason::NotFlying);
        }
        let position = self.known_position(cx)?;
        if ground_distance_m(&position, &segment.waypoint) > self.config.movement.max_distance_m {
            return Err(Reason::TooFar);
        }
        if self.assembler.replaces(segment) {
            self.break_path(Reason::PathReplaced, cx);
        }
        match self.assembler.add(segment) {
            Outcome::Open => {
                self.assembling.push(*envelope);
                self.assembly_deadline = Some(cx.now + envelope.begin_within);
                self.report(envelope, Stage::Accepted, Reason::None, ImiError::None, cx);
                Ok(())
            }
            Outcome::Closed => {
                self.follow(envelope, position, cx);
                Ok(())
            }
            Outcome::Refused { reason, broken } => {
                if broken {
                    self.break_path(reason, cx);
                }
                Err(reason)
            }
        }
    }

    /// The path is closed: it goes to the DSP as a whole, and its waypoints but the last have their final word.
    fn follow<O: Outputs>(
        &mut self,
        closing: &Envelope,
        position: Geographic,
        cx: &mut Context<'_, O>,
    ) {
        self.answer_assembled(Stage::Done, Reason::None, cx);
        self.trajectory.begin(position, self.assembler.waypoints());
        self.tracker.begin(self.assembler.waypoints());
        let count = self.assembler.waypoints().len();
        self.begin(closing, MovementKind::GoToWaypoint, count, cx, |order| {
            Activity::Following { order }
        });
        self.begin_feed(cx);
    }

    /// Gives up the path under assembly, if there is one, and tells the senders of its waypoints.
    pub(super) fn break_path<O: Outputs>(&mut self, reason: Reason, cx: &mut Context<'_, O>) {
        self.answer_assembled(Stage::Aborted, reason, cx);
        self.assembler.clear();
    }

    /// The final word for the waypoints of the path under assembly. The list keeps its memory.
    fn answer_assembled<O: Outputs>(
        &mut self,
        stage: Stage,
        reason: Reason,
        cx: &mut Context<'_, O>,
    ) {
        for index in 0..self.assembling.len() {
            let envelope = self.assembling[index];
            self.report(&envelope, stage, reason, ImiError::None, cx);
        }
        self.assembling.clear();
        self.assembly_deadline = None;
    }

    /// The movement has begun on the DSP: from now on it has the time of a movement.
    pub(super) fn movement_begun<O>(&mut self, cx: &Context<'_, O>) {
        let limit = self.config.movement.time_limit();
        if let Some(order) = self.activity.order_mut() {
            order.begun = true;
            order.deadline = cx.now + limit;
        }
    }
}

fn write_one(port: u16) -> Command {
    Command::Write16 { port, value: 1 }
}
