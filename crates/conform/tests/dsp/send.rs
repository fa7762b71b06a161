//! What the small DSP sends: status, flow control, and frames in their order.

use dsp_protocol::{Group, Profile, checksum, crc32};

use super::{Dsp, Out, Phase, digits};
use crate::fault::Fault;

impl Dsp {
    pub(super) fn queue_status(&mut self) {
        let busy = !self.statuses.is_empty()
            || self.sending.as_ref().is_some_and(|(_, _, status)| *status)
                && !self.is(Fault::StatusBeforeAck);
        if self.is(Fault::SendsNoStatus) {
            return;
        }
        if busy && !(self.is(Fault::QueuesStatuses) && self.statuses.len() < 8) {
            return;
        }
        let mut mask = self.word(10_000);
        match self.fault {
            Fault::IgnoresMask => mask = 0xFFFF,
            Fault::AddsGroup => mask |= 1 << 9,
            Fault::NoTime => mask &= !1,
            Fault::TimeWithoutMask => mask |= 1,
            Fault::LeavesOut(group) => mask &= !group.bit(),
            _ => {}
        }
        let time = self.clock();
        let flag = u8::from(self.flies())
            | if self.is(Fault::SetsAnotherFlag) {
                0x20
            } else {
                0
            };
        let mut payload = digits(u32::from(mask), 3);
        if self.is(Fault::SetsPadding) && self.frames_sent % 40 == 39 {
            payload[0] |= 0x40;
        }
        payload.push(flag);
        for group in Group::ALL
            .into_iter()
            .filter(|group| mask & group.bit() != 0)
        {
            payload.extend(self.group(group, time));
            if self.is(Fault::WrongLength(group)) {
                payload.push(0);
            }
        }
        let mut out = self.out(0xE9, payload);
        out.error = if self.is(Fault::NewestErrorFirst) {
            self.errors.pop_back()
        } else {
            self.errors.pop_front()
        };
        self.statuses.push_back(out);
    }

    pub(super) fn clock(&mut self) -> u32 {
        let elapsed = (self.now - self.booted).as_millis() as u64;
        let clock = match self.fault {
            Fault::TimeIn(factor) => (elapsed / u64::from(factor)) as u32,
            Fault::ClockStops => {
                u32::try_from(u64::from(self.clock_start) + elapsed).unwrap_or(u32::MAX)
            }
            _ => self.clock_start.wrapping_add(elapsed as u32),
        };
        if self.is(Fault::WrapResets) && clock < self.last_time {
            let due = (self.status_due, self.flow_due);
            let mask = self.words[0];
            let booted = (self.booted, self.clock_start);
            self.boot(self.now);
            (self.status_due, self.flow_due) = due;
            (self.booted, self.clock_start) = booted;
            self.words[0] = mask;
        }
        self.time_repeats = !self.time_repeats;
        if !(self.is(Fault::TimeStands) && self.time_repeats) {
            self.last_time = clock;
        }
        self.last_time
    }

    pub(super) fn group(&self, group: Group, time: u32) -> Vec<u8> {
        let fields = group.limits();
        let len = |wire: &str| match wire {
            "u7" => (7, 1),
            "u14" => (14, 2),
            "u16" | "i16" => (16, 3),
            _ => (32, 5),
        };
        let mut bytes = Vec::new();
        for (index, field) in fields.iter().enumerate() {
            let value: i64 = match (group, index) {
                (Group::Time, _) => i64::from(time),
                (Group::Geographic, axis) => {
                    let steps = if axis == 2 { 1e3 } else { 1e7 };
                    (self.place[axis] * steps).round() as i64
                }
                (Group::Acceleration, 2) if self.is(Fault::GravityUp) => 981,
                (Group::Acceleration, 2) => -981,
                (Group::Supply, 0) => 24_000,
                (Group::Supply, 1) => 80,
                (Group::Supply, _) => 1,
                (Group::PilotPwm | Group::Actuation, _) => 1_500,
                (Group::GpsQuality, _) => 4,
                _ => 0,
            };
            let value = match self.fault {
                Fault::Implausible(wrong) if wrong == group => {
                    (field.max * f64::from(field.steps_per_unit)).round() as i64 + 1
                }
                _ => value,
            };
            let (bits, count) = len(field.wire);
            let cut = (value & ((1 << bits) - 1)) as u32;
            bytes.extend(digits(cut, count));
        }
        bytes
    }

    pub(super) fn queue_flow(&mut self) {
        let free = match self.fault {
            Fault::FreePlaces(free) => free,
            _ => 2,
        };
        let places = match self.fault {
            Fault::Places(places) => places,
            _ => 16,
        };
        let has_room = places - self.path.len().min(places) >= free;
        let hovers = self.phase == Phase::Hover
            || self.is(Fault::AsksOnGround) && self.phase == Phase::Ground
            || self.is(Fault::AsksDuringLanding) && self.phase == Phase::Descent;
        if self.is(Fault::FlowBeforeFlag) && matches!(self.phase, Phase::Starting { .. }) {
            self.flow = Some(1);
            return;
        }
        if hovers && has_room {
            self.awaits_flow = false;
        }
        self.flow = Some(u8::from(hovers && has_room));
    }

    /// Begins the next frame if none is being sent.
    pub(super) fn send(&mut self) {
        if self.is(Fault::BreaksStatusOff)
            && !self.acks.is_empty()
            && let Some((frame, _, true)) = &self.sending
            && frame.len() > 60
        {
            self.output.extend(&frame[..frame.len() / 2]);
            self.sending = None;
        }
        if self.sending.is_some() {
            return;
        }
        let now = self.now;
        let ack_waits = self.acks.front().is_some_and(|(from, _)| *from <= now);
        if ack_waits && self.is(Fault::AckForError) {
            // The error goes back, to the next status.
            if let Some(code) = self.error_of_status.take() {
                self.errors.push_front(code);
            }
        }
        if !(ack_waits && self.is(Fault::AckBeforeError))
            && let Some(code) = self.error_of_status.take()
        {
            let out = self.out(0xE6, digits(u32::from(code), 3));
            if self.is(Fault::TwoErrorsForStatus) {
                self.error_of_status = self.errors.pop_front();
            }
            return self.begin(out);
        }
        if self.is(Fault::StatusBeforeAck)
            && let Some(out) = self.statuses.pop_front()
        {
            return self.begin_status(out);
        }
        if ack_waits && let Some((_, out)) = self.acks.pop_front() {
            return self.begin(out);
        }
        if std::mem::take(&mut self.alarm) {
            let out = self.out(0xE6, digits(100, 3));
            return self.begin(out);
        }
        if let Some(flow) = self.flow.take() {
            let out = self.out(0xAA, vec![flow]);
            return self.begin(out);
        }
        if let Some(out) = self.statuses.pop_front() {
            self.begin_status(out);
        }
    }

    pub(super) fn begin_status(&mut self, out: Out) {
        if out.error.is_some() || !self.is(Fault::AckBeforeError) {
            self.error_of_status = out.error;
        }
        self.begin(out);
    }

    pub(super) fn begin(&mut self, out: Out) {
        let is_status = out.header == 0xE9;
        self.frames_sent += 1;
        let profile = match (self.fault, self.profile) {
            (Fault::AnswersInOtherProfile, Profile::Classic)
                if self.frames_sent.is_multiple_of(30) =>
            {
                Profile::Extended
            }
            (Fault::AnswersInOtherProfile, Profile::Extended)
                if self.frames_sent.is_multiple_of(30) =>
            {
                Profile::Classic
            }
            (_, profile) => profile,
        };
        let is_wrong = self.is(Fault::AlwaysSendsWrongCheckField)
            || self.is(Fault::SendsWrongCheckField) && self.frames_sent.is_multiple_of(30);
        let mut frame = match profile {
            Profile::Classic => vec![out.header],
            Profile::Extended => vec![0xDA, self.number, out.header & 0x7F],
        };
        frame.extend(&out.payload);
        match profile {
            Profile::Classic => frame.push(checksum(&frame) ^ u8::from(is_wrong)),
            Profile::Extended => {
                if matches!(out.header, 0xC3 | 0xCC | 0xA5) {
                    frame.push(out.acknowledges);
                }
                frame.extend(digits(crc32(&frame) ^ u32::from(is_wrong), 5));
                let step = match self.fault {
                    Fault::NumberStands if self.frames_sent.is_multiple_of(20) => 0,
                    Fault::SkipsNumbers if self.frames_sent.is_multiple_of(20) => 2,
                    _ => 1,
                };
                self.number = (self.number + step) & 0x7F;
            }
        }
        if self.is(Fault::SendsBytesBetween) && self.frames_sent.is_multiple_of(30) {
            frame.push(0);
        }
        let until = self.now + self.byte * frame.len() as u32;
        self.sending = Some((frame, until, is_status));
    }
}
