//! The conformance kit for firmware of the DSP: it plays the PC and judges which sentences of `docs/protocol.md` a DSP
//! keeps.
//!
//! Written from that page. What is sent and judged shares no code with the bridge, so what the two of them ask of a DSP
//! is the page alone; frames are those of [`dsp_protocol`]. The serial port of [`cli`] and [`shell`], around it, is the
//! bridge's.
//!
//! * [`table`]: the checks, each with its sentence, what is sent, what must come back; [`checks`] has them by topic;
//! * [`permitted`]: what may be sent, and that nothing else is: without [`permitted::RotorDisconnected`] no type can
//!   express a message that moves a rotor;
//! * [`wire`]: the line as a value; [`bench`](mod@bench): a check's end of it; [`monitor`]: what is judged of all
//!   messages;
//! * [`run`]: the whole run as a value that is given time and bytes; [`report`]: what it found; [`replay`]: a dialogue
//!   that is played again.
//!
//! Nothing else has a port, a clock or a thread. A check is linear code that sends and waits, as a suspended function;
//! the value around it goes on when time or bytes come.
//!
//! # Example
//!
//! A DSP that answers nothing:
//!
//! ```
//! use std::time::Duration;
//!
//! use conform::wire::Setup;
//! use conform::report::Ended;
//! use conform::run::{Conformance, Player, Settings};
//! use dsp_protocol::{Profile, Sequence};
//!
//! let mut run = Conformance::new(Settings {
//!     setup: Setup {
//!         profile: Profile::Classic,
//!         baud: None,
//!         slack: Duration::from_millis(5),
//!         first_number: Sequence::FIRST,
//!         is_lossy: false,
//!     },
//!     can_reset: false,
//!     proof: None,
//!     only: Vec::new(),
//! });
//! let mut sent = Vec::new();
//! run.step(Duration::ZERO, &[]);
//! while let Some(next) = run.next_deadline() {
//!     sent.extend(run.take_outbox());
//!     run.step(next, &[]);
//! }
//! assert!(run.is_finished());
//! assert_eq!(run.report().ended_early, Some(Ended::Silent));
//! assert_eq!(sent[..6], [0xF0, 0x00, 0x00, 0x4F, 0x09, 0x48], "it reads port 10121");
//! ```

pub mod arrival;
pub mod bench;
pub mod check;
pub mod checks;
pub mod cli;
pub mod monitor;
pub mod outcome;
pub mod permitted;
mod pilot;
pub mod replay;
pub mod report;
pub mod run;
pub mod shell;
pub mod table;
pub mod wire;
