//! Bytes from the DSP: decoded, judged, and turned into events. Of a status that means above all: is it made of the
//! groups that were asked for, and if not, or if none comes, does the DSP still have our mask?

use dsp_protocol::{
    Command, DecodeError, Decoded, Downlink, FlowControl, Group, Received, Status, StatusMask,
};
use ipc_types::MonotonicNs;

use super::commands::{Ack, AckData, Acknowledged};
use super::line::Sent;
use super::session::{READ_MASK, write_mask};
use super::{Link, LinkEvent, LinkTimer, Purpose, State, StatusSample, increment};

/// A status in another mask that comes so often in a row is no noise.
const ODD_STATUSES: u32 = 2;

/// Probes that are answered without any other message before the DSP counts as rebooted.
const PROBE_ONLY_REPLIES: u32 = 2;

impl Link {
    /// Takes bytes from the front of `input` until something happens or all are used. Events must be polled in between.
    pub fn receive(&mut self, now: MonotonicNs, input: &mut &[u8]) {
        while self.events.is_empty() && !input.is_empty() {
            let (used, decoded) = self.decoder.receive(input);
            self.health.bytes_received += used as u64;
            *input = input.get(used..).unwrap_or_default();
            match decoded {
                Decoded::Incomplete => {}
                Decoded::Rejected(error) => self.count_rejected(error),
                Decoded::Message(received) => {
                    let sent = self.line.sent(now, input.len(), self.read);
                    self.received(now, sent, &received);
                }
            }
        }
    }

    /// How many bytes of the message that has begun are missing at least; 0 when none has.
    pub fn missing(&self) -> usize {
        self.decoder.missing()
    }

    /// All bytes that the line had were taken: the newest flow control may count.
    pub fn end_read(&mut self, now: MonotonicNs) {
        self.read = now;
        if self.grants.end_read(now) {
            self.events.push_back(LinkEvent::Grant);
        }
    }

    /// The next thing that happened; call until there is nothing after every other call.
    pub fn poll_event(&mut self) -> Option<LinkEvent> {
        self.events.pop_front()
    }

    fn received(&mut self, now: MonotonicNs, sent: Sent, received: &Received<Downlink>) {
        if let Some(number) = received.sequence
            && let Some(last) = self.last_received.replace(number)
            && number != last
        {
            let missed = u32::from(number.missed_since(last));
            self.rejected.missed_messages = self.rejected.missed_messages.saturating_add(missed);
        }
        let ack = |command, data| Ack {
            command,
            data,
            acknowledges: received.acknowledges,
        };
        self.health.messages_received += 1;
        self.health.last_message_ns = now.0;
        self.message_arrived(now);
        match received.message {
            Downlink::Ack { command } => {
                return self.acknowledged(now, &ack(command, AckData::None));
            }
            Downlink::Ack16 { command, value } => {
                return self.acknowledged(now, &ack(command, AckData::Bits16(value)));
            }
            Downlink::Ack32 { command, value } => {
                return self.acknowledged(now, &ack(command, AckData::Bits32(value)));
            }
            Downlink::Status(status) => self.status(now, sent, status),
            Downlink::FlowControl(flow) => self.grants.arrived(flow == FlowControl::Send),
            Downlink::Error(code) => {
                let starting = !self.is_up();
                self.events
                    .push_back(LinkEvent::DspError { code, starting });
            }
        }
        if let State::Up(session) = &mut self.state {
            session.probe_only_replies = 0;
        }
    }

    fn status(&mut self, now: MonotonicNs, sent: Sent, mut status: Status) {
        self.statuses.arrived(now);
        let asked_for = self.config.status.mask();
        let has_time = status.time_ms.is_some() || !asked_for.contains(Group::Time);
        let has_others = status.mask().0 & !asked_for.0 != 0;
        // Fewer groups than asked for, time among them: a sensor has no values.
        if !self.takes_mask(now, &status) && (has_others || !has_time) {
            // Made for another mask, or damaged; it could overtake one that is held back.
            return increment(&mut self.health.telemetry_incoherent);
        }
        self.expect_status(now);
        status.withdraw(StatusMask(!asked_for.0));
        self.withdraw_implausible(&mut status);
        let sample = StatusSample {
            status,
            received: now,
            sent,
        };
        let Some(time_ms) = status.time_ms else {
            // Without the DSP's time, the order of the line decides.
            return self.events.push_back(LinkEvent::Sample(sample));
        };
        let verdict = self.coherence.arrive(time_ms, sample);
        self.health.telemetry_incoherent = self
            .health
            .telemetry_incoherent
            .saturating_add(verdict.dropped);
        if verdict.rebooted {
            self.rebooted(now);
        }
        self.events
            .extend(verdict.send.into_iter().flatten().map(LinkEvent::Sample));
    }

    /// The next status must come within twice the time for which one counts as recent, so that a DSP that says nothing
    /// at all is probed first.
    pub(super) fn expect_status(&mut self, now: MonotonicNs) {
        if self.is_up() {
            self.timers
                .arm(LinkTimer::Status, now + 2 * self.status_fresh_for());
        }
    }

    /// The DSP sends other messages, but no status. Its mask shows whether it has rebooted, or has only stopped
    /// sending.
    pub(super) fn status_overdue(&mut self, now: MonotonicNs) {
        self.ask_for_status(READ_MASK, Purpose::StatusProbe { instead: None });
        self.expect_status(now);
    }

    /// Whether a status has the groups that were asked for, or others that are taken instead. After several statuses
    /// with others the link asks for the DSP's mask; if that is ours all the same, the groups are taken as they come.
    pub(super) fn takes_mask(&mut self, now: MonotonicNs, status: &Status) -> bool {
        let ours = self.config.status.mask();
        let groups = status.mask();
        let (State::Up(session) | State::Silent(session)) = &mut self.state else {
            // Nothing can be asked yet: only what cannot be wrong is taken.
            return groups == ours;
        };
        if groups == ours {
            session.odd_mask = None;
            return true;
        }
        if session.accepted_masks.contains(&Some(groups)) {
            return true;
        }
        let count = match session.odd_mask {
            Some((mask, count)) if mask == groups => count.saturating_add(1),
            _ => 1,
        };
        session.odd_mask = Some((groups, count));
        session.odd_mask_at = now;
        if count == ODD_STATUSES {
            let instead = Some(groups);
            self.ask_for_status(READ_MASK, Purpose::StatusProbe { instead });
        }
        false
    }

    /// Why status comes in another mask, or not at all, is not known: the next one makes the link ask again.
    pub(super) fn mask_not_read(&mut self) {
        if let State::Up(session) | State::Silent(session) = &mut self.state {
            session.odd_mask = None;
        }
    }

    /// The DSP's mask was read because no status came, or one with the groups `instead` of ours.
    pub(super) fn mask_read(
        &mut self,
        now: MonotonicNs,
        instead: Option<StatusMask>,
        data: AckData,
    ) {
        // Status that has been coming in another mask all the time is what came instead.
        let instead = instead.or_else(|| self.odd_groups(now));
        match (instead, self.is_our_mask(data)) {
            (None, true) => self.ask_for_status(Command::ActivateStatus, Purpose::ReactivateStatus),
            (None, false) => self.lost_its_mask(now),
            (Some(groups), true) => {
                if let State::Up(session) | State::Silent(session) = &mut self.state {
                    session.accept(groups);
                    self.events.push_back(LinkEvent::OddStatus { groups });
                }
            }
            // It goes on sending, so it has not booted: a reboot switches the status off.
            (Some(_), false) => {
                let write = write_mask(&self.config);
                self.ask_for_status(write, Purpose::RewriteMask);
            }
        }
    }

    /// The groups of the status that comes, if several in a row have the same mask, which is not the one asked for.
    fn odd_groups(&self, now: MonotonicNs) -> Option<StatusMask> {
        let State::Up(session) = self.state else {
            return None;
        };
        let is_recent = now.since(session.odd_mask_at) <= self.status_fresh_for();
        match session.odd_mask {
            Some((groups, count)) if is_recent && count >= ODD_STATUSES => Some(groups),
            _ => None,
        }
    }

    /// A queue that is full now has room when the next status is overdue, or comes in another mask again.
    fn ask_for_status(&mut self, command: Command, purpose: Purpose) {
        if !self.commands.has(|other| *other == purpose)
            && self.commands.push(command, purpose).is_err()
        {
            self.mask_not_read();
        }
    }

    /// Whether a read of the mask gave the one that was written.
    pub(super) fn is_our_mask(&self, data: AckData) -> bool {
        data == AckData::Bits16(self.config.status.mask().0)
    }

    fn withdraw_implausible(&mut self, status: &mut Status) {
        let implausible = status.implausible_groups();
        if implausible != StatusMask::NONE {
            let groups = &mut self.rejected.implausible_groups;
            *groups = groups.saturating_add(implausible.0.count_ones());
            self.rejected.implausible_mask |= u32::from(implausible.0);
            status.withdraw(implausible);
        }
    }

    fn acknowledged(&mut self, now: MonotonicNs, ack: &Ack) {
        let Some(Acknowledged {
            purpose,
            is_certain,
            sent,
        }) = self.commands.acknowledge(ack)
        else {
            return increment(&mut self.health.acks_unmatched);
        };
        increment(&mut self.health.commands_acknowledged);
        self.arm_command_timer();
        if let State::Up(session) = &mut self.state {
            session.last_delivered = session.last_delivered.max(sent);
        }
        let Some(purpose) = purpose else {
            return self.empty_path();
        };
        match purpose {
            Purpose::StartUp(step) => self.step_done(now, step, ack.data, is_certain),
            Purpose::Probe => self.probe_answered(now, ack.data, is_certain),
            // A value that may be that of another port says nothing.
            Purpose::StatusProbe { .. } if !is_certain => self.mask_not_read(),
            Purpose::StatusProbe { instead } => self.mask_read(now, instead, ack.data),
            Purpose::ReactivateStatus | Purpose::RewriteMask => {}
            Purpose::KeepAlive => {
                if is_certain && ack.data != AckData::Bits16(self.config.link.pc_timeout_ms) {
                    self.lost_its_mask(now);
                }
            }
            Purpose::EmptyPath => self.path_emptied(is_certain),
            Purpose::Flight(command) => self
                .events
                .push_back(LinkEvent::Delivered(command, ack.data)),
        }
        // A queue that was full has room now.
        self.empty_path();
    }

    fn probe_answered(&mut self, now: MonotonicNs, data: AckData, is_certain: bool) {
        let State::Up(session) = &mut self.state else {
            return;
        };
        session.probe_only_replies += 1;
        let says_nothing_else = session.probe_only_replies >= PROBE_ONLY_REPLIES;
        if says_nothing_else || is_certain && !self.is_our_mask(data) {
            self.lost_its_mask(now);
        }
    }

    fn count_rejected(&mut self, error: DecodeError) {
        let counter = match error {
            DecodeError::Stray => &mut self.rejected.stray,
            // The DSP sends no commands; its decoder never gives that one.
            DecodeError::UnknownHeader | DecodeError::UnknownCommand => {
                &mut self.rejected.unknown_header
            }
            DecodeError::OtherProfile => &mut self.rejected.other_profile,
            DecodeError::Truncated => &mut self.rejected.truncated,
            DecodeError::Checksum => &mut self.rejected.checksum,
            DecodeError::Padding => &mut self.rejected.padding,
            DecodeError::Value => &mut self.rejected.value,
        };
        increment(counter);
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::config::BridgeConfig;
    use crate::link::FlightCommand;
    use crate::link::session::{DspSession, StartUp};

    const NOW: MonotonicNs = MonotonicNs(10_000_000_000);
    const OTHER: AckData = AckData::Bits16(3);

    fn up() -> Link {
        let mut link = Link::new(&BridgeConfig::default());
        link.enter(State::Up(DspSession::begin(NOW, StartUp::FIRST)), NOW);
        link
    }

    /// How often other groups came in a row, how long ago, and what follows when the mask is read because none came.
    #[test]
    fn a_mask_that_is_not_ours_is_written_again_while_status_comes_and_else_the_dsp_has_booted() {
        let fresh_ms = up().status_fresh_for().as_millis() as u64;
        for (count, ago_ms, goes_on) in [
            (0, 0, false),
            (1, 0, false),
            (2, 0, true),
            (2, fresh_ms, true),
            (2, fresh_ms + 1, false),
            (3, 0, true),
        ] {
            for (data, is_ours) in [(OTHER, false), (AckData::Bits16(0xFFFF), true)] {
                let mut link = up();
                for _ in 0..count {
                    assert!(!link.takes_mask(NOW, &Status::default()));
                }
                link.commands.abandon();
                link.mask_read(NOW + Duration::from_millis(ago_ms), None, data);
                let asks = |purpose| link.commands.has(|it| *it == purpose);
                let found = [
                    asks(Purpose::ReactivateStatus),
                    matches!(link.events.front(), Some(LinkEvent::OddStatus { .. })),
                    link.events.contains(&LinkEvent::Rebooted),
                    asks(Purpose::RewriteMask),
                ];
                let expected = [(true, false), (true, true), (false, false), (false, true)];
                let expected = expected.map(|it| it == (is_ours, goes_on));
                assert_eq!(found, expected, "{count} {ago_ms} {is_ours}");
            }
        }
    }

    /// A late acknowledgement may be that of another port.
    #[test]
    fn a_mask_that_is_not_certain_says_nothing() {
        for is_certain in [true, false] {
            let mut link = up();
            if !is_certain {
                link.ask_for_status(READ_MASK, Purpose::Probe);
                link.commands.poll(NOW);
                link.commands.abandon();
            }
            link.status_overdue(NOW);
            link.commands.poll(NOW);
            link.acknowledged(
                NOW,
                &Ack {
                    command: 0,
                    data: OTHER,
                    acknowledges: None,
                },
            );
            assert_eq!(link.events.contains(&LinkEvent::Rebooted), is_certain);
        }
    }

    #[test]
    fn a_sign_of_life_is_queued_behind_other_commands() {
        let mut link = up();
        let _ = link.command(Command::ClearErrors, FlightCommand::ClearErrors);
        link.keep_alive(NOW);
        assert!(link.commands.has(|it| *it == Purpose::KeepAlive));
    }

    #[test]
    fn before_the_start_up_only_our_mask_is_taken() {
        let status = Status::default();
        for ours in [true, false] {
            let mut link = Link::new(&BridgeConfig::default());
            if ours {
                link.config.status.groups.clear();
            }
            assert_eq!(link.takes_mask(NOW, &status), ours);
        }
    }

    #[test]
    fn a_question_for_the_mask_that_finds_the_queue_full_is_asked_when_there_is_room() {
        let mut link = up();
        while (link.command(Command::ClearErrors, FlightCommand::ClearErrors)).is_ok() {}
        for is_full in [true, false] {
            for _ in 0..ODD_STATUSES {
                assert!(!link.takes_mask(NOW, &Status::default()));
            }
            let is_asked = (link.commands).has(|it| matches!(it, Purpose::StatusProbe { .. }));
            assert_eq!(is_asked, !is_full);
            link.commands.abandon();
        }
    }
}
