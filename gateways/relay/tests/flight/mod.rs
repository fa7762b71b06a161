//! The relay with real processes: a simulated robot in one domain, a station in another one, and the relays between them.
//!
//! `ril` is found beside the relay's program, where `cargo test --workspace` builds it, or by `RIL_BINARY`.

mod faults;
mod mission;
mod rig;
