//! Faults on purpose: a seeded, timed script of what goes wrong between PC and DSP.
//!
//! ```text
//!            ┌────────────────────── injector ──────────────────────┐
//! DSP ─▶ serial link ─▶ messages (dropped …) ─▶ bytes (flipped, late …) ─▶ PC
//! DSP ◀───────── messages ◀─────────────── bytes ◀─────────── serial link ◀─ PC
//!  ▲
//!  └──────────── events (errors, reboots, hangs, jumps of the clock)  ─▶ port (hang-up)
//! ```
//!
//! The [`Injector`] is a pure value: it is given bytes with the simulated time at which they went through the serial
//! link, and is drained of bytes and events. It knows no clock, thread or file, and never acts on the DSP or the port
//! itself: the simulator does what its events describe, and the process behind the simulator hangs up a real
//! pseudo-terminal.
//!
//! Faults depend on script, bytes and times alone, byte for byte, however the clock steps. All that is held is bounded;
//! what does not fit is dropped and counted ([`FaultCounters`]).
//!
//! # Example
//!
//! A DSP that reboots after a second, behind a serial link that loses one byte in ten:
//!
//! ```
//! use std::time::Duration;
//!
//! use dsp_protocol::{Command, Uplink};
//! use dsp_sim::faults::{Damage, Directions, DspEvent, Fault, Script, Times, Window};
//! use dsp_sim::simulator::{Setup, Simulator};
//!
//! let script = Script {
//!     seed: 7,
//!     faults: vec![
//!         Fault::Bytes {
//!             direction: Directions::ToPc,
//!             window: Window::since(Duration::from_millis(300)),
//!             damage: Damage::Drop { rate: 0.1 },
//!         },
//!         Fault::Dsp {
//!             times: Times::once(Duration::from_secs(1)),
//!             event: DspEvent::Reboot,
//!         },
//!     ],
//! };
//! let mut simulator = Simulator::new(Setup { faults: Some(script), ..Setup::default() });
//! let activate = Uplink::Command(Command::ActivateStatus);
//! simulator.receive(Duration::ZERO, activate.encode().as_bytes());
//! simulator.advance(Duration::from_secs(2));
//! let counters = simulator.faults().expect("there is a script");
//! assert_eq!(counters.reboots, 1);
//! assert!(counters.to_pc.bytes.dropped > 0);
//! assert_eq!(counters.to_dsp.lost(), 0);
//! ```

mod bytes;
mod counters;
mod messages;
mod script;
mod table;
mod timetable;

use std::collections::VecDeque;
use std::time::Duration;

use dsp_protocol::{Downlink, Profile, Uplink};

use crate::random::Random;

pub use bytes::QUEUE_PLACES;
pub use counters::{ByteCounters, DirectionCounters, FaultCounters, MessageCounters};
pub use script::{
    Act, AfterStall, Damage, Direction, Directions, DspEvent, Fault, Happening, HelicopterEvent,
    MIN_PERIOD, MessageKind, Script, Times, Window,
};
pub use table::{FaultKind, MAX_FAULTS};

use bytes::ByteStage;
use messages::{MessageFault, MessageStage};
use timetable::{Event, Timetable};

/// Number of the first stream of random numbers that faults draw from: those of wind and noise lie far below, so that
/// one seed for both repeats nothing.
const FIRST_STREAM: u64 = 1 << 16;

/// Whether the serial port of the PC is there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PortState {
    /// How often it was hung up so far. Whoever sees two more than before has missed a return.
    pub hang_ups: u64,
    /// Whether it is gone now.
    pub is_gone: bool,
    /// Whether it comes back, or came back last, as another device.
    pub elsewhere: bool,
}

/// A script at work.
#[derive(Clone, Debug)]
pub struct Injector {
    to_pc: ToPc,
    to_dsp: ToDsp,
    timetable: Timetable,
    port: PortState,
    /// When the port comes back.
    port_returns: Option<Duration>,
    /// All but those of the two directions, which have their own.
    counters: FaultCounters,
}

/// From the DSP to the PC: faults first drop messages, then the serial link damages them.
#[derive(Clone, Debug)]
struct ToPc {
    messages: MessageStage<Downlink>,
    bytes: ByteStage,
    entered: u64,
    left: u64,
}

/// From the PC to the DSP: the serial link damages bytes, then faults drop what is left of the messages.
#[derive(Clone, Debug)]
struct ToDsp {
    bytes: ByteStage,
    messages: MessageStage<Uplink>,
    /// What the DSP gets now: a message that has just become whole.
    ready: VecDeque<u8>,
    entered: u64,
    left: u64,
}

impl Injector {
    /// Begins a script on a serial link of `profile`.
    pub fn new(script: &Script, profile: Profile) -> Injector {
        let mut injector = Injector {
            to_pc: ToPc {
                messages: MessageStage::new(profile),
                bytes: ByteStage::default(),
                entered: 0,
                left: 0,
            },
            to_dsp: ToDsp {
                bytes: ByteStage::default(),
                messages: MessageStage::new(profile),
                ready: VecDeque::new(),
                entered: 0,
                left: 0,
            },
            timetable: Timetable::new(&script.faults),
            port: PortState::default(),
            port_returns: None,
            counters: FaultCounters::default(),
        };
        for (index, fault) in script.faults.iter().enumerate() {
            injector.add(fault, |direction| {
                let stream = FIRST_STREAM + 2 * index as u64 + direction as u64;
                Random::new(script.seed, stream)
            });
        }
        injector
    }

    /// Takes a byte that went through the serial link at `at`, which is no earlier than that of the byte before on
    /// the same way.
    pub fn enter(&mut self, direction: Direction, at: Duration, byte: u8) {
        match direction {
            Direction::ToPc => self.to_pc.enter(at, byte),
            Direction::ToDsp => self.to_dsp.enter(at, byte),
        }
    }

    /// Gives the next byte that comes out by `now`. Call it only when every byte that went through the serial link by
    /// `now` has entered.
    pub fn leave(&mut self, direction: Direction, now: Duration) -> Option<u8> {
        match direction {
            Direction::ToPc => self.to_pc.leave(now),
            Direction::ToDsp => self.to_dsp.leave(now),
        }
    }

    /// When a byte comes out, an event is due, or the port returns.
    pub fn next_deadline(&self) -> Option<Duration> {
        [
            self.to_pc.messages.next_deadline(),
            self.to_pc.bytes.next_deadline(),
            self.to_dsp.messages.next_deadline(),
            self.to_dsp.bytes.next_deadline(),
            self.timetable.next_deadline(),
            self.port_returns,
        ]
        .into_iter()
        .flatten()
        .min()
    }

    /// Does what is due by `now` to the port, and gives the next thing that is due to happen to the DSP or the
    /// helicopter; call it until there is nothing.
    pub fn next_event(&mut self, now: Duration) -> Option<Happening> {
        while let Some((due, event)) = self.timetable.take(now) {
            match event {
                Event::Happens(happening) => {
                    self.counters.count(happening);
                    return Some(happening);
                }
                Event::HangUp { length, elsewhere } => self.hang_up(due, length, elsewhere),
            }
        }
        if self.port_returns.is_some_and(|returns| returns <= now) {
            self.port_returns = None;
            self.port.is_gone = false;
        }
        None
    }

    /// Whether the port is there. It changes in [`next_event`](Self::next_event) alone.
    pub fn port(&self) -> PortState {
        self.port
    }

    /// Counts bytes from the PC that came out while the DSP hung.
    pub fn count_missed(&mut self, count: u64) {
        self.counters.missed_bytes += count;
    }

    /// Counts bytes to the PC that came out while the port was gone.
    pub fn count_unplugged(&mut self, count: u64) {
        self.counters.unplugged_bytes += count;
    }

    /// What was done so far.
    pub fn counters(&self) -> FaultCounters {
        let (to_pc, to_dsp) = (&self.to_pc, &self.to_dsp);
        FaultCounters {
            to_pc: DirectionCounters {
                entered: to_pc.entered,
                left: to_pc.left,
                bytes: to_pc.bytes.counters(),
                messages: to_pc.messages.counters(),
            },
            to_dsp: DirectionCounters {
                entered: to_dsp.entered,
                left: to_dsp.left,
                bytes: to_dsp.bytes.counters(),
                messages: to_dsp.messages.counters(),
            },
            ..self.counters
        }
    }

    /// Bytes that have entered and neither come out nor been lost, and added ones.
    pub fn waiting(&self, direction: Direction) -> usize {
        match direction {
            Direction::ToPc => self.to_pc.messages.waiting() + self.to_pc.bytes.waiting(),
            Direction::ToDsp => {
                let ToDsp {
                    bytes,
                    messages,
                    ready,
                    ..
                } = &self.to_dsp;
                bytes.waiting() + messages.waiting() + ready.len()
            }
        }
    }

    /// Puts a fault in its place; `random` makes the random numbers for a direction.
    fn add(&mut self, fault: &Fault, random: impl Fn(Direction) -> Random) {
        match *fault {
            Fault::Bytes {
                direction,
                window,
                damage,
            } => {
                for (each, bytes) in [
                    (Direction::ToPc, &mut self.to_pc.bytes),
                    (Direction::ToDsp, &mut self.to_dsp.bytes),
                ] {
                    if direction.contain(each) {
                        bytes.add(window, damage, random(each));
                    }
                }
            }
            Fault::Messages {
                message,
                window,
                rate,
                act,
            } => {
                let direction = message.direction();
                let fault = MessageFault::new(message, window, rate, act, random(direction));
                match direction {
                    Direction::ToPc => self.to_pc.messages.add(fault),
                    Direction::ToDsp => self.to_dsp.messages.add(fault),
                }
            }
            // The timetable has them.
            Fault::Dsp { .. } | Fault::Helicopter { .. } | Fault::HangUp { .. } => {}
        }
    }

    /// A port that is hung up again while it is gone stays away for the longer of both times.
    fn hang_up(&mut self, due: Duration, length: Duration, elsewhere: bool) {
        let returns = due.saturating_add(length);
        self.port_returns = self.port_returns.max(Some(returns));
        self.port = PortState {
            hang_ups: self.port.hang_ups + 1,
            is_gone: true,
            elsewhere,
        };
        self.counters.hang_ups += 1;
    }
}

impl ToPc {
    fn enter(&mut self, at: Duration, byte: u8) {
        self.entered += 1;
        let bytes = &mut self.bytes;
        self.messages.enter(at, byte, &mut |at, message| {
            message.iter().for_each(|byte| bytes.enter(at, *byte));
        });
    }

    fn leave(&mut self, now: Duration) -> Option<u8> {
        let bytes = &mut self.bytes;
        self.messages.release(now, &mut |at, message| {
            message.iter().for_each(|byte| bytes.enter(at, *byte));
        });
        let (_, byte) = self.bytes.leave(now)?;
        self.left += 1;
        Some(byte)
    }
}

impl ToDsp {
    fn enter(&mut self, at: Duration, byte: u8) {
        self.entered += 1;
        self.bytes.enter(at, byte);
    }

    fn leave(&mut self, now: Duration) -> Option<u8> {
        while self.ready.is_empty() {
            let ready = &mut self.ready;
            let mut sink = |_, message: &[u8]| ready.extend(message);
            match self.bytes.leave(now) {
                Some((at, byte)) => self.messages.enter(at, byte, &mut sink),
                None => {
                    self.messages.release(now, &mut sink);
                    break;
                }
            }
        }
        let byte = self.ready.pop_front()?;
        self.left += 1;
        Some(byte)
    }
}

#[cfg(test)]
mod tests;
