//! What the flight does with the path under way: its points go to the DSP one for each grant, verified where the DSP counts them;
//! its waypoints are seen to be reached; at its end the DSP's path buffer is emptied.

use dsp_protocol::downlink::Geographic;
use dsp_protocol::{Command, DspErrorCode, Uplink, port};
use ipc_types::code::{ImiError, Reason, Stage};

use super::arrival::{distance_m, here};
use super::motion::{Motion, PathStep, Rest};
use super::report::{Detail, Verdict};
use super::verification::{Counted, OnGrant};
use super::{Context, Flight, FlightTimer};
use crate::link::FlightCommand;
use crate::outputs::Outputs;

const COUNT_WAYPOINTS: Command = Command::Read16 {
    port: port::WAYPOINT_COUNT,
};

/// Error 30 so often since a waypoint was first sent means that a DSP that counts refuses it. One may be the answer to a waypoint
/// that was damaged on its way.
const REFUSALS: u32 = 2;

impl Flight {
    /// The DSP's path buffer is empty: before the first waypoint goes, the DSP's count is read.
    pub(super) fn begin_feed<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        self.set_path_step(PathStep::Ready);
        self.count_waypoints(cx);
    }

    /// Flow control grants one waypoint. A grant that finds nothing to send is not kept: the DSP repeats it.
    pub(super) fn send_waypoint<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        let Motion::Following(following) = self.motion else {
            return;
        };
        if !matches!(following.step, PathStep::Ready | PathStep::Flying) {
            return;
        }
        let Some(point) = self.route.trajectory.peek() else {
            return;
        };
        if following.step == PathStep::Ready && !self.begins_in_time(cx) {
            return;
        }
        let on_grant = self.route.verification.on_grant();
        if on_grant == OnGrant::Wait {
            return;
        }
        let again = self.route.verification.is_repetition();
        if !cx.link.waypoint(cx.now, &point.waypoint, again) {
            return;
        }
        if following.step == PathStep::Ready {
            let start = self.observation.position(cx.now);
            let length_m = start.map_or(0.0, |start| self.route.length_m(&start));
            self.movement_begun(length_m, cx);
            self.set_path_step(PathStep::Flying);
        }
        match on_grant {
            OnGrant::SendAndCount => {
                self.route.verification.sent();
                self.count_waypoints(cx);
            }
            OnGrant::Send | OnGrant::Wait => self.next_waypoint(cx),
        }
    }

    /// The DSP's count was read.
    pub(super) fn waypoints_counted<O: Outputs>(&mut self, count: u16, cx: &mut Context<'_, O>) {
        let Motion::Following(_) = self.motion else {
            return;
        };
        match self.route.verification.counted(count) {
            Counted::Ready => cx.link.note_verified(true),
            Counted::Unverified => cx.link.note_verified(false),
            Counted::Arrived => {
                self.route.refusals = 0;
                self.next_waypoint(cx);
            }
            Counted::AskAgain => self.count_waypoints(cx),
            Counted::Lost => cx.link.count_repeated_waypoint(),
            Counted::Failed(reason) => self.fatal(ImiError::CommunicationFatalError, reason, cx),
        }
    }

    /// An error of the DSP while a path is under way that may be about a waypoint of it.
    pub(super) fn waypoint_refused<O: Outputs>(
        &mut self,
        code: DspErrorCode,
        cx: &mut Context<'_, O>,
    ) {
        let Motion::Following(following) = self.motion else {
            return;
        };
        let has_begun = !matches!(following.step, PathStep::AwaitingEmpty | PathStep::Ready);
        if self.route.verification.is_unverified() {
            if has_begun {
                self.waypoint_missing(self.movement.waypoints_sent, code, cx);
            } else if code == DspErrorCode::INVALID_COMMAND {
                self.route.verification.question_refused();
            }
            return;
        }
        let is_sending = following.step == PathStep::Flying;
        if code != DspErrorCode::INVALID_COMMAND
            || !is_sending
            || self.route.trajectory.peek().is_none()
        {
            // The count says what has become of the waypoint.
            return;
        }
        self.route.refusals += 1;
        if self.route.refusals == REFUSALS {
            self.waypoint_missing(self.movement.waypoints_sent + 1, code, cx);
        }
    }

    /// The DSP does not have this waypoint, or may not have it: the path ends, since what follows would be flown without it.
    fn waypoint_missing<O: Outputs>(
        &mut self,
        waypoint: u32,
        code: DspErrorCode,
        cx: &mut Context<'_, O>,
    ) {
        let reason = match code {
            DspErrorCode::INVALID_COMMAND | DspErrorCode::UART_QUEUE_FULL => Reason::RefusedByDsp,
            _ => Reason::DeliveryFailed,
        };
        let detail = Detail {
            waypoint,
            dsp_error: Some(code),
            ..Detail::default()
        };
        self.give_up_movement(&Verdict::aborted(reason).about(detail), Rest::Ready, cx);
    }

    /// The waypoint is with the DSP. Those that follow and are the same on the wire are with it too: it would take
    /// them for copies.
    fn next_waypoint<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        let wire = |waypoint| Uplink::Waypoint(waypoint).encode();
        let trajectory = &mut self.route.trajectory;
        let Some(sent) = trajectory.peek().map(|point| wire(point.waypoint)) else {
            return;
        };
        let before = self.movement.waypoints_sent;
        while let Some(point) = trajectory.peek()
            && wire(point.waypoint) == sent
        {
            if let Some(index) = point.path_index {
                self.movement.waypoints_sent = index as u32 + 1;
            }
            trajectory.advance();
            self.route.advanced += 1;
        }
        if self.movement.waypoints_sent != before {
            self.progress(cx);
        }
    }

    fn count_waypoints<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        let queued = cx
            .link
            .command(COUNT_WAYPOINTS, FlightCommand::CountWaypoints);
        if queued.is_err() {
            self.undelivered(FlightCommand::CountWaypoints, cx);
        }
    }

    /// A position while a path is under way.
    pub(super) fn watch_arrival<O: Outputs>(
        &mut self,
        position: &Geographic,
        cx: &mut Context<'_, O>,
    ) {
        let Motion::Following(following) = self.motion else {
            return;
        };
        match following.step {
            PathStep::Flying => {}
            PathStep::Settling => return self.watch_settling(position, cx),
            PathStep::AwaitingEmpty
            | PathStep::Ready
            | PathStep::Finishing
            | PathStep::BridgeEnding => return,
        }
        let sent = self.movement.waypoints_sent as usize;
        let before = self.route.tracker.reached();
        let has_arrived = self.route.tracker.observe(cx.now, position, sent);
        let reached = self.route.tracker.reached();
        self.movement.waypoints_reached = reached as u32;
        if has_arrived && !self.route.ahead().is_empty() && self.route.verification.is_unverified()
        {
            // Not seen to be reached, and perhaps never with the DSP.
            let detail = Detail {
                waypoint: reached as u32 + 1,
                ..Detail::default()
            };
            let verdict = Verdict::ended(Stage::Unknown, Reason::DeliveryFailed, ImiError::None)
                .about(detail);
            self.give_up_movement(&verdict, Rest::Ready, cx);
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
    fn watch_settling<O: Outputs>(&mut self, position: &Geographic, cx: &mut Context<'_, O>) {
        let radius_m = cx.link.parameters().acceptance_radius_m();
        let is_there = self
            .route
            .target()
            .is_none_or(|target| distance_m(&here(position), target) <= radius_m);
        if is_there {
            self.settled(cx);
        }
    }

    /// The time to settle is over. When the helicopter is not in the box, it has overshot, or the position that said so was
    /// damaged: the path goes on.
    pub(super) fn settling_expired<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        let position = self.observation.position(cx.now);
        if position.is_some_and(|position| self.route.tracker.is_at_end(&position)) {
            self.settled(cx);
        } else {
            self.set_path_step(PathStep::Flying);
        }
    }

    /// The path has been flown. It is done when the DSP holds nothing of it.
    fn settled<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        if let Motion::Following(following) = self.motion
            && following.step == PathStep::Settling
        {
            self.set_path_step(PathStep::Finishing);
            self.timers.stop(FlightTimer::Step);
            cx.link.forget_movement();
            cx.link.forget_path();
        }
    }

    fn set_path_step(&mut self, step: PathStep) {
        if let Motion::Following(following) = &mut self.motion {
            following.step = step;
            self.is_changed = true;
        }
    }
}
