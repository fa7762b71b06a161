//! The functionality of the module: movements from the request to the final report.
//!
//! [`Flight`] is given requests, events of the link and the time, and answers through the link's commands and
//! [`Outputs`]. What the module does is one value, [`Motion`]: its file has the tables of states, orders and events.
//! This file has what comes in and what is answered; `actions` carries out what the tables say; the other files are
//! values that both ask.

mod actions;
pub mod arrival;
pub mod assembly;
pub mod control;
pub mod dsp_order;
mod invariants;
pub mod last_order;
pub mod motion;
pub mod observation;
pub mod parameters;
pub mod report;
pub mod request;
pub mod route;
pub mod trajectory;

use std::time::Duration;

use dsp_protocol::Waypoint;
use dsp_protocol::downlink::Geographic;
use ipc_types::MonotonicNs;
use ipc_types::code::{CameBetween, ImiError, ParameterOperation, Reason, SenderLost, Stage};
use ipc_types::payload::{MovementEnd, MovementState, RequestReport, SafetyState};
use module_kit::journal::{NotASnapshot, raw};
use serde::{Deserialize, Serialize};

use crate::config::BridgeConfig;
use crate::errors::reason_of;
use crate::geodesy::{ground_distance_m, here};
use crate::link::session::DspPath;
use crate::link::{FlightCommand, Link, LinkEvent};
use crate::outputs::{Notice, Outputs};
use crate::safety::Safety;
use crate::safety::fence::{Fence, Speeds};
use crate::timers::{TimerTable, timers};
use assembly::Assembler;
use control::{Authority, Control, SenderClock};
use last_order::LastOrder;
use motion::{Action, Event, Facts, Motion, MovementOrder, OrderKind, Rest};
use observation::Observation;
use parameters::ParameterRequests;
use report::{Answers, Detail, Verdict, in_time};
use request::{Movement, Request, RequestHeader, RequestKey, Segment};
use route::Route;
use trajectory::Trajectory;

/// No status for so long is none that is slow: the longest period (port 10001) is 10 s.
const MISSING_AFTER: Duration = Duration::from_secs(11);

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
        /// The end of the time that the holder of control may be silent.
        Control,
        /// The end of the lease of the path under way.
        Lease,
        /// The status that is missing: what rules judge without one.
        Status,
    }
}

/// What a step of the flight works with.
pub struct Context<'a> {
    /// The present moment.
    pub now: MonotonicNs,
    /// The link to the DSP.
    pub link: &'a mut Link,
    /// Where reports go.
    pub out: &'a mut dyn Outputs,
}

/// The state of the module's functionality: requests and events of the link in, commands and reports out.
#[derive(Debug, Serialize, Deserialize)]
pub struct Flight {
    #[serde(skip)]
    config: BridgeConfig,
    motion: Motion,
    assembler: Assembler,
    route: Route,
    answers: Answers,
    observation: Observation,
    safety: Safety,
    parameters: ParameterRequests,
    control: Control,
    #[serde(with = "raw")]
    movement: MovementState,
    #[serde(with = "raw")]
    last_end: MovementEnd,
    timers: TimerTable<FlightTimer>,
    /// The error of the last control request that was refused, until the module's motion changes or a request is
    /// accepted.
    refusal: ImiError,
    refused_requests: u32,
    escalated: u32,
    /// The bridge is ending: no request is taken any more.
    is_ending: bool,
    is_changed: bool,
    /// Whether the fence in force or the path under way has changed since the last publication.
    is_outline_changed: bool,
}

impl Flight {
    /// A module that waits for its start.
    pub fn new(config: &BridgeConfig, trajectory: Box<dyn Trajectory>) -> Self {
        Flight {
            config: config.clone(),
            motion: Motion::Idle(Rest::Waiting(ImiError::None)),
            assembler: Assembler::new(),
            route: Route::new(&config.arrival, trajectory),
            answers: Answers::default(),
            observation: Observation::default(),
            safety: Safety::new(&config.safety, &config.fence),
            parameters: ParameterRequests::default(),
            control: Control::new(&config.control),
            movement: MovementState::default(),
            last_end: MovementEnd::default(),
            timers: TimerTable::new(),
            refusal: ImiError::None,
            refused_requests: 0,
            escalated: 0,
            is_ending: false,
            is_changed: true,
            is_outline_changed: true,
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
        self.safety.configure(&config.safety, fence);
        self.answers.configure();
        self.control.configure(&config.control);
        self.config = config.clone();
        Ok(())
    }

    /// Takes an event of the link.
    pub fn link_event(&mut self, event: &LinkEvent, cx: &mut Context<'_>) {
        match event {
            LinkEvent::Ready => {}
            LinkEvent::Sample(sample) => {
                let had_home = self.observation.home().is_some();
                let fresh_for = cx.link.status_fresh_for();
                self.observation.take(sample, fresh_for);
                self.is_changed |= had_home != self.observation.home().is_some();
                let event = Event::Status {
                    flying: sample.status.flying,
                    position: self.observation.latest(),
                };
                self.apply(event, cx);
                self.enforce_safety(cx);
                let missing = cx.now + fresh_for.max(MISSING_AFTER);
                self.timers.arm(FlightTimer::Status, missing);
            }
            LinkEvent::Grant => self.apply(Event::Grant, cx),
            LinkEvent::PathEmptied => self.apply(Event::PathEmptied, cx),
            LinkEvent::PathNotEmptied => self.apply(Event::PathNotEmptied, cx),
            LinkEvent::PathDropped => self.apply(Event::PathDropped, cx),
            LinkEvent::Delivered(FlightCommand::Parameter, data) => {
                let end = self.parameters.delivered(*data, cx.link);
                self.parameter_ended(end, cx);
            }
            LinkEvent::Undelivered(FlightCommand::Parameter) => {
                let end = self
                    .parameters
                    .fail(Reason::CommunicationFatalError, cx.link);
                self.parameter_ended(end, cx);
            }
            LinkEvent::Delivered(command, data) => {
                self.apply(Event::Delivered(*command, *data), cx)
            }
            LinkEvent::Undelivered(command) => self.apply(Event::Undelivered(*command), cx),
            LinkEvent::DspError { code, starting } => {
                let (code, starting) = (*code, *starting);
                cx.out.notice(&Notice::DspError { code, starting });
                match self.config.errors.escalates(code) {
                    _ if starting => {}
                    Some(error) => self.fatal(error, reason_of(error), cx),
                    None => self.apply(Event::DspError(code), cx),
                }
            }
            LinkEvent::Rebooted => {
                self.happened(CameBetween::DspRebooted, cx);
                self.dsp_vanished(ImiError::HeroDspFatalError, Reason::DspRebooted, cx);
            }
            LinkEvent::Lost => {
                self.happened(CameBetween::LinkLost, cx);
                let error = ImiError::CommunicationFatalError;
                self.dsp_vanished(error, Reason::CommunicationFatalError, cx);
            }
            LinkEvent::ParameterRefused { written, found } => {
                let (written, found) = (*written, *found);
                cx.out.notice(&Notice::ParameterRefused { written, found });
            }
            LinkEvent::OddStatus { groups } => {
                cx.out.notice(&Notice::OddStatus { groups: *groups });
            }
        }
        if let Motion::Deferred { .. } = self.motion {
            self.apply(Event::Reachable, cx);
        }
    }

    /// An event that no request ordered. No step of an earlier command may follow it.
    fn happened(&mut self, what: CameBetween, cx: &Context<'_>) {
        self.answers.take_event(LastOrder::event(what), cx.now);
    }

    /// The DSP is gone, or is not the one it was: open paths and parameter requests end, and the motion gets the event.
    fn dsp_vanished(&mut self, error: ImiError, reason: Reason, cx: &mut Context<'_>) {
        self.break_path(reason, cx);
        self.end_parameter_requests(reason, cx);
        self.apply(Event::Vanished(error, reason), cx);
    }

    /// Handles the next deadline that has passed; false when none has.
    pub fn expire(&mut self, cx: &mut Context<'_>) -> bool {
        let Some(timer) = self.timers.expired(cx.now) else {
            return false;
        };
        match timer {
            FlightTimer::Assembly => self.break_path(Reason::TooLate, cx),
            FlightTimer::Begin => self.apply(Event::BeginByPassed, cx),
            FlightTimer::Limit => self.apply(Event::TimeLimit, cx),
            FlightTimer::Step => self.apply(Event::StepDue, cx),
            FlightTimer::Parameter => {
                let end = self.parameters.expire(cx.now, cx.link);
                self.parameter_ended(end, cx);
            }
            FlightTimer::Control => {
                match self.motion.movement_order() {
                    Some(_) => self.control.wait(cx.now),
                    None => self.is_changed |= self.control.expire(cx.now),
                }
                self.arm_control();
            }
            FlightTimer::Lease => self.sender_lost(cx),
            FlightTimer::Status => self.miss_status(cx),
        }
        true
    }

    /// When [`Flight::expire`] has something to do.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.timers.next()
    }

    /// Takes a request, or the reason why it cannot be one.
    pub fn request(
        &mut self,
        header: &RequestHeader,
        request: Result<Request, Reason>,
        cx: &mut Context<'_>,
    ) {
        if !self.is_new(header, cx) {
            return;
        }
        let carried_out = |request| self.carry_out(header, request, cx);
        let outcome = request.map_err(Verdict::from).and_then(carried_out);
        self.is_changed = true;
        self.arm_control();
        if let Err(refusal) = outcome {
            self.answers.refused(header);
            // A path with a hole is never flown: a refused waypoint takes its open path along.
            let is_of_open_path = self.assembler.open_path() == Some(header.path_id);
            if is_of_open_path && matches!(header.key, RequestKey::Movement(_)) {
                self.break_path(Reason::PathBroken, cx);
            }
            self.refused_requests = self.refused_requests.saturating_add(1);
            if refusal.error != ImiError::None {
                self.refusal = refusal.error;
            }
            self.report(header, &refusal, cx);
        }
    }

    /// Carries a request out, if its sender may have that now.
    fn carry_out(
        &mut self,
        header: &RequestHeader,
        request: Request,
        cx: &mut Context<'_>,
    ) -> Result<(), Verdict> {
        // First: a step that is outdated is no order, and changes nothing.
        if !self.ends_what_it_names(header, &request) {
            self.answers.follows(header)?;
        }
        let (who, authority) = (header.who(), request.authority());
        let is_movement = matches!(request, Request::Movement(_));
        if let Request::Control(_) = request {
            in_time(header, cx.now)?;
        }
        self.control.ask(who, authority, cx.now)?;
        match request {
            Request::Control(_) => self.report(header, &Verdict::DONE, cx),
            Request::Start => self.start(header, cx)?,
            Request::Stop => self.stop(header, cx)?,
            Request::NewFence(fence) => self.new_fence(header, fence, cx)?,
            Request::Movement(movement) => self.take_movement(header, &movement, cx)?,
            Request::Port {
                operation,
                port,
                value,
            } => {
                let facts = self.facts(cx);
                let verdict = (self.parameters).take(header, operation, port, value, &facts)?;
                if operation == ParameterOperation::Write {
                    self.answers.wrote(header);
                }
                self.report(header, &verdict, cx);
                self.parameter_ended(None, cx);
            }
        }
        if authority == Authority::Order {
            self.control.took(who, is_movement, cx.now);
        }
        Ok(())
    }

    /// Whether the request is a hold or a landing that names the movement under way: it ends that one and nothing
    /// newer, though an order in between was refused.
    fn ends_what_it_names(&self, header: &RequestHeader, request: &Request) -> bool {
        let is_end = matches!(request, Request::Movement(Movement::Land | Movement::Hold));
        let under_way = self.motion.requester().map(|it| it.request_id);
        is_end && header.after != 0 && under_way == Some(header.after)
    }

    fn start(&mut self, header: &RequestHeader, cx: &mut Context<'_>) -> Result<(), Verdict> {
        self.answers.may_begin(header, cx.now)?;
        if !cx.link.is_up() {
            return Err(Reason::LinkDown.into());
        }
        let rest = self.motion.standing().start()?;
        self.answers.take(header, CameBetween::Start);
        self.change_motion(Motion::Idle(rest));
        self.report(header, &Verdict::DONE, cx);
        Ok(())
    }

    fn stop(&mut self, header: &RequestHeader, cx: &mut Context<'_>) -> Result<(), Verdict> {
        // The order counts even when it is refused.
        self.answers.take(header, CameBetween::Stop);
        in_time(header, cx.now)?;
        let then = self.motion.standing().stop()?;
        self.break_path(Reason::Stopped, cx);
        self.give_up(&Verdict::aborted(Reason::Stopped), then, cx);
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
            self.apply(Event::Undelivered(FlightCommand::ClearErrors), cx);
        }
        Ok(())
    }

    /// The geofence of the configuration was read again, or could not be. What is left of the path under way is checked
    /// against it.
    fn new_fence(
        &mut self,
        header: &RequestHeader,
        fence: Result<Fence, Reason>,
        cx: &mut Context<'_>,
    ) -> Result<(), Verdict> {
        in_time(header, cx.now)?;
        let fence = fence?;
        self.is_outline_changed |= fence != self.safety.fence;
        self.safety.fence = fence;
        self.report(header, &Verdict::DONE, cx);
        if let (Some(_), Some(position)) =
            (self.motion.path_step(), self.observation.position(cx.now))
            && let Some((leg, breach)) = self.safety.check_path(&position, self.route.ahead())
        {
            let reached = self.movement.waypoints_reached as usize;
            let intervention = self.safety.breach(breach, reached + leg);
            self.intervene(intervention, cx);
        }
        Ok(())
    }

    fn take_movement(
        &mut self,
        header: &RequestHeader,
        movement: &Movement,
        cx: &mut Context<'_>,
    ) -> Result<(), Verdict> {
        match movement {
            Movement::TakeOff { .. } | Movement::Waypoint(_) => {
                let newest = self.assembler.newest();
                self.answers.may_begin_after(newest, header, cx.now)?;
            }
            // These orders count even when they are refused.
            Movement::Land | Movement::Hold => {
                let what = match movement {
                    Movement::Land => CameBetween::Land,
                    _ => CameBetween::Hold,
                };
                self.answers.take(header, what);
                in_time(header, cx.now)?;
            }
        }
        let is_hold_or_landing = matches!(movement, Movement::Land | Movement::Hold);
        let facts = self.observation.safety_facts(cx.now);
        self.safety.check_movement(is_hold_or_landing, &facts)?;
        let asked = match movement {
            Movement::TakeOff { .. } => OrderKind::TakeOff,
            Movement::Land => OrderKind::Land,
            Movement::Hold => OrderKind::Hold,
            Movement::Waypoint(_) => OrderKind::Path,
        };
        let facts = self.facts(cx);
        let order = MovementOrder {
            requester: Some(*header),
            then: self.motion.allows(asked, header.preempt, &facts)?,
        };
        match *movement {
            Movement::TakeOff { altitude_m } => self.take_off(order, altitude_m, cx)?,
            Movement::Waypoint(segment) => self.waypoint(order, header, &segment, cx)?,
            Movement::Land if !facts.may_fly => return Err(Reason::NotFlying.into()),
            Movement::Land if facts.is_link_up => self.order_landing(order, cx),
            Movement::Hold if facts.is_link_up => self.order_hold(order, cx),
            Movement::Land | Movement::Hold => {
                let lands = *movement == Movement::Land;
                self.defer(order, lands, cx);
            }
        }
        Ok(())
    }

    fn waypoint(
        &mut self,
        order: MovementOrder,
        header: &RequestHeader,
        segment: &Segment,
        cx: &mut Context<'_>,
    ) -> Result<(), Verdict> {
        if !self.known_flying(cx)? {
            return Err(Reason::NotFlying.into());
        }
        if !segment.first && !self.assembler.continues(segment) {
            return Err(Reason::PathWithoutHead.into());
        }
        let position = self.known_position(cx)?;
        let distance_m = ground_distance_m(&position, &segment.waypoint);
        let most_m = self.config.movement.max_distance_m;
        if distance_m > most_m {
            return Err(Verdict::from(Reason::TooFar).about(Detail {
                waypoint: self.number_in_path(segment) as u32,
                value: Some(distance_m),
                most_m,
                ..Detail::default()
            }));
        }
        let header = self.part_of_path(header, segment, cx.now)?;
        // First, so that a waypoint that is refused disturbs no path of another client.
        self.check_leg_to(segment, &position, cx)?;
        if segment.first {
            self.break_path(Reason::PathReplaced, cx);
        }
        match self.assembler.add(segment) {
            Ok(false) => {
                self.answer_newest(&Verdict::DONE, cx);
                self.assembler.set_newest(header);
                self.timers.arm(FlightTimer::Assembly, header.begin_by);
                self.is_changed = true;
                self.report(&header, &Verdict::ACCEPTED, cx);
                Ok(())
            }
            Ok(true) => {
                let requester = Some(header);
                self.follow(MovementOrder { requester, ..order }, &position, cx)
            }
            Err(reason) => {
                if self.assembler.open_path().is_none() {
                    self.break_path(reason, cx);
                }
                Err(reason.into())
            }
        }
    }

    /// A waypoint of the open path: it came in time for the one before it, and carries the moment of the whole path.
    fn part_of_path(
        &self,
        header: &RequestHeader,
        segment: &Segment,
        now: MonotonicNs,
    ) -> Result<RequestHeader, Verdict> {
        let is_part = self.assembler.continues(segment);
        let Some(newest) = self.assembler.newest().filter(|_| is_part) else {
            return Ok(*header);
        };
        in_time(newest, now)?;
        let header = RequestHeader {
            issued: header.issued.with(&newest.issued),
            ..*header
        };
        self.answers.may_begin(&header, now)?;
        Ok(header)
    }

    /// Which waypoint of its path it is, from 1.
    fn number_in_path(&self, segment: &Segment) -> usize {
        match self.assembler.continues(segment) {
            true => self.assembler.waypoints().len() + 1,
            false => 1,
        }
    }

    /// The leg that ends at this waypoint, against the geofence and the ground.
    fn check_leg_to(
        &mut self,
        segment: &Segment,
        position: &Geographic,
        cx: &Context<'_>,
    ) -> Result<(), Verdict> {
        let leg = self.number_in_path(segment);
        let speeds = self.speeds_of_leg(leg, cx);
        let from = match self.assembler.waypoints().last() {
            Some(last) if leg > 1 => *last,
            _ => here(position),
        };
        let ground_m = self.observation.ground_altitude_m();
        self.safety
            .check_leg(&from, &segment.waypoint, leg, &speeds, ground_m)?;
        Ok(())
    }

    /// How fast a leg of a path is flown; the first one begins as fast as the helicopter is now.
    fn speeds_of_leg(&self, leg: usize, cx: &Context<'_>) -> Speeds {
        let measured_mps = self.observation.speed_mps(cx.now).filter(|_| leg == 1);
        Speeds {
            begin_mps: measured_mps.unwrap_or(f64::INFINITY),
            ..cx.link.parameters().speeds()
        }
    }

    fn known_position(&self, cx: &Context<'_>) -> Result<Geographic, Reason> {
        self.observation.position(cx.now).ok_or(Reason::NoPosition)
    }

    fn known_flying(&self, cx: &Context<'_>) -> Result<bool, Reason> {
        self.observation.flying(cx.now).ok_or(Reason::NoPosition)
    }

    /// The sender of a request is gone, or has given it up. A path that it was still sending is broken, and of one that
    /// is flown the sender is lost. Another movement goes on to its end, which is a hover or the ground.
    pub fn sender_gone(&mut self, key: RequestKey, cx: &mut Context<'_>) {
        if self
            .assembler
            .newest()
            .is_some_and(|newest| newest.key == key)
        {
            self.break_path(Reason::PathBroken, cx);
        }
        if self.path_followed().is_some_and(|header| header.key == key) {
            self.sender_lost(cx);
        }
    }

    /// A process has ended: one with which a sender ends, who may have had control, or that of the path's sender.
    pub fn process_ended(&mut self, process: u32, cx: &mut Context<'_>) {
        self.is_changed |= self.control.gone(process);
        self.arm_control();
        if self.path_process() == Some(process) {
            self.sender_lost(cx);
        }
    }

    /// The request of the path under way, if that does not go on without its sender.
    pub fn path_followed(&self) -> Option<&RequestHeader> {
        self.path_request()
            .filter(|header| header.lost.then != SenderLost::Continue)
    }

    /// The process of the sender of that path, if its end can be seen.
    pub fn path_process(&self) -> Option<u32> {
        let sender = self.path_followed()?.sender;
        (sender.process).filter(|_| sender.clock != SenderClock::Unknown)
    }

    fn path_request(&self) -> Option<&RequestHeader> {
        self.motion.path_step()?;
        self.motion.requester()
    }

    /// The path under way whose sender renews it, and until when.
    pub fn lease(&self) -> Option<(u64, MonotonicNs)> {
        let until = self.timers.due(FlightTimer::Lease)?;
        self.path_request().map(|header| (header.path_id, until))
    }

    /// The sender renewed the path at this moment.
    pub fn lease_renewed(&mut self, at: MonotonicNs) {
        let lease = self.path_request().and_then(|header| header.lost.lease);
        if let Some((lease, due)) = lease.zip(self.timers.due(FlightTimer::Lease)) {
            self.timers.arm(FlightTimer::Lease, due.max(at + lease));
        }
    }

    /// The machine was suspended for `slept`, and the process that renews the path's lease with it. So the lease is
    /// longer by that, and does not end before the driver has looked whether it was renewed.
    pub fn suspended(&mut self, slept: Duration, now: MonotonicNs) {
        if let Some(due) = self.timers.due(FlightTimer::Lease) {
            let not_yet = now + Duration::from_nanos(1);
            self.timers
                .arm(FlightTimer::Lease, (due + slept).max(not_yet));
        }
    }

    /// The path under way ends without its sender: the helicopter hovers, or lands.
    fn sender_lost(&mut self, cx: &mut Context<'_>) {
        let lands =
            (self.path_request()).is_some_and(|header| header.lost.then == SenderLost::Land);
        self.apply(Event::SenderLost, cx);
        let Motion::Idle(then) = self.motion else {
            return;
        };
        self.answers.take_loss();
        let requester = None;
        match (lands, cx.link.is_up()) {
            (false, _) => {}
            (true, true) => self.order_landing(MovementOrder { requester, then }, cx),
            (true, false) => self.defer(MovementOrder { requester, then }, true, cx),
        }
    }

    /// Restarts the timer of the holder's silence, or stops it if no silence counts.
    fn arm_control(&mut self) {
        match self.control.silent_from() {
            Some(from) => self.timers.arm(FlightTimer::Control, from),
            None => self.timers.stop(FlightTimer::Control),
        }
    }

    /// The control of the module.
    pub(crate) fn control(&self) -> &Control {
        &self.control
    }

    /// The bridge is about to end: the DSP's path buffer is emptied, and no request is taken any more. What is under
    /// way gets its final report when the DSP has acknowledged that, or from [`Flight::close`].
    pub fn wind_down(&mut self, cx: &mut Context<'_>) {
        self.is_ending = true;
        self.break_path(Reason::BridgeEnding, cx);
        self.apply(Event::WindDown, cx);
    }

    /// The bridge is ending: every open request gets its final report.
    pub fn close(&mut self, cx: &mut Context<'_>) {
        self.is_ending = true;
        self.break_path(Reason::BridgeEnding, cx);
        self.apply(Event::Close, cx);
        self.end_parameter_requests(Reason::BridgeEnding, cx);
    }

    fn apply(&mut self, event: Event, cx: &mut Context<'_>) {
        let facts = self.facts(cx);
        let action = self.motion.apply(event, &facts);
        if action != Action::None {
            self.act(action, cx);
        }
    }

    fn facts(&self, cx: &Context<'_>) -> Facts {
        Facts {
            now: cx.now,
            is_link_up: cx.link.is_up(),
            is_path_empty: cx.link.path() == DspPath::Empty,
            flying: self.observation.flying(cx.now),
            may_fly: self.observation.may_fly(),
            looks_later: self.timers.is_armed(FlightTimer::Step),
        }
    }

    /// Reports the end of a parameter request, and gives the next one to the DSP.
    fn parameter_ended(&mut self, end: Option<(RequestHeader, Verdict)>, cx: &mut Context<'_>) {
        let mut end = end;
        loop {
            if let Some((header, verdict)) = end {
                self.report(&header, &verdict, cx);
            }
            end = self.parameters.expire(cx.now, cx.link);
            end = end.or_else(|| self.parameters.send(cx.link));
            if end.is_none() {
                break;
            }
        }
        match self.parameters.deadline() {
            Some(deadline) => self.timers.arm(FlightTimer::Parameter, deadline),
            None => self.timers.stop(FlightTimer::Parameter),
        }
    }

    /// All parameter requests end: the DSP is gone, or the bridge ends.
    fn end_parameter_requests(&mut self, reason: Reason, cx: &mut Context<'_>) {
        self.timers.stop(FlightTimer::Parameter);
        let mut is_first = true;
        while let Some((header, verdict)) = self.parameters.end_next(reason, is_first) {
            is_first = false;
            self.report(&header, &verdict, cx);
        }
        cx.link.forget_parameter();
    }

    /// Gives up the path under assembly, if there is one. Its newest waypoint gets the reason; those before it were
    /// done when they became part of it.
    fn break_path(&mut self, reason: Reason, cx: &mut Context<'_>) {
        self.answer_newest(&Verdict::aborted(reason), cx);
        if self.assembler.open_path().is_some() {
            self.is_changed = true;
        }
        self.assembler.clear();
    }

    /// The final report for the newest waypoint of the path under assembly.
    fn answer_newest(&mut self, verdict: &Verdict, cx: &mut Context<'_>) {
        self.timers.stop(FlightTimer::Assembly);
        if let Some(newest) = self.assembler.take_newest() {
            self.report(&newest, verdict, cx);
        }
    }

    fn progress(&mut self, cx: &mut Context<'_>) {
        self.is_changed = true;
        if let Some(requester) = self.motion.requester().copied() {
            self.report(&requester, &Verdict::PROGRESS, cx);
        }
    }

    fn report(&mut self, header: &RequestHeader, verdict: &Verdict, cx: &mut Context<'_>) {
        if verdict.stage == Stage::Accepted {
            self.refusal = ImiError::None;
        }
        // The counts belong to the movement of this request, or to the path that its waypoint lies in.
        let own = header.request_id == self.movement.request_id
            && header.path_id == self.movement.path_id;
        let counts = if own {
            self.movement
        } else {
            MovementState {
                waypoints_total: self.assembler.waypoints().len() as u32,
                ..MovementState::default()
            }
        };
        let mut report = RequestReport {
            request_id: header.request_id,
            path_id: header.path_id,
            reported_ns: cx.now.0,
            waypoints_total: counts.waypoints_total,
            waypoints_sent: counts.waypoints_sent,
            waypoints_reached: counts.waypoints_reached,
            ..RequestReport::default()
        };
        verdict.write(&mut report);
        if verdict.stage.is_final() {
            self.answers.note(&report);
        }
        cx.out.report(header.key, &report);
    }

    /// Whether this request may be executed. One that was asked before is answered here, and never executed twice.
    fn is_new(&mut self, header: &RequestHeader, cx: &mut Context<'_>) -> bool {
        let id = header.request_id;
        if let Some(report) = self.answers.report_of(id) {
            let report = RequestReport {
                reported_ns: cx.now.0,
                ..*report
            };
            cx.out.report(header.key, &report);
            return false;
        }
        // A request is open until it has had its final report.
        let mut open = (self.assembler.newest().into_iter())
            .chain(self.motion.requester())
            .chain(self.parameters.open());
        let (stage, reason) = if id == 0 {
            (Stage::Refused, Reason::InvalidRequest)
        } else if open.any(|header| header.request_id == id) {
            (Stage::Refused, Reason::StillOpen)
        } else if header.repeat {
            (Stage::Unknown, Reason::NotRemembered)
        } else if self.is_ending {
            (Stage::Refused, Reason::BridgeEnding)
        } else {
            return true;
        };
        // Not remembered: this is not the final report of the request that was asked first.
        let report = RequestReport {
            request_id: id,
            path_id: header.path_id,
            reported_ns: cx.now.0,
            ..RequestReport::new(stage, reason)
        };
        self.refused_requests = self.refused_requests.saturating_add(1);
        cx.out.report(header.key, &report);
        false
    }

    /// The geofence in force.
    pub(crate) fn fence(&self) -> &Fence {
        &self.safety.fence
    }

    /// The waypoints of the path under way; empty if there is none.
    pub(crate) fn held_path(&self) -> &[Waypoint] {
        match self.motion.path_step() {
            Some(_) => self.route.tracker.path(),
            None => &[],
        }
    }

    /// Whether [the fence](Flight::fence) or [the path](Flight::held_path) changed since the last time; asking resets
    /// it.
    pub(crate) fn take_outline_changed(&mut self) -> bool {
        std::mem::take(&mut self.is_outline_changed)
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

    /// How the movement that ended last did so, as published.
    pub fn last_end(&self) -> &MovementEnd {
        &self.last_end
    }

    /// The error that the state shows: why a control request was refused, or why the module rests.
    pub fn error(&self) -> ImiError {
        if self.refusal == ImiError::None {
            self.motion.error()
        } else {
            self.refusal
        }
    }

    /// Where the helicopter stands, and in the air where it took off.
    pub fn home(&self) -> Option<Geographic> {
        self.observation.home()
    }

    /// The safety rules as they stand.
    pub fn safety_state(&self, now: MonotonicNs) -> SafetyState {
        self.safety.published(&self.observation.safety_facts(now))
    }

    /// Horizontal distance from the last known position to the last waypoint of the path being flown, m.
    pub fn distance_to_go_m(&self, now: MonotonicNs) -> Option<f64> {
        self.motion.path_step()?;
        let position = self.observation.position(now)?;
        Some(ground_distance_m(&position, self.route.target()?))
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
}
