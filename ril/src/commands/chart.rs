//! Fence and path of files, for maps.

use std::path::Path;

use ipc_types::payload::WaypointPosition;
use runtime::exit::Failure;

use super::plan;
use crate::watch::chart::{Chart, FenceFile};

/// The fence of the bridge's configuration `bridge`, or of `bridge.toml` if it is there, and the path of `plan`.
///
/// # Errors
///
/// Code 78 when the configuration is wrong, 2 when a file cannot be read or is no plan.
pub(super) fn chart(bridge: Option<&Path>, plan: Option<&Path>) -> Result<Chart, Failure> {
    let default = Path::new(bridge::cli::DEFAULT_CONFIG_FILE);
    // The bridge's own code checks it, so that a fence is drawn which can be in force.
    runtime::config::load::<bridge::BridgeConfig>(bridge, default)?;
    let fence = runtime::config::load::<FenceFile>(bridge, default)?;
    let path = plan.map(waypoints).transpose()?;
    Ok(Chart::new(&fence.value, &path.unwrap_or_default()))
}

/// The items of a plan that have a position.
fn waypoints(file: &Path) -> Result<Vec<WaypointPosition>, Failure> {
    let plan = plan::read_file(file)?;
    let positions = plan.items.iter().filter_map(|item| item.action.position());
    let on_map = positions.map(|position| WaypointPosition {
        latitude_deg: position.latitude_deg,
        longitude_deg: position.longitude_deg,
        // The map is seen from above.
        altitude_m: 0.0,
    });
    Ok(on_map.collect())
}
