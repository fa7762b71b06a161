//! Whether the DSP is there, and what is done when it is not, or is not the one it was.

use std::time::Duration;

use dsp_protocol::{Command, Group, Status, port};
use ipc_types::MonotonicNs;
use ipc_types::code::LinkState;

use super::delivery::AckData;
use super::{Line, LineEvent, Purpose, Sample, increment, startup};

/// So many status periods may pass without a status before the DSP is told to send it: noise destroys some of them.
const STATUS_PERIODS: u32 = 4;

const READ_MASK: Command = Command::Read16 {
    port: port::STATUS_MASK,
};

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

    /// A status in our mask shows that the DSP sends what it was asked for. It may leave groups out that it does not have,
    /// but never its time.
    pub(super) fn heard_status(&mut self, now: MonotonicNs, status: &Status) {
        let ours = self.config.status.mask();
        let has_others = status.mask().0 & !ours.0 != 0;
        let has_time = status.time_ms.is_some() || !ours.contains(Group::Time);
        if has_time && !has_others {
            self.expect_status(now);
        }
    }

    /// Without the DSP's time the line's order has to do. But where the time was asked for, a status without it was made
    /// for another mask or damaged, and could overtake one that is held back.
    pub(super) fn untimed(&mut self, sample: Sample) {
        if self.config.status.mask().contains(Group::Time) {
            increment(&mut self.health.telemetry_incoherent);
        } else {
            self.events.push_back(LineEvent::Sample(sample));
        }
    }

    /// The next status must come within a time.
    pub(super) fn expect_status(&mut self, now: MonotonicNs) {
        if self.state == LinkState::Up {
            self.status_deadline = Some(now + self.status_patience());
        }
    }

    /// The DSP says other things, but no status, or none with our groups. Its mask tells whether it has rebooted, or has
    /// only stopped to send.
    pub(super) fn status_overdue(&mut self, now: MonotonicNs) {
        self.ask_for_status(READ_MASK, Purpose::StatusProbe);
        self.expect_status(now);
    }

    /// The DSP has our mask: it is told again to send status, which disturbs nothing else.
    pub(super) fn wake_status(&mut self) {
        self.ask_for_status(Command::ActivateStatus, Purpose::WakeStatus);
    }

    /// A queue that is full now has room when the next status is overdue.
    fn ask_for_status(&mut self, command: Command, purpose: Purpose) {
        if !self.delivery.has(|other| *other == purpose) {
            let _ = self.delivery.push(command, purpose);
        }
    }

    /// Whether a read of the mask gave the one that was written.
    pub(super) fn is_our_mask(&self, data: AckData) -> bool {
        data == AckData::Bits16(self.config.status.mask().0)
    }

    /// The DSP has lost our mask, or says nothing but answers.
    pub(super) fn has_lost_its_mask(&mut self, now: MonotonicNs) {
        // Its clock has restarted as well; that must not be taken for a second reboot.
        self.coherence.reset();
        self.rebooted(now);
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
            // A queue full of unanswered commands is itself a probe: its failure ends the silence.
            let _ = self.delivery.push(READ_MASK, Purpose::Probe);
        }
    }

    pub(super) fn enter(&mut self, state: LinkState, now: MonotonicNs) {
        self.state = state;
        self.health.state_since_ns = now.0;
    }
}
