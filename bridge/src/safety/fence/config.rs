//! `[fence]` of `bridge.toml`, and what is refused in it.

use std::collections::HashSet;
use std::fmt;

use geo::line_intersection::{LineIntersection, line_intersection};
use geo::{Coord, Line, LineString, Polygon, coord};
use runtime::config::Deserializer;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Serialize};

use super::area::{Area, AreaConfig, Band, Shape, altitude_m};
use super::leg::{MAX_EXTENT_M, MAX_LATITUDE_DEG, Plane};
use super::room::Room;
use crate::geodesy::longitude_difference_deg;

/// Most areas of a fence: several times what an airfield or a town needs. Judging a leg takes at most about 15 ns for
/// each edge, so 0.3 ms with the most areas and vertices. Measuring a breach takes up to 200 times that if all areas
/// are inclusions, and happens once for each refused path.
pub const MAX_AREAS: usize = 64;

/// Most vertices of a polygon. A circle as a polygon of so many vertices is right to 1/13,000 of its radius, so no bent
/// outline needs more.
pub const MAX_VERTICES: usize = 256;

/// Smallest radius of a circle: less than the box in which a waypoint counts as reached is surely a mistake of units.
const MIN_RADIUS_M: f64 = 1.0;

/// Largest radius of a circle, which is then as wide as a polygon may be.
const MAX_RADIUS_M: f64 = MAX_EXTENT_M / 2.0;

/// Longest name of an area, characters: a log line stays readable.
const MAX_NAME_CHARS: usize = 64;

/// `[fence]`: limits that hold everywhere, and areas.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct FenceConfig {
    /// The helicopter stays above this telemetry altitude, metres.
    #[serde(deserialize_with = "altitude_m")]
    pub floor_m: Option<f64>,
    /// The helicopter stays below this telemetry altitude, metres.
    #[serde(deserialize_with = "altitude_m")]
    pub ceiling_m: Option<f64>,
    /// A path stays so far from every boundary, metres.
    #[serde(deserialize_with = "margin_m")]
    pub margin_m: f64,
    /// How hard the helicopter brakes at least, m/s².
    #[serde(deserialize_with = "braking_mps2")]
    pub braking_mps2: f64,
    /// How long a hold takes to begin, s ([`Room`]).
    #[serde(deserialize_with = "reaction_s")]
    pub reaction_s: f64,
    /// `[[fence.area]]`, at most [`MAX_AREAS`].
    pub area: Vec<Area>,
}

runtime::ranged! {
    fn margin_m(f64) in 0.0..=1000.0;
    fn braking_mps2(f64) in 0.1..=20.0;
    fn reaction_s(f64) in 0.0..=10.0;
}

impl Default for FenceConfig {
    fn default() -> Self {
        let Room {
            margin_m,
            braking_mps2,
            reaction_s,
        } = Room::default();
        FenceConfig {
            floor_m: None,
            ceiling_m: None,
            margin_m,
            braking_mps2,
            reaction_s,
            area: Vec::new(),
        }
    }
}

/// Checked inside the table, so that an error points at the line of this area. With `serde(try_from)` it would point at
/// the first one.
impl<'de> Deserialize<'de> for Area {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(AreaVisitor)
    }
}

struct AreaVisitor;

impl<'de> Visitor<'de> for AreaVisitor {
    type Value = Area;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a table with `name`, `kind` and a shape")
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Area, A::Error> {
        let config = AreaConfig::deserialize(MapAccessDeserializer::new(map))?;
        Area::try_from(config).map_err(A::Error::custom)
    }
}

impl FenceConfig {
    /// The limits that hold everywhere, the areas, and the room to stop, when they fit together.
    ///
    /// # Errors
    /// Why they do not.
    pub(super) fn checked(self) -> Result<(Band, Vec<Area>, Room), String> {
        let areas = self.area;
        if areas.len() > MAX_AREAS {
            let count = areas.len();
            return Err(format!(
                "the fence has {count} areas; at most {MAX_AREAS} are allowed"
            ));
        }
        let mut names = HashSet::new();
        if let Some(area) = areas.iter().find(|area| !names.insert(area.name())) {
            let name = area.name();
            return Err(format!(
                "two areas are called `{name}`; give each its own name"
            ));
        }
        let band = band("the fence's", self.floor_m, self.ceiling_m)?;
        let room = Room {
            margin_m: self.margin_m,
            braking_mps2: self.braking_mps2,
            reaction_s: self.reaction_s,
        };
        Ok((band, areas, room))
    }
}

impl TryFrom<AreaConfig> for Area {
    type Error = String;

    fn try_from(config: AreaConfig) -> Result<Area, String> {
        match config.placed() {
            Ok((plane, shape, band)) => Ok(Area {
                config,
                plane,
                shape,
                band,
            }),
            Err(fault) => {
                let name: String = config.name.chars().take(MAX_NAME_CHARS).collect();
                Err(format!("area `{name}`: {fault}"))
            }
        }
    }
}

impl AreaConfig {
    fn placed(&self) -> Result<(Plane, Shape, Band), String> {
        let length = self.name.chars().count();
        if !(1..=MAX_NAME_CHARS).contains(&length) || self.name.chars().any(char::is_control) {
            return Err(format!(
                "a name has 1 to {MAX_NAME_CHARS} printable characters"
            ));
        }
        let band = band("its", self.floor_m, self.ceiling_m)?;
        let (plane, shape) = match (&self.polygon, self.centre, self.radius_m) {
            (Some(vertices), None, None) => place_polygon(vertices)?,
            (None, Some(centre), Some(radius_m)) => place_circle(centre, radius_m)?,
            _ => return Err("give either `polygon`, or `centre` and `radius_m`".to_owned()),
        };
        Ok((plane, shape, band))
    }
}

/// Altitudes of `whose`, which must have something between floor and ceiling.
fn band(whose: &str, floor_m: Option<f64>, ceiling_m: Option<f64>) -> Result<Band, String> {
    let floor_m = floor_m.unwrap_or(f64::NEG_INFINITY);
    let ceiling_m = ceiling_m.unwrap_or(f64::INFINITY);
    match floor_m < ceiling_m {
        true => Ok(Band { floor_m, ceiling_m }),
        false => Err(format!(
            "{whose} floor_m = {floor_m} is not below its ceiling_m = {ceiling_m}"
        )),
    }
}

fn place_circle(centre: [f64; 2], radius_m: f64) -> Result<(Plane, Shape), String> {
    check_coordinate(centre)?;
    if !(MIN_RADIUS_M..=MAX_RADIUS_M).contains(&radius_m) {
        return Err(format!(
            "radius_m = {radius_m} is out of range: it must be from {MIN_RADIUS_M} to {MAX_RADIUS_M}"
        ));
    }
    let [latitude_deg, longitude_deg] = centre;
    Ok((
        Plane::at(latitude_deg, longitude_deg),
        Shape::Circle { radius_m },
    ))
}

fn place_polygon(vertices: &[[f64; 2]]) -> Result<(Plane, Shape), String> {
    let vertices = match vertices {
        [first, between @ .., last] if first == last && !between.is_empty() => {
            &vertices[..vertices.len() - 1]
        }
        _ => vertices,
    };
    if !(3..=MAX_VERTICES).contains(&vertices.len()) {
        let count = vertices.len();
        return Err(format!(
            "a polygon has 3 to {MAX_VERTICES} vertices, and this one has {count}"
        ));
    }
    vertices.iter().copied().try_for_each(check_coordinate)?;
    let (plane, reach) = plane_in_the_middle(vertices)?;
    let outline: Vec<Coord> = vertices
        .iter()
        .map(|&[latitude_deg, longitude_deg]| plane.coord(latitude_deg, longitude_deg))
        .collect();
    check_simple(&outline)?;
    let polygon = Polygon::new(LineString(outline), Vec::new());
    Ok((plane, Shape::Polygon { polygon, reach }))
}

fn check_coordinate(point: [f64; 2]) -> Result<(), String> {
    let [latitude_deg, longitude_deg] = point;
    // Not-a-number is in no range.
    let known = (-MAX_LATITUDE_DEG..=MAX_LATITUDE_DEG).contains(&latitude_deg)
        && (-180.0..=180.0).contains(&longitude_deg);
    known.then_some(()).ok_or_else(|| {
        format!(
            "[{latitude_deg}, {longitude_deg}] is no [latitude, longitude] within ±{MAX_LATITUDE_DEG} and ±180 degrees"
        )
    })
}

/// The plane at the middle of the polygon, and how far the polygon reaches from there to the east and to the north.
fn plane_in_the_middle(vertices: &[[f64; 2]]) -> Result<(Plane, Coord), String> {
    let first_deg = vertices[0][1];
    let (low, high) = vertices.iter().fold(
        ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]),
        |(low, high), &[latitude_deg, longitude_deg]| {
            let point = [
                latitude_deg,
                longitude_difference_deg(longitude_deg, first_deg),
            ];
            (
                [low[0].min(point[0]), low[1].min(point[1])],
                [high[0].max(point[0]), high[1].max(point[1])],
            )
        },
    );
    let middle = [(low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0];
    let plane = Plane::at(
        middle[0],
        longitude_difference_deg(first_deg + middle[1], 0.0),
    );
    let corner = plane.coord(high[0], first_deg + high[1]);
    let reach = coord! { x: corner.x.abs(), y: corner.y.abs() };
    let extent_m = 2.0 * reach.x.max(reach.y);
    // A difference of longitudes is at most 180 degrees, so an outline round the Earth is far too wide as well.
    if extent_m <= MAX_EXTENT_M {
        Ok((plane, reach))
    } else {
        Err(format!(
            "the polygon is {extent_m:.0} m wide; at most {MAX_EXTENT_M} m are allowed, east to west and north to south"
        ))
    }
}

/// Whether no edge meets another one, except neighbours at their common vertex.
fn check_simple(outline: &[Coord]) -> Result<(), String> {
    let count = outline.len();
    let edge = |index: usize| Line::new(outline[index], outline[(index + 1) % count]);
    for index in 0..count {
        if outline[index] == outline[(index + 1) % count] {
            let vertex = (index + 1) % count + 1;
            return Err(format!(
                "vertex {vertex} of the polygon repeats the vertex before it"
            ));
        }
    }
    for first in 0..count {
        for second in first + 1..count {
            let neighbours = second == first + 1 || (second + 1) % count == first;
            let simple = match line_intersection(edge(first), edge(second)) {
                None => true,
                Some(LineIntersection::SinglePoint { .. }) => neighbours,
                Some(LineIntersection::Collinear { .. }) => false,
            };
            if !simple {
                return Err(format!(
                    "the polygon crosses or touches itself: the edge that begins at vertex {} meets the one that begins at vertex {}",
                    first + 1,
                    second + 1,
                ));
            }
        }
    }
    Ok(())
}
