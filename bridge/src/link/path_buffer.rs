//! What the link does about the DSP's path buffer: it is emptied until it is known to be empty, and kept while the PC is there.

use dsp_protocol::Command;
use ipc_types::MonotonicNs;

use super::dsp_path::DspPath;
use super::session::Session;
use super::start_up::READ_PC_TIMEOUT;
use super::{Link, LinkEvent, LinkTimer, Purpose, State};

/// The keep-alive goes out so many times within the DSP's time-out for the PC.
const KEEP_ALIVES: u32 = 3;

impl Link {
    /// What the DSP's path buffer holds is not known any more, or belongs to a movement that has ended. It is emptied, as often
    /// as it takes.
    pub fn forget_path(&mut self) {
        if let State::Up(session) | State::Silent(session) = &mut self.state {
            session.path = DspPath::Unknown;
            self.is_changed = true;
            self.empty_path();
        }
    }

    /// Sends *invalidate path* while the DSP's buffer is not known to be empty. In silence the probe decides first whether the
    /// DSP is there; the start-up would empty the buffer as well.
    pub(super) fn empty_path(&mut self) {
        let is_unknown =
            matches!(self.state, State::Up(session) if session.path == DspPath::Unknown);
        if !is_unknown
            || self.timers.is_armed(LinkTimer::EmptyPath)
            || self.commands.has(|purpose| *purpose == Purpose::EmptyPath)
        {
            return;
        }
        // A full queue drains or fails within seconds; every acknowledgement and failure comes back here.
        let _ = self
            .commands
            .push(Command::InvalidatePath, Purpose::EmptyPath);
    }

    /// *Invalidate path* was acknowledged. When that may be a late acknowledgement of an earlier one, it proves nothing, and
    /// the buffer is emptied once more when no late one can come any more.
    pub(super) fn path_emptied(&mut self, is_certain: bool) {
        let State::Up(session) = &mut self.state else {
            return;
        };
        if session.path != DspPath::Unknown {
            return;
        }
        if !is_certain {
            let late_until = self.commands.late_until(Command::InvalidatePath);
            return self.timers.arm(LinkTimer::EmptyPath, late_until);
        }
        session.path = DspPath::Empty;
        self.cannot_empty_path = false;
        self.is_changed = true;
        self.timers.stop(LinkTimer::KeepAlive);
        self.events.push_back(LinkEvent::PathEmptied);
    }

    /// Three attempts failed. The DSP says other things, or the link would be silent: the next attempts follow at once.
    pub(super) fn path_not_emptied(&mut self) {
        self.cannot_empty_path = true;
        self.events.push_back(LinkEvent::PathNotEmptied);
        self.empty_path();
    }

    /// While the path buffer may hold something, the DSP must see that the PC is there.
    pub(super) fn schedule_keep_alive(&mut self, now: MonotonicNs) {
        if let State::Up(Session {
            has_pc_timeout: true,
            ..
        }) = self.state
        {
            let period = self.config.link.pc_timeout() / KEEP_ALIVES;
            self.timers.arm(LinkTimer::KeepAlive, now + period);
        }
    }

    /// Whether the path is not under way any more: the DSP may have taken the PC for gone and emptied its path buffer by itself,
    /// or the bridge stood still for that long, after which no path goes on by itself, whichever DSP it is.
    pub(super) fn may_have_dropped_path(&self, now: MonotonicNs) -> bool {
        let (State::Up(session) | State::Silent(session)) = &self.state else {
            return false;
        };
        let pc_timeout = self.config.link.pc_timeout();
        // There is an input at least for each state that is published.
        let standstill = pc_timeout.max(2 * self.config.state.period());
        session.path == DspPath::Ours
            && !pc_timeout.is_zero()
            && (session.may_have_dropped_path(now, pc_timeout)
                || now.since(self.grants.last_input()) >= standstill)
    }

    /// First of every input, before a flow control that waited is answered.
    pub fn begin_input(&mut self, now: MonotonicNs) {
        if self.may_have_dropped_path(now) {
            // Waypoints may be among them.
            self.discard_waiting_bytes();
            self.forget_path();
            self.events.push_back(LinkEvent::PathDropped);
        }
        self.grants.begin_input(now);
    }

    /// All bytes that the line had were taken: the newest flow control may count.
    pub fn end_read(&mut self, now: MonotonicNs) {
        if self.grants.end_read(now) {
            self.events.push_back(LinkEvent::Grant);
        }
    }

    /// The time for a sign of life has come.
    pub(super) fn keep_alive(&mut self, now: MonotonicNs) {
        let State::Up(session) = self.state else {
            return;
        };
        if session.path == DspPath::Empty {
            return;
        }
        self.schedule_keep_alive(now);
        if !self.commands.has(|purpose| *purpose == Purpose::KeepAlive) {
            // A queue that is full shows the DSP that the PC is there.
            let _ = self.commands.push(READ_PC_TIMEOUT, Purpose::KeepAlive);
        }
    }
}
