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
//! [`link`] knows bytes, acknowledgements, start-up, liveness, and what the DSP's path buffer may hold; [`flight`]
//! knows movements, paths, arrival and parameters; [`safety`] judges the rules of flight safety, and the flight does
//! what they say; [`translate`] is the seam between wire and shared memory. The [`shell`] owns the port, the
//! shared-memory ports, the clock and the one wait. Around the core is a [`journal`], from which a recording replays
//! every decision.
//!
//! ```
//! use bridge::{Bridge, BridgeConfig, Input};
//! use ipc_types::MonotonicNs;
//!
//! let mut bridge = Bridge::new(&BridgeConfig::default());
//! // `()` discards what the bridge says.
//! bridge.apply(MonotonicNs(0), Input::PortOpened(Default::default()), &mut ());
//! // The first command of the start-up sequence: write the status mask to port 10000.
//! assert_eq!(bridge.transmit(MonotonicNs(0))[..5], [0xF0, 0x01, 0x00, 0x4E, 0x10]);
//! ```

pub mod cli;
pub mod config;
mod core;
pub mod errors;
pub mod flight;
pub mod geodesy;
pub mod journal;
pub mod link;
pub mod outline;
pub mod outputs;
pub mod safety;
pub mod shell;
mod timers;
pub mod translate;

pub use config::BridgeConfig;
pub use core::{Bridge, Input};
pub use flight::control::{Sender, SenderClock};
pub use outputs::{Output, Outputs, RequestKey};
