//! A stand-in for the flight-control DSP and for the helicopter that it flies.
//!
//! It speaks the DSP's side of `docs/protocol.md`, from which it was written without a look at the bridge: what the two
//! agree on is the page, not a shared piece of code. On one machine it opens a pseudo-terminal, so that no hardware is
//! needed; on a bench it takes a serial port; in a test it is a value that is given bytes and the time.
//!
//! ```text
//!        ┌────────────────────── simulator (pure) ──────────────────────┐
//! port ─▶ serial link ─▶ faults ─▶ device ─▶ orders ─▶ helicopter
//! port ◀─ faults ◀─ serial link ◀─ device ◀─ sensors ◀─ (guidance, control, body, wind)
//! ```
//!
//! * [`simulator`]: all of it behind one facade; [`device`]: the protocol, ports, errors; [`helicopter`]: the flight;
//!   [`serial_link`]: the pace of the bytes; [`faults`]: what goes wrong on purpose, by a script; [`random`]: seeded
//!   numbers. None of them knows a file, a thread or a clock.
//! * [`port`], [`pty`], [`serial_port`], [`shell`], [`cli`], [`config`]: the process around it.
//!
//! Time is simulated, a `Duration` since the start that the caller holds. The same seed and the same bytes at the same
//! times give the same flight, the same answers and the same faults, bit for bit.
//!
//! # Example
//!
//! Take off and fly to a waypoint, in virtual time:
//!
//! ```
//! use std::time::Duration;
//!
//! use dsp_protocol::{Command, Uplink, Waypoint, port};
//! use dsp_sim::helicopter::Phase;
//! use dsp_sim::simulator::{Setup, Simulator};
//!
//! let mut simulator = Simulator::new(Setup::default());
//! let send = |simulator: &mut Simulator, message: Uplink| {
//!     simulator.receive(simulator.now(), message.encode().as_bytes());
//! };
//! let fly_until = |simulator: &mut Simulator, done: fn(&Simulator) -> bool| {
//!     while !done(simulator) {
//!         let next = simulator.next_deadline().expect("something goes on");
//!         simulator.advance(next);
//!         simulator.transmit(|bytes| bytes.len()); // a PC that listens and keeps nothing
//!     }
//! };
//!
//! send(&mut simulator, Uplink::Command(Command::Following { on: true }));
//! send(&mut simulator, Uplink::Command(Command::Write16 { port: port::TAKE_OFF, value: 1 }));
//! fly_until(&mut simulator, |simulator| simulator.dsp().counters().waypoint_requests == 1);
//! assert_eq!(simulator.helicopter().phase(), Phase::Hovering);
//!
//! let waypoint = Waypoint { latitude_deg: 37.4112, longitude_deg: -6.001, altitude_m: 25.0 };
//! send(&mut simulator, Uplink::Waypoint(waypoint));
//! fly_until(&mut simulator, |simulator| simulator.helicopter().arrived() == 1);
//! assert!(simulator.now() < Duration::from_secs(20));
//! ```

pub mod cli;
pub mod config;
pub mod device;
pub mod faults;
pub mod helicopter;
pub mod port;
pub mod pty;
pub mod random;
pub mod serial_link;
pub mod serial_port;
pub mod shell;
pub mod simulator;
