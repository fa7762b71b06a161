//! [`Manager`]: starts and stops a module, and says how it is; [`StateSchedule`]: when that is published. Pure values:
//! they are given the time.

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{ControlCommand, ImiCode};
use ipc_types::module::{DOING_LEN, State, doing_bytes};

use crate::rules::{OnStop, Refused, Rest, Standing};

/// Starts and stops one module by the [rules](crate::rules), and has the state that is published.
///
/// ```
/// use ipc_types::MonotonicNs;
/// use ipc_types::code::{ControlCommand, ModuleStatus};
/// use module_kit::rules::Refused;
/// use module_kit::{Manager, OnStop};
///
/// let now = MonotonicNs(1);
/// let mut manager = Manager::new(now);
/// assert!(!manager.begin(now, 1, "landing", OnStop::Refused), "it was not started");
///
/// manager.control(now, ControlCommand::Start).unwrap();
/// assert!(manager.begin(now, 1, "landing", OnStop::Refused));
/// let refused = manager.control(now, ControlCommand::Stop);
/// assert_eq!(refused, Err(Refused::UnableToAbort));
///
/// manager.done(now);
/// assert_eq!(manager.state(1001).status(), Some(ModuleStatus::Ended));
/// ```
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Manager {
    standing: Standing<ImiCode>,
    /// The error of the last control request that was refused, until the standing changes or one is accepted.
    refusal: ImiCode,
    functionality: u32,
    #[serde(with = "doing")]
    doing: [u8; DOING_LEN],
    since: MonotonicNs,
    is_changed: bool,
}

impl Manager {
    /// A module that waits for its start.
    pub fn new(now: MonotonicNs) -> Manager {
        Manager {
            standing: Standing::Resting(Rest::Waiting(ImiCode(0))),
            refusal: ImiCode(0),
            functionality: 0,
            doing: [0; DOING_LEN],
            since: now,
            is_changed: true,
        }
    }

    /// Whether the module may work: it was started, and neither a stop nor an error has ended that.
    pub fn is_started(&self) -> bool {
        !self.standing.is_blocked()
    }

    /// Whether the module may work, and has not since its last start.
    pub fn is_ready(&self) -> bool {
        self.standing == Standing::Resting(Rest::Ready)
    }

    /// Whether work is under way.
    pub fn is_working(&self) -> bool {
        matches!(self.standing, Standing::Working(_))
    }

    /// Since when it is as it is.
    pub fn since(&self) -> MonotonicNs {
        self.since
    }

    /// How the module is.
    pub fn standing(&self) -> Standing<ImiCode> {
        self.standing
    }

    /// Carries out a start or a stop.
    ///
    /// # Errors
    /// Why it is refused. The state shows the error of a refusal until something is accepted.
    pub fn control(&mut self, now: MonotonicNs, command: ControlCommand) -> Result<(), Refused> {
        let rest = match command {
            ControlCommand::Start => self.standing.start(),
            ControlCommand::Stop => self.standing.stop(),
            ControlCommand::ReloadFence
            | ControlCommand::TakeControl
            | ControlCommand::ReleaseControl
            | ControlCommand::PassControl => Err(Refused::UnknownCommand),
        };
        match rest {
            Ok(rest) => self.rest(now, rest),
            Err(refused) => {
                self.refusal = refused.error().into();
                self.is_changed |= !self.refusal.is_none();
                return Err(refused);
            }
        }
        Ok(())
    }

    /// Begins work, or goes on to another: `functionality` is the module's own number of what it does, and `doing` the
    /// same in ASCII. False, and nothing happens, when the module was not started.
    pub fn begin(
        &mut self,
        now: MonotonicNs,
        functionality: u32,
        doing: &str,
        on_stop: OnStop,
    ) -> bool {
        let is_started = self.is_started();
        if is_started {
            let doing = doing_bytes(doing);
            self.change(now, Standing::Working(on_stop), functionality, doing);
        }
        is_started
    }

    /// The work ended as it should. Without work, nothing happens.
    pub fn done(&mut self, now: MonotonicNs) {
        if self.is_working() {
            self.rest(now, Rest::Done);
        }
    }

    /// The work ended early, with an error of the module's own. The module is blocked until the next start. Without
    /// work it is noted, as the [rules](crate::rules) say.
    pub fn fail(&mut self, now: MonotonicNs, error: u32) {
        let error = ImiCode(error);
        match self.standing {
            Standing::Resting(rest) => self.rest(now, rest.with_fatal(error)),
            Standing::Working(_) | Standing::Stopping { .. } => {
                self.rest(now, Rest::Aborted(error));
            }
        }
    }

    fn rest(&mut self, now: MonotonicNs, rest: Rest<ImiCode>) {
        self.change(now, Standing::Resting(rest), 0, [0; DOING_LEN]);
    }

    fn change(
        &mut self,
        now: MonotonicNs,
        standing: Standing<ImiCode>,
        functionality: u32,
        doing: [u8; DOING_LEN],
    ) {
        let is_same =
            standing == self.standing && functionality == self.functionality && doing == self.doing;
        if !is_same {
            self.since = now;
        }
        self.is_changed |= !is_same || !self.refusal.is_none();
        self.refusal = ImiCode(0);
        self.standing = standing;
        self.functionality = functionality;
        self.doing = doing;
    }

    /// The state of the module with this id, but for the publisher's fields.
    pub fn state(&self, module_id: u32) -> State {
        let error = match self.refusal.is_none() {
            true => self.standing.error(),
            false => self.refusal,
        };
        State {
            since_ns: self.since.0,
            module_id,
            status: self.standing.status().code(),
            error: error.0,
            blocked: self.standing.is_blocked().into(),
            functionality: self.functionality,
            unable_to_abort: self.standing.unable_to_abort().into(),
            doing: self.doing,
            ..State::default()
        }
    }

    /// Whether the state has changed since the last call.
    pub fn take_changed(&mut self) -> bool {
        std::mem::take(&mut self.is_changed)
    }
}

/// What the module does, as a value of serde: arrays of more than 32 bytes are none.
mod doing {
    use serde::{Deserialize, Deserializer, Serializer};

    use super::DOING_LEN;

    pub fn serialize<S: Serializer>(doing: &[u8; DOING_LEN], to: S) -> Result<S::Ok, S::Error> {
        to.serialize_bytes(doing)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<[u8; DOING_LEN], D::Error> {
        let bytes = Vec::<u8>::deserialize(from)?;
        let length = bytes.len();
        let wrong = |_| serde::de::Error::invalid_length(length, &"the bytes of `doing`");
        bytes.try_into().map_err(wrong)
    }
}

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
    use super::*;
    use ControlCommand::{ReloadFence, Start, Stop};
    use ipc_types::code::ModuleStatus;

    const NOW: MonotonicNs = MonotonicNs(7);

    fn started() -> Manager {
        let mut manager = Manager::new(MonotonicNs(1));
        manager.control(NOW, Start).unwrap();
        manager
    }

    #[test]
    fn a_refusal_is_shown_until_something_is_accepted() {
        let mut manager = started();
        assert!(manager.take_changed());
        assert_eq!(manager.control(NOW, Start), Err(Refused::Running));
        assert!(manager.take_changed());
        let state = manager.state(1000);
        assert_eq!((state.error, state.status), (1, 2));
        manager.control(NOW, Stop).unwrap();
        assert_eq!(manager.state(1000).error, 0);
    }

    #[test]
    fn work_is_only_begun_after_a_start_and_ends_once() {
        let mut manager = Manager::new(NOW);
        assert!(!manager.begin(NOW, 1, "work", OnStop::Aborts));
        manager.control(NOW, Start).unwrap();
        assert!(manager.begin(MonotonicNs(8), 1, "work", OnStop::Aborts));
        let state = manager.state(1000);
        assert_eq!((state.functionality, state.doing()), (1, Some("work")));
        assert_eq!((state.since_ns, state.blocked), (8, 0));
        manager.done(MonotonicNs(9));
        manager.done(MonotonicNs(10));
        let state = manager.state(1000);
        assert_eq!(state.status(), Some(ModuleStatus::Ended));
        assert_eq!((state.since_ns, state.functionality), (9, 0));
        assert!(manager.is_started(), "more work may come");
    }

    #[test]
    fn an_error_ends_work_and_blocks() {
        let mut manager = started();
        assert!(manager.begin(NOW, 1, "work", OnStop::Refused));
        manager.fail(NOW, 1001);
        assert_eq!(manager.state(1000).status(), Some(ModuleStatus::Aborted));
        assert_eq!(manager.state(1000).error, 1001);
        assert!(!manager.begin(NOW, 1, "work", OnStop::Refused));
        manager.control(NOW, Start).unwrap();
        assert_eq!(manager.state(1000).error, 0);
    }

    #[test]
    fn the_same_again_is_no_change_and_each_difference_is_one() {
        let later = MonotonicNs(99);
        for (functionality, doing, on_stop, is_changed) in [
            (1, "work", OnStop::Aborts, false),
            (2, "work", OnStop::Aborts, true),
            (1, "more", OnStop::Aborts, true),
            (1, "work", OnStop::Ends, true),
        ] {
            let mut manager = started();
            assert!(manager.is_ready() && !manager.is_working());
            manager.begin(NOW, 1, "work", OnStop::Aborts);
            assert!(manager.is_working() && !manager.is_ready());
            manager.take_changed();
            manager.begin(later, functionality, doing, on_stop);
            assert_eq!(manager.take_changed(), is_changed);
            let since = if is_changed { later } else { NOW };
            assert_eq!(manager.state(1000).since_ns, since.0);
        }
        // That a refusal is over is a change, too.
        let mut manager = started();
        manager.begin(NOW, 1, "work", OnStop::Aborts);
        let _ = manager.control(NOW, Start);
        manager.take_changed();
        manager.begin(later, 1, "work", OnStop::Aborts);
        assert!(manager.take_changed());
        assert_eq!(manager.state(1000).since_ns, NOW.0);
    }

    #[test]
    fn what_only_the_bridge_can_do_is_refused_and_changes_nothing() {
        let mut manager = started();
        manager.take_changed();
        let refused = manager.control(NOW, ReloadFence);
        assert_eq!(refused, Err(Refused::UnknownCommand));
        assert!(!manager.take_changed());
    }

    #[test]
    fn a_fatal_error_without_work_is_noted() {
        let mut manager = Manager::new(NOW);
        manager.fail(NOW, 1001);
        let state = manager.state(1000);
        let waiting = Some(ModuleStatus::WaitingDataToStart);
        assert_eq!((state.status(), state.error), (waiting, 1001));
    }

    #[test]
    fn a_state_is_due_at_once_when_it_changes_and_each_second() {
        let at = |ms: u64| MonotonicNs(ms * 1_000_000);
        let (mut manager, mut schedule) = (Manager::new(at(0)), StateSchedule::new(at(0)));
        let mut due = |manager: &mut Manager, ms| schedule.due(manager, 1001, at(ms)).is_some();
        assert!(due(&mut manager, 0), "the first");
        assert!(!due(&mut manager, 999));
        assert!(due(&mut manager, 1000), "a period later");
        manager.control(at(1100), Start).unwrap();
        assert!(due(&mut manager, 1100), "a change");
        assert!(!due(&mut manager, 2000), "the period began anew");
        assert!(due(&mut manager, 2100));
    }
}
