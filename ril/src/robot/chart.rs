//! [`Chart`]: what the map has besides the robot: the geofence of a configuration of the bridge, and the path of a plan.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use bridge::safety::fence::{Area, AreaConfig, AreaKind, Fence, FenceConfig};
use ipc_types::payload::WaypointPosition;
use plans::Plan;
use plans::error::MAX_FILE_BYTES;
use runtime::exit::Failure;
use serde::Deserialize;

use crate::robot::geo::{METRES_PER_DEGREE, Place};

/// Corners of a circle's outline: its edges leave the circle by 0.5 % of the radius.
const CIRCLE_CORNERS: u32 = 32;

/// `[fence]` of `bridge.toml`; the other tables are the bridge's.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct FenceFile {
    fence: FenceTable,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
struct FenceTable {
    floor_m: Option<f64>,
    ceiling_m: Option<f64>,
    area: Vec<AreaConfig>,
}

impl From<&Fence> for FenceFile {
    fn from(fence: &Fence) -> FenceFile {
        let FenceConfig {
            floor_m,
            ceiling_m,
            area,
        } = fence.clone().into();
        FenceFile {
            fence: FenceTable {
                floor_m,
                ceiling_m,
                area: area.iter().map(Area::config).cloned().collect(),
            },
        }
    }
}

/// An area of the fence as a closed line.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    /// Whether the robot must stay inside.
    pub is_inclusion: bool,
    /// Corners in order; the last one is joined with the first.
    pub corners: Vec<Place>,
}

/// See the module's documentation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chart {
    /// The areas of the fence.
    pub fence: Vec<Outline>,
    /// Lowest altitude everywhere, m.
    pub floor_m: Option<f64>,
    /// Highest altitude everywhere, m.
    pub ceiling_m: Option<f64>,
    /// Waypoints in order.
    pub path: Vec<Place>,
}

impl Chart {
    /// The chart of a fence, which the bridge's own code has checked, and of a path.
    pub fn new(file: &FenceFile, path: &[WaypointPosition]) -> Chart {
        let place =
            |waypoint: &WaypointPosition| Place::new(waypoint.latitude_deg, waypoint.longitude_deg);
        Chart {
            fence: file.fence.area.iter().map(Outline::of).collect(),
            floor_m: file.fence.floor_m,
            ceiling_m: file.fence.ceiling_m,
            path: path.iter().filter_map(place).collect(),
        }
    }
}

/// The fence of the bridge's configuration `bridge`, or of `bridge.toml` if it is there, and the path of `plan`.
///
/// # Errors
///
/// Code 78 when the configuration is wrong, 2 when a file cannot be read or is no plan.
pub fn of_files(bridge: Option<&Path>, plan: Option<&Path>) -> Result<Chart, Failure> {
    let default = Path::new(bridge::cli::DEFAULT_CONFIG_FILE);
    // The bridge's own code reads it, so that a fence is drawn which can be in force.
    let loaded = runtime::config::load::<bridge::BridgeConfig>(bridge, default)?;
    let path = plan.map(waypoints).transpose()?;
    let fence = FenceFile::from(&loaded.value.fence);
    Ok(Chart::new(&fence, &path.unwrap_or_default()))
}

/// The items of a plan that have a position.
fn waypoints(file: &Path) -> Result<Vec<WaypointPosition>, Failure> {
    let plan = read_plan(file)?;
    let positions = plan.items.iter().filter_map(|item| item.action.position());
    let on_map = positions.map(|position| WaypointPosition {
        latitude_deg: position.latitude_deg,
        longitude_deg: position.longitude_deg,
        // The map is seen from above.
        altitude_m: 0.0,
    });
    Ok(on_map.collect())
}

/// Reads the file of a plan.
///
/// # Errors
///
/// Code 2 when the file cannot be read, or is no plan.
pub fn read_plan(file: &Path) -> Result<Plan, Failure> {
    let name = file.display();
    let mut bytes = Vec::new();
    // One byte more than allowed shows that a file is too long.
    File::open(file)
        .and_then(|file| {
            let limit = MAX_FILE_BYTES as u64 + 1;
            file.take(limit).read_to_end(&mut bytes)
        })
        .map_err(|error| Failure::usage(format!("{name}: cannot be read: {error}")))?;
    plans::read(file, &bytes).map_err(|error| Failure::usage(format!("{name}: {error}")))
}

impl Outline {
    fn of(area: &AreaConfig) -> Outline {
        let polygon = area.polygon.iter().flatten();
        let mut corners: Vec<Place> = polygon
            .filter_map(|[lat, lon]| Place::new(*lat, *lon))
            .collect();
        if let (Some([latitude, longitude]), Some(radius_m)) = (area.centre, area.radius_m) {
            let radius_deg = radius_m / METRES_PER_DEGREE;
            let scale = latitude.to_radians().cos().max(0.01);
            corners.extend((0..CIRCLE_CORNERS).filter_map(|corner| {
                let angle = f64::from(corner) * std::f64::consts::TAU / f64::from(CIRCLE_CORNERS);
                Place::new(
                    latitude + radius_deg * angle.cos(),
                    longitude + radius_deg * angle.sin() / scale,
                )
            }));
        }
        Outline {
            is_inclusion: area.kind == AreaKind::Inclusion,
            corners,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::geo::distance_m;

    #[test]
    fn the_annotated_example_has_a_polygon_and_a_circle() {
        let example = include_str!("../../../bridge/bridge.toml");
        let fence = example.split("# floor_m").nth(1).unwrap();
        let fence = fence.split("[errors]").next().unwrap().replace("# ", "");
        let text = format!(
            "[serial]\nport = \"x\"\n[fence]\nfloor_m{}",
            fence.replace("\n#\n", "\n")
        );
        let file: FenceFile = runtime::config::parse(&text, "bridge.toml").unwrap();
        let chart = Chart::new(&file, &[]);
        assert_eq!((chart.floor_m, chart.ceiling_m), (Some(5.0), Some(120.0)));
        assert!(chart.fence[0].is_inclusion && !chart.fence[1].is_inclusion);
        assert_eq!(chart.fence[0].corners.len(), 4);
        let centre = Place::new(37.412, -6.001).unwrap();
        for corner in &chart.fence[1].corners {
            assert!((distance_m(centre, *corner) - 30.0).abs() < 0.2);
        }
    }

    #[test]
    fn no_file_is_an_empty_chart() {
        assert_eq!(Chart::new(&FenceFile::default(), &[]), Chart::default());
    }
}
