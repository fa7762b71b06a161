//! The functionality of the module: movements from the request to the final report.
//!
//! It owns the path under assembly, the movement under way and what was last seen of the helicopter; it is given
//! requests, events of the link and the time, and answers through the link's commands and [`Outputs`]. What the module does is
//! one value, [`Motion`]; the published state follows from it.
//!
//! | motion | ends well | ends early |
//! |---|---|---|
//! | taking off | the DSP's word: flow control 1, or port 10121 reads 0 in the air | refused by the DSP, ack error, time limit, DSP error, link lost, reboot, pilot |
//! | following | at the last waypoint, and the DSP's path buffer is known to be empty | the same, stop, pre-emption, safety rule |
//! | landing | on the ground, and port 10122 reads 0 | as taking off |
//! | holding, stopping | the DSP's path buffer is known to be empty | ack error, link lost, reboot |
//! | wanted | → landing or holding, when the DSP is heard | its moment has passed, stop, on the ground |
//!
//! Every request ends in exactly one final report. Where the DSP may be doing what cannot be seen any more, it is
//! `unknown`.

mod answer;
pub mod arrival;
pub mod assembly;
pub mod dsp_order;
mod end;
mod enforcement;
mod feed;
pub mod issue_order;
pub mod motion;
mod movement;
pub mod observation;
mod parameter_jobs;
pub mod parameters;
mod port_number;
pub mod report;
pub mod request;
pub mod route;
pub mod safety;
pub mod trajectory;
pub mod verification;
pub mod violation;

use dsp_protocol::{Command, DspErrorCode};
use ipc_types::MonotonicNs;
use ipc_types::code::{ControlCommand, ImiError, Reason, Stage};
use ipc_types::payload::{MovementState, SafetyState};
use module_kit::completed::Completed;
use module_kit::journal::raw;
use serde::{Deserialize, Serialize};

use crate::config::BridgeConfig;
use crate::errors::reason_of;
use crate::link::commands::AckData;
use crate::link::dsp_path::DspPath;
use crate::link::{FlightCommand, Link, LinkEvent, Sample};
use crate::outputs::{Notice, Outputs};
use crate::safety::fence::Fence;
use crate::timers::{TimerTable, timers};
use assembly::Assembler;
use issue_order::Mark;
use motion::{Motion, PathStep, Rest};
use observation::{Observation, known_position};
use parameter_jobs::ParameterRequests;
use report::{Refusal, Verdict, in_time};
use request::{RequestHeader, RequestKey};
use route::{NotASnapshot, Route};
use safety::Safety;
use trajectory::Trajectory;

/// Final reports that are remembered: of two whole paths of 1024 waypoints, 280 KiB.
const REMEMBERED: usize = 2048;

timers! {
    /// What the flight waits for.
    enum FlightTimer {
        /// The next waypoint of the path under assembly.
        Assembly,
        /// The beginning of the movement on the DSP, or the end of a hold or stop.
        Begin,
        /// The end of a movement that has begun.
        Limit,
        /// The next look at how the movement goes on.
        Step,
        /// The answer to the parameter request under way.
        Parameter,
    }
}

/// What a step of the flight works with.
pub struct Context<'a, O> {
    /// The present moment.
    pub now: MonotonicNs,
    /// The link to the DSP.
    pub link: &'a mut Link,
    /// Where reports go.
    pub out: &'a mut O,
}

/// See the module's documentation.
#[derive(Debug, Serialize, Deserialize)]
pub struct Flight {
    #[serde(skip)]
    config: BridgeConfig,
    motion: Motion,
    assembler: Assembler,
    /// The request of the newest waypoint of the path under assembly; those before it are done.
    newest_waypoint: Option<RequestHeader>,
    route: Route,
    completed: Completed,
    /// The orders that were taken.
    mark: Mark,
    observation: Observation,
    safety: Safety,
    parameters: ParameterRequests,
    #[serde(with = "raw")]
    movement: MovementState,
    timers: TimerTable<FlightTimer>,
    /// The error of the last control request that was refused, until the module's motion changes or a request is accepted.
    refusal: ImiError,
    refused_requests: u32,
    escalated: u32,
    /// The bridge is ending: no request is taken any more.
    is_ending: bool,
    is_changed: bool,
}

impl Flight {
    /// A module that waits for its start.
    pub fn new(config: &BridgeConfig, trajectory: Box<dyn Trajectory>) -> Self {
        Flight {
            config: config.clone(),
            motion: Motion::Idle(Rest::Waiting(ImiError::None)),
            assembler: Assembler::new(),
            newest_waypoint: None,
            route: Route::new(&config.arrival, trajectory),
            completed: Completed::with_capacity(REMEMBERED),
            mark: Mark::default(),
            observation: Observation::default(),
            safety: Safety::new(config),
            parameters: ParameterRequests::new(),
            movement: MovementState::default(),
            timers: TimerTable::new(),
            refusal: ImiError::None,
            refused_requests: 0,
            escalated: 0,
            is_ending: false,
            is_changed: true,
        }
    }

    /// After a snapshot: takes over what the configuration says.
    ///
    /// # Errors
    /// The snapshot cannot be one.
    pub(crate) fn configure(
        &mut self,
        config: &BridgeConfig,
        trajectory: Box<dyn Trajectory>,
        fence: Fence,
    ) -> Result<(), NotASnapshot> {
        self.route.configure(&config.arrival, trajectory)?;
        self.safety.configure(config, fence);
        self.completed.set_capacity(REMEMBERED);
        self.config = config.clone();
        Ok(())
    }

    /// The geofence in force.
    pub(crate) fn fence(&self) -> &Fence {
        self.safety.fence()
    }

    /// Takes an event of the link.
    pub fn link_event<O: Outputs>(&mut self, event: &LinkEvent, cx: &mut Context<'_, O>) {
        match event {
            LinkEvent::Ready => {}
            LinkEvent::Sample(sample) => self.sample(sample, cx),
            LinkEvent::Grant => self.granted(cx),
            LinkEvent::PathEmptied => self.path_emptied(cx),
            LinkEvent::PathNotEmptied => self.path_not_emptied(cx),
            LinkEvent::Delivered(command, data) => self.delivered(*command, *data, cx),
            LinkEvent::Undelivered(command) => self.undelivered(*command, cx),
            LinkEvent::PathDropped => self.path_dropped(cx),
            LinkEvent::DspError { code, starting } => self.dsp_error(*code, *starting, cx),
            LinkEvent::Rebooted => {
                self.dsp_vanished(ImiError::HeroDspFatalError, Reason::DspRebooted, cx);
            }
            LinkEvent::Lost => {
                let error = ImiError::CommunicationFatalError;
                self.dsp_vanished(error, Reason::CommunicationFatalError, cx);
            }
            LinkEvent::ParameterRefused { written, found } => {
                cx.out.notice(&Notice::ParameterRefused {
                    written: *written,
                    found: *found,
                });
            }
            LinkEvent::OddStatus { groups } => {
                cx.out.notice(&Notice::OddStatus { groups: *groups });
            }
        }
        self.carry_out_wanted(cx);
    }

    /// Handles the next deadline that has passed; false when none has.
    pub fn expire<O: Outputs>(&mut self, cx: &mut Context<'_, O>) -> bool {
        let Some(timer) = self.timers.expired(cx.now) else {
            return false;
        };
        match timer {
            FlightTimer::Assembly => self.break_path(Reason::TooLate, cx),
            FlightTimer::Begin => self.begin_expired(cx),
            FlightTimer::Limit => {
                self.fatal(ImiError::MovementTimeout, Reason::MovementTimeout, cx);
            }
            FlightTimer::Step => self.step_due(cx),
            FlightTimer::Parameter => self.parameter_expired(cx),
        }
        true
    }

    /// When [`Flight::expire`] has something to do.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.timers.next()
    }

    /// Takes a control request, or the reason why it cannot be one.
    pub fn control_request<O: Outputs>(
        &mut self,
        header: &RequestHeader,
        control: Result<ControlCommand, Reason>,
        cx: &mut Context<'_, O>,
    ) {
        if !self.is_new(header, cx) {
            return;
        }
        let outcome = control
            .map_err(Refusal::from)
            .and_then(|control| match control {
                ControlCommand::Start => {
                    self.may_begin(header, cx.now)?;
                    self.start(header, cx)
                }
                ControlCommand::Stop => {
                    self.mark.take(&header.issued);
                    in_time(header, cx.now)?;
                    self.stop(header, cx)
                }
                // The shell reads the configuration and calls `new_fence`.
                ControlCommand::ReloadFence => Err(Reason::InvalidFence.into()),
            });
        if let Err(refusal) = outcome {
            self.refuse(header, &refusal, cx);
        }
    }

    fn start<O: Outputs>(
        &mut self,
        header: &RequestHeader,
        cx: &mut Context<'_, O>,
    ) -> Result<(), Refusal> {
        if !cx.link.is_up() {
            return Err(Reason::LinkDown.into());
        }
        let rest = self.motion.standing().start().map_err(Refusal::from)?;
        self.mark.take(&header.issued);
        self.change_motion(Motion::Idle(rest));
        self.report(header, &Verdict::DONE, cx);
        Ok(())
    }

    fn stop<O: Outputs>(
        &mut self,
        header: &RequestHeader,
        cx: &mut Context<'_, O>,
    ) -> Result<(), Refusal> {
        let then = self.motion.standing().stop().map_err(Refusal::from)?;
        self.break_path(Reason::Stopped, cx);
        self.give_up_movement(&Verdict::aborted(Reason::Stopped), then, cx);
        if !cx.link.is_up() {
            // This side is empty now. The link empties the DSP's path buffer as soon as it can.
            self.change_motion(Motion::Idle(then));
            self.report(header, &Verdict::aborted(Reason::LinkDown), cx);
            return Ok(());
        }
        self.change_motion(Motion::Stopping {
            requester: *header,
            errors_cleared: false,
            then,
        });
        self.timers.arm(FlightTimer::Begin, header.begin_by);
        self.report(header, &Verdict::ACCEPTED, cx);
        cx.link.forget_path();
        if !self.clear_errors(cx) {
            self.undelivered(FlightCommand::ClearErrors, cx);
        }
        Ok(())
    }

    /// The sender of a request is gone. A path that it was still sending is broken; a movement goes on to its end,
    /// which is a hover or the ground.
    pub fn sender_gone<O: Outputs>(&mut self, key: RequestKey, cx: &mut Context<'_, O>) {
        if self.newest_waypoint.is_some_and(|newest| newest.key == key) {
            self.break_path(Reason::PathBroken, cx);
        }
    }

    /// The bridge is about to end: the DSP's path buffer is emptied, and no request is taken any more. What is under way gets its
    /// final report when the DSP has acknowledged that, or from [`Flight::close`].
    pub fn wind_down<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        self.is_ending = true;
        self.break_path(Reason::BridgeEnding, cx);
        if let Motion::Following(following) = &mut self.motion {
            match following.step {
                // The DSP has nothing of it.
                PathStep::AwaitingEmpty | PathStep::Ready => {
                    let verdict = Verdict::aborted(Reason::BridgeEnding);
                    self.give_up_movement(&verdict, Rest::Ready, cx);
                }
                PathStep::Flying | PathStep::Settling => {
                    following.step = PathStep::BridgeEnding;
                    self.timers.stop(FlightTimer::Step);
                    self.timers.stop(FlightTimer::Limit);
                    cx.link.forget_movement();
                    cx.link.forget_path();
                }
                PathStep::Finishing | PathStep::BridgeEnding => {}
            }
        }
    }

    /// The bridge is ending: every open request gets its final report.
    pub fn close<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        self.is_ending = true;
        self.break_path(Reason::BridgeEnding, cx);
        // A take-off or landing goes on; its end will not be seen.
        let verdict = Verdict::ended(Stage::Unknown, Reason::BridgeEnding, ImiError::None);
        match self.motion {
            // The last published state says how the module rested.
            Motion::Idle(_) => {}
            Motion::Stopping { then, .. } => self.finish(&verdict, then, cx),
            Motion::Wanted { .. } => {
                self.finish(&Verdict::aborted(Reason::BridgeEnding), Rest::Ready, cx);
            }
            _ => self.finish(&verdict, Rest::Ready, cx),
        }
        self.end_parameter_requests(Reason::BridgeEnding, cx);
    }

    /// The geofence of the configuration was read again, or could not be.
    pub fn new_fence<O: Outputs>(
        &mut self,
        header: &RequestHeader,
        fence: Result<Fence, Reason>,
        cx: &mut Context<'_, O>,
    ) {
        if !self.is_new(header, cx) {
            return;
        }
        match in_time(header, cx.now).and(fence.map_err(Refusal::from)) {
            Ok(fence) => {
                self.safety.set_fence(fence);
                self.report(header, &Verdict::DONE, cx);
                self.check_path_under_way(cx);
            }
            Err(refusal) => self.refuse(header, &refusal, cx),
        }
    }

    /// What the module does.
    pub fn motion(&self) -> &Motion {
        &self.motion
    }

    /// Whether a path is under assembly.
    pub fn is_receiving_path(&self) -> bool {
        self.assembler.open_path().is_some()
    }

    /// The movement under way, or the last one, as published.
    pub fn movement(&self) -> &MovementState {
        &self.movement
    }

    /// The error that the state shows: why a control request was refused, or why the module rests.
    pub fn error(&self) -> ImiError {
        if self.refusal == ImiError::None {
            self.motion.error()
        } else {
            self.refusal
        }
    }

    /// Telemetry altitude of the ground on which the helicopter stood last, m.
    pub fn ground_altitude_m(&self) -> Option<f64> {
        self.observation.ground_altitude_m()
    }

    /// The safety rules as they stand.
    pub fn safety_state(&self, now: MonotonicNs) -> SafetyState {
        self.safety.published(&self.observation, now)
    }

    /// Horizontal distance from the last known position to the last waypoint of the path being flown, m.
    pub fn distance_to_go_m(&self, now: MonotonicNs) -> Option<f64> {
        let Motion::Following(_) = self.motion else {
            return None;
        };
        let position = self.observation.position(now)?;
        Some(arrival::ground_distance_m(&position, self.route.target()?))
    }

    /// Requests refused so far.
    pub fn refused_requests(&self) -> u32 {
        self.refused_requests
    }

    /// Errors that ended the functionality so far.
    pub fn escalated(&self) -> u32 {
        self.escalated
    }

    /// Whether the published state changed since the last time; asking resets it.
    pub fn take_changed(&mut self) -> bool {
        std::mem::take(&mut self.is_changed)
    }

    fn sample<O: Outputs>(&mut self, sample: &Sample, cx: &mut Context<'_, O>) {
        self.observation.take(sample, cx.link.status_fresh_for());
        match self.motion {
            Motion::Following(_) => {
                self.route.verification.status_arrived();
                if let Some(position) = known_position(&sample.status) {
                    self.watch_arrival(&position, cx);
                }
            }
            Motion::TakingOff(_) | Motion::Landing(_) => {
                self.watch_dsp_order(sample.status.flying, cx);
            }
            Motion::Idle(_)
            | Motion::Holding { .. }
            | Motion::Wanted { .. }
            | Motion::Stopping { .. } => {}
        }
        self.enforce_safety(cx);
    }

    /// Flow control: the DSP asks for a waypoint, which it does only when it flies and neither takes off nor lands.
    fn granted<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        match self.motion {
            Motion::TakingOff(_) | Motion::Landing(_) => self.granted_in_dsp_order(cx),
            Motion::Following(_) => self.send_waypoint(cx),
            Motion::Idle(_)
            | Motion::Holding { .. }
            | Motion::Wanted { .. }
            | Motion::Stopping { .. } => {}
        }
    }

    fn delivered<O: Outputs>(
        &mut self,
        command: FlightCommand,
        data: AckData,
        cx: &mut Context<'_, O>,
    ) {
        match command {
            FlightCommand::WriteTakeOffAltitude
            | FlightCommand::ReadTakeOffAltitude
            | FlightCommand::TakeOff
            | FlightCommand::Land
            | FlightCommand::ReadMovement => self.dsp_order_delivered(command, data, cx),
            FlightCommand::CountWaypoints => {
                if let AckData::Bits16(count) = data {
                    self.waypoints_counted(count, cx);
                }
            }
            FlightCommand::ClearErrors => {
                if let Motion::Stopping { errors_cleared, .. } = &mut self.motion {
                    *errors_cleared = true;
                    self.stop_if_done(cx);
                }
            }
            FlightCommand::Parameter => self.parameter_delivered(data, cx),
        }
    }

    fn dsp_error<O: Outputs>(
        &mut self,
        code: DspErrorCode,
        starting: bool,
        cx: &mut Context<'_, O>,
    ) {
        cx.out.notice(&Notice::DspError { code, starting });
        if starting {
            return;
        }
        if let Some(error) = self.config.errors.escalates(code) {
            return self.fatal(error, reason_of(error), cx);
        }
        // The DSP refused a command, a port's value or a waypoint, or could not read it. Which one, the movement under way knows.
        match (code, self.motion) {
            (DspErrorCode::INVALID_COMMAND, Motion::TakingOff(_) | Motion::Landing(_)) => {
                self.dsp_order_refused(cx);
            }
            (
                DspErrorCode::INVALID_COMMAND
                | DspErrorCode::UART_QUEUE_FULL
                | DspErrorCode::UNKNOWN_HEADER
                | DspErrorCode::PC_CHECKSUM,
                Motion::Following(_),
            ) => self.waypoint_refused(code, cx),
            _ => {}
        }
    }

    fn path_emptied<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        match self.motion {
            Motion::Following(following) => match following.step {
                PathStep::AwaitingEmpty => self.begin_feed(cx),
                PathStep::Finishing => self.finish(&Verdict::DONE, Rest::Done, cx),
                PathStep::BridgeEnding => {
                    self.finish(&Verdict::aborted(Reason::BridgeEnding), Rest::Ready, cx);
                }
                PathStep::Ready | PathStep::Flying | PathStep::Settling => {}
            },
            Motion::Holding { .. } => self.finish(&Verdict::DONE, Rest::Done, cx),
            Motion::Stopping { .. } => self.stop_if_done(cx),
            Motion::Idle(_) | Motion::TakingOff(_) | Motion::Landing(_) | Motion::Wanted { .. } => {
            }
        }
    }

    fn stop_if_done<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        let is_empty = cx.link.path() == DspPath::Empty;
        if let Motion::Stopping {
            errors_cleared: true,
            then,
            ..
        } = self.motion
            && is_empty
        {
            self.finish(&Verdict::DONE, then, cx);
        }
    }

    /// Queues the emptying of the DSP's error queue; false when there is no room.
    fn clear_errors<O>(&self, cx: &mut Context<'_, O>) -> bool {
        cx.link.has(FlightCommand::ClearErrors)
            || cx
                .link
                .command(Command::ClearErrors, FlightCommand::ClearErrors)
                .is_ok()
    }

    /// Gives the final report to the sender of the present motion's request, and rests.
    fn finish<O: Outputs>(&mut self, verdict: &Verdict, rest: Rest, cx: &mut Context<'_, O>) {
        let requester = self.motion.requester().copied();
        let then = match self.motion.order() {
            Some(order) if verdict.stage == Stage::Done => order.then,
            // However a hold or landing ends, it does not start the module.
            Some(order) if order.then.is_blocked() && !rest.is_blocked() => order.then,
            _ => rest,
        };
        self.route.clear();
        self.change_motion(Motion::Idle(then));
        if let Some(requester) = requester {
            self.report(&requester, verdict, cx);
        }
    }

    /// The one place where the motion changes as a whole; its timers go with it.
    fn change_motion(&mut self, motion: Motion) {
        self.motion = motion;
        for timer in [FlightTimer::Begin, FlightTimer::Limit, FlightTimer::Step] {
            self.timers.stop(timer);
        }
        self.refusal = ImiError::None;
        self.is_changed = true;
    }
}
