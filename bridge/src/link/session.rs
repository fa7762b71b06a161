//! [`Session`]: what is known of a DSP that was started up, above all what its path buffer may hold.

use std::time::Duration;

use dsp_protocol::{Command, StatusMask};
use ipc_types::MonotonicNs;

use super::dsp_path::DspPath;
use super::start_up::{READ_PC_TIMEOUT, StartUp};
use super::{Link, LinkEvent, LinkTimer, Purpose, State};

/// The keep-alive goes out so many times within the DSP's time-out for the PC.
const KEEP_ALIVES: u32 = 3;

/// Sensors that come and go make a few masks; the oldest is asked for anew.
const ACCEPTED_MASKS: usize = 4;

/// What is known of a DSP that was started up.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Session {
    /// What its path buffer may hold.
    pub path: DspPath,
    /// It empties its path buffer by itself when the PC is gone.
    pub has_pc_timeout: bool,
    /// When the last message was sent that the DSP is known to have got.
    pub heard: MonotonicNs,
    /// Probes in a row that were answered without any other message.
    pub probe_only_replies: u32,
    /// A mask that is not ours, in the last status and how often in a row, and when that came.
    pub odd_mask: Option<(StatusMask, u32)>,
    pub odd_mask_at: MonotonicNs,
    /// Masks that are not ours but are taken, because the DSP says that it has ours; the newest first.
    pub accepted_masks: [Option<StatusMask>; ACCEPTED_MASKS],
}

impl Session {
    /// A DSP that has just been started up.
    pub fn begin(now: MonotonicNs, start_up: StartUp) -> Session {
        Session {
            heard: now,
            path: if start_up.is_path_empty {
                DspPath::Empty
            } else {
                DspPath::Unknown
            },
            has_pc_timeout: start_up.has_pc_timeout,
            ..Session::default()
        }
    }

    /// Whether the DSP may have taken the PC for gone when it got nothing of it for this time.
    pub fn would_have_dropped_path(&self, silence: Duration, pc_timeout: Duration) -> bool {
        self.has_pc_timeout && self.path == DspPath::Ours && silence >= pc_timeout
    }

    /// Takes status with these groups from now on.
    pub fn accept(&mut self, groups: StatusMask) {
        self.accepted_masks.rotate_right(1);
        self.accepted_masks[0] = Some(groups);
        self.odd_mask = None;
    }
}

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

    /// The time for a sign of life has come. When the DSP has acknowledged nothing for as long as it waits for the PC, it may have
    /// emptied its path buffer by itself.
    pub(super) fn keep_alive(&mut self, now: MonotonicNs) {
        let State::Up(session) = self.state else {
            return;
        };
        if session.path == DspPath::Empty {
            return;
        }
        let silence = now.since(session.heard);
        if session.would_have_dropped_path(silence, self.config.link.pc_timeout()) {
            self.events.push_back(LinkEvent::PathDropped);
        }
        self.schedule_keep_alive(now);
        if !self.commands.has(|purpose| *purpose == Purpose::KeepAlive) {
            // A queue that is full shows the DSP that the PC is there.
            let _ = self.commands.push(READ_PC_TIMEOUT, Purpose::KeepAlive);
        }
    }
}
