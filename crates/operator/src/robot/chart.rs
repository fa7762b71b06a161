//! [`Chart`]: what the map has besides the robot: the geofence in force and the path that the bridge holds, or those of
//! a configuration and of a plan.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use bridge::safety::fence::{Area, AreaConfig, AreaKind, Fence, FenceConfig};
use ipc_types::outline::{Outline, OutlineArea, OutlineShape};
use ipc_types::payload::WaypointPosition;
use plans::Plan;
use plans::error::MAX_FILE_BYTES;
use runtime::exit::Failure;
use runtime::plain::plain_path;
use serde::{Deserialize, Serialize};

use crate::robot::geo::{METRES_PER_DEGREE, Place};

/// Corners of a circle's outline: its edges leave the circle by 0.5 % of the radius.
const CIRCLE_CORNERS: u32 = 32;

/// `[fence]` of `bridge.toml`; the other tables are the bridge's.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct FenceFile {
    /// The fence.
    pub fence: FenceConfig,
}

/// An area of a fence, as a map draws it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChartArea {
    /// Its name; empty if it has none.
    pub name: String,
    /// Whether the helicopter must be inside; else it must be outside.
    pub inclusion: bool,
    /// `None` if it has no floor.
    pub floor_m: Option<f64>,
    /// `None` if it has no ceiling.
    pub ceiling_m: Option<f64>,
    /// Latitude and longitude, degrees.
    pub corners: Vec<[f64; 2]>,
}

/// What a map has besides the robot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chart {
    /// The areas of the fence, each a closed line: a circle is one of many corners.
    pub fence: Vec<ChartArea>,
    /// Lowest altitude everywhere, m.
    pub floor_m: Option<f64>,
    /// Highest altitude everywhere, m.
    pub ceiling_m: Option<f64>,
    /// Waypoints in order.
    pub path: Vec<Place>,
}

impl Chart {
    /// The chart of a fence, which the bridge's own code has checked, and of a path.
    pub fn new(fence: &FenceConfig, path: &[WaypointPosition]) -> Chart {
        let areas = fence.area.iter().map(Area::config);
        Chart {
            fence: areas.map(drawn).collect(),
            floor_m: fence.floor_m,
            ceiling_m: fence.ceiling_m,
            path: places(path),
        }
    }
}

/// What a bridge holds.
impl From<&Outline> for Chart {
    fn from(held: &Outline) -> Chart {
        let areas = held.areas.iter().map(area_config);
        Chart {
            fence: areas.map(|area| drawn(&area)).collect(),
            floor_m: held.floor_m,
            ceiling_m: held.ceiling_m,
            path: places(&held.path),
        }
    }
}

fn places(path: &[WaypointPosition]) -> Vec<Place> {
    let place =
        |waypoint: &WaypointPosition| Place::new(waypoint.latitude_deg, waypoint.longitude_deg);
    path.iter().filter_map(place).collect()
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
    let fence = loaded.value.fence.into();
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
    let name = plain_path(file);
    let mut bytes = Vec::new();
    // One byte more than allowed shows that a file is too long.
    File::open(file)
        .and_then(|file| {
            let limit = MAX_FILE_BYTES as u64 + 1;
            file.take(limit).read_to_end(&mut bytes)
        })
        .map_err(|error| Failure::usage(format!("{name}: cannot be read: {error}")))?;
    plans::read(file, &bytes).map_err(|error| {
        Failure::usage(format!("{name}: {error}"))
            .with_next_step("correct the file; docs/plans.md says what is read")
    })
}

/// An area as it is drawn.
fn drawn(area: &AreaConfig) -> ChartArea {
    let corners = match (area.centre, area.radius_m) {
        (Some(centre), Some(radius_m)) => circle(centre, radius_m),
        _ => corners(area.polygon.as_deref().unwrap_or_default()),
    };
    ChartArea {
        name: area.name.clone(),
        inclusion: area.kind == AreaKind::Inclusion,
        floor_m: area.floor_m,
        ceiling_m: area.ceiling_m,
        corners: corners.into_iter().map(Place::degrees).collect(),
    }
}

/// The fence that a bridge holds, as the bridge's own code judges by it.
///
/// # Errors
///
/// What makes it none: a bridge of this version publishes no such outline.
pub fn fence_of(held: &Outline) -> Result<Fence, String> {
    let areas = held.areas.iter().map(area_config).map(Area::try_from);
    Fence::try_from(FenceConfig {
        floor_m: held.floor_m,
        ceiling_m: held.ceiling_m,
        area: areas.collect::<Result<_, _>>()?,
        ..FenceConfig::default()
    })
}

/// An area that a bridge holds, as its configuration has it.
fn area_config(held: &OutlineArea) -> AreaConfig {
    let (polygon, centre, radius_m) = match &held.shape {
        OutlineShape::Polygon(polygon) => (Some(polygon.clone()), None, None),
        OutlineShape::Circle { centre, radius_m } => (None, Some(*centre), Some(*radius_m)),
    };
    AreaConfig {
        name: held.name.clone(),
        kind: match held.is_inclusion {
            true => AreaKind::Inclusion,
            false => AreaKind::Exclusion,
        },
        polygon,
        centre,
        radius_m,
        floor_m: held.floor_m,
        ceiling_m: held.ceiling_m,
    }
}

fn corners(polygon: &[[f64; 2]]) -> Vec<Place> {
    let corner = |[latitude, longitude]: &[f64; 2]| Place::new(*latitude, *longitude);
    polygon.iter().filter_map(corner).collect()
}

fn circle([latitude, longitude]: [f64; 2], radius_m: f64) -> Vec<Place> {
    let radius_deg = radius_m / METRES_PER_DEGREE;
    let scale = latitude.to_radians().cos().max(0.01);
    let corner = |corner: u32| {
        let angle = f64::from(corner) * std::f64::consts::TAU / f64::from(CIRCLE_CORNERS);
        Place::new(
            latitude + radius_deg * angle.cos(),
            longitude + radius_deg * angle.sin() / scale,
        )
    };
    (0..CIRCLE_CORNERS).filter_map(corner).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::fixture::area;
    use crate::robot::geo::distance_m;

    #[test]
    fn the_annotated_example_has_a_polygon_and_a_circle() {
        let example = include_str!("../../../../bridge/bridge.toml");
        let fence = example.split("# floor_m").nth(1).unwrap();
        let fence = fence.split("[errors]").next().unwrap().replace("# ", "");
        let text = format!(
            "[serial]\nport = \"x\"\n[fence]\nfloor_m{}",
            fence.replace("\n#\n", "\n")
        );
        let file: FenceFile = runtime::config::parse(&text, "bridge.toml").unwrap();
        let chart = Chart::new(&file.fence, &[]);
        assert_eq!((chart.floor_m, chart.ceiling_m), (Some(5.0), Some(120.0)));
        assert!(chart.fence[0].inclusion && !chart.fence[1].inclusion);
        assert_eq!(chart.fence[0].corners.len(), 4);
        let centre = Place::new(37.412, -6.001).unwrap();
        for [latitude_deg, longitude_deg] in &chart.fence[1].corners {
            let corner = Place::new(*latitude_deg, *longitude_deg).unwrap();
            assert!((distance_m(centre, corner) - 30.0).abs() < 0.2);
        }
    }

    #[test]
    fn what_the_bridge_holds_is_drawn_and_judged_as_the_same_file_is() {
        let text = "[fence]\nceiling_m = 50.0\n\
            [[fence.area]]\nname = \"a\"\nkind = \"inclusion\"\npolygon = [[37.0, -6.0], [37.1, -6.0], [37.1, -6.1]]\n\
            [[fence.area]]\nname = \"b\"\nkind = \"exclusion\"\ncentre = [37.0, -6.0]\nradius_m = 5.0\n";
        let file: FenceFile = runtime::config::parse(text, "bridge.toml").unwrap();
        let path = [WaypointPosition {
            latitude_deg: 37.05,
            longitude_deg: -6.05,
            altitude_m: 20.0,
        }];
        let polygon = vec![[37.0, -6.0], [37.1, -6.0], [37.1, -6.1]];
        let (centre, radius_m) = ([37.0, -6.0], 5.0);
        let held = Outline {
            number: 1,
            floor_m: None,
            ceiling_m: Some(50.0),
            areas: vec![
                area("a", true, OutlineShape::Polygon(polygon)),
                area("b", false, OutlineShape::Circle { centre, radius_m }),
            ],
            path: path.to_vec(),
        };
        assert_eq!(Chart::from(&held), Chart::new(&file.fence, &path));
        let made = fence_of(&held).unwrap();
        assert_eq!((made.areas(), made.area_name(1)), (2, Some("b")));
        let twice = Outline {
            areas: vec![held.areas[0].clone(), held.areas[0].clone()],
            ..held
        };
        assert!(fence_of(&twice).is_err(), "two areas of one name");
    }

    #[test]
    fn no_file_is_an_empty_chart() {
        assert_eq!(Chart::new(&FenceConfig::default(), &[]), Chart::default());
    }
}
