//! The functionality of the module: movements from the request to the final word.
//!
//! It owns the path under assembly, the movement under way and what was last seen of the helicopter; it is given
//! requests, events of the line and the time, and answers through the line's commands and [`Outputs`]. Whether it may
//! work at all is the [`Manager`]'s decision.
//!
//! | activity | ends well | ends early |
//! |---|---|---|
//! | taking off | at the altitude, and the DSP asks for waypoints | ack error, deadline, DSP error, link lost, reboot |
//! | following | arrival at the last waypoint | the same, and stop |
//! | landing | on the ground | the same as taking off |
//! | stopping | its commands are acknowledged | ack error, link lost, reboot |
//!
//! Every request ends in exactly one final word. Where the DSP may be doing what nobody can see any more, the word is
//! `unknown`.

pub mod activity;
pub mod arrival;
mod feed;
pub mod ledger;
mod movement;
pub mod observation;
pub mod path;
pub mod request;
mod stop;
pub mod trajectory;
pub mod verification;

use dsp_protocol::downlink::Geographic;
use dsp_protocol::{Command, port};
use ipc_types::MonotonicNs;
use ipc_types::code::{ImiError, Reason, Stage};
use ipc_types::payload::{MovementState, RequestReport};

use crate::config::BridgeConfig;
use crate::errors::{ErrorTable, reason_of};
use crate::line::{FlightCommand, Line, LineEvent};
use crate::manager::{Event, Manager};
use crate::outputs::Outputs;
use activity::Activity;
use arrival::Tracker;
use ledger::Ledger;
use observation::{Observation, known_position};
use path::{Assembler, MAX_WAYPOINTS};
use request::{Envelope, RequestKey};
use trajectory::Trajectory;
use verification::Verification;

/// What a step of the flight works with.
pub struct Context<'a, O> {
    /// The present moment.
    pub now: MonotonicNs,
    /// The line to the DSP.
    pub line: &'a mut Line,
    /// Where reports go.
    pub out: &'a mut O,
}

/// See the module's documentation.
#[derive(Debug)]
pub struct Flight<T> {
    config: BridgeConfig,
    manager: Manager,
    activity: Activity,
    assembler: Assembler,
    /// The requests of the waypoints of the path under assembly, and when the next waypoint must have come.
    assembling: Vec<Envelope>,
    assembly_deadline: Option<MonotonicNs>,
    trajectory: T,
    verification: Verification,
    tracker: Tracker,
    ledger: Ledger,
    observation: Observation,
    movement: MovementState,
    refused_requests: u32,
    transcended: u32,
}

impl<T: Trajectory> Flight<T> {
    /// A module that waits for its start.
    pub fn new(config: &BridgeConfig, trajectory: T) -> Self {
        Flight {
            config: config.clone(),
            manager: Manager::default(),
            activity: Activity::AtRest,
            assembler: Assembler::new(),
            assembling: Vec::with_capacity(MAX_WAYPOINTS),
            assembly_deadline: None,
            trajectory,
            verification: Verification::begin(),
            ledger: Ledger::new(),
            tracker: Tracker::new(config.arrival.tolerance(), config.arrival.dwell()),
            observation: Observation::new(config.link.silent_after()),
            movement: MovementState::default(),
            refused_requests: 0,
            transcended: 0,
        }
    }

    /// Takes an event of the line.
    pub fn line_event<O: Outputs>(&mut self, event: &LineEvent, cx: &mut Context<'_, O>) {
        match event {
            LineEvent::Ready => {}
            LineEvent::Sample(sample) => {
                self.observation.take(sample);
                let position = known_position(&sample.status);
                self.watch_arrival(position, sample.status.flying, cx);
            }
            LineEvent::Grant => self.granted(cx),
            LineEvent::Delivered(command) => self.delivered(*command, cx),
            LineEvent::WaypointCount(count) => self.waypoints_counted(*count, cx),
            LineEvent::MovementConfirmed(true) => {}
            LineEvent::MovementConfirmed(false) => self.refused_by_dsp(cx),
            LineEvent::Undelivered(command) => self.undelivered(*command, cx),
            LineEvent::DspError { code, starting } => {
                if let (Some(error), false) = (self.errors().transcends(*code), *starting) {
                    self.fatal(error, reason_of(error), cx);
                }
            }
            LineEvent::Rebooted => {
                self.dsp_vanished(ImiError::HeroDspFatalError, Reason::DspRebooted, cx)
            }
            LineEvent::Lost => {
                self.dsp_vanished(
                    ImiError::CommunicationFatalError,
                    Reason::CommunicationFatalError,
                    cx,
                );
            }
        }
    }

    /// Handles every deadline that has passed.
    pub fn expire<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        if self
            .assembly_deadline
            .is_some_and(|deadline| cx.now >= deadline)
        {
            self.break_path(Reason::DeadlineExpired, cx);
        }
        if let Some(order) = self.activity.order().copied()
            && cx.now >= order.deadline
        {
            let reason = if order.begun {
                Reason::MovementTimeout
            } else {
                Reason::DeadlineExpired
            };
            self.fatal(ImiError::MovementTimeout, reason, cx);
        }
    }

    /// When [`Flight::expire`] has something to do.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let order = self.activity.order().map(|order| order.deadline);
        [self.assembly_deadline, order].into_iter().flatten().min()
    }

    /// The sender of a request is gone. A path that it was still sending is broken; a movement goes on to its end,
    /// which is a hover or the ground.
    pub fn sender_gone<O: Outputs>(&mut self, key: RequestKey, cx: &mut Context<'_, O>) {
        if self.assembling.iter().any(|envelope| envelope.key == key) {
            self.break_path(Reason::PathBroken, cx);
        }
    }

    /// The bridge is ending: every open request gets its final word.
    pub fn close<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        self.break_path(Reason::BridgeEnding, cx);
        // The helicopter goes on with what it was told; nobody will see how it ends.
        self.finish_activity(Stage::Unknown, Reason::BridgeEnding, ImiError::None, cx);
    }

    /// The module's state machine.
    pub fn manager(&self) -> &Manager {
        &self.manager
    }

    /// What the functionality is doing.
    pub fn activity(&self) -> &Activity {
        &self.activity
    }

    /// Whether a path is under assembly.
    pub fn receiving_path(&self) -> bool {
        self.assembler.open_path().is_some()
    }

    /// The movement under way, or the last one, as published.
    pub fn movement(&self) -> &MovementState {
        &self.movement
    }

    /// Horizontal distance from the last known position to the last waypoint of the path being flown, m.
    pub fn distance_to_go_m(&self, now: MonotonicNs) -> Option<f64> {
        let Activity::Following { .. } = self.activity else {
            return None;
        };
        let position = self.observation.position(now)?;
        Some(arrival::ground_distance_m(
            &position,
            self.tracker.target()?,
        ))
    }

    /// Requests refused so far.
    pub fn refused_requests(&self) -> u32 {
        self.refused_requests
    }

    /// DSP errors that ended the functionality so far.
    pub fn transcended(&self) -> u32 {
        self.transcended
    }

    fn errors(&self) -> &ErrorTable {
        &self.config.errors
    }

    fn watch_arrival<O: Outputs>(
        &mut self,
        position: Option<Geographic>,
        flying: bool,
        cx: &mut Context<'_, O>,
    ) {
        let arrived = match (&mut self.activity, position) {
            (Activity::Following { .. }, Some(position)) => {
                let sent = self.movement.waypoints_sent as usize;
                let before = self.tracker.reached();
                let arrived = self.tracker.observe(cx.now, &position, sent);
                self.movement.waypoints_reached = self.tracker.reached() as u32;
                if !arrived && self.tracker.reached() != before {
                    self.progress(cx);
                }
                arrived
            }
            (
                Activity::TakingOff {
                    target_altitude_m,
                    at_altitude,
                    ..
                },
                Some(position),
            ) => {
                let tolerance_m = self.config.arrival.altitude_m;
                *at_altitude =
                    flying && (position.altitude_m - *target_altitude_m).abs() <= tolerance_m;
                false
            }
            (Activity::Landing { order }, _) => order.begun && !flying,
            _ => false,
        };
        if arrived {
            self.movement_ended(cx);
        }
    }

    /// Flow control: the DSP asks for a waypoint, which it does only when it flies and neither takes off nor lands.
    fn granted<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        match self.activity {
            Activity::TakingOff {
                order, at_altitude, ..
            } if order.begun && at_altitude => {
                self.movement_ended(cx);
            }
            Activity::Following { .. } => self.send_waypoint(cx),
            _ => {}
        }
    }

    /// The DSP has the order. That it arrived does not say that it is carried out: the port tells.
    fn ordered<O: Outputs>(&mut self, port: u16, cx: &mut Context<'_, O>) {
        self.movement_begun(cx);
        self.progress(cx);
        let confirm = Command::Read16 { port };
        if cx
            .line
            .command(confirm, FlightCommand::ConfirmMovement)
            .is_err()
        {
            self.undelivered(FlightCommand::ConfirmMovement, cx);
        }
    }

    /// The DSP does not do what it was ordered to. Nothing is under way, so the next order may come.
    fn refused_by_dsp<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        if self.activity.unable_to_abort() {
            self.manager.handle(Event::MovementEnded);
            self.finish_activity(Stage::Aborted, Reason::RefusedByDsp, ImiError::None, cx);
        }
    }

    fn movement_ended<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        self.manager.handle(Event::MovementEnded);
        self.finish_activity(Stage::Done, Reason::None, ImiError::None, cx);
    }

    /// Gives the final word to whoever waits for the present activity, and rests.
    fn finish_activity<O: Outputs>(
        &mut self,
        stage: Stage,
        reason: Reason,
        error: ImiError,
        cx: &mut Context<'_, O>,
    ) {
        let activity = std::mem::replace(&mut self.activity, Activity::AtRest);
        self.trajectory.clear();
        let envelope = match activity {
            Activity::Stopping { requester } => requester,
            _ => activity.order().map(|order| order.envelope),
        };
        if let Some(envelope) = envelope {
            self.report(&envelope, stage, reason, error, cx);
        }
    }

    fn progress<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        if let Some(order) = self.activity.order().copied() {
            self.report(
                &order.envelope,
                Stage::Progress,
                Reason::None,
                ImiError::None,
                cx,
            );
        }
    }

    fn refuse<O: Outputs>(
        &mut self,
        envelope: &Envelope,
        reason: Reason,
        error: ImiError,
        cx: &mut Context<'_, O>,
    ) {
        self.refused_requests = self.refused_requests.saturating_add(1);
        self.report(envelope, Stage::Refused, reason, error, cx);
    }

    fn report<O: Outputs>(
        &mut self,
        envelope: &Envelope,
        stage: Stage,
        reason: Reason,
        error: ImiError,
        cx: &mut Context<'_, O>,
    ) {
        // The counts belong to the movement of this request, or to the path that its waypoint lies in.
        let own = envelope.request_id == self.movement.request_id
            && envelope.path_id == self.movement.path_id;
        let counts = if own {
            self.movement
        } else {
            MovementState::default()
        };
        let total = if own {
            counts.waypoints_total
        } else {
            self.assembler.waypoints().len() as u32
        };
        let report = RequestReport {
            request_id: envelope.request_id,
            path_id: envelope.path_id,
            reported_ns: cx.now.0,
            stage: stage.code(),
            reason: reason.code(),
            imi_error: error.code(),
            waypoints_total: total,
            waypoints_sent: counts.waypoints_sent,
            waypoints_reached: counts.waypoints_reached,
            ..RequestReport::default()
        };
        if stage.is_final() {
            self.ledger.note(&report);
        }
        cx.out.report(envelope.key, &report);
    }

    /// Whether this request may be executed. One that was asked before is answered here, and never executed twice.
    fn is_new<O: Outputs>(&mut self, envelope: &Envelope, cx: &mut Context<'_, O>) -> bool {
        if let Some(report) = self.ledger.final_word(envelope.request_id) {
            let report = RequestReport {
                reported_ns: cx.now.0,
                ..*report
            };
            cx.out.report(envelope.key, &report);
            return false;
        }
        let refusal = if envelope.request_id == 0 {
            (Stage::Refused, Reason::InvalidRequest)
        } else if self.is_open(envelope.request_id) {
            (Stage::Refused, Reason::Busy)
        } else if envelope.repeat {
            (Stage::Unknown, Reason::NotRemembered)
        } else {
            return true;
        };
        // Not through the ledger: this is not the word for the request that was asked first.
        let report = RequestReport {
            request_id: envelope.request_id,
            path_id: envelope.path_id,
            reported_ns: cx.now.0,
            ..RequestReport::new(refusal.0, refusal.1)
        };
        self.refused_requests = self.refused_requests.saturating_add(1);
        cx.out.report(envelope.key, &report);
        false
    }

    /// Whether a request with this id has not had its final word.
    fn is_open(&self, request_id: u64) -> bool {
        let stopping = match &self.activity {
            Activity::Stopping { requester } => requester.as_ref(),
            _ => None,
        };
        let under_way = self.activity.order().map(|order| &order.envelope);
        self.assembling
            .iter()
            .chain(under_way)
            .chain(stopping)
            .any(|envelope| envelope.request_id == request_id)
    }

    fn delivered<O: Outputs>(&mut self, command: FlightCommand, cx: &mut Context<'_, O>) {
        match command {
            FlightCommand::TakeOffAltitude
            | FlightCommand::InvalidatePath
            | FlightCommand::CountWaypoints
            | FlightCommand::ConfirmMovement => {}
            FlightCommand::TakeOff => self.ordered(port::TAKE_OFF, cx),
            FlightCommand::Land => self.ordered(port::LAND, cx),
            FlightCommand::ClearErrors => {
                self.finish_activity(Stage::Done, Reason::None, ImiError::None, cx)
            }
        }
    }
}
