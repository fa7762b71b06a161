//! What the tables of [`motion`](super::motion) say is carried out: commands to the DSP, the beginning and the end of
//! movements, and what safety rules do.

use std::time::Duration;

use dsp_protocol::downlink::Geographic;
use dsp_protocol::{Command, port};
use ipc_types::code::{CameBetween, ImiError, MovementKind, Reason, SafetyAction, Stage};
use ipc_types::payload::{MovementEnd, MovementState};

use super::dsp_order::{Doubt, DspOrder};
use super::last_order::{LastOrder, movement};
use super::motion::{Action, Event, Motion, MovementOrder, PathStep, Rest};
use super::report::{Detail, Verdict};
use super::route::Counted;
use super::{Context, Flight, FlightTimer};
use crate::geodesy::{distance_m, here};
use crate::link::FlightCommand;
use crate::link::commands::ALWAYS;
use crate::link::session::DspPath;
use crate::outputs::Notice;
use crate::safety::{AreaName, Intervention, Judged};

/// Pause between two looks at the port of a take-off or landing, while the order is not confirmed or the rotor runs
/// down.
const LOOK_PERIOD: Duration = Duration::from_millis(250);

/// Pause between two looks at what rules say while no status comes.
const MISSING_PERIOD: Duration = Duration::from_secs(1);

/// Pause between two looks at the port of a take-off that is under way: its end shows by flow control.
const CLIMB_LOOK_PERIOD: Duration = Duration::from_secs(1);

impl Flight {
    pub(super) fn act(&mut self, action: Action, cx: &mut Context<'_>) {
        match action {
            Action::None => {}
            Action::End(verdict, rest) => self.end(&verdict, rest, cx),
            Action::GiveUp(verdict, rest) => self.give_up(&verdict, rest, cx),
            Action::Fatal(error, reason) => self.fatal(error, reason, cx),
            Action::PathLost(error, reason) => {
                self.safety.movement_lost(reason, cx.now);
                self.fatal(error, reason, cx);
            }
            Action::Withdraw(command, verdict) => {
                if cx.link.withdraw(command) {
                    self.give_up(&verdict, Rest::Ready, cx);
                }
            }
            Action::Intervene(violation) => {
                let leg = match self.motion {
                    Motion::Following { .. } => self.movement.waypoints_reached as usize + 1,
                    _ => 0,
                };
                let facts = self.observation.safety_facts(cx.now);
                let area = self.safety.present_area(&facts);
                let intervention = self.safety.intervene(violation, leg, area);
                self.intervene(intervention, cx);
            }
            Action::Hold(order) => self.undefer(order, Flight::order_hold, cx),
            Action::Land(order) if order.requester.is_some() => {
                self.undefer(order, Flight::order_landing, cx);
            }
            Action::Land(order) => {
                self.safety.count_intervention();
                self.order_landing(order, cx);
            }
            Action::ReadTakeOffAltitude => {
                let read = Command::Read32 {
                    port: port::TAKE_OFF_ALTITUDE_M,
                };
                self.command(read, FlightCommand::ReadTakeOffAltitude, cx);
            }
            Action::OrderTakeOff => {
                if self.begins_in_time(cx) {
                    self.motion.take_off_sent();
                    self.command(write_one(port::TAKE_OFF), FlightCommand::TakeOff, cx);
                }
            }
            Action::Ordered => {
                let length_m = match self.motion {
                    Motion::TakingOff { height_m, .. } => f64::from(height_m),
                    _ => {
                        let position = self.observation.position(cx.now);
                        position.map_or(0.0, |position| position.altitude_m.max(0.0))
                    }
                };
                self.movement_begun(length_m, cx);
                // Between two status messages the DSP can begin and end a take-off.
                self.observation.forget_flying(cx.now);
                self.progress(cx);
                self.look(cx);
            }
            Action::Look => self.look(cx),
            // The end of a landing shows by the flying flag; that of a take-off by flow control, and by the port should
            // that stay away.
            Action::UnderWay => {
                self.timers.stop(FlightTimer::Step);
                if let Motion::TakingOff { .. } = self.motion {
                    self.timers
                        .arm(FlightTimer::Step, cx.now + CLIMB_LOOK_PERIOD);
                }
            }
            Action::OrderDone => self.order_done(cx),
            Action::BeginPath => self.begin_path(cx),
            Action::SendWaypoint => self.send_waypoint(cx),
            Action::Counted(count) => self.waypoints_counted(count, cx),
            Action::WaypointError(code) => {
                let sent = self.movement.waypoints_sent;
                let step = self.motion.path_step();
                let end = step.and_then(|step| self.route.dsp_error(code, step, sent));
                if let Some(verdict) = end {
                    self.give_up(&verdict, Rest::Ready, cx);
                }
            }
            Action::Watch(position) => self.watch_path(position.as_ref(), cx),
            Action::SettlingOver => {
                let position = self.observation.position(cx.now);
                match position.is_some_and(|position| self.route.tracker.is_at_end(&position)) {
                    true => self.settled(cx),
                    // The helicopter has overshot, or the position that said so was damaged: the path goes on.
                    false => self.set_path_step(PathStep::Flying),
                }
            }
            Action::EmptyPath => {
                self.timers.stop(FlightTimer::Step);
                self.timers.stop(FlightTimer::Limit);
                cx.link.forget_movement();
                cx.link.forget_path();
            }
        }
    }

    /// A fatal error: it ends the functionality and empties every buffer (requirement D8).
    pub(super) fn fatal(&mut self, error: ImiError, reason: Reason, cx: &mut Context<'_>) {
        self.is_changed = true;
        self.refusal = ImiError::None;
        if !self.motion.note_fatal(error) {
            return;
        }
        self.escalated = self.escalated.saturating_add(1);
        self.break_path(reason, cx);
        let stage = self.motion.stage_of_early_end(reason);
        let verdict = Verdict::ended(stage, reason, error);
        self.give_up(&verdict, Rest::Aborted(error), cx);
        cx.link.forget_path();
        // Without room for the command the DSP's errors stay in its queue; the bridge only counts them.
        self.clear_errors(cx);
    }

    /// Ends the movement under way on this side of the link, if there is one. What the DSP may hold of it is emptied.
    pub(super) fn give_up(&mut self, verdict: &Verdict, rest: Rest, cx: &mut Context<'_>) {
        if let Motion::Idle(_) | Motion::Stopping { .. } = self.motion {
            return;
        }
        cx.link.forget_movement();
        cx.link.forget_path();
        self.end(verdict, rest, cx);
    }

    /// Gives the final report to the sender of the present motion's request, and rests.
    fn end(&mut self, verdict: &Verdict, rest: Rest, cx: &mut Context<'_>) {
        let requester = self.motion.requester().copied();
        let then = match self.motion.movement_order() {
            Some(order) if verdict.stage == Stage::Done => order.then,
            // However a hold or landing ends, it does not start the module.
            Some(order) if order.then.is_blocked() && !rest.is_blocked() => order.then,
            _ => rest,
        };
        if let Some(kind) = self.motion.kind() {
            self.last_end = MovementEnd {
                ended_ns: cx.now.0,
                request_id: self.movement.request_id,
                kind: kind.code(),
                stage: verdict.stage.code(),
                reason: verdict.reason.code(),
                waypoints_reached: self.movement.waypoints_reached,
            };
        }
        self.route.clear();
        self.change_motion(Motion::Idle(then));
        self.control.wait(cx.now);
        self.arm_control();
        if let Some(requester) = requester {
            self.report(&requester, verdict, cx);
        }
    }

    /// The one place where the motion changes as a whole; its timers go with it.
    pub(super) fn change_motion(&mut self, motion: Motion) {
        let paths = [self.motion.path_step(), motion.path_step()];
        self.is_outline_changed |= paths.iter().any(Option::is_some);
        self.motion = motion;
        for timer in [
            FlightTimer::Begin,
            FlightTimer::Limit,
            FlightTimer::Step,
            FlightTimer::Lease,
        ] {
            self.timers.stop(timer);
        }
        self.refusal = ImiError::None;
        self.is_changed = true;
    }

    /// Begins a movement. A path that was still being sent, waypoint by waypoint, is thereby given up.
    fn begin(&mut self, motion: Motion, waypoints: usize, cx: &mut Context<'_>) {
        self.break_path(Reason::PathReplaced, cx);
        let requester = motion.requester().copied();
        // A deferred movement was accepted when it came.
        let is_accepted =
            requester.is_some_and(|header| header.request_id == self.movement.request_id);
        self.change_motion(motion);
        self.movement = MovementState {
            request_id: requester.map_or(0, |header| header.request_id),
            path_id: requester.map_or(0, |header| header.path_id),
            kind: motion.kind().map_or(0, MovementKind::code),
            waypoints_total: waypoints as u32,
            ..MovementState::default()
        };
        let Some(header) = requester else {
            let begin_by = cx.now + self.config.movement.begin_within();
            return self.timers.arm(FlightTimer::Begin, begin_by);
        };
        self.timers.arm(FlightTimer::Begin, header.begin_by);
        if !is_accepted {
            let kind = motion.kind().unwrap_or(MovementKind::Hold);
            self.answers.take(&header, movement(kind));
            let reason = match motion {
                Motion::Deferred { .. } => Reason::LinkDown,
                _ => Reason::None,
            };
            let accepted = Verdict::ended(Stage::Accepted, reason, ImiError::None);
            self.report(&header, &accepted, cx);
        }
    }

    /// Ends what is under way because another movement takes its place.
    fn pre_empt(&mut self, cx: &mut Context<'_>) {
        if let Motion::Following { .. } | Motion::Holding { .. } | Motion::Deferred { .. } =
            self.motion
        {
            self.give_up(&Verdict::aborted(Reason::Replaced), Rest::Ready, cx);
        }
    }

    /// The helicopter hovers where it is, and the module stays as it is.
    pub(super) fn order_hold(&mut self, order: MovementOrder, cx: &mut Context<'_>) {
        self.pre_empt(cx);
        cx.link.forget_path();
        self.begin(Motion::Holding { order }, 0, cx);
    }

    /// Orders the landing, for a request or for a safety rule. A path under way ends as replaced. The order goes out
    /// first; it empties the DSP's path buffer, which the link makes sure of.
    pub(super) fn order_landing(&mut self, order: MovementOrder, cx: &mut Context<'_>) {
        self.pre_empt(cx);
        let until = order.requester.map_or(ALWAYS, |header| header.begin_by);
        let queued = cx
            .link
            .command_until(write_one(port::LAND), FlightCommand::Land, until);
        cx.link.forget_path();
        let step = DspOrder::Ordering(Doubt::default());
        self.begin(Motion::Landing { order, step }, 0, cx);
        if queued.is_err() {
            self.apply(Event::Undelivered(FlightCommand::Land), cx);
        }
    }

    /// Takes a hold or a landing that cannot be carried out yet.
    pub(super) fn defer(&mut self, order: MovementOrder, lands: bool, cx: &mut Context<'_>) {
        self.pre_empt(cx);
        cx.link.forget_path();
        self.begin(Motion::Deferred { order, lands }, 0, cx);
    }

    /// The DSP can be reached again: a hold or a landing that waited for it is carried out, within the time that it
    /// had.
    fn undefer(
        &mut self,
        order: MovementOrder,
        carry_out: fn(&mut Flight, MovementOrder, &mut Context<'_>),
        cx: &mut Context<'_>,
    ) {
        let due = self.timers.due(FlightTimer::Begin);
        self.change_motion(Motion::Idle(order.then));
        carry_out(self, order, cx);
        if let (Motion::Landing { .. } | Motion::Holding { .. }, Some(due)) = (self.motion, due) {
            self.timers.arm(FlightTimer::Begin, due);
        }
    }

    pub(super) fn take_off(
        &mut self,
        order: MovementOrder,
        height_m: f32,
        cx: &mut Context<'_>,
    ) -> Result<(), Verdict> {
        if self.known_flying(cx)? {
            return Err(Reason::AlreadyFlying.into());
        }
        let position = self.known_position(cx)?;
        self.safety.check_take_off(&position, height_m)?;
        let write = Command::Write32 {
            port: port::TAKE_OFF_ALTITUDE_M,
            value: height_m,
        };
        cx.link
            .command(write, FlightCommand::WriteTakeOffAltitude)
            .map_err(|_| Reason::TooManyRequests)?;
        let motion = Motion::TakingOff {
            order,
            height_m,
            ground_altitude_m: position.altitude_m,
            is_granted: false,
            step: DspOrder::Preparing,
        };
        self.begin(motion, 0, cx);
        Ok(())
    }

    /// The path is closed: it goes to the DSP as a whole as soon as the DSP holds nothing else.
    pub(super) fn follow(
        &mut self,
        order: MovementOrder,
        position: &Geographic,
        cx: &mut Context<'_>,
    ) -> Result<(), Verdict> {
        // The helicopter may have moved since the first waypoint came.
        let ground_m = self.observation.ground_altitude_m();
        let speeds = self.speeds_of_leg(1, cx);
        if let Some(first) = self.assembler.waypoints().first().copied()
            && let Err(refusal) =
                (self.safety).check_leg(&here(position), &first, 1, &speeds, ground_m)
        {
            self.break_path(Reason::PathBroken, cx);
            return Err(refusal.into());
        }
        self.answer_newest(&Verdict::DONE, cx);
        self.pre_empt(cx);
        self.route.begin(*position, self.assembler.waypoints());
        let count = self.assembler.waypoints().len();
        let step = PathStep::AwaitingEmpty;
        self.begin(Motion::Following { order, step }, count, cx);
        if let Some(lease) = order.requester.and_then(|header| header.lost.lease) {
            self.timers.arm(FlightTimer::Lease, cx.now + lease);
        }
        match cx.link.path() {
            DspPath::Empty => self.begin_path(cx),
            // The link is emptying the path buffer.
            DspPath::Unknown => {}
            DspPath::Ours => cx.link.forget_path(),
        }
        Ok(())
    }

    /// The movement has begun on the DSP: from now on it has the time that its length takes.
    fn movement_begun(&mut self, length_m: f64, cx: &Context<'_>) {
        let limit = self.config.movement.time_limit(length_m);
        self.timers.stop(FlightTimer::Begin);
        self.timers.arm(FlightTimer::Limit, cx.now + limit);
        self.is_changed = true;
    }

    /// The movement is about to begin on the DSP. False when a later order has come since it was accepted, or its
    /// moment has passed: it then ends.
    fn begins_in_time(&mut self, cx: &mut Context<'_>) -> bool {
        let Some(requester) = self.motion.requester().copied() else {
            return true;
        };
        let judged = self.answers.may_begin(&requester, cx.now);
        if let Err(refusal) = judged {
            self.give_up(&refusal.at(Stage::Aborted), Rest::Ready, cx);
        }
        judged.is_ok()
    }

    /// Reads the port of the take-off or landing, and looks again after a time.
    fn look(&mut self, cx: &mut Context<'_>) {
        let (port, period) = match self.motion {
            Motion::TakingOff {
                step: DspOrder::UnderWay,
                ..
            } => (port::TAKE_OFF, CLIMB_LOOK_PERIOD),
            Motion::TakingOff { .. } => (port::TAKE_OFF, LOOK_PERIOD),
            Motion::Landing { .. } => (port::LAND, LOOK_PERIOD),
            _ => return,
        };
        self.timers.arm(FlightTimer::Step, cx.now + period);
        if !cx.link.has(FlightCommand::ReadMovement) {
            self.command(Command::Read16 { port }, FlightCommand::ReadMovement, cx);
        }
    }

    /// The DSP's own word: the take-off or landing is over.
    fn order_done(&mut self, cx: &mut Context<'_>) {
        let mut height_m = None;
        if let Motion::TakingOff {
            ground_altitude_m, ..
        } = self.motion
        {
            self.observation.note_flying(cx.now);
            let position = self.observation.position(cx.now);
            height_m = position.map(|position| position.altitude_m - ground_altitude_m);
        }
        cx.link.forget_movement();
        let detail = Detail {
            value: height_m,
            ..Detail::default()
        };
        self.end(&Verdict::DONE.about(detail), Rest::Done, cx);
    }

    /// The DSP's path buffer is empty. Before the first waypoint goes, the DSP's count is read.
    fn begin_path(&mut self, cx: &mut Context<'_>) {
        self.set_path_step(PathStep::Ready);
        self.count_waypoints(cx);
    }

    fn count_waypoints(&mut self, cx: &mut Context<'_>) {
        let read = Command::Read16 {
            port: port::WAYPOINT_COUNT,
        };
        self.command(read, FlightCommand::CountWaypoints, cx);
    }

    /// Flow control grants one waypoint. A grant that finds nothing to send is dropped: the DSP repeats it.
    fn send_waypoint(&mut self, cx: &mut Context<'_>) {
        let Some(step @ (PathStep::Ready | PathStep::Flying)) = self.motion.path_step() else {
            return;
        };
        let is_first = step == PathStep::Ready;
        if self.route.is_sent() || is_first && !self.begins_in_time(cx) {
            return;
        }
        let Some(is_verified) = self.route.send(cx.now, cx.link) else {
            return;
        };
        if is_first {
            let start = self.observation.position(cx.now);
            let length_m = start.map_or(0.0, |start| self.route.length_m(&start));
            self.movement_begun(length_m, cx);
            self.set_path_step(PathStep::Flying);
        }
        if is_verified {
            self.route.verification.sent();
            self.count_waypoints(cx);
        } else {
            self.waypoint_arrived(cx);
        }
    }

    fn waypoint_arrived(&mut self, cx: &mut Context<'_>) {
        if let Some(sent) = self.route.advance(self.movement.waypoints_sent) {
            self.movement.waypoints_sent = sent;
            self.progress(cx);
        }
    }

    fn waypoints_counted(&mut self, count: u16, cx: &mut Context<'_>) {
        match self.route.verification.counted(count) {
            Counted::Ready => cx.link.note_verified(true),
            Counted::Unverified => cx.link.note_verified(false),
            Counted::Arrived => {
                self.route.refusals = 0;
                self.waypoint_arrived(cx);
            }
            Counted::AskAgain => self.count_waypoints(cx),
            Counted::Lost => cx.link.count_repeated_waypoint(),
            Counted::Failed(reason) => self.fatal(ImiError::CommunicationFatalError, reason, cx),
        }
    }

    /// A status while a path is under way.
    fn watch_path(&mut self, position: Option<&Geographic>, cx: &mut Context<'_>) {
        self.route.verification.status_arrived();
        let Some(position) = position else { return };
        match self.motion.path_step() {
            Some(PathStep::Flying) => {}
            Some(PathStep::Settling) => return self.watch_settling(position, cx),
            _ => return,
        }
        let sent = self.movement.waypoints_sent as usize;
        let before = self.route.tracker.reached();
        let has_arrived = self.route.tracker.observe(cx.now, position, sent);
        let reached = self.route.tracker.reached();
        self.movement.waypoints_reached = reached as u32;
        let is_unseen = !self.route.ahead().is_empty();
        if has_arrived && is_unseen && self.route.verification.is_unverified() {
            // The bridge did not see the waypoint reached, and the DSP may never reach it.
            let detail = Detail {
                waypoint: reached as u32 + 1,
                ..Detail::default()
            };
            let verdict = Verdict::aborted(Reason::DeliveryFailed).about(detail);
            self.give_up(&verdict.at(Stage::Unknown), Rest::Ready, cx);
        } else if has_arrived {
            self.set_path_step(PathStep::Settling);
            let settle = self.config.arrival.settle();
            self.timers.arm(FlightTimer::Step, cx.now + settle);
            self.watch_settling(position, cx);
        } else if reached != before {
            self.progress(cx);
        }
    }

    /// The helicopter is in the box of the last waypoint, which may be wider than the DSP's own rule: it goes on to the
    /// waypoint, as far as the DSP takes it.
    fn watch_settling(&mut self, position: &Geographic, cx: &mut Context<'_>) {
        let radius_m = cx.link.parameters().acceptance_radius_m();
        let target = self.route.target();
        if target.is_none_or(|target| distance_m(&here(position), target) <= radius_m) {
            self.settled(cx);
        }
    }

    /// The path has been flown. It is done when the DSP holds nothing of it.
    fn settled(&mut self, cx: &mut Context<'_>) {
        if self.motion.path_step() == Some(PathStep::Settling) {
            self.set_path_step(PathStep::Finishing);
            self.timers.stop(FlightTimer::Step);
            cx.link.forget_movement();
            cx.link.forget_path();
        }
    }

    fn set_path_step(&mut self, step: PathStep) {
        self.motion.set_path_step(step);
        self.is_changed = true;
    }

    /// After each sample: a rule that is broken ends what it must end.
    pub(super) fn enforce_safety(&mut self, cx: &mut Context<'_>) {
        let flying = self.observation.flying(cx.now) == Some(true);
        // Take-off and landing pass every altitude; they are vertical, and the fence was asked before.
        let is_flown = flying && !self.motion.unable_to_abort();
        let judged = Judged {
            fence: is_flown,
            ahead: is_flown && self.motion.path_step().is_some(),
            position: flying && !matches!(self.motion, Motion::TakingOff { .. }),
        };
        let facts = self.observation.safety_facts(cx.now);
        let is_new = self.safety.look(&facts, cx.now, judged);
        if self.safety.is_taken_over(&facts) {
            self.happened(CameBetween::Pilot, cx);
        }
        self.tell_rule(is_new, cx);
        // The start-up has emptied the DSP's path buffer, so the helicopter hovers.
        if cx.link.is_up()
            && let Some(violation) = self.safety.link_back(cx.now)
        {
            let violation = Some(violation);
            cx.out.notice(&Notice::Safety {
                violation,
                area: AreaName::default(),
            });
            if let Some(violation) = violation.filter(|one| one.action == SafetyAction::Land) {
                self.answers.take_event(LastOrder::rule(&violation), cx.now);
                self.apply(Event::SafetyLand, cx);
            }
        }
        self.obey_rule(is_new, cx);
    }

    /// No status comes. Of a helicopter that flew when the last one came the position is lost in time; what the other
    /// rules said stays.
    pub(super) fn miss_status(&mut self, cx: &mut Context<'_>) {
        if !self.observation.flew() {
            return;
        }
        self.timers
            .arm(FlightTimer::Status, cx.now + MISSING_PERIOD);
        if cx.link.is_up() {
            let is_judged = !matches!(self.motion, Motion::TakingOff { .. });
            let is_new = self.safety.miss_position(cx.now, is_judged);
            self.tell_rule(is_new, cx);
            self.obey_rule(is_new, cx);
        }
    }

    /// Tells which rule is broken, if that `is_new`.
    fn tell_rule(&mut self, is_new: bool, cx: &mut Context<'_>) {
        if is_new {
            self.is_changed = true;
            let facts = self.observation.safety_facts(cx.now);
            cx.out.notice(&Notice::Safety {
                violation: self.safety.present,
                area: self.safety.present_area(&facts),
            });
        }
    }

    /// Does what the rule that is broken wants, if one is; some of it only when that `is_new`.
    fn obey_rule(&mut self, is_new: bool, cx: &mut Context<'_>) {
        let Some(violation) = self.safety.present else {
            return;
        };
        if let SafetyAction::Hold | SafetyAction::Land = violation.action {
            if is_new {
                self.answers.take_event(LastOrder::rule(&violation), cx.now);
            }
            self.break_path(violation.reason(), cx);
            self.apply(Event::SafetyHold(violation), cx);
        }
        if violation.action == SafetyAction::Land && is_new {
            self.apply(Event::SafetyLand, cx);
        }
    }

    /// Ends the movement because of a rule that is broken. The module stays started.
    pub(super) fn intervene(&mut self, intervention: Intervention, cx: &mut Context<'_>) {
        let event = LastOrder::rule(&intervention.violation);
        self.answers.take_event(event, cx.now);
        let refusal = Verdict::from(intervention);
        self.give_up(&refusal.at(Stage::Aborted), Rest::Ready, cx);
    }

    /// Queues a command of the movement under way.
    fn command(&mut self, command: Command, purpose: FlightCommand, cx: &mut Context<'_>) {
        let until = match (purpose, self.motion.requester()) {
            (FlightCommand::TakeOff, Some(header)) => header.begin_by,
            _ => ALWAYS,
        };
        if cx.link.command_until(command, purpose, until).is_err() {
            self.apply(Event::Undelivered(purpose), cx);
        }
    }

    /// Queues the emptying of the DSP's error queue; false when there is no room.
    pub(super) fn clear_errors(&self, cx: &mut Context<'_>) -> bool {
        cx.link.has(FlightCommand::ClearErrors)
            || cx
                .link
                .command(Command::ClearErrors, FlightCommand::ClearErrors)
                .is_ok()
    }
}

fn write_one(port: u16) -> Command {
    Command::Write16 { port, value: 1 }
}
