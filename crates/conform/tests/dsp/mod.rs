//! A small DSP, written from docs/protocol.md alone: it shares frames, ports and behaviour neither with the bridge nor
//! with the simulator, and can be wrong in each way of [`Fault`]. Its helicopter climbs and flies at 2 m/s and has no
//! inertia.

mod flight;
mod receive;
mod send;

use std::collections::VecDeque;
use std::time::Duration;

use dsp_protocol::Profile;
use dsp_protocol::port::{PORTS_16, PORTS_32};

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

    /// Has the DSP's clock wrap soon.
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
            let number = self.waypoint_number;
            self.drop_path();
            if self.is(Fault::TimeoutKeepsWaypointNumber) {
                self.waypoint_number = number;
            }
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
