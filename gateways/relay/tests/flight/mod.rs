//! The relay with real processes: a simulated robot in one domain, a station in another one, and the relays between
//! them.
//!
//! `ril` is found beside the relay's program, where `cargo test --workspace` builds it, or by `RIL_BINARY`.

mod clock;
mod faults;
mod mission;
mod unread;

use std::path::{Path, PathBuf};

use ril_tests::Rig;
use ril_tests::sandbox::beside_or_skip;

/// `None` if there is no `ril`: the test is skipped, and says so.
fn ril() -> Option<PathBuf> {
    beside_or_skip(Path::new(env!("CARGO_BIN_EXE_ril-relay")))
}

/// A robot and a station; `relay_toml` is the configuration of the robot's relay. `None` if there is no `ril`.
fn rig(name: &str, relay_toml: &str) -> Option<Rig> {
    Some(Rig::start(&ril()?, name, relay_toml))
}
