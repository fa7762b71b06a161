//! Fixtures for programs that speak with the HERO's Robot Implementation Layer.
//!
//! * [`domain`]: shared memory of a test's own, and the proof that nothing of it is left;
//! * [`stand_in`]: a bridge, a status, and publishers and servers of any module, that publish and answer as the test
//!   says;
//! * [`script`], [`recording`]: flights written down as telemetry, and flights from a log of status;
//! * [`replay`]: a recorded flight (MCAP) with all its topics, played as far as a test says;
//! * [`garbage`]: payloads of any bit pattern; [`stranger`]: a struct that no program knows;
//! * [`process`]: child processes in that domain, their lines, signals and exits;
//! * [`sandbox`]: `ril` in a domain and a folder of its own, and what its processes hold; [`relayed`]: two of them with
//!   relays between, and [`air`]: a bad radio between those;
//! * [`pty`]: a folder for links to pseudo-terminals;
//! * [`languages`]: programs in C, C++ and Python with the RIL's library; [`readers`]: programs of others that read
//!   recordings;
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
//! # A program that speaks with a module, and its test
//!
//! [`StandInTopic`] and [`StandInServer`] take the place of any module, by the types of its topics and requests.
//!
//! ```
//! # use ipc_types::{ControlOf, StateOf, code::ControlCommand, module::State};
//! # use ril_tests::{StandInServer, StandInTopic, TestDomain, process::WAIT_LIMIT};
//! ipc_types::shared_struct! {
//!     /// How charged the battery is.
//!     pub struct Charge("battery_watch.Charge.v1") = 24 {
//!         /// Counts the samples of this publisher from 1.
//!         pub sequence: u64,
//!         /// When the publisher began, host monotonic ns.
//!         pub epoch_ns: u64,
//!         /// Of the whole battery, 0 to 1.
//!         pub charge: f64,
//!     }
//! }
//! ipc_types::topic!(Charge, "battery_watch/charge");
//! struct BatteryWatch;
//! ipc_types::module!(BatteryWatch, "battery_watch", 1001);
//!
//! let domain = TestDomain::new();
//! let charges = StandInTopic::<Charge>::start(&domain);
//! let control = StandInServer::<ControlOf<BatteryWatch>>::start(&domain);
//!
//! // What the program under test would do:
//! let ipc = domain.join("program");
//! let mut subscriber = ipc.subscriber::<Charge>().unwrap();
//! charges.publish(&Charge { charge: 0.5, ..Charge::default() });
//! subscriber.wait(WAIT_LIMIT).unwrap();
//! assert_eq!(subscriber.latest().unwrap().unwrap().charge, 0.5);
//! let mut client = ipc.client::<ControlOf<BatteryWatch>>().unwrap();
//! let start = ControlOf::<BatteryWatch>::command(7, ControlCommand::Start);
//! client.send(&start).unwrap();
//! assert_eq!(control.next_request(), start);
//! ```
//!
//! # A recorded flight
//!
//! [`Replay`] plays a recording (MCAP) with all its topics, message by message: a program is tested against what was
//! flown once.
//!
//! `examples/consumer` and `examples/module` are projects of their own that use this library as a stranger would.

pub mod air;
pub mod domain;
pub mod garbage;
pub mod languages;
pub mod packages;
pub mod preload;
pub mod process;
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
pub mod watchdog;

pub use domain::TestDomain;
pub use garbage::Garbage;
pub use process::Process;
pub use pty::PtyFolder;
pub use recording::Recording;
pub use relayed::Rig;
pub use replay::Replay;
pub use sandbox::Sandbox;
pub use script::Script;
pub use stand_in::{
    Answer, PortTable, Publishing, Received, StandInBridge, StandInPort, StandInServer,
    StandInStatus, StandInTopic,
};
pub use unread::UnreadPipe;
pub use watchdog::Watchdog;
