//! Whether the DSP is there, and what is done when it is not, or is not the one it was: probing and start-up. Its path
//! buffer is emptied until it is known to be empty, and what it holds is kept while the PC is there.

use std::time::Duration;

use dsp_protocol::Command;
use ipc_types::MonotonicNs;

use super::commands::AckData;
use super::session::{DspPath, DspSession, READ_MASK, READ_PC_TIMEOUT, StartUp, StartupStep};
use super::{Link, LinkEvent, LinkTimer, Purpose, State, increment};

/// The keep-alive goes out so many times within the DSP's time-out for the PC.
const KEEP_ALIVES: u32 = 3;

impl Link {
    /// Any valid message shows that the DSP is there.
    pub(super) fn message_arrived(&mut self, now: MonotonicNs) {
        self.messages.arrived(now);
        if let State::Silent(session) = self.state {
            self.enter(State::Up(session), now);
            self.expect_status(now);
            self.schedule_keep_alive(now);
            self.empty_path();
        }
        if self.is_up() {
            let fresh_for = self.messages.fresh_for(self.config.link.silent_after());
            self.timers.arm(LinkTimer::Silence, now + fresh_for);
        }
    }

    /// The DSP has lost our mask, or answers commands and sends nothing else.
    pub(super) fn lost_its_mask(&mut self, now: MonotonicNs) {
        // The DSP's clock has restarted as well; that must not be taken for a second reboot.
        self.coherence.reset();
        self.rebooted(now);
    }

    pub(super) fn rebooted(&mut self, now: MonotonicNs) {
        increment(&mut self.health.dsp_boots);
        self.events.push_back(LinkEvent::Rebooted);
        self.begin_start_up(now);
    }

    pub(super) fn begin_start_up(&mut self, now: MonotonicNs) {
        self.abandon();
        if matches!(self.state, State::Connecting(_)) {
            self.state = State::Connecting(StartUp::FIRST);
        } else {
            self.enter(State::Connecting(StartUp::FIRST), now);
        }
        self.queue_step(StartupStep::FIRST, None);
    }

    /// Asks for a step: repeated as usual, or sent `once` and waiting that long.
    fn queue_step(&mut self, step: StartupStep, once: Option<Duration>) {
        let command = step.command(&self.config, &self.parameters);
        let purpose = Purpose::StartUp(step);
        // The queue was emptied when the start-up began, and has one command of it at a time.
        let queued = match once {
            None => self.commands.push(command, purpose),
            Some(timeout) => self.commands.push_once(command, purpose, timeout),
        };
        debug_assert_eq!(queued, Ok(()));
    }

    /// A step of the start-up was acknowledged.
    pub(super) fn step_done(
        &mut self,
        now: MonotonicNs,
        step: StartupStep,
        data: AckData,
        is_certain: bool,
    ) {
        let State::Connecting(start_up) = &mut self.state else {
            return;
        };
        match step {
            StartupStep::ReadPcTimeout => {
                let announced = AckData::Bits16(self.config.link.pc_timeout_ms);
                start_up.has_pc_timeout = data == announced;
            }
            StartupStep::InvalidatePath => start_up.is_path_empty = is_certain,
            StartupStep::ReadParameter(index) => {
                let written = self.parameters.write(index);
                if is_certain && !is_value_of(written, data) {
                    let found = data;
                    self.events
                        .push_back(LinkEvent::ParameterRefused { written, found });
                }
            }
            _ => {}
        }
        match step.next(&self.config, &self.parameters) {
            Some(next) => {
                start_up.step = next;
                self.queue_step(next, None);
            }
            None => {
                let start_up = *start_up;
                self.started_up(now, start_up);
            }
        }
    }

    fn started_up(&mut self, now: MonotonicNs, start_up: StartUp) {
        self.failed_start_ups = 0;
        self.cannot_empty_path = false;
        self.enter(State::Up(DspSession::begin(now, start_up)), now);
        self.message_arrived(now);
        self.expect_status(now);
        self.events.push_back(LinkEvent::Ready);
        if !start_up.is_path_empty {
            self.path_emptied(false);
        }
    }

    /// The start-up begins again. Each of its first commands is sent once and waits longer than the one before, so a
    /// bridge without a DSP wakes about once a second.
    pub(super) fn start_up_failed(&mut self) {
        self.abandon();
        self.failed_start_ups = self.failed_start_ups.saturating_add(1);
        let step = match self.failed_start_ups.is_multiple_of(2) {
            true => StartupStep::FIRST,
            false => StartupStep::StopPath,
        };
        self.state = State::Connecting(StartUp {
            step,
            ..StartUp::FIRST
        });
        let timeout = self.config.link.start_up_timeout(self.failed_start_ups);
        self.queue_step(step, Some(timeout));
    }

    /// Gives up every command and all bytes that have not left.
    pub(super) fn abandon(&mut self) {
        self.commands.abandon();
        self.timers.stop_all();
        self.discard_waiting_bytes();
    }

    /// A command that was given up must not reach the DSP later, when nothing waits for it any more.
    pub(super) fn discard_waiting_bytes(&mut self) {
        self.outgoing.clear();
        self.discard_unsent = true;
    }

    pub(super) fn silence(&mut self, now: MonotonicNs) {
        let State::Up(session) = self.state else {
            return;
        };
        self.enter(State::Silent(session), now);
        self.timers.stop(LinkTimer::Status);
        self.timers.stop(LinkTimer::KeepAlive);
        if !self.commands.has(|purpose| *purpose == Purpose::Probe) {
            // A queue full of unanswered commands is itself a probe: its failure ends the silence.
            let _ = self.commands.push(READ_MASK, Purpose::Probe);
        }
    }

    /// What the DSP's path buffer holds is not known any more, or belongs to a movement that has ended. It is emptied,
    /// as often as it takes.
    pub fn forget_path(&mut self) {
        if let State::Up(session) | State::Silent(session) = &mut self.state {
            session.path = DspPath::Unknown;
            self.is_changed = true;
            self.empty_path();
        }
    }

    /// Sends *invalidate path* while the DSP's buffer is not known to be empty. In silence the probe decides first
    /// whether the DSP is there; the start-up would empty the buffer as well.
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

    /// *Invalidate path* was acknowledged. When that may be a late acknowledgement of an earlier one, it proves
    /// nothing, and the buffer is emptied once more when no late one can come any more.
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

    /// Three attempts failed. The DSP still sends other messages, else the link would be silent: the next attempts
    /// follow at once.
    pub(super) fn path_not_emptied(&mut self) {
        self.cannot_empty_path = true;
        self.events.push_back(LinkEvent::PathNotEmptied);
        self.empty_path();
    }

    /// While the path buffer may hold something, the DSP must see that the PC is there.
    pub(super) fn schedule_keep_alive(&mut self, now: MonotonicNs) {
        if let State::Up(DspSession {
            has_pc_timeout: true,
            ..
        }) = self.state
        {
            let period = self.config.link.pc_timeout() / KEEP_ALIVES;
            self.timers.arm(LinkTimer::KeepAlive, now + period);
        }
    }

    /// The machine was suspended for `slept`, which `now` counts. When the DSP may have taken the PC for gone, it may
    /// also have booted meanwhile: the link was lost, and the start-up begins.
    pub fn suspended(&mut self, now: MonotonicNs, slept: Duration) {
        let is_started = matches!(self.state, State::Up(_) | State::Silent(_));
        if is_started && slept >= self.standstill() {
            self.events.push_back(LinkEvent::Lost);
            self.begin_start_up(now);
        }
    }

    /// After so long a pause of the bridge no path goes on. Each published state brings at least one input.
    fn standstill(&self) -> Duration {
        (self.config.link.pc_timeout()).max(2 * self.config.state.period())
    }

    /// Whether the path is not under way any more: the DSP may have taken the PC for gone and emptied its path buffer
    /// by itself, or the bridge stood still for that long, after which no path goes on by itself, whichever DSP it is.
    pub(super) fn may_have_dropped_path(&self, now: MonotonicNs) -> bool {
        let (State::Up(session) | State::Silent(session)) = &self.state else {
            return false;
        };
        let pc_timeout = self.config.link.pc_timeout();
        session.path == DspPath::Ours
            && !pc_timeout.is_zero()
            && (session.may_have_dropped_path(now, pc_timeout)
                || now.since(self.grants.last_input()) >= self.standstill())
    }

    /// First of every input, before a flow control that waited is answered.
    pub fn begin_input(&mut self, now: MonotonicNs) {
        if self.may_have_dropped_path(now) {
            // Waypoints may be among the discarded bytes.
            self.discard_waiting_bytes();
            self.forget_path();
            self.events.push_back(LinkEvent::PathDropped);
        }
        self.grants.begin_input(now);
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

/// Whether `data` is the value that `written` wrote.
fn is_value_of(written: Command, data: AckData) -> bool {
    match (written, data) {
        (Command::Write16 { value, .. }, AckData::Bits16(found)) => value == found,
        (Command::Write32 { value, .. }, AckData::Bits32(found)) => value == found,
        _ => false,
    }
}
