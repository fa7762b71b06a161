//! The bridge between the PC and the flight-control DSP of the HERO helicopter (`BRIDGEMOD`).
//!
//! A pure core and a thin shell. The core, [`Bridge`], is two state machines side by side:
//!
//! ```text
//!              bytes                LinkEvent               reports, state, telemetry
//! serial port ──────▶ link::Link ───────────▶ flight::Flight ───────────▶ Outputs
//!             ◀──────            ◀───────────       ▲
//!              bytes       commands, waypoints      └── requests
//! ```
//!
//! [`link`] knows bytes, acknowledgements, start-up, liveness, and what the DSP's path buffer may hold; [`flight`] knows
//! movements, paths, arrival and parameters; [`safety`] judges legs against the geofence; [`translate`] is the seam between wire and shared memory. The [`shell`] owns the port,
//! the shared-memory ports, the clock and the one wait. [`journaled`] stands between shell and core and writes the [`journal`], from
//! which a recording replays every decision.
//!
//! ```
//! use bridge::outputs::Notice;
//! use bridge::{Bridge, BridgeConfig, Outputs, RequestKey};
//! use ipc_types::MonotonicNs;
//! use ipc_types::payload::{DspTelemetry, ModuleState, RequestReport};
//!
//! struct NoOutputs;
//! impl Outputs for NoOutputs {
//!     fn telemetry(&mut self, _fill: impl FnOnce(&mut DspTelemetry)) {}
//!     fn state(&mut self, _state: &ModuleState) {}
//!     fn report(&mut self, _to: RequestKey, _report: &RequestReport) {}
//!     fn notice(&mut self, _notice: &Notice) {}
//! }
//!
//! let mut bridge = Bridge::new(&BridgeConfig::default());
//! bridge.port_opened(MonotonicNs(0), &mut NoOutputs);
//! // The first command of the start-up sequence: write the status mask to port 10000.
//! assert_eq!(bridge.transmit(MonotonicNs(0))[..5], [0xF0, 0x01, 0x00, 0x4E, 0x10]);
//! ```

pub mod cli;
pub mod config;
mod core;
pub mod errors;
pub mod flight;
pub mod journal;
pub mod journaled;
pub mod link;

pub mod outputs;
pub mod safety;
pub mod shell;
pub mod snapshot;
mod timers;
pub mod translate;

pub use config::BridgeConfig;
pub use core::Bridge;
pub use flight::request::RequestKey;
pub use outputs::Outputs;
