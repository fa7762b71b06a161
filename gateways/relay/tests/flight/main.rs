//! The relay with real processes: a simulated robot in one domain, a station in another one, and the relays between them.
//!
//! `ril` is found beside the relay's program, where `cargo test --workspace` builds it, or by `RIL_BINARY`.

mod bridge_log;
mod cut;
mod kills;
mod link_loss;
mod machine;
mod mission;
mod refusals;
mod rig;
mod robots;
mod schemas;
mod stall;
