//! The short form of the program `endurance`: loops of kills and of starts, attacks, floods, full memories and power cuts, bad links,
//! stations and viewers.

use std::time::Duration;

use endurance::plan::Plan;
use endurance::site::Site;
use ril_tests::Sandbox;

mod attacks;
mod field;
mod loops;
mod mavlink;
mod power_cut;
mod views;

/// Where one measurement runs, for as long as `limit`.
fn site(name: &str, plan: &Plan, limit: Duration) -> Site {
    Site::new(Sandbox::new([env!("CARGO_BIN_EXE_ril")], name, limit), plan)
}
