//! Fixtures for programs that speak over shared memory with [`ipc_types`], of any topic and any request.
//!
//! * [`domain`]: shared memory of a test's own, and the proof that nothing of it is left;
//! * [`stand_in`]: publishers and servers that publish and answer as the test says;
//! * [`scenario`]: values over time, stalls, deaths and garbage, written down and played;
//! * [`garbage`]: payloads of any bit pattern;
//! * [`expect`]: a sample that must come, nothing lost, exactly one final report;
//! * [`virtual_time`]: the clock of a core that is given the time;
//! * [`process`]: child processes in that domain, their lines, signals and exits;
//! * [`watchdog`]: ends a test that hangs.
//!
//! # A consumer and its test
//!
//! ```
//! # use ipc_fixtures::{StandInTopic, TestDomain, process::WAIT_LIMIT};
//! # use ipc_types::Subscriber;
//! ipc_types::shared_struct! {
//!     /// How a conveyor belt runs.
//!     pub struct Belt("conveyor.Belt.v1") = 24 {
//!         /// Counts the samples of this publisher from 1.
//!         pub sequence: u64,
//!         /// When the publisher began, host monotonic ns.
//!         pub epoch_ns: u64,
//!         /// Of the belt [m/s].
//!         pub speed_mps: f64,
//!     }
//! }
//! ipc_types::topic!(Belt, "conveyor/belt");
//!
//! /// The program under test: how fast was it before it stood?
//! fn fastest_mps(belt: &mut Subscriber<Belt>) -> f64 {
//!     let (mut fastest_mps, mut stands) = (0.0_f64, false);
//!     while !stands {
//!         belt.wait(WAIT_LIMIT).unwrap();
//!         belt.drain(|sample| {
//!             fastest_mps = fastest_mps.max(sample.speed_mps);
//!             stands = sample.speed_mps == 0.0;
//!         }).unwrap();
//!     }
//!     fastest_mps
//! }
//!
//! let domain = TestDomain::new(); // asserts in the end that nothing is left
//! let mut belt = domain.join("consumer").subscriber().unwrap();
//! let stand_in = StandInTopic::<Belt>::start(&domain);
//! for step in (0..1000).rev() {
//!     stand_in.publish(&Belt { speed_mps: f64::from(step) / 100.0, ..Belt::default() });
//! }
//! assert_eq!(fastest_mps(&mut belt), 9.99); // a thousand samples, and none was lost
//! assert_eq!(belt.losses().lost, 0);
//! ```
//!
//! # A client and its test
//!
//! [`StandInServer`] takes requests and answers them as the test says: accept, refuse, hang or die.
//!
//! ```
//! # use ipc_fixtures::{Answer, StandInServer, TestDomain, process::WAIT_LIMIT};
//! # use ipc_types::code::{Reason, Stage};
//! ipc_types::shared_struct! {
//!     /// Sets the speed of a conveyor belt.
//!     pub struct SetSpeed("conveyor.SetSpeed.v1") = 16 {
//!         /// Chosen by the sender, not 0, never used before by any sender; every report repeats it.
//!         pub request_id: u64,
//!         /// Of the belt [m/s].
//!         pub speed_mps: f64,
//!     }
//! }
//! ipc_types::request!(SetSpeed, "conveyor/speed");
//!
//! let domain = TestDomain::new();
//! let server = StandInServer::<SetSpeed>::start(&domain);
//! server.answer_next(Answer::refuse(Reason::OutOfRange));
//!
//! let mut client = domain.join("operator").client::<SetSpeed>().unwrap();
//! let request = SetSpeed { request_id: 7, speed_mps: 99.0 };
//! let report = client.request(&request).unwrap().result_timeout(WAIT_LIMIT).unwrap().unwrap();
//! assert_eq!((report.stage(), report.reason()), (Some(Stage::Refused), Some(Reason::OutOfRange)));
//! assert_eq!(server.next_request(), request);
//! ```
//!
//! `examples/conveyor` is a project of its own that tests a publisher, a consumer and a request server so.

pub mod domain;
pub mod expect;
pub mod garbage;
pub mod process;
pub mod scenario;
pub mod stand_in;
pub mod virtual_time;
pub mod watchdog;

pub use domain::TestDomain;
pub use garbage::Garbage;
pub use process::Process;
pub use scenario::Scenario;
pub use stand_in::{Answer, Publishing, StandInServer, StandInTopic};
pub use virtual_time::VirtualTime;
pub use watchdog::Watchdog;
