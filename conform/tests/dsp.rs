//! A small DSP, written from docs/protocol.md alone: it shares frames, ports and behaviour neither with the bridge nor with the
//! simulator, and can be wrong in each way of [`Fault`]. Its helicopter climbs and flies at 2 m/s and has no inertia.

use std::collections::VecDeque;
use std::time::Duration;

use dsp_protocol::port::{PORTS_16, PORTS_32};
use dsp_protocol::{Group, Profile, checksum, crc32};

use crate::fault::Fault;
use crate::harness::Peer;

const MS: Duration = Duration::from_millis(1);
/// A step of the helicopter.
const TICK: Duration = Duration::from_millis(20);
const GROUND_M: f64 = 10.0;
const HOME: (f64, f64) = (37.411, -6.001);
/// A burst is a run of bytes with no longer pause than this between them.
const BURST_PAUSE: Duration = Duration::from_millis(3);

#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    Ground,
    Starting { until: Duration },
    Climb,
    Hover,
    Descent,
    Stopping { until: Duration },
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Waypoint {
    /// Latitude, longitude in 10⁻⁷ °, altitude in mm.
    raw: [i32; 3],
}

/// A frame that is being sent, or waits.
#[derive(Clone, Debug)]
struct Out {
    header: u8,
    payload: Vec<u8>,
    acknowledges: u8,
    /// An error that goes with a status.
    error: Option<u16>,
}

pub struct Dsp {
    fault: Fault,
    profile: Profile,
    byte: Duration,
    now: Duration,
    booted: Duration,
    clock_start: u32,
    // Receiver.
    line: VecDeque<(Duration, u8)>,
    line_free: Duration,
    frame: Vec<u8>,
    skip: bool,
    last_byte: Duration,
    burst: usize,
    after_noise: bool,
    // Sender.
    acks: VecDeque<(Duration, Out)>,
    alarm: bool,
    flow: Option<u8>,
    statuses: VecDeque<Out>,
    error_of_status: Option<u16>,
    sending: Option<(Vec<u8>, Duration, bool)>,
    number: u8,
    frames_sent: u64,
    output: Vec<u8>,
    // State.
    words: [u16; PORTS_16.len()],
    floats: [f32; PORTS_32.len()],
    late_writes: VecDeque<(Duration, u16, u16)>,
    reads: u32,
    status_due: Option<Duration>,
    flow_due: Option<Duration>,
    timeout_due: Option<Duration>,
    last_time: u32,
    time_repeats: bool,
    errors: VecDeque<u16>,
    started_up: bool,
    awaits_flow: bool,
    reported_profile: Option<Duration>,
    last_command: Option<(u8, Vec<u8>, Out)>,
    waypoint_number: Option<u8>,
    count: u16,
    path: VecDeque<Waypoint>,
    phase: Phase,
    tick: Duration,
    place: [f64; 3],
}

impl Dsp {
    pub fn new(profile: Profile, baud: u32, fault: Fault) -> Dsp {
        let mut dsp = Dsp {
            fault,
            profile,
            byte: Duration::from_nanos(10_000_000_000 / u64::from(baud)),
            now: Duration::ZERO,
            booted: Duration::ZERO,
            clock_start: match fault {
                Fault::ClockStops | Fault::WrapResets => u32::MAX - 90_000_000,
                _ => 0,
            },
            line: VecDeque::new(),
            line_free: Duration::ZERO,
            frame: Vec::new(),
            skip: false,
            last_byte: Duration::ZERO,
            burst: 0,
            after_noise: false,
            acks: VecDeque::new(),
            alarm: false,
            flow: None,
            statuses: VecDeque::new(),
            error_of_status: None,
            sending: None,
            number: 0,
            frames_sent: 0,
            output: Vec::new(),
            words: [0; PORTS_16.len()],
            floats: [0.0; PORTS_32.len()],
            late_writes: VecDeque::new(),
            reads: 0,
            status_due: None,
            flow_due: None,
            timeout_due: None,
            last_time: 0,
            time_repeats: false,
            errors: VecDeque::new(),
            started_up: false,
            awaits_flow: false,
            reported_profile: None,
            last_command: None,
            waypoint_number: None,
            count: 0,
            path: VecDeque::new(),
            phase: Phase::Ground,
            tick: Duration::ZERO,
            place: [HOME.0, HOME.1, GROUND_M],
        };
        dsp.boot(Duration::ZERO);
        dsp
    }

    /// The same with a clock that will wrap soon.
    pub fn near_wrap(mut self) -> Dsp {
        self.clock_start = u32::MAX - 8_000;
        self
    }

    fn is(&self, fault: Fault) -> bool {
        self.fault == fault
    }

    fn boot(&mut self, now: Duration) {
        let mask = self.words.first().copied().unwrap_or(0);
        for (word, port) in self.words.iter_mut().zip(PORTS_16) {
            *word = port.boot.cast_unsigned() as u16;
            if self.fault == Fault::BootsWith(port.number) {
                *word += 1;
            }
            if self.fault == Fault::ReadsOtherRange(port.number) {
                *word = 501;
                if port.number == 10_210 {
                    *word = 3_001;
                }
            }
        }
        for (float, port) in self.floats.iter_mut().zip(PORTS_32) {
            *float = port.boot;
            if self.fault == Fault::BootsWith(port.number) {
                *float += 0.5;
            }
            if self.fault == Fault::ReadsOtherRange(port.number) {
                *float = port.max + 1.0;
            }
        }
        if self.is(Fault::KeepsMask) {
            self.words[0] = mask;
        }
        if !self.is(Fault::KeepsClock) {
            self.booted = now;
        } else {
            self.clock_start = 3_600_000;
        }
        if now > Duration::ZERO && !self.is(Fault::KeepsClock) {
            self.clock_start = 0;
        }
        self.acks.clear();
        self.alarm = false;
        self.flow = None;
        self.statuses.clear();
        self.error_of_status = None;
        self.sending = None;
        if !self.is(Fault::KeepsNumbers) {
            self.number = 0;
        }
        self.status_due = None;
        self.flow_due = None;
        self.timeout_due = None;
        self.errors.clear();
        self.started_up = false;
        self.awaits_flow = false;
        self.reported_profile = None;
        self.last_command = None;
        self.waypoint_number = None;
        self.count = if self.is(Fault::CountsFromFive) { 5 } else { 0 };
        self.path.clear();
        self.frame.clear();
        self.skip = false;
        if self.is(Fault::SendsAtBoot) && now > Duration::ZERO {
            self.alarm = true;
        }
        if self.is(Fault::ActiveAtBoot) && now > Duration::ZERO {
            self.status_due = Some(now + 1_700 * MS);
        }
    }

    fn word(&self, number: u16) -> u16 {
        let index = PORTS_16.iter().position(|port| port.number == number);
        self.words[index.expect("a port")]
    }

    fn float(&self, number: u16) -> f32 {
        let index = PORTS_32.iter().position(|port| port.number == number);
        self.floats[index.expect("a port")]
    }

    fn error(&mut self, code: u16) {
        if code == 0 {
            return;
        }
        let places = match self.fault {
            Fault::ErrorPlaces(places) => places,
            _ => 16,
        };
        if self.is(Fault::ErrorsAtOnce) {
            let out = self.out(0xE6, digits(u32::from(code), 3));
            self.acks.push_back((self.now, out));
        } else if self.errors.len() < places {
            self.errors.push_back(code);
        } else if self.is(Fault::DropsOldestError) {
            self.errors.pop_front();
            self.errors.push_back(code);
        }
    }

    fn out(&self, header: u8, payload: Vec<u8>) -> Out {
        Out {
            header,
            payload,
            acknowledges: 0,
            error: None,
        }
    }

    // Receiving.

    fn take_byte(&mut self, byte: u8) {
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

    fn headers(&self) -> [u8; 2] {
        match self.profile {
            Profile::Classic => [0xF0, 0x99],
            Profile::Extended => [0xB3, 0xB3],
        }
    }

    fn begin_frame(&mut self, byte: u8) {
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

    fn meet_other_profile(&mut self) {
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
    fn around(&self) -> (usize, usize) {
        match self.profile {
            Profile::Classic => (1, 1),
            Profile::Extended => (3, 5),
        }
    }

    fn continue_frame(&mut self) {
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

    fn judge(&mut self, frame: &[u8], kind: u8) {
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
        if kind == 0x19 {
            self.take_waypoint(payload, sequence);
        } else {
            self.take_command(payload, sequence);
        }
        if !(self.is(Fault::TimeoutIgnoresReads) && code == 0) {
            self.restart_timeout();
        }
    }

    /// Whether an unused bit is set.
    fn padding(&self, kind: u8, payload: &[u8]) -> bool {
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

    fn restart_timeout(&mut self) {
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

    fn acknowledge(&mut self, header: u8, code: u8, data: Vec<u8>, sequence: Option<u8>) -> Out {
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

    fn take_command(&mut self, payload: &[u8], sequence: Option<u8>) {
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

    fn activate(&mut self) {
        let due = match self.fault {
            Fault::FirstStatusAtOnce => self.now,
            _ => self.now + self.status_period(),
        };
        self.status_due = match (self.status_due, self.fault) {
            (Some(_), Fault::ActivateSwitches) => None,
            (Some(old), fault) if fault != Fault::ActivateRestarts => Some(old),
            _ => Some(due),
        };
    }

    fn follow(&mut self, on: bool) {
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

    fn drop_path(&mut self) {
        self.path.clear();
        if !self.is(Fault::KeepsWaypointNumber) {
            self.waypoint_number = None;
        }
    }

    fn status_period(&self) -> Duration {
        let factor = match self.fault {
            Fault::PeriodFactor(factor) => factor,
            _ => 1,
        };
        MS * u32::from(self.word(10_001)).max(1) * factor
    }

    fn flow_period(&self) -> Duration {
        MS * u32::from(self.word(10_002)).max(1)
    }

    fn read_word(&mut self, number: u16) -> Option<u16> {
        self.reads += 1;
        match number {
            10_003 if self.is(Fault::CountWithoutBit15) => Some(self.count),
            10_003 => Some(0x8000 | self.count & 0x7FFF),
            10_121 => Some(u16::from(
                self.takes_off() && !self.is(Fault::TakeOffReadsZero)
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

    fn write_word(&mut self, number: u16, value: u16) -> bool {
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

    fn change_periods(&mut self, number: u16) {
        let (status, flow) = (
            self.now + self.status_period(),
            self.now + self.flow_period(),
        );
        let keeps = self.is(Fault::KeepsOldPeriod);
        let from_now = self.is(Fault::CountsNewPeriodFromNow);
        let change = |due: &mut Option<Duration>, new: Duration| {
            if let Some(due) = due {
                *due = match () {
                    () if keeps => *due,
                    () if from_now => new,
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

    fn write_float(&mut self, number: u16, bits: u32) -> bool {
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

    // Flight.

    fn flies(&self) -> bool {
        matches!(self.phase, Phase::Climb | Phase::Hover | Phase::Descent)
    }

    fn takes_off(&self) -> bool {
        matches!(self.phase, Phase::Starting { .. } | Phase::Climb) || self.awaits_flow
    }

    fn order_take_off(&mut self, value: u16) -> bool {
        if value != 1 && !self.is(Fault::AnyValueMoves) {
            return false;
        }
        if self.takes_off() {
            return !self.is(Fault::RefusesTakeOffAgain);
        }
        if self.is(Fault::TakesOffDuringLanding) && self.phase == Phase::Descent {
            return true;
        }
        let may = self.started_up || self.is(Fault::TakesOffWithoutStartUp);
        if self.phase != Phase::Ground || !may {
            return false;
        }
        self.phase = Phase::Starting {
            until: self.now + 1_500 * MS,
        };
        self.awaits_flow = self.flow_due.is_some();
        self.tick = self.now + TICK;
        true
    }

    fn order_landing(&mut self, value: u16) -> bool {
        if value != 1 && !self.is(Fault::AnyValueMoves) {
            return false;
        }
        if matches!(self.phase, Phase::Descent | Phase::Stopping { .. }) {
            return !self.is(Fault::RefusesLandAgain);
        }
        if self.is(Fault::LandsDuringTakeOff) && self.takes_off() {
            return true;
        }
        if self.phase != Phase::Hover || self.awaits_flow {
            return self.is(Fault::SilentAboutLandOnGround) && self.phase == Phase::Ground;
        }
        self.drop_path();
        self.phase = Phase::Descent;
        true
    }

    fn take_waypoint(&mut self, payload: &[u8], sequence: Option<u8>) {
        let raw = [0, 5, 10].map(|at| number(&payload[at..at + 5]).cast_signed());
        let waypoint = Waypoint { raw };
        if sequence.is_some()
            && sequence == self.waypoint_number
            && !self.is(Fault::TakesWaypointCopies)
        {
            return;
        }
        if self.is(Fault::RefusedWaypointLeavesNumber) {
            self.waypoint_number = sequence;
        }
        if self.is(Fault::TakesWaypointsDuringTakeOff) && self.takes_off() {
            return;
        }
        let accepts = self.phase == Phase::Hover && !self.awaits_flow && self.flow_due.is_some();
        let [latitude, longitude, altitude] = raw.map(f64::from);
        let is_within = latitude.abs() <= 90e7
            && longitude.abs() <= 180e7
            && (-1_000_000.0..=20_000_000.0).contains(&altitude)
            || self.is(Fault::TakesAnyWaypoint);
        let is_high = altitude >= (GROUND_M + 0.5) * 1e3
            || self.is(Fault::TakesLowWaypoints)
            || self.is(Fault::TakesAnyWaypoint);
        if !accepts || !is_within || !is_high {
            if !(self.is(Fault::SilentAboutWaypointsOnGround) && self.phase == Phase::Ground) {
                self.error(30);
            }
            return;
        }
        let is_equal = self.path.back().is_some_and(|newest| {
            *newest == waypoint
                || self.is(Fault::EqualByPosition) && newest.raw[..2] == waypoint.raw[..2]
        });
        if is_equal && !self.is(Fault::TakesEqualWaypoints) {
            return;
        }
        let places = match self.fault {
            Fault::Places(places) => places,
            _ => 16,
        };
        if self.path.len() >= places {
            return self.error(match self.fault {
                Fault::FullIs(code) => code,
                _ => 15,
            });
        }
        self.path.push_back(waypoint);
        self.waypoint_number = sequence;
        if !self.is(Fault::CountsNothing) {
            self.count = (self.count + 1) & 0x7FFF;
        }
    }

    fn fly(&mut self) {
        let step = 2.0 * TICK.as_secs_f64();
        match self.phase {
            Phase::Ground => {}
            Phase::Starting { until } => {
                if self.now >= until {
                    self.phase = Phase::Climb;
                }
            }
            Phase::Climb => {
                let height = match self.fault {
                    Fault::ClimbsToTen => 10.0,
                    _ => f64::from(self.float(20_121)),
                };
                self.place[2] += step;
                if self.place[2] >= GROUND_M + height {
                    self.place[2] = GROUND_M + height;
                    self.phase = Phase::Hover;
                }
            }
            Phase::Hover => self.fly_path(),
            Phase::Descent => {
                self.place[2] -= step;
                if self.place[2] <= GROUND_M {
                    self.place[2] = GROUND_M;
                    self.phase = Phase::Stopping {
                        until: self.now + 1_000 * MS,
                    };
                }
            }
            Phase::Stopping { until } => {
                if self.now >= until {
                    self.phase = Phase::Ground;
                }
            }
        }
    }

    fn fly_path(&mut self) {
        let Some(waypoint) = self.path.front().copied() else {
            return;
        };
        let [latitude, longitude, altitude] = waypoint.raw.map(f64::from);
        let north = (latitude / 1e7 - self.place[0]) * 111_000.0;
        let east = (longitude / 1e7 - self.place[1]) * 88_000.0;
        let up = altitude / 1e3 - self.place[2];
        let distance = (north * north + east * east + up * up).sqrt();
        if distance <= f64::from(self.float(20_002)) && up.abs() < 0.1 {
            if !self.is(Fault::ReachedStays) {
                self.path.pop_front();
            }
            return;
        }
        // Slow ahead, quick upwards, as the ports say.
        let ahead = f64::from(self.float(20_000)) * TICK.as_secs_f64() / distance.max(0.01);
        let climb = f64::from(self.float(20_001)) * TICK.as_secs_f64();
        self.place[0] += north * ahead.min(1.0) / 111_000.0;
        self.place[1] += east * ahead.min(1.0) / 88_000.0;
        let is_steep = north.abs() + east.abs() < 1.0;
        let most = if is_steep { climb } else { climb.min(0.002) };
        self.place[2] += up.clamp(-most, most);
    }

    // Sending.

    fn queue_status(&mut self) {
        let busy = !self.statuses.is_empty()
            || self.sending.as_ref().is_some_and(|(_, _, status)| *status)
                && !self.is(Fault::StatusBeforeAck);
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

    fn clock(&mut self) -> u32 {
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

    fn group(&self, group: Group, time: u32) -> Vec<u8> {
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

    fn queue_flow(&mut self) {
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
    fn send(&mut self) {
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
        if let Some(code) = self.error_of_status.take() {
            let out = self.out(0xE6, digits(u32::from(code), 3));
            if self.is(Fault::TwoErrorsForStatus) {
                self.error_of_status = self.errors.pop_front();
            }
            return self.begin(out);
        }
        let now = self.now;
        if self.is(Fault::StatusBeforeAck)
            && let Some(out) = self.statuses.pop_front()
        {
            return self.begin_status(out);
        }
        if self.acks.front().is_some_and(|(from, _)| *from <= now)
            && let Some((_, out)) = self.acks.pop_front()
        {
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

    fn begin_status(&mut self, out: Out) {
        self.error_of_status = out.error;
        self.begin(out);
    }

    fn begin(&mut self, out: Out) {
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
        let is_wrong = self.is(Fault::SendsWrongCheckField) && self.frames_sent.is_multiple_of(30);
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

    fn next_event(&self) -> Option<Duration> {
        let tick = (self.phase != Phase::Ground).then_some(self.tick);
        [
            self.line.front().map(|(at, _)| *at),
            self.sending.as_ref().map(|(_, until, _)| *until),
            self.acks
                .front()
                .filter(|_| self.sending.is_none())
                .map(|(from, _)| *from),
            self.late_writes.front().map(|(at, _, _)| *at),
            self.status_due,
            self.flow_due,
            self.timeout_due,
            tick,
        ]
        .into_iter()
        .flatten()
        .min()
    }

    fn happen(&mut self) {
        let now = self.now;
        if let Some((frame, _, _)) = self.sending.take_if(|(_, until, _)| *until <= now) {
            self.output.extend(frame);
        }
        while let Some((_, byte)) = due(&mut self.line, |(at, _)| *at <= now) {
            self.take_byte(byte);
        }
        while let Some((_, number, value)) = due(&mut self.late_writes, |(at, _, _)| *at <= now) {
            let index = PORTS_16.iter().position(|port| port.number == number);
            self.words[index.expect("a port")] = value;
            self.change_periods(number);
        }
        if self.timeout_due.take_if(|due| *due <= now).is_some() && !self.path.is_empty() {
            self.drop_path();
        }
        if self.phase != Phase::Ground && self.tick <= now {
            self.tick = now + TICK;
            self.fly();
        }
        if self.status_due.is_some_and(|due| due <= now) {
            self.status_due = Some(now + self.status_period());
            self.queue_status();
        }
        if self.flow_due.is_some_and(|due| due <= now) {
            self.flow_due = Some(now + self.flow_period());
            self.queue_flow();
        }
        self.send();
    }
}

impl Peer for Dsp {
    fn receive(&mut self, now: Duration, bytes: &[u8]) {
        self.advance(now);
        for byte in bytes {
            self.line_free = self.line_free.max(now) + self.byte;
            self.line.push_back((self.line_free, *byte));
        }
    }

    fn advance(&mut self, now: Duration) {
        while let Some(next) = self.next_event().filter(|next| *next <= now) {
            self.now = self.now.max(next);
            self.happen();
        }
        self.now = self.now.max(now);
    }

    fn next_deadline(&self) -> Option<Duration> {
        self.next_event()
    }

    fn take_output(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.output)
    }

    fn reset(&mut self, now: Duration) {
        self.advance(now);
        self.boot(now);
        self.happen();
    }
}

/// Takes the first of a queue, if it is due.
fn due<T>(queue: &mut VecDeque<T>, is_due: impl Fn(&T) -> bool) -> Option<T> {
    if queue.front().is_some_and(is_due) {
        return queue.pop_front();
    }
    None
}

/// The `count` digits of a value, the most significant one first.
fn digits(value: u32, count: usize) -> Vec<u8> {
    let shifts = (0..count).rev().map(|digit| 7 * digit as u32);
    shifts
        .map(|shift| (u64::from(value) >> shift) as u8 & 0x7F)
        .collect()
}

/// The value of digits.
fn number(digits: &[u8]) -> u32 {
    let fold = |value: u64, digit: &u8| value << 7 | u64::from(*digit);
    digits.iter().fold(0, fold) as u32
}

/// What happens to bytes with `rate` damaged: one bit of each of those is changed.
pub struct Damaged<P> {
    pub peer: P,
    pub random: fastrand::Rng,
    pub rate: f64,
}

impl<P> Damaged<P> {
    fn damage(&mut self, bytes: &mut [u8]) {
        for byte in bytes {
            if self.random.f64() < self.rate {
                *byte ^= 1 << self.random.u8(0..8);
            }
        }
    }
}

impl<P: Peer> Peer for Damaged<P> {
    fn receive(&mut self, now: Duration, bytes: &[u8]) {
        let mut bytes = bytes.to_vec();
        self.damage(&mut bytes);
        self.peer.receive(now, &bytes);
    }

    fn advance(&mut self, now: Duration) {
        self.peer.advance(now);
    }

    fn next_deadline(&self) -> Option<Duration> {
        self.peer.next_deadline()
    }

    fn take_output(&mut self) -> Vec<u8> {
        let mut bytes = self.peer.take_output();
        self.damage(&mut bytes);
        bytes
    }

    fn reset(&mut self, now: Duration) {
        self.peer.reset(now);
    }
}
