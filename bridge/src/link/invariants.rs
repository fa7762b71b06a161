//! What must hold between the parts of a link after each input. Debug builds check it, so every virtual mission
//! judges it.

use super::session::{DspPath, DspSession};
use super::{Link, LinkTimer, Purpose, State};

impl Link {
    /// # Panics
    /// When two parts of the link contradict each other, which is a defect.
    pub(crate) fn assert_sound(&self) {
        let is_armed = |timer| self.timers.is_armed(timer);
        let state = &self.state;
        let waits = |purpose| self.commands.has(|one| *one == purpose);
        // What the DSP does not take: every end of a command comes back to it.
        let is_full = self.commands.is_full();
        match state {
            State::Gone => {
                debug_assert!(self.timers.next().is_none());
                debug_assert!(self.outgoing.as_bytes().is_empty());
                debug_assert!(self.commands.deadline().is_none());
            }
            State::Connecting(start_up) => {
                debug_assert!(waits(Purpose::StartUp(start_up.step)), "{start_up:?}");
                debug_assert!(!is_armed(LinkTimer::Silence) && !is_armed(LinkTimer::KeepAlive));
            }
            State::Up(DspSession { path, .. }) => {
                debug_assert!(is_armed(LinkTimer::Silence));
                let is_emptied = waits(Purpose::EmptyPath) || is_armed(LinkTimer::EmptyPath);
                debug_assert!(is_emptied || is_full || *path != DspPath::Unknown);
                debug_assert!(!self.cannot_empty_path || *path == DspPath::Unknown);
            }
            State::Silent(_) => {
                debug_assert!(waits(Purpose::Probe) || is_full);
                debug_assert!(!is_armed(LinkTimer::Status) && !is_armed(LinkTimer::KeepAlive));
            }
        }
        let awaits_ack = self.commands.deadline().is_some();
        debug_assert!(!awaits_ack || is_armed(LinkTimer::Command));
        self.commands.assert_sound();
    }
}
