//! Whether the DSP is there, and what is done when it is not, or is not the one it was.

use std::time::Duration;

use dsp_protocol::{Command, port};
use ipc_types::MonotonicNs;
use ipc_types::code::LinkState;

use super::{Line, LineEvent, Purpose, increment, startup};

/// So many status periods may pass without a status before the DSP is told to send it: noise destroys some of them.
const STATUS_PERIODS: u32 = 4;

impl Line {
    /// Any valid message shows that the DSP is there.
    pub(super) fn heard_something(&mut self, now: MonotonicNs) {
        if self.state == LinkState::Silent {
            self.enter(LinkState::Up, now);
            self.expect_status(now);
        }
        if self.state == LinkState::Up {
            self.silence_deadline = Some(now + self.config.link.silent_after());
        }
    }

    /// The next status must come within a time.
    pub(super) fn expect_status(&mut self, now: MonotonicNs) {
        if self.state == LinkState::Up {
            self.status_deadline = Some(now + self.status_patience());
        }
    }

    /// The DSP says other things, but no status: it is told again to send it, which disturbs nothing else.
    pub(super) fn wake_status(&mut self, now: MonotonicNs) {
        if !self.delivery.has(|purpose| *purpose == Purpose::WakeStatus) {
            // A queue that is full now has room when the next status is overdue.
            let _ = self
                .delivery
                .push(Command::ActivateStatus, Purpose::WakeStatus);
        }
        self.expect_status(now);
    }

    /// Twice the time after which the link is silent, so that a DSP that says nothing at all is probed first; longer
    /// when the configured status period is.
    fn status_patience(&self) -> Duration {
        let period_ms = self
            .config
            .parameters
            .writes()
            .find_map(|write| match write {
                Command::Write16 {
                    port: port::STATUS_PERIOD_MS,
                    value,
                } => Some(u64::from(value)),
                _ => None,
            });
        let period = Duration::from_millis(period_ms.unwrap_or_default());
        (2 * self.config.link.silent_after()).max(STATUS_PERIODS * period)
    }

    pub(super) fn rebooted(&mut self, now: MonotonicNs) {
        increment(&mut self.health.dsp_boots);
        self.events.push_back(LineEvent::Rebooted);
        self.begin_start_up(now);
    }

    pub(super) fn begin_start_up(&mut self, now: MonotonicNs) {
        self.abandon();
        self.start_up_retry = None;
        if self.state != LinkState::Connecting {
            self.enter(LinkState::Connecting, now);
        }
        let mut commands =
            startup::sequence(self.config.status.mask(), &self.config.parameters).peekable();
        while let Some(command) = commands.next() {
            let last = commands.peek().is_none();
            // The queue is empty, and its length is derived from the longest start-up.
            let queued = self.delivery.push(command, Purpose::StartUp { last });
            debug_assert_eq!(queued, Ok(()));
        }
    }

    /// Gives up every command and all bytes that have not left.
    pub(super) fn abandon(&mut self) {
        self.delivery.forget(|_| true);
        self.silence_deadline = None;
        self.status_deadline = None;
        self.discard_waiting_bytes();
    }

    /// A command that was given up must not reach the DSP later, when nobody expects it any more.
    pub(super) fn discard_waiting_bytes(&mut self) {
        self.outgoing.clear();
        self.discard_unsent = true;
    }

    pub(super) fn silence(&mut self, now: MonotonicNs) {
        self.enter(LinkState::Silent, now);
        self.silence_deadline = None;
        self.status_deadline = None;
        if !self.delivery.has(|purpose| *purpose == Purpose::Probe) {
            let probe = Command::Read16 {
                port: port::STATUS_MASK,
            };
            // A queue full of unanswered commands is itself a probe: its failure ends the silence.
            let _ = self.delivery.push(probe, Purpose::Probe);
        }
    }

    pub(super) fn enter(&mut self, state: LinkState, now: MonotonicNs) {
        self.state = state;
        self.health.state_since_ns = now.0;
    }
}
