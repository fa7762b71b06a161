//! Faults on purpose: a seeded, timed script of what goes wrong between PC and DSP.
//!
//! ```text
//!            ┌────────────────────── injector ──────────────────────┐
//! DSP ─▶ line ─▶ messages (swallowed …) ─▶ bytes (flipped, late …) ─▶ PC
//! DSP ◀───────── messages ◀─────────────── bytes ◀─────────── line ◀─ PC
//!  ▲
//!  └──────────── events (errors, reboots, hangs, jumps of the clock)  ─▶ port (hang-up)
//! ```
//!
//! The [`Injector`] is a pure value: it is given bytes with the simulated time at which they went through the line, and
//! is drained of bytes and events. It knows no clock, thread or file, and never acts on the DSP or the port itself: the
//! simulator does what its events say, and the process behind the simulator hangs up a real pseudo-terminal.
//!
//! The same script, bytes and times give the same faults, byte for byte, however the clock steps. All that is held is
//! bounded; what does not fit is dropped and counted ([`FaultCounters`]).
//!
//! # Example
//!
//! A DSP that reboots after a second, behind a line that loses one byte in ten:
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
//! assert!(counters.to_pc.dropped > 0);
//! assert_eq!(counters.to_dsp.dropped, 0);
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
pub use counters::{DirectionCounters, FaultCounters};
pub use script::{
    Act, AfterStall, Damage, Direction, Directions, DspEvent, Fault, MIN_PERIOD, MessageKind,
    Script, Times, Window,
};
pub use table::{Kind, MAX_FAULTS};

use bytes::ByteStage;
use messages::MessageStage;
use timetable::{Event, Timetable};

/// Number of the first stream of random numbers that faults draw from: those of wind and noise lie far below, so that one
/// seed for both repeats nothing.
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
    downlink: MessageStage<Downlink>,
    to_pc: ByteStage,
    to_dsp: ByteStage,
    uplink: MessageStage<Uplink>,
    /// Bytes that the DSP gets now: those of a message that has just become whole.
    heard: VecDeque<u8>,
    timetable: Timetable,
    port: PortState,
    /// When the port comes back.
    port_returns: Option<Duration>,
    counters: FaultCounters,
}

impl Injector {
    /// Begins a script on a line that speaks `profile`.
    pub fn new(script: &Script, profile: Profile) -> Injector {
        let mut injector = Injector {
            downlink: MessageStage::new(profile),
            to_pc: ByteStage::default(),
            to_dsp: ByteStage::default(),
            uplink: MessageStage::new(profile),
            heard: VecDeque::new(),
            timetable: Timetable::new(&script.faults),
            port: PortState::default(),
            port_returns: None,
            counters: FaultCounters::default(),
        };
        for (index, fault) in script.faults.iter().enumerate() {
            // A stream for each direction.
            let stream = FIRST_STREAM + 2 * index as u64;
            injector.add(fault, |offset| Random::new(script.seed, stream + offset));
        }
        injector
    }

    /// Takes a byte that went through the line at `at`, which is no earlier than that of the byte before on the same way.
    pub fn enter(&mut self, direction: Direction, at: Duration, byte: u8) {
        match direction {
            Direction::ToPc => {
                let Injector {
                    downlink,
                    to_pc,
                    counters,
                    ..
                } = self;
                counters.to_pc.entered += 1;
                let mut copy = DirectionCounters::default();
                let mut sink = |at: Duration, bytes: &[u8]| {
                    for byte in bytes {
                        to_pc.enter(at, *byte, &mut copy);
                    }
                };
                downlink.enter(at, byte, &mut counters.to_pc, &mut sink);
            }
            Direction::ToDsp => {
                self.counters.to_dsp.entered += 1;
                self.to_dsp.enter(at, byte, &mut self.counters.to_dsp);
            }
        }
    }
}
