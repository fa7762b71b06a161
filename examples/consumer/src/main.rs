//! `altitude-guard LIMIT_M`: prints a line for each notice, until the helicopter has landed.

use std::error::Error;
use std::time::Duration;

use altitude_guard::{Guard, watch};
use ipc_types::{Ipc, SchedulingRole, request_slice};

fn main() -> Result<(), Box<dyn Error>> {
    let limit = std::env::args().nth(1).unwrap_or_default();
    let Ok(limit_m) = limit.parse() else {
        return Err(format!("`{limit}` is no altitude in metres: altitude-guard LIMIT_M").into());
    };
    let mut telemetry = Ipc::connect("altitude-guard")?.subscriber()?;
    request_slice(SchedulingRole::Consumer);
    println!("guarding {limit_m} m");
    watch(
        &mut telemetry,
        &mut Guard::new(limit_m),
        Duration::from_secs(1),
        |notice| println!("{notice}"),
    )?;
    let losses = telemetry.losses();
    println!("landed; {} samples, {} lost", losses.received, losses.lost);
    Ok(())
}
