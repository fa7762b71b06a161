//! What is noted when the bridge's state changes.

use ipc_types::MonotonicNs;
use ipc_types::code::{LinkState, MovementKind, PilotSwitch};
use ipc_types::payload::ModuleState;

use super::super::journal::Weight;
use super::{DspError, MAX_REACHED, Robot};
use crate::pilot;

impl Robot {
    /// Notes what changed from one state of the bridge to the next.
    pub(super) fn compare(&mut self, before: &ModuleState, state: &ModuleState, now: MonotonicNs) {
        let is_same_bridge = before.epoch_ns == state.epoch_ns;
        if !is_same_bridge {
            self.journal
                .add(now, Weight::Note, "the bridge was started again");
        }
        self.note_movement(before, state, now);
        self.note_activity(Some(before), state, now);
        if before.link.state() != state.link.state() && state.link.state() == Some(LinkState::Up) {
            self.journal.add(now, Weight::Note, "link to the DSP up");
        }
        if is_same_bridge
            && before.link.dsp_boots != 0
            && before.link.dsp_boots < state.link.dsp_boots
        {
            self.journal.add(now, Weight::Warning, "the DSP rebooted");
        }
        let switch = state.safety.pilot_switch();
        if before.safety.pilot_switch() != switch
            && let Some(switch @ (PilotSwitch::Manual | PilotSwitch::Auto)) = switch
        {
            let text = format!("pilot's switch on {switch}");
            self.journal.add(now, Weight::Note, text);
        }
        if is_same_bridge && before.safety.interventions < state.safety.interventions {
            let text = "a safety rule refused or ended a movement";
            self.journal.add(now, Weight::Warning, text);
        }
        let errors = &state.dsp_errors;
        if is_same_bridge && before.dsp_errors.total < errors.total {
            self.dsp_error = Some(DspError {
                code: errors.last_code,
                is_fatal: before.dsp_errors.escalated < errors.escalated,
                at: now,
            });
        }
    }

    pub(super) fn note_activity(
        &mut self,
        before: Option<&ModuleState>,
        state: &ModuleState,
        now: MonotonicNs,
    ) {
        let flying = self.pilot.flying;
        let of = |state: &ModuleState| {
            let functionality = state.functionality()?;
            Some(pilot::activity(functionality, flying))
        };
        if before.and_then(of) != of(state)
            && let Some(activity) = of(state)
        {
            self.journal.add(now, Weight::Note, activity);
        }
    }

    fn note_movement(&mut self, before: &ModuleState, state: &ModuleState, now: MonotonicNs) {
        let (was, movement) = (&before.movement, &state.movement);
        if was.request_id != movement.request_id || was.path_id != movement.path_id {
            self.reached.clear();
            let order = match movement.kind() {
                Some(MovementKind::GoToWaypoint) => {
                    format!("order: path of {} waypoints", movement.waypoints_total)
                }
                Some(kind) => format!("order: {kind}"),
                None => return,
            };
            self.journal.add(now, Weight::Order, order);
        } else if was.waypoints_reached < movement.waypoints_reached {
            let (reached, total) = (movement.waypoints_reached, movement.waypoints_total);
            let text = format!("waypoint {reached} of {total} reached");
            self.journal.add(now, Weight::Note, text);
            if let Some(place) = self.pilot.place
                && self.reached.len() < MAX_REACHED
            {
                self.reached.push(place);
            }
        }
    }
}
