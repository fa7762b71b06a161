//! [`StateSchedule`]: when a module publishes its state. A pure value: it is given the time.

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::module::State;

use crate::manager::Manager;

/// How often the state is published though it has not changed: consumers see by it that the module works.
pub const STATE_PERIOD: Duration = Duration::from_secs(1);

/// When a module publishes its state: at once when it changes, and once a [`STATE_PERIOD`].
#[derive(Clone, Copy, Debug)]
pub struct StateSchedule {
    next: MonotonicNs,
}

impl StateSchedule {
    /// The first state is due `now`.
    pub fn new(now: MonotonicNs) -> StateSchedule {
        StateSchedule { next: now }
    }

    /// When the state is due though nothing changes.
    pub fn next(&self) -> MonotonicNs {
        self.next
    }

    /// The state of the module with the number `id` if it is due, which is to be published now. A change is logged.
    pub fn due(&mut self, manager: &mut Manager, id: u32, now: MonotonicNs) -> Option<State> {
        let is_changed = manager.take_changed();
        if !is_changed && now < self.next {
            return None;
        }
        self.next = now + STATE_PERIOD;
        let state = State {
            published_ns: now.0,
            ..manager.state(id)
        };
        if is_changed {
            let status = manager.standing().status();
            let doing = state.doing().unwrap_or_default();
            tracing::info!(%status, error = state.error, doing, "state");
        }
        Some(state)
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::code::ControlCommand;

    use super::*;

    #[test]
    fn a_state_is_due_at_once_when_it_changes_and_each_second() {
        let at = |ms: u64| MonotonicNs(ms * 1_000_000);
        let (mut manager, mut schedule) = (Manager::new(at(0)), StateSchedule::new(at(0)));
        let mut due = |manager: &mut Manager, ms| schedule.due(manager, 1001, at(ms)).is_some();
        assert!(due(&mut manager, 0), "the first");
        assert!(!due(&mut manager, 999));
        assert!(due(&mut manager, 1000), "a period later");
        manager.control(at(1100), ControlCommand::Start).unwrap();
        assert!(due(&mut manager, 1100), "a change");
        assert!(!due(&mut manager, 2000), "the period began anew");
        assert!(due(&mut manager, 2100));
    }
}
