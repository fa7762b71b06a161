//! Fixtures for programs that speak with the HERO's Robot Implementation Layer.
//!
//! What knows the helicopter, on top of `ipc-fixtures`, whose fixtures are here as well: the domain of a test,
//! processes, stand-ins for any topic and request, what a test expects.
//!
//! * [`stand_in`]: a bridge and a status that publish and answer as the test says;
//! * [`script`], [`recording`]: flights written down as telemetry, and flights from a log of status;
//! * [`replay`]: a recorded flight (MCAP) with all its topics, played as far as a test says;
//! * [`stranger`]: a struct that no program knows;
//! * [`sandbox`]: `ril` in a domain and a folder of its own, and what its processes hold; [`relayed`]: two of them with
//!   relays between, and [`air`]: a bad radio between those;
//! * [`pty`]: a folder for links to pseudo-terminals;
//! * [`unread`]: outputs that nobody reads; [`pace`]: for how long something is held up;
//! * [`languages`]: programs in C, C++ and Python with the RIL's library; [`readers`]: programs of others that read
//!   recordings.
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
//! [`StandInBridge`] takes requests and answers them as the test says: accept, refuse, hang or die.
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
//! # A recorded flight
//!
//! [`Replay`] plays a recording (MCAP) with all its topics, message by message: a program is tested against what was
//! flown once.
//!
//! `examples/consumer` and `examples/module` are projects of their own that use this library as a stranger would.

pub mod air;
pub mod languages;
pub mod pace;
pub mod packages;
pub mod preload;
pub mod pty;
pub mod readers;
pub mod recording;
pub mod relayed;
pub mod replay;
pub mod sandbox;
pub mod script;
pub mod stand_in;
pub mod stranger;
pub mod unread;

pub use ipc_fixtures::{
    Answer, Garbage, Process, Publishing, Scenario, StandInServer, StandInTopic, TestDomain,
    VirtualTime, Watchdog, domain, expect, process, watchdog,
};
pub use pty::PtyFolder;
pub use recording::Recording;
pub use relayed::Rig;
pub use replay::Replay;
pub use sandbox::Sandbox;
pub use script::Script;
pub use stand_in::{PortTable, Received, StandInBridge, StandInPort, StandInStatus};
pub use unread::{OutputKind, UnreadOutput};

/// Compiles the consumer that the README shows.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;

/// Compiles the first consumer of the page.
#[cfg(doctest)]
#[doc = include_str!("../../docs/consumers.md")]
struct FirstMinute;
