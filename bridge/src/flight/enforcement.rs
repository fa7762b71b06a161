//! What the flight does about the rules of [`Safety`](super::safety::Safety) that are broken.

use ipc_types::code::{SafetyAction, SafetyRule};

use super::arrival::here;
use super::motion::{Motion, Order, Rest};
use super::report::Verdict;
use super::safety::{action_of, refuse};
use super::violation::Violation;
use super::{Context, Flight};
use crate::outputs::{Notice, Outputs};

impl Flight {
    /// After each sample: a rule that is broken ends what it must end.
    pub(super) fn enforce_safety<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        let before = self.safety.present.map(key);
        let flying = self.observation.flying(cx.now) == Some(true);
        // Take-off and landing pass every altitude; they are vertical, and the fence was asked before.
        let is_flown = flying && !self.motion.unable_to_abort();
        let present = self.safety.look(&self.observation, cx.now, is_flown);
        let is_new = before != present.map(key);
        if is_new {
            self.is_changed = true;
            cx.out.notice(&Notice::Safety { violation: present });
        }
        self.react_to_lost_link(flying, cx);
        let Some(violation) = present else { return };
        match violation.action {
            SafetyAction::Warn | SafetyAction::Refuse => {}
            SafetyAction::Hold => self.end_for_safety(violation, cx),
            SafetyAction::Land => {
                self.end_for_safety(violation, cx);
                if is_new {
                    self.land_for_safety(flying, cx);
                }
            }
        }
    }

    /// Ends a path because of a rule; the pilot's switch also ends take-off and landing. The module stays started.
    fn end_for_safety<O: Outputs>(&mut self, violation: Violation, cx: &mut Context<'_, O>) {
        self.break_path(violation.reason(), cx);
        let leg = match self.motion {
            Motion::Following(_) => self.movement.waypoints_reached as usize + 1,
            Motion::TakingOff(_) | Motion::Landing(_)
                if violation.rule == SafetyRule::PilotSwitch =>
            {
                0
            }
            _ => return,
        };
        let refusal = self.safety.intervene(violation, leg);
        let verdict = Verdict::aborted(refusal.reason).about(refusal.detail);
        self.give_up_movement(&verdict, Rest::Ready, cx);
    }

    /// Lands because of a rule, if nothing else is under way.
    fn land_for_safety<O: Outputs>(&mut self, flying: bool, cx: &mut Context<'_, O>) {
        let then = match self.motion {
            Motion::Idle(rest) => rest,
            Motion::Holding { .. } => Rest::Ready,
            _ => return,
        };
        if flying && cx.link.is_up() {
            self.safety.count_intervention();
            let requester = None;
            self.order_landing(Order { requester, then }, cx);
        }
    }

    /// The link was lost on a path and is back: what the configuration says. The start-up has emptied the DSP's path buffer, so
    /// the helicopter hovers.
    fn react_to_lost_link<O: Outputs>(&mut self, flying: bool, cx: &mut Context<'_, O>) {
        if !cx.link.is_up() {
            return;
        }
        let Some(lost) = self.safety.path_lost.take() else {
            return;
        };
        let violation = Violation {
            rule: SafetyRule::LinkLoss,
            action: action_of(self.safety.config.link_loss),
            amount: cx.now.since(lost).as_secs_f64(),
        };
        cx.out.notice(&Notice::Safety {
            violation: Some(violation),
        });
        if violation.action == SafetyAction::Land {
            self.land_for_safety(flying, cx);
        }
    }

    /// The geofence changed: what is left of the path under way is checked against it.
    pub(super) fn check_path_under_way<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        let (Motion::Following(_), Some(position)) =
            (self.motion, self.observation.position(cx.now))
        else {
            return;
        };
        let mut from = here(&position);
        let reached = self.movement.waypoints_reached as usize;
        let breach = self
            .route
            .ahead()
            .iter()
            .enumerate()
            .find_map(|(index, to)| {
                let breach = self.safety.fence.check_leg(&from, to);
                from = *to;
                breach.map(|breach| (reached + index + 1, breach))
            });
        if let Some((leg, breach)) = breach {
            let refusal = self.safety.intervene(refuse(breach), leg);
            let verdict = Verdict::aborted(refusal.reason).about(refusal.detail);
            self.give_up_movement(&verdict, Rest::Ready, cx);
        }
    }
}

/// By what a violation is known from one sample to the next: amounts change all the time.
fn key(violation: Violation) -> (SafetyRule, SafetyAction) {
    (violation.rule, violation.action)
}
