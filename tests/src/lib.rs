//! Fixtures for programs that speak with the HERO's Robot Implementation Layer.
//!
//! * [`domain`]: shared memory of a test's own, and the proof that nothing of it is left;
//! * [`stand_in`]: a bridge and a status that publish and answer as they are told;
//! * [`script`]: flights written down as telemetry;
//! * [`process`]: child processes in that domain, their lines, signals and exits;
//! * [`pty`]: a folder for links to pseudo-terminals;
//! * [`watchdog`]: ends a test that hangs.
//!
//! # A consumer and its test
//!
//! ```
//! use std::time::Duration;
//!
//! use ipc_types::Subscriber;
//! use ipc_types::payload::HeroTelemetry;
//! use ril_tests::{Script, StandInStatus, TestDomain};
//!
//! /// The program under test: how high did it fly?
//! fn highest_m(telemetry: &mut Subscriber<HeroTelemetry>) -> f64 {
//!     let (mut highest_m, mut landed) = (f64::MIN, false);
//!     while !landed {
//!         telemetry.wait(Duration::from_secs(10)).unwrap();
//!         telemetry
//!             .drain(|sample| {
//!                 highest_m = highest_m.max(sample.geodetic.altitude_m);
//!                 landed = !sample.is_flying();
//!             })
//!             .unwrap();
//!     }
//!     highest_m
//! }
//!
//! let domain = TestDomain::new();
//! let mut telemetry = domain.join("consumer").subscriber().unwrap();
//! let status = StandInStatus::start(&domain);
//! for sample in Script::at(37.4, -5.9, 10.0).take_off(5.0).land().hero() {
//!     status.publish(&sample);
//! }
//! assert_eq!(highest_m(&mut telemetry), 15.0);
//! ```
//!
//! An operator's program is tested the same way against [`StandInBridge`], which takes its requests.

pub mod domain;
pub mod process;
pub mod pty;
pub mod script;
pub mod stand_in;
pub mod watchdog;

pub use domain::TestDomain;
pub use process::Process;
pub use pty::PtyFolder;
pub use script::Script;
pub use stand_in::{Answer, Received, StandInBridge, StandInStatus};
pub use watchdog::Watchdog;
