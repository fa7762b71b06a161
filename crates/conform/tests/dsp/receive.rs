//! What the small DSP receives: frames, commands, writes of ports.

use std::time::Duration;

use dsp_protocol::port::{PORTS_16, PORTS_32};
use dsp_protocol::{Profile, checksum, crc32};

use super::{BURST_PAUSE, Dsp, MS, Out, Phase, digits, number};
use crate::fault::Fault;

impl Dsp {
    pub(super) fn take_byte(&mut self, byte: u8) {
        let pause = self.now.saturating_sub(self.last_byte);
        self.last_byte = self.now;
        if pause > BURST_PAUSE {
            self.burst = 0;
        }
        self.burst += 1;
        if let Fault::ReceivesOnly(most) = self.fault
            && self.burst > most
        {
            return;
        }
        if let Fault::GivesUpWithin(ms) = self.fault
            && !self.frame.is_empty()
            && pause > MS * ms as u32
        {
            self.frame.clear();
        }
        let mut byte = byte;
        if self.is(Fault::TakesHeadersWithoutBit7)
            && self.frame.is_empty()
            && matches!(byte | 0x80, 0xF0 | 0xB3)
            && self.headers()[0] == byte | 0x80
        {
            byte |= 0x80;
        }
        let is_within = self.is(Fault::IgnoresHeadersWithin) && !self.frame.is_empty();
        if byte & 0x80 != 0 && !is_within {
            if !self.frame.is_empty() && self.is(Fault::ReportsTruncated) {
                self.error(102);
            }
            self.frame.clear();
            self.skip = false;
            return self.begin_frame(byte);
        }
        if self.frame.is_empty() {
            if !self.skip && self.is(Fault::ReportsStrays) {
                self.error(100);
            }
            if self.skip && self.is(Fault::CountsEachByte) {
                self.error(100);
            }
            if !self.skip {
                self.after_noise = true;
            }
            self.skip = true;
            return;
        }
        self.frame.push(byte);
        self.continue_frame();
    }

    pub(super) fn headers(&self) -> [u8; 2] {
        match self.profile {
            Profile::Classic => [0xF0, 0x99],
            Profile::Extended => [0xB3, 0xB3],
        }
    }

    pub(super) fn begin_frame(&mut self, byte: u8) {
        let other = match self.profile {
            Profile::Classic => byte == 0xB3,
            Profile::Extended => matches!(byte, 0xF0 | 0x99),
        };
        if self.headers().contains(&byte) {
            self.frame.push(byte);
            return;
        }
        self.skip = true;
        self.after_noise = true;
        if other {
            return self.meet_other_profile();
        }
        if !self.is(Fault::SilentAboutHeaders) {
            self.error(100);
        }
    }

    pub(super) fn meet_other_profile(&mut self) {
        match self.fault {
            Fault::OtherProfileSilent => return,
            Fault::OtherProfileWaits => return self.error(100),
            _ => {}
        }
        let is_due = self
            .reported_profile
            .is_none_or(|at| self.now >= at + 1_000 * MS);
        if is_due || self.is(Fault::OtherProfileAlways) {
            self.reported_profile = Some(self.now);
            self.alarm = true;
        }
    }

    /// Bytes before the payload, and behind it.
    pub(super) fn around(&self) -> (usize, usize) {
        match self.profile {
            Profile::Classic => (1, 1),
            Profile::Extended => (3, 5),
        }
    }

    pub(super) fn continue_frame(&mut self) {
        let (front, behind) = self.around();
        if self.frame.len() < front {
            return;
        }
        let kind = match self.profile {
            Profile::Classic => self.frame[0] & 0x7F,
            Profile::Extended => self.frame[2],
        };
        let payload = match kind {
            0x19 => 15,
            0x70 => match self.frame.get(front) {
                None => return,
                Some(code) => match code {
                    0 | 2 => 4,
                    1 => 7,
                    3 => 9,
                    4..=6 => 1,
                    7 => 2,
                    _ if self.is(Fault::ChecksUnknownCommands)
                        || self.is(Fault::AcknowledgesUnknownCommands) =>
                    {
                        1
                    }
                    _ => {
                        self.frame.clear();
                        self.skip = true;
                        if !self.is(Fault::SilentAboutUnknownCommands) {
                            self.error(30);
                        }
                        return;
                    }
                },
            },
            _ if self.is(Fault::ChecksCrcBeforeKind) => 4,
            _ => {
                self.frame.clear();
                self.skip = true;
                return self.error(100);
            }
        };
        if self.frame.len() == front + payload + behind {
            let frame = std::mem::take(&mut self.frame);
            self.judge(&frame, kind);
        }
    }

    pub(super) fn judge(&mut self, frame: &[u8], kind: u8) {
        let (front, behind) = self.around();
        let (summed, check) = frame.split_at(frame.len() - behind);
        let is_right = match self.profile {
            Profile::Classic => check[0] == checksum(summed),
            Profile::Extended => {
                let crc = digits(crc32(summed), 5);
                let from = usize::from(self.is(Fault::IgnoresTopOfCrc));
                check[from..] == crc[from..]
            }
        };
        let payload = &summed[front..];
        let sequence = match self.profile {
            Profile::Classic => None,
            Profile::Extended => Some(frame[1]),
        };
        let code = if kind == 0x70 { payload[0] } else { 99 };
        let padding = self.padding(kind, payload);
        if self.is(Fault::LosesFirstFrameBehindNoise) && std::mem::take(&mut self.after_noise) {
            return;
        }
        if self.is(Fault::JudgesPaddingFirst) && padding {
            return self.error(30);
        }
        if !is_right && !self.is(Fault::TakesAnyCheckField) {
            if self.is(Fault::AcknowledgesDamaged) && code < 8 {
                self.acknowledge(0xC3, code, Vec::new(), sequence);
            }
            if self.is(Fault::TakesDamagedWrites) && code == 3 {
                self.write_float(number(&payload[1..4]) as u16, number(&payload[4..9]));
            }
            return match self.fault {
                Fault::SilentAboutCheckField => {}
                Fault::NamesAnotherErrorForCheckField => self.error(30),
                _ => self.error(102),
            };
        }
        if kind != 0x70 && kind != 0x19 {
            return self.error(100);
        }
        if kind == 0x70 && code > 7 {
            if self.is(Fault::AcknowledgesUnknownCommands) {
                self.acknowledge(0xC3, code & 7, Vec::new(), sequence);
            }
            return self.error(30);
        }
        if padding && !self.is(Fault::TakesAnyPadding) {
            return self.error(30);
        }
        if code == 7 && payload[1] > 1 && !self.is(Fault::TakesAnyFollowing) {
            return self.error(30);
        }
        let errors = self.errors.len();
        if kind == 0x19 {
            self.take_waypoint(payload, sequence);
        } else {
            self.take_command(payload, sequence);
        }
        let is_ignored = match self.fault {
            Fault::TimeoutIgnoresReads => code == 0,
            Fault::TimeoutIgnoresWaypoints => kind == 0x19,
            Fault::TimeoutIgnoresRefused => self.errors.len() > errors,
            _ => false,
        };
        if !is_ignored {
            self.restart_timeout();
        }
    }

    /// Whether an unused bit is set.
    pub(super) fn padding(&self, kind: u8, payload: &[u8]) -> bool {
        let word = |at: usize| payload[at] & 0x7C != 0;
        let long = |at: usize| payload[at] & 0x70 != 0;
        match (kind, payload[0]) {
            (0x19, _) => long(0) || long(5) || long(10),
            (0x70, 0 | 2) => word(1),
            (0x70, 1) => word(1) || word(4),
            (0x70, 3) => word(1) || long(4),
            _ => false,
        }
    }

    pub(super) fn restart_timeout(&mut self) {
        let mut timeout = f64::from(self.word(10_004));
        match self.fault {
            Fault::TimeoutFactor(factor) => timeout *= factor,
            Fault::NoTimeout => timeout = 0.0,
            Fault::TimeoutWhenOff if timeout == 0.0 => timeout = 1_000.0,
            _ => {}
        }
        self.timeout_due =
            (timeout > 0.0).then(|| self.now + Duration::from_secs_f64(timeout / 1e3));
    }

    pub(super) fn acknowledge(
        &mut self,
        header: u8,
        code: u8,
        data: Vec<u8>,
        sequence: Option<u8>,
    ) -> Out {
        let named = match self.fault {
            Fault::NamesAnotherCommand if code == 1 => 4,
            _ => code,
        };
        let mut payload = vec![named];
        payload.extend(data);
        let mut out = self.out(header, payload);
        out.acknowledges = match self.fault {
            Fault::AcksNumberZero => 0,
            _ => sequence.unwrap_or(0),
        };
        let after = match self.fault {
            Fault::AcksAfter(ms) => MS * ms as u32,
            _ => Duration::ZERO,
        };
        if !self.is(Fault::NoAckOf(code)) {
            self.acks.push_back((self.now + after, out.clone()));
            if self.is(Fault::AcksTwice) {
                self.acks.push_back((self.now + after, out.clone()));
            }
        }
        out
    }

    pub(super) fn take_command(&mut self, payload: &[u8], sequence: Option<u8>) {
        if let (Some(sequence), Some((last, bytes, out))) = (sequence, self.last_command.clone()) {
            let same_number = last == sequence || self.is(Fault::CopiesByBytes);
            let same_bytes = bytes == payload || self.is(Fault::CopiesByNumber);
            if same_number && same_bytes && !self.is(Fault::ExecutesCopies) {
                if self.is(Fault::SilentAboutCopies) {
                    return;
                }
                if self.is(Fault::ReadsCopiesAnew) && payload[0] == 0 {
                    let value = self.read_word(number(&payload[1..4]) as u16);
                    let value = digits(u32::from(value.unwrap_or(0)), 3);
                    self.acknowledge(0xCC, 0, value, Some(sequence));
                    return;
                }
                self.acks.push_back((self.now, out));
                return;
            }
            if self.is(Fault::WantsNextNumber) && sequence != (last + 1) & 0x7F {
                self.last_command = Some((sequence, payload.to_vec(), out));
                return;
            }
        }
        let code = payload[0];
        let port = || number(&payload[1..4]) as u16;
        let mut refused = false;
        let (header, data) = match code {
            0 => {
                let value = self.read_word(port());
                refused = value.is_none() && !self.is(Fault::SilentAboutUnknownReads);
                let unknown = u16::from(self.is(Fault::UnknownReadsOne));
                (0xCC, digits(u32::from(value.unwrap_or(unknown)), 3))
            }
            2 => {
                let index = PORTS_32.iter().position(|one| one.number == port());
                refused = index.is_none() && !self.is(Fault::SilentAboutUnknownReads);
                let value = index.map_or(0.0, |index| self.floats[index]);
                match self.fault {
                    Fault::AcksWordsForFloats => (0xCC, digits(value as u32, 3)),
                    _ => (0xA5, digits(value.to_bits(), 5)),
                }
            }
            _ => (0xC3, Vec::new()),
        };
        let (header, data) = match self.fault {
            Fault::AcksReadsWithoutData if code == 0 => (0xC3, Vec::new()),
            _ => (header, data),
        };
        refused |= match code {
            1 => !self.write_word(port(), number(&payload[4..7]) as u16),
            3 => !self.write_float(port(), number(&payload[4..9])),
            4 => {
                if !self.is(Fault::KeepsErrors) {
                    self.errors.clear();
                    self.error_of_status = None;
                }
                false
            }
            5 => {
                self.activate();
                false
            }
            6 => {
                if !self.is(Fault::InvalidateKeepsPath) {
                    self.drop_path();
                }
                self.is(Fault::RefusesInvalidateDuringTakeOff) && self.takes_off()
            }
            7 => {
                self.follow(payload[1] != 0);
                false
            }
            _ => false,
        };
        let silent = refused && self.is(Fault::RefusesWithoutAck) && matches!(code, 1 | 3);
        if !silent {
            let out = self.acknowledge(header, code, data, sequence);
            self.last_command = sequence.map(|sequence| (sequence, payload.to_vec(), out));
        }
        let is_quiet = self.is(Fault::RefusesInSilence) && matches!(code, 1 | 3);
        if refused && !is_quiet {
            self.error(30);
        }
    }

    pub(super) fn activate(&mut self) {
        let due = match self.fault {
            Fault::FirstStatusAtOnce => self.now,
            _ => self.now + self.status_period(),
        };
        if self.is(Fault::ActivateStartsFlow) {
            self.flow_due = self.flow_due.or(Some(self.now + self.flow_period()));
        }
        self.status_due = match (self.status_due, self.fault) {
            (Some(_), Fault::ActivateSwitches) => None,
            (Some(old), fault) if fault != Fault::ActivateRestarts => Some(old),
            _ => Some(due),
        };
    }

    pub(super) fn follow(&mut self, on: bool) {
        if on {
            self.started_up = true;
            let due = match self.fault {
                Fault::FirstFlowAtOnce => self.now,
                _ => self.now + self.flow_period(),
            };
            self.flow_due = match (self.flow_due, self.fault) {
                (Some(old), fault) if fault != Fault::FollowingRestarts => Some(old),
                _ => Some(due),
            };
        } else {
            if !self.is(Fault::FlowAfterOff) {
                self.flow_due = None;
                self.flow = None;
            }
            self.awaits_flow = false;
            if !self.is(Fault::FollowingOffKeepsPath) {
                self.drop_path();
            }
        }
    }

    pub(super) fn drop_path(&mut self) {
        self.path.clear();
        if !self.is(Fault::KeepsWaypointNumber) {
            self.waypoint_number = None;
        }
    }

    pub(super) fn status_period(&self) -> Duration {
        let factor = match self.fault {
            Fault::PeriodFactor(factor) => factor,
            _ => 1,
        };
        let period = MS * u32::from(self.word(10_001)).max(1) * factor;
        match self.fault {
            Fault::PeriodTooLong => period * 106 / 100,
            _ => period,
        }
    }

    pub(super) fn flow_period(&self) -> Duration {
        MS * u32::from(self.word(10_002)).max(1)
    }

    pub(super) fn read_word(&mut self, number: u16) -> Option<u16> {
        self.reads += 1;
        match number {
            10_003 if self.is(Fault::CountWithoutBit15) => Some(self.count),
            10_003 => Some(0x8000 | self.count & 0x7FFF),
            10_121 => Some(u16::from(
                self.takes_off()
                    && !self.is(Fault::TakeOffReadsZero)
                    && !(self.is(Fault::TakeOffReadsZeroAtHeight) && self.phase == Phase::Hover)
                    || self.is(Fault::TakeOffReadsOneForever) && self.flies(),
            )),
            10_122 => Some(u16::from(
                matches!(self.phase, Phase::Descent | Phase::Stopping { .. })
                    && !self.is(Fault::LandReadsZero),
            )),
            _ => {
                let index = PORTS_16.iter().position(|port| port.number == number)?;
                let value = self.words[index];
                if self.is(Fault::ReadsConsume) && number >= 10_200 {
                    self.words[index] ^= 1;
                }
                Some(value)
            }
        }
    }

    pub(super) fn write_word(&mut self, number: u16, value: u16) -> bool {
        match number {
            10_121 => return self.order_take_off(value),
            10_122 => return self.order_landing(value),
            10_003 if self.is(Fault::CountIsWritable) => {
                self.count = value & 0x7FFF;
                return true;
            }
            20_000 if self.is(Fault::MixesWidths) => {
                self.floats[0] = f32::from(value);
                return false;
            }
            _ => {}
        }
        let Some(index) = PORTS_16.iter().position(|port| port.number == number) else {
            return self.is(Fault::SilentAboutUnknownWrites);
        };
        let port = PORTS_16[index];
        let as_value = if port.signed {
            i32::from(value.cast_signed())
        } else {
            i32::from(value)
        };
        let mut range = port.min..=port.max;
        if self.is(Fault::TakesBeyond(number)) {
            range = -40_000..=70_000;
        }
        if self.is(Fault::RefusesEnd(number)) {
            range = port.min..=port.max - 1;
        }
        if !range.contains(&as_value) {
            return false;
        }
        if self.is(Fault::WritesLate) {
            self.late_writes
                .push_back((self.now + 20 * MS, number, value));
            return true;
        }
        self.words[index] = match self.fault {
            Fault::KeepsTimeoutWrong if number == 10_004 => value / 2,
            _ => value,
        };
        self.change_periods(number);
        true
    }

    pub(super) fn change_periods(&mut self, number: u16) {
        let (status, flow) = (
            self.now + self.status_period(),
            self.now + self.flow_period(),
        );
        let keeps = self.is(Fault::KeepsOldPeriod);
        let from_now = self.is(Fault::CountsNewPeriodFromNow);
        let (at_once, now) = (self.is(Fault::NewPeriodAtOnce), self.now);
        let change = |due: &mut Option<Duration>, new: Duration| {
            if let Some(due) = due {
                *due = match () {
                    () if keeps => *due,
                    () if from_now => new,
                    () if at_once && *due > new => now + MS,
                    () => (*due).min(new),
                };
            }
        };
        match number {
            10_001 => change(&mut self.status_due, status),
            10_002 => change(&mut self.flow_due, flow),
            _ => {}
        }
    }

    pub(super) fn write_float(&mut self, number: u16, bits: u32) -> bool {
        let value = f32::from_bits(bits);
        if number == 10_000 && self.is(Fault::MixesWidths) {
            self.words[0] = value as u16;
            return false;
        }
        let Some(index) = PORTS_32.iter().position(|port| port.number == number) else {
            return self.is(Fault::SilentAboutUnknownWrites);
        };
        let port = PORTS_32[index];
        let mut is_in = value >= port.min && value <= port.max;
        is_in |= self.is(Fault::TakesBeyond(number));
        is_in &= !(self.is(Fault::RefusesEnd(number)) && value == port.max);
        if is_in {
            self.floats[index] = value;
        }
        is_in
    }
}
