//! The shared-memory contract of the HERO's Robot Implementation Layer.
//!
//! `docs/ipc.md` is the contract in words; this crate is its executable form:
//!
//! * [`payload`]: the fixed-layout structs that lie in shared memory, with units, frames and validity;
//! * [`code`]: the numbers in them that stand for states, reasons, errors and groups of values, as typed enums;
//! * [`schema`]: what lies in a topic, as a text that programs read which have never seen the struct;
//! * [`service`]: the one table of services, with every quality-of-service value;
//! * [`mod@module`]: a module of a crate of its own: its name, its id, its state and its control requests;
//! * [`domain`]: which shared memory a process uses, and how nothing of it is left behind;
//! * [`inspect`]: what is there of a domain, without touching it;
//! * [`ipc`]: [`Ipc`], a process's part in it, which makes the ports: [`Publisher`] and [`Subscriber`] for what is
//!   published, [`Server`] and [`Client`] for requests, [`Waiter`] to sleep on several at once; with the feature
//!   `tokio` `Async`, a port in that event loop;
//! * [`discovery`]: which services of a robot are new;
//! * [`dynamic`]: topics and requests of structs that this program was not built with;
//! * [`robot`], [`time`]: the robot id and the host's monotonic time;
//! * [`scheduling`]: how a thread that waits comes to run sooner;
//! * [`files`]: creating files in a process with threads that open ports.
//!
//! It is the only crate that knows iceoryx2; no type of it appears here.
//!
//! Features, none of which is on by default: `tracing` says in the program's log what no call returns, such as that a
//! generation is worn or a wake-up failed; `tokio` adds `Async`.
//!
//! # A module's own topic
//!
//! ```no_run
//! ipc_types::shared_struct! {
//!     /// Voltages of the flight battery.
//!     pub struct Voltages("battery_watch.Voltages.v1") = 64 {
//!         /// Counts the samples of this publisher from 1.
//!         pub sequence: u64,
//!         /// When the publisher began, host monotonic ns.
//!         pub epoch_ns: u64,
//!         /// Of the cells, from the negative pole, under load [V].
//!         pub cells: [f32; 12],
//!     }
//! }
//! ipc_types::topic!(Voltages, "battery_watch/cell_voltages");
//! ```
//!
//! # A consumer
//!
//! ```no_run
//! use ipc_types::{Ipc, payload::HeroTelemetry};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! for sample in Ipc::connect("example")?.subscriber::<HeroTelemetry>()?.iter() {
//!     println!("{:.1} m", sample?.geodetic.altitude_m);
//! }
//! # Ok(())
//! # }
//! ```

// Without `tracing` what only the log would say is not looked at.
#![cfg_attr(not(feature = "tracing"), allow(unused_imports, unused_variables))]

#[cfg(feature = "tokio")]
mod async_io;
pub mod client;
pub mod code;
pub mod configuration;
pub mod discovery;
mod disk;
pub mod domain;
mod domain_error;
mod doorbell;
pub mod dynamic;
pub mod files;
mod follow;
mod forked;
mod generation;
mod housekeeper;
pub mod inspect;
mod iox;
pub mod ipc;
pub mod journal;
pub mod lease;
mod lease_page;
mod limits;
mod lock_file;
mod log;
mod members;
// What the macros make is unsafe to implement by hand: they check what makes it safe.
#[allow(unsafe_code)]
pub mod module;
pub mod open;
pub mod outline;
mod patience;
pub mod payload;
mod pollable;
mod port;
pub mod provider;
pub mod publisher;
mod random;
mod reserve;
pub mod robot;
mod robot_folder;
pub mod scheduling;
pub mod schema;
mod segment;
pub mod sequence;
pub mod server;
pub mod service;
mod serving_port;
pub mod session;
pub mod subscriber;
mod tickets;
pub mod time;
pub mod waiter;
mod wake;

#[doc(hidden)]
pub use client::keep_report;
pub use payload::support as macro_support;

#[cfg(feature = "tokio")]
pub use async_io::{Async, AsyncError};
pub use client::{Client, RequestHandle, SendError};
pub use code::TelemetryGroup;
pub use domain::Domain;
pub use domain_error::DomainError;
pub use dynamic::{
    DynamicClient, DynamicError, DynamicPublisher, DynamicServer, DynamicSubscriber,
};
pub use forked::Forked;
pub use inspect::{Removal, Repair};
pub use ipc::Ipc;
pub use journal::{JournalPiece, JournalTail, LeftTail};
pub use limits::{FreeMemory, LowLimit, allow_many_files, free_memory, low_limits};
pub use members::Members;
pub use module::{ControlOf, Module, RelayModule, StateOf, StatusModule};
pub use open::OpenError;
pub use patience::Patience;
pub use pollable::PortSet;
pub use port::{Payload, Port};
pub use provider::Provider;
pub use publisher::{PublishError, Publisher};
pub use random::fresh_request_id;
pub use robot::RobotId;
pub use scheduling::{SchedulingRole, request_slice};
pub use schema::Schema;
pub use sequence::{Losses, SequenceTracker};
pub use server::{ReportError, ServeError, Server, Ticket};
pub use service::{Request, ServiceId, Topic};
pub use session::JoinError;
pub use subscriber::{ReceiveError, RecvError, Subscriber};
pub use time::MonotonicNs;
pub use waiter::{Descriptor, Ready, Source, WaitError, Waiter, Wake};

/// What tests of several files use.
#[cfg(test)]
mod tests {
    pub(crate) mod explore;
}
