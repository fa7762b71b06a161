//! What is noted when the bridge's state changes.

use ipc_types::MonotonicNs;
use ipc_types::payload::ModuleState;

use super::{DspError, MAX_REACHED, Robot};
use crate::changes::Weight;
use crate::{changes, pilot};

impl Robot {
    /// Notes what changed from one state of the bridge to the next.
    pub(super) fn compare(&mut self, before: &ModuleState, state: &ModuleState, now: MonotonicNs) {
        for (weight, text) in changes::of_states(before, state) {
            self.journal.add(now, weight, text);
        }
        self.follow_movement(before, state);
        self.note_activity(Some(before), state, now);
        let is_same_bridge = before.epoch_ns == state.epoch_ns;
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

    /// Keeps the places of the waypoints that were reached.
    fn follow_movement(&mut self, before: &ModuleState, state: &ModuleState) {
        if changes::is_another_movement(before, state) {
            self.reached.clear();
        } else if before.movement.waypoints_reached < state.movement.waypoints_reached
            && let Some(place) = self.pilot.place
            && self.reached.len() < MAX_REACHED
        {
            self.reached.push(place);
        }
    }
}
