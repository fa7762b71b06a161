//! Movements that the bridge forms: paths from their waypoints to the DSP, holding, and what begins each movement.

use dsp_protocol::downlink::Geographic;
use ipc_types::MonotonicNs;
use ipc_types::code::{ImiError, MovementKind, Reason, Stage};
use ipc_types::payload::MovementState;

use super::arrival::{ground_distance_m, here};
use super::assembly::{Outcome, Segment};
use super::motion::{Following, Motion, Order, PathStep, Rest};
use super::report::{Refusal, Verdict, in_time};
use super::request::{Movement, RequestHeader};
use super::{Context, Flight, FlightTimer};
use crate::link::dsp_path::DspPath;
use crate::outputs::Outputs;

impl Flight {
    /// Takes a movement request, or the reason why it cannot be one.
    pub fn movement_request<O: Outputs>(
        &mut self,
        header: &RequestHeader,
        movement: Result<Movement, Reason>,
        cx: &mut Context<'_, O>,
    ) {
        if !self.is_new(header, cx) {
            return;
        }
        let outcome = movement.map_err(Refusal::from).and_then(|movement| {
            match movement {
                Movement::TakeOff { .. } | Movement::Waypoint(_) => {
                    self.may_be_taken(header, cx.now)?;
                }
                // They count even when they are refused.
                Movement::Land | Movement::Hold => {
                    self.mark.take(&header.issued);
                    in_time(header, cx.now)?;
                }
            }
            self.safety
                .check_movement(&movement, &self.observation, cx.now)?;
            match movement {
                Movement::TakeOff { altitude_m } => self.take_off(header, altitude_m, cx),
                Movement::Land => self.land(header, cx),
                Movement::Hold => self.hold(header, cx),
                Movement::Waypoint(segment) => self.waypoint(header, &segment, cx),
            }
        });
        if let Err(refusal) = outcome {
            // A path with a hole is never flown: a refused waypoint takes its open path along.
            let belongs_to_open_path = self.assembler.open_path() == Some(header.path_id);
            if belongs_to_open_path {
                self.break_path(Reason::PathBroken, cx);
            }
            self.refuse(header, &refusal, cx);
        }
    }

    /// What every movement needs: a started module, a DSP that listens, and no movement under way but one that it may
    /// pre-empt (requirements D6, H6).
    pub(super) fn ready_to_move<O>(
        &self,
        preempt: bool,
        cx: &Context<'_, O>,
    ) -> Result<(), Refusal> {
        if self.motion.wants_start() {
            return Err(Reason::NotStarted.into());
        }
        if !cx.link.is_up() {
            return Err(Reason::LinkDown.into());
        }
        match self.motion {
            Motion::Idle(_) => Ok(()),
            Motion::Following(_) | Motion::Holding { .. } if preempt => Ok(()),
            _ => Err(Reason::Busy.into()),
        }
    }

    pub(super) fn known_position<O>(&self, cx: &Context<'_, O>) -> Result<Geographic, Refusal> {
        let position = self.observation.position(cx.now);
        Ok(position.ok_or(Reason::NoPosition)?)
    }

    pub(super) fn known_flying<O>(&self, cx: &Context<'_, O>) -> Result<bool, Refusal> {
        let flying = self.observation.flying(cx.now);
        Ok(flying.ok_or(Reason::NoPosition)?)
    }

    /// What a hold or a landing needs: a helicopter that flies or may fly, whatever the module's state is; on the ground, a module that
    /// is started and a DSP that listens. One that is blocked rests afterwards as it did before.
    pub(super) fn order_on_the_spot<O>(
        &self,
        header: &RequestHeader,
        preempt: bool,
        cx: &Context<'_, O>,
    ) -> Result<Order, Refusal> {
        if !self.observation.may_fly() {
            if self.motion.is_blocked() {
                return Err(Reason::NotStarted.into());
            }
            if !cx.link.is_up() {
                return Err(Reason::LinkDown.into());
            }
        }
        let before = match self.motion {
            Motion::Idle(rest) => rest,
            Motion::Wanted { order, .. } => order.then,
            Motion::Following(Following { order, .. }) | Motion::Holding { order } if preempt => {
                order.then
            }
            _ => return Err(Reason::Busy.into()),
        };
        let then = match before.is_blocked() {
            true => before,
            false => Rest::Done,
        };
        let requester = Some(*header);
        Ok(Order { requester, then })
    }

    /// Takes a hold or a landing that cannot be carried out yet.
    pub(super) fn want<O: Outputs>(&mut self, order: Order, lands: bool, cx: &mut Context<'_, O>) {
        self.pre_empt(cx);
        cx.link.forget_path();
        let motion = Motion::Wanted { order, lands };
        let kind = motion.kind().unwrap_or(MovementKind::Hold);
        self.begin(order.requester.as_ref(), kind, 0, motion, cx);
    }

    /// The DSP is heard again: a hold or a landing that waited for it is carried out, within the time that it had.
    pub(super) fn carry_out_wanted<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        let Motion::Wanted { order, lands } = self.motion else {
            return;
        };
        let flying = self.observation.flying(cx.now);
        if !cx.link.is_up() {
            return;
        }
        if lands && flying == Some(false) {
            return self.finish(&Verdict::aborted(Reason::NotFlying), Rest::Ready, cx);
        }
        let due = self.timers.due(FlightTimer::Begin);
        self.change_motion(Motion::Idle(order.then));
        match lands {
            true => self.order_landing(order, cx),
            false => self.order_hold(order, cx),
        }
        if let (Motion::Landing(_) | Motion::Holding { .. }, Some(due)) = (self.motion, due) {
            self.timers.arm(FlightTimer::Begin, due);
        }
    }

    /// Ends the path or the hold under way, because another movement takes its place.
    pub(super) fn pre_empt<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        if let Motion::Following(_) | Motion::Holding { .. } | Motion::Wanted { .. } = self.motion {
            self.give_up_movement(&Verdict::aborted(Reason::Replaced), Rest::Ready, cx);
        }
    }

    /// The helicopter hovers where it is, and the module stays as it is.
    fn hold<O: Outputs>(
        &mut self,
        header: &RequestHeader,
        cx: &mut Context<'_, O>,
    ) -> Result<(), Refusal> {
        if self.motion.unable_to_abort() {
            return Err(Reason::UnableToAbort.into());
        }
        let order = self.order_on_the_spot(header, true, cx)?;
        match cx.link.is_up() {
            true => self.order_hold(order, cx),
            false => self.want(order, false, cx),
        }
        Ok(())
    }

    fn order_hold<O: Outputs>(&mut self, order: Order, cx: &mut Context<'_, O>) {
        self.pre_empt(cx);
        cx.link.forget_path();
        let motion = Motion::Holding { order };
        self.begin(order.requester.as_ref(), MovementKind::Hold, 0, motion, cx);
    }

    /// Begins a movement. Another one that was still being sent, waypoint by waypoint, is thereby given up.
    pub(super) fn begin<O: Outputs>(
        &mut self,
        requester: Option<&RequestHeader>,
        kind: MovementKind,
        waypoints: usize,
        motion: Motion,
        cx: &mut Context<'_, O>,
    ) {
        self.break_path(Reason::PathReplaced, cx);
        // One that was wanted was accepted when it came.
        let is_accepted =
            requester.is_some_and(|header| header.request_id == self.movement.request_id);
        self.change_motion(motion);
        self.movement = MovementState {
            request_id: requester.map_or(0, |header| header.request_id),
            path_id: requester.map_or(0, |header| header.path_id),
            kind: kind.code(),
            waypoints_total: waypoints as u32,
            ..MovementState::default()
        };
        let begin_by = match requester {
            None => cx.now + self.config.movement.begin_within(),
            Some(header) => {
                self.mark.take(&header.issued);
                header.begin_by
            }
        };
        self.timers.arm(FlightTimer::Begin, begin_by);
        if let Some(header) = requester
            && !is_accepted
        {
            let reason = match motion {
                Motion::Wanted { .. } => Reason::LinkDown,
                _ => Reason::None,
            };
            let accepted = Verdict::ended(Stage::Accepted, reason, ImiError::None);
            self.report(header, &accepted, cx);
        }
    }

    fn waypoint<O: Outputs>(
        &mut self,
        header: &RequestHeader,
        segment: &Segment,
        cx: &mut Context<'_, O>,
    ) -> Result<(), Refusal> {
        self.ready_to_move(header.preempt, cx)?;
        if !self.known_flying(cx)? {
            return Err(Reason::NotFlying.into());
        }
        let position = self.known_position(cx)?;
        if ground_distance_m(&position, &segment.waypoint) > self.config.movement.max_distance_m {
            return Err(Reason::TooFar.into());
        }
        let header = &self.part_of_path(header, segment, cx.now)?;
        // First, so that a waypoint that is refused disturbs no path of another client.
        self.check_leg_to(segment, &position)?;
        if self.assembler.replaces(segment) {
            self.break_path(Reason::PathReplaced, cx);
        }
        match self.assembler.add(segment) {
            Outcome::Open => {
                self.answer_newest(&Verdict::DONE, cx);
                self.newest_waypoint = Some(*header);
                self.timers.arm(FlightTimer::Assembly, header.begin_by);
                self.is_changed = true;
                self.report(header, &Verdict::ACCEPTED, cx);
                Ok(())
            }
            Outcome::Closed => self.follow(header, position, cx),
            Outcome::Refused { reason, broken } => {
                if broken {
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
    ) -> Result<RequestHeader, Refusal> {
        let is_part = !segment.first && self.assembler.open_path() == Some(segment.path_id);
        let Some(newest) = self.newest_waypoint.filter(|_| is_part) else {
            return Ok(*header);
        };
        in_time(&newest, now)?;
        let header = RequestHeader {
            issued: header.issued.with(&newest.issued),
            ..*header
        };
        self.may_begin(&header, now)?;
        Ok(header)
    }

    /// The leg that ends at this waypoint, against the geofence and the ground.
    fn check_leg_to(&mut self, segment: &Segment, position: &Geographic) -> Result<(), Refusal> {
        let is_continued = !segment.first && self.assembler.open_path() == Some(segment.path_id);
        let waypoints = self.assembler.waypoints();
        let (from, leg) = match waypoints.last() {
            Some(last) if is_continued => (*last, waypoints.len() + 1),
            _ => (here(position), 1),
        };
        let ground_m = self.observation.ground_altitude_m();
        self.safety
            .check_leg(&from, &segment.waypoint, leg, ground_m)
    }

    /// The path is closed: it goes to the DSP as a whole as soon as the DSP holds nothing else.
    fn follow<O: Outputs>(
        &mut self,
        closing: &RequestHeader,
        position: Geographic,
        cx: &mut Context<'_, O>,
    ) -> Result<(), Refusal> {
        // The helicopter may have moved since the first waypoint came.
        let first = self.assembler.waypoints().first().copied();
        let from = here(&position);
        let ground_m = self.observation.ground_altitude_m();
        if let Some(first) = first
            && let Err(refusal) = self.safety.check_leg(&from, &first, 1, ground_m)
        {
            self.break_path(Reason::PathBroken, cx);
            return Err(refusal);
        }
        self.answer_newest(&Verdict::DONE, cx);
        self.pre_empt(cx);
        self.route.begin(position, self.assembler.waypoints());
        let count = self.assembler.waypoints().len();
        let motion = Motion::Following(Following {
            order: Order::of(*closing),
            step: PathStep::AwaitingEmpty,
        });
        self.begin(Some(closing), MovementKind::GoToWaypoint, count, motion, cx);
        match cx.link.path() {
            DspPath::Empty => self.begin_feed(cx),
            // The link is emptying it.
            DspPath::Unknown => {}
            DspPath::Ours => cx.link.forget_path(),
        }
        Ok(())
    }

    /// Gives up the path under assembly, if there is one. Its newest waypoint gets the reason; those before it were done when
    /// they became part of it.
    pub(super) fn break_path<O: Outputs>(&mut self, reason: Reason, cx: &mut Context<'_, O>) {
        self.answer_newest(&Verdict::aborted(reason), cx);
        if self.assembler.open_path().is_some() {
            self.is_changed = true;
        }
        self.assembler.clear();
    }

    /// The final report for the newest waypoint of the path under assembly.
    fn answer_newest<O: Outputs>(&mut self, verdict: &Verdict, cx: &mut Context<'_, O>) {
        self.timers.stop(FlightTimer::Assembly);
        if let Some(newest) = self.newest_waypoint.take() {
            self.report(&newest, verdict, cx);
        }
    }
}
