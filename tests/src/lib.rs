//! Fixtures for programs that speak with the HERO's Robot Implementation Layer.
//!
//! * [`domain`]: shared memory of a test's own, and the proof that nothing of it is left;
//! * [`stand_in`]: a bridge and a status that publish and answer as they are told;
//! * [`script`], [`recording`]: flights written down as telemetry, and flights from a log of status;
//! * [`garbage`]: payloads of any bit pattern;
//! * [`process`]: child processes in that domain, their lines, signals and exits;
//! * [`chain`]: the real simulator, bridge and status, to start and to kill;
//! * [`pty`]: a folder for links to pseudo-terminals;
//! * [`watchdog`]: ends a test that hangs.
//!
//! # A consumer and its test
//!
//! ```
//! # use std::time::Duration;
//! # use ipc_types::{Subscriber, payload::HeroTelemetry};
//! # use ril_tests::{Script, StandInStatus, TestDomain};
//! /// The program under test: how high did it fly?
//! fn highest_m(telemetry: &mut Subscriber<HeroTelemetry>) -> f64 {
//!     let (mut highest_m, mut landed) = (f64::MIN, false);
//!     while !landed {
//!         telemetry.wait(Duration::from_secs(10)).unwrap();
//!         telemetry.drain(|sample| {
//!             highest_m = highest_m.max(sample.geodetic.altitude_m);
//!             landed = !sample.is_flying();
//!         }).unwrap();
//!     }
//!     highest_m
//! }
//!
//! let domain = TestDomain::new(); // asserts in the end that nothing is left
//! let mut telemetry = domain.join("consumer").subscriber().unwrap();
//! let status = StandInStatus::start(&domain);
//! for sample in Script::at(37.4, -5.9, 10.0).take_off(5.0).land().hero() {
//!     status.publish(&sample);
//! }
//! assert_eq!(highest_m(&mut telemetry), 15.0);
//! ```
//!
//! # An operator's program and its test
//!
//! [`StandInBridge`] takes requests and answers them as it is told: accept, refuse, hang or die.
//!
//! ```
//! # use ipc_types::{code::{Reason, Stage}, payload::MovementData};
//! # use ril_tests::{Answer, Received, StandInBridge, TestDomain, process::WAIT_LIMIT};
//! let domain = TestDomain::new();
//! let bridge = StandInBridge::start(&domain);
//! bridge.answer_next(Answer::Die);
//!
//! let mut client = domain.join("operator").client::<MovementData>().unwrap();
//! let request = MovementData::take_off(7, 10.0);
//! client.send(&request).unwrap();
//! assert_eq!(bridge.next_request(), Received::Movement(request));
//! let mut last = None;
//! while client.outstanding() > 0 {
//!     client.wait(WAIT_LIMIT).unwrap();
//!     client.drain(|report| last = report.stage().zip(report.reason()));
//! }
//! assert_eq!(last, Some((Stage::Unknown, Reason::BridgeGone)));
//! ```
//!
//! `examples/consumer` is a project of its own that uses this library as a stranger would.

pub mod chain;
pub mod domain;
pub mod garbage;
pub mod process;
pub mod pty;
pub mod recording;
pub mod script;
pub mod stand_in;
pub mod watchdog;

pub use chain::Chain;
pub use domain::TestDomain;
pub use garbage::Garbage;
pub use process::Process;
pub use pty::PtyFolder;
pub use recording::Recording;
pub use script::Script;
pub use stand_in::{Answer, PortTable, Received, StandInBridge, StandInPort, StandInStatus};
pub use watchdog::Watchdog;
