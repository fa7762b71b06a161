//! One area: a polygon or circle with a floor and a ceiling, and where a leg is inside it.

use dsp_protocol::Waypoint;
use geo::{Contains, Coord, Distance, Euclidean, Point, Polygon};
use runtime::config::{Deserializer, in_range};
use serde::{Deserialize, Serialize, Serializer};

use super::leg::{Leg, Plane, Span, join, rest, where_between, where_in_disc, where_near_edge};

/// Whether the helicopter must be inside an area or outside it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum AreaKind {
    /// Each point of a leg must be inside at least one inclusion area, if there is any.
    Inclusion,
    /// No point of a leg may be inside an exclusion area.
    Exclusion,
}

/// `[[fence.area]]`: either `polygon`, or `centre` and `radius_m`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct AreaConfig {
    /// Names the area in refusals and logs; no other area has the same name.
    pub name: String,
    /// Whether the helicopter must be inside or outside.
    pub kind: AreaKind,
    /// Vertices in order, [latitude, longitude] in degrees, 3 to `MAX_VERTICES`. The last one may repeat the first.
    #[serde(default)]
    pub polygon: Option<Vec<[f64; 2]>>,
    /// Centre of a circle, [latitude, longitude] in degrees.
    #[serde(default)]
    pub centre: Option<[f64; 2]>,
    /// Radius of the circle, metres.
    #[serde(default)]
    pub radius_m: Option<f64>,
    /// The area begins at this altitude, metres; without it, it reaches down without end.
    #[serde(default, deserialize_with = "altitude_m")]
    pub floor_m: Option<f64>,
    /// The area ends at this altitude, metres; without it, it reaches up without end.
    #[serde(default, deserialize_with = "altitude_m")]
    pub ceiling_m: Option<f64>,
}

/// A valid area of a [`Fence`](super::Fence), made from an [`AreaConfig`](super::AreaConfig).
#[derive(Clone, Debug, PartialEq)]
pub struct Area {
    /// The table that it was made of.
    pub(super) config: AreaConfig,
    pub(super) plane: Plane,
    pub(super) shape: Shape,
    pub(super) band: Band,
}

impl Area {
    /// The table that it was made of.
    pub fn config(&self) -> &AreaConfig {
        &self.config
    }
}

/// The outline of an area in its plane.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Shape {
    /// A simple polygon without holes. No vertex is farther from the origin of the plane, to the east and to the north,
    /// than `reach`.
    Polygon { polygon: Polygon, reach: Coord },
    /// A circle round the origin of the plane.
    Circle { radius_m: f64 },
}

/// Altitudes from a floor to a ceiling. An end that is missing is infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Band {
    pub(super) floor_m: f64,
    pub(super) ceiling_m: f64,
}

impl Default for Band {
    fn default() -> Self {
        Band {
            floor_m: f64::NEG_INFINITY,
            ceiling_m: f64::INFINITY,
        }
    }
}

/// An area is written as the table that it was made of.
impl Serialize for Area {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        self.config.serialize(to)
    }
}

impl Area {
    /// Its name in the configuration.
    pub fn name(&self) -> &str {
        &self.config.name
    }

    /// Whether the helicopter must be inside it or outside.
    pub fn kind(&self) -> AreaKind {
        self.config.kind
    }

    /// Adds the spans of a leg that are inside. Whatever only touches the boundary is inside an exclusion area, and is
    /// not inside an inclusion area. What is nearer than `touch_m` touches it.
    pub(super) fn where_inside(
        &self,
        from: &Waypoint,
        to: &Waypoint,
        touch_m: f64,
        spans: &mut Vec<Span>,
    ) {
        let leg = self.plane.leg(from, to);
        let margin_m = match self.config.kind {
            AreaKind::Inclusion => -touch_m,
            AreaKind::Exclusion => touch_m,
        };
        let Some(in_band) = self
            .band
            .where_inside(&leg, margin_m)
            .and_then(|span| span.and(Span::WHOLE))
        else {
            return;
        };
        match &self.shape {
            Shape::Circle { radius_m } => {
                let inside = where_in_disc(&leg, Coord::zero(), radius_m + margin_m);
                spans.extend(inside.and_then(|span| span.and(in_band)));
            }
            Shape::Polygon { polygon, reach } if passes(&leg, *reach, touch_m) => {
                let inside = where_in_polygon(&leg, polygon, self.config.kind, touch_m);
                spans.extend(inside.into_iter().filter_map(|span| span.and(in_band)));
            }
            Shape::Polygon { .. } => {}
        }
    }

    /// How far a point is inside the area grown by `margin_m`: metres to the nearest side, floor or ceiling; 0 when it
    /// is outside.
    pub(super) fn depth_m(&self, at: &Waypoint, margin_m: f64) -> f64 {
        let (beside_m, above_m) = self.inward_m(at);
        (beside_m.min(above_m) + margin_m).max(0.0)
    }

    /// How far a point is outside the area drawn in by `margin_m`: metres to its nearest point; 0 when it is inside.
    pub(super) fn excess_m(&self, at: &Waypoint, margin_m: f64) -> f64 {
        let (beside_m, above_m) = self.inward_m(at);
        let out_m = |inward_m: f64| (inward_m - margin_m).min(0.0);
        out_m(beside_m).hypot(out_m(above_m))
    }

    /// Metres from the sides, and metres from floor or ceiling, whichever is nearer; negative where that is outside.
    fn inward_m(&self, at: &Waypoint) -> (f64, f64) {
        let point = self.plane.coord(at.latitude_deg, at.longitude_deg);
        let beside_m = match &self.shape {
            Shape::Circle { radius_m } => radius_m - point.x.hypot(point.y),
            Shape::Polygon { polygon, .. } => {
                let distance_m = Euclidean.distance(&Point(point), polygon.exterior());
                if polygon.contains(&point) {
                    distance_m
                } else {
                    -distance_m
                }
            }
        };
        let Band { floor_m, ceiling_m } = self.band;
        let above_m = (at.altitude_m - floor_m).min(ceiling_m - at.altitude_m);
        (beside_m, above_m)
    }
}

impl Band {
    /// Where the leg's line is between floor and ceiling, both moved outwards by a margin.
    fn where_inside(&self, leg: &Leg, margin_m: f64) -> Option<Span> {
        let (low, high) = (self.floor_m - margin_m, self.ceiling_m + margin_m);
        where_between(leg.altitude_m, leg.climb_m, low, high)
    }
}

/// An altitude of a fence: the limits are those of `[movement]`, no waypoint is outside them.
pub(super) fn altitude_m<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<f64>, D::Error> {
    in_range(deserializer, -1000.0..=20_000.0).map(Some)
}

/// Whether the leg comes near the rectangle round a polygon: most legs are far from most areas.
fn passes(leg: &Leg, reach: Coord, touch_m: f64) -> bool {
    let (east_m, north_m) = (reach.x + touch_m, reach.y + touch_m);
    let abreast = where_between(leg.start.x, leg.way.x, -east_m, east_m);
    let level = where_between(leg.start.y, leg.way.y, -north_m, north_m);
    abreast
        .zip(level)
        .and_then(|(abreast, level)| abreast.and(level)?.and(Span::WHOLE))
        .is_some()
}

/// The spans of a leg in a polygon. Membership can only change where the leg is near an edge. So the spans near edges
/// are found first, and one point of each span between them decides for all of it.
fn where_in_polygon(leg: &Leg, polygon: &Polygon, kind: AreaKind, touch_m: f64) -> Vec<Span> {
    let mut touching: Vec<Span> = polygon
        .exterior()
        .lines()
        .filter_map(|edge| where_near_edge(leg, edge, touch_m)?.and(Span::WHOLE))
        .collect();
    let mut inside = rest(&mut touching);
    inside.retain(|span| polygon.contains(&leg.at(span.middle())));
    if kind == AreaKind::Exclusion {
        inside.append(&mut touching);
        join(&mut inside);
    }
    inside
}
