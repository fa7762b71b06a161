//! A second judge of legs, for comparison with [`Fence`](bridge::safety::fence::Fence) and written differently: it
//! knows neither crossings nor intervals.
//!
//! It only computes how far single points are from breaking a rule (distances, and sums of angles for polygons). As
//! this clearance changes by at most one metre per metre of the leg, it walks along the leg in steps that cannot jump
//! over a breach. Where the clearance is within [`GREY_M`] of what counts as touching, either answer is right; the
//! judge says so.

use std::f64::consts::PI;

use bridge::safety::fence::{AreaConfig, AreaKind, Fence, FenceConfig, FenceRule, TOUCH_M};
use dsp_protocol::Waypoint;

/// Half the width of the clearances at which both answers are right: it covers that the two judges measure metres
/// with different formulas, 10⁻⁷ of 2 km apart, and is a tenth of what counts as touching.
pub const GREY_M: f64 = 0.001;

/// How many of the smallest steps a leg that may have touched is watched for a point that surely does.
const FINE_STEPS: u32 = 1000;

/// Steps in which the rest of it is searched.
const COARSE_STEP: f64 = 1e-3;

/// A fence as plain data.
#[derive(Clone, Debug, Default)]
pub struct Site {
    pub floor_m: Option<f64>,
    pub ceiling_m: Option<f64>,
    pub areas: Vec<AreaConfig>,
}

impl Site {
    /// The fence under test.
    pub fn fence(&self) -> Fence {
        let area = self.areas.iter().cloned().map(|area| area.try_into());
        Fence::try_from(FenceConfig {
            floor_m: self.floor_m,
            ceiling_m: self.ceiling_m,
            area: area.collect::<Result<_, _>>().unwrap(),
            ..FenceConfig::default()
        })
        .unwrap()
    }
}

/// Metres per degree of latitude and of longitude: the usual series, good to 10⁻⁷.
pub fn metres_per_degree(latitude_deg: f64) -> [f64; 2] {
    let a = latitude_deg.to_radians();
    [
        111_132.954 - 559.822 * (2.0 * a).cos() + 1.175 * (4.0 * a).cos()
            - 0.0023 * (6.0 * a).cos(),
        111_412.876 * a.cos() - 93.503 * (3.0 * a).cos() + 0.1175 * (5.0 * a).cos(),
    ]
}

/// A longitude or a difference of longitudes from −180 to below 180.
pub fn normal_deg(longitude_deg: f64) -> f64 {
    longitude_deg - 360.0 * ((longitude_deg + 180.0) / 360.0).floor()
}

/// One area in metres round its middle.
struct Zone {
    kind: AreaKind,
    middle_deg: [f64; 2],
    scale: [f64; 2],
    /// No vertices: a circle.
    outline: Vec<[f64; 2]>,
    radius_m: f64,
    floor_m: f64,
    ceiling_m: f64,
}

impl Zone {
    fn new(area: &AreaConfig) -> Zone {
        let vertices = area.polygon.clone().unwrap_or_default();
        let middle_deg = area.centre.unwrap_or_else(|| {
            let first = vertices[0][1];
            let middle = |values: &dyn Fn(&[f64; 2]) -> f64| {
                let values: Vec<f64> = vertices.iter().map(values).collect();
                (values.iter().copied().fold(f64::MAX, f64::min)
                    + values.iter().copied().fold(f64::MIN, f64::max))
                    / 2.0
            };
            [
                middle(&|vertex| vertex[0]),
                first + middle(&|vertex| normal_deg(vertex[1] - first)),
            ]
        });
        let mut zone = Zone {
            kind: area.kind,
            middle_deg,
            scale: metres_per_degree(middle_deg[0]),
            outline: Vec::new(),
            radius_m: area.radius_m.unwrap_or(0.0),
            floor_m: area.floor_m.unwrap_or(f64::NEG_INFINITY),
            ceiling_m: area.ceiling_m.unwrap_or(f64::INFINITY),
        };
        zone.outline = vertices
            .iter()
            .map(|&[lat, lon]| zone.metres(lat, lon))
            .collect();
        zone
    }

    /// [north, east] of the middle.
    fn metres(&self, latitude_deg: f64, longitude_deg: f64) -> [f64; 2] {
        [
            (latitude_deg - self.middle_deg[0]) * self.scale[0],
            normal_deg(longitude_deg - self.middle_deg[1]) * self.scale[1],
        ]
    }

    /// How far a point is inside the sides, and inside floor and ceiling; negative: outside.
    fn inward_m(&self, at: &Waypoint) -> [f64; 2] {
        let point = self.metres(at.latitude_deg, at.longitude_deg);
        let vertical_m = (at.altitude_m - self.floor_m).min(self.ceiling_m - at.altitude_m);
        if self.outline.is_empty() {
            return [self.radius_m - point[0].hypot(point[1]), vertical_m];
        }
        let mut distance_m = f64::MAX;
        let mut turned = 0.0;
        for (index, &a) in self.outline.iter().enumerate() {
            let b = self.outline[(index + 1) % self.outline.len()];
            distance_m = distance_m.min(distance_to_segment_m(point, a, b));
            let angle = |vertex: [f64; 2]| (vertex[0] - point[0]).atan2(vertex[1] - point[1]);
            let turn = angle(b) - angle(a);
            turned += turn - 2.0 * PI * (turn / (2.0 * PI)).round();
        }
        // The outline goes round a point inside once, and round a point outside not at all.
        let inside = f64::abs(turned) > PI;
        [if inside { distance_m } else { -distance_m }, vertical_m]
    }
}

fn distance_to_segment_m(point: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let along = [b[0] - a[0], b[1] - a[1]];
    let from_a = [point[0] - a[0], point[1] - a[1]];
    let squared = along[0] * along[0] + along[1] * along[1];
    let nearest = ((from_a[0] * along[0] + from_a[1] * along[1]) / squared).clamp(0.0, 1.0);
    (from_a[0] - nearest * along[0]).hypot(from_a[1] - nearest * along[1])
}

/// A rule, and for an exclusion its area.
type Constraint = (FenceRule, Option<usize>);

/// Where a leg breaks one constraint, as fractions of it.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    pub constraint: Constraint,
    /// From here on it may touch.
    pub possibly: f64,
    /// Here it surely does, perhaps before.
    pub surely: Option<f64>,
}

/// The judge of one site.
pub struct Oracle {
    floor_m: f64,
    ceiling_m: f64,
    zones: Vec<Zone>,
    constraints: Vec<Constraint>,
}

impl Oracle {
    pub fn new(site: &Site) -> Oracle {
        let zones: Vec<Zone> = site.areas.iter().map(Zone::new).collect();
        let exclusions = zones.iter().enumerate();
        let exclusions = exclusions.filter(|(_, zone)| zone.kind == AreaKind::Exclusion);
        let mut constraints: Vec<Constraint> = exclusions
            .map(|(index, _)| (FenceRule::Exclusion, Some(index)))
            .collect();
        constraints.extend(site.floor_m.map(|_| (FenceRule::Floor, None)));
        constraints.extend(site.ceiling_m.map(|_| (FenceRule::Ceiling, None)));
        if zones.iter().any(|zone| zone.kind == AreaKind::Inclusion) {
            constraints.push((FenceRule::Inclusion, None));
        }
        Oracle {
            floor_m: site.floor_m.unwrap_or(f64::NEG_INFINITY),
            ceiling_m: site.ceiling_m.unwrap_or(f64::INFINITY),
            zones,
            constraints,
        }
    }

    /// How far a point is from breaking a constraint.
    fn room(&self, (rule, area): Constraint, at: &Waypoint, speed: Speed) -> Room {
        let inside = |zone: &Zone| {
            let [sides_m, vertical_m] = zone.inward_m(at);
            speed
                .over_ground(sides_m)
                .nearer(speed.climbing(vertical_m))
        };
        match (rule, area) {
            (FenceRule::Floor, _) => speed.climbing(at.altitude_m - self.floor_m),
            (FenceRule::Ceiling, _) => speed.climbing(self.ceiling_m - at.altitude_m),
            (_, Some(index)) => {
                let [sides_m, vertical_m] = self.zones[index].inward_m(at);
                speed
                    .over_ground(-sides_m)
                    .farther(speed.climbing(-vertical_m))
            }
            (_, None) => {
                let room = self.inclusions().map(inside).reduce(Room::farther);
                room.expect("a constraint that exists")
            }
        }
    }

    /// How much a point breaks a constraint, as [`Breach::amount_m`](bridge::safety::fence::Breach) defines it.
    fn amount_m(&self, constraint: Constraint, at: &Waypoint) -> f64 {
        if constraint.0 == FenceRule::Inclusion {
            let outside_m = |zone: &Zone| {
                let [sides_m, vertical_m] = zone.inward_m(at);
                sides_m.min(0.0).hypot(vertical_m.min(0.0))
            };
            return self.inclusions().map(outside_m).fold(f64::MAX, f64::min);
        }
        let still = Speed {
            ground_m: 0.0,
            climb_m: 0.0,
        };
        (-self.room(constraint, at, still).clearance_m).max(0.0)
    }

    fn inclusions(&self) -> impl Iterator<Item = &Zone> {
        self.zones
            .iter()
            .filter(|zone| zone.kind == AreaKind::Inclusion)
    }

    /// Metres over ground and of altitude for a whole leg, on the map where it is longest.
    fn speed(&self, from: &Waypoint, to: &Waypoint) -> Speed {
        let north_deg = to.latitude_deg - from.latitude_deg;
        let east_deg = normal_deg(to.longitude_deg - from.longitude_deg);
        let maps = self.zones.iter().map(|zone| zone.scale);
        let ground = maps.map(|scale| (north_deg * scale[0]).hypot(east_deg * scale[1]));
        Speed {
            ground_m: ground.fold(0.0, f64::max),
            climb_m: (to.altitude_m - from.altitude_m).abs(),
        }
    }

    /// Length of a leg.
    pub fn length_m(&self, from: &Waypoint, to: &Waypoint) -> f64 {
        let speed = self.speed(from, to);
        speed.ground_m.hypot(speed.climb_m)
    }

    /// Every constraint that a leg breaks or touches.
    pub fn judge(&self, from: &Waypoint, to: &Waypoint) -> Vec<Hit> {
        let speed = self.speed(from, to);
        let least_step = GREY_M / 2.0 / self.length_m(from, to).max(GREY_M);
        let constraints = self.constraints.iter();
        constraints
            .filter_map(|&constraint| {
                let room = |t| self.room(constraint, &along(from, to, t), speed);
                walk(least_step, room).map(|(possibly, surely)| Hit {
                    constraint,
                    possibly,
                    surely,
                })
            })
            .collect()
    }

    /// The largest amount at evenly spaced points of a leg, both ends included.
    pub fn largest_amount_m(
        &self,
        constraint: Constraint,
        from: &Waypoint,
        to: &Waypoint,
        spaces: u32,
    ) -> f64 {
        (0..=spaces)
            .map(|space| along(from, to, f64::from(space) / f64::from(spaces)))
            .map(|at| self.amount_m(constraint, &at))
            .fold(0.0, f64::max)
    }
}

/// How far a leg goes in all.
#[derive(Clone, Copy)]
struct Speed {
    ground_m: f64,
    climb_m: f64,
}

/// How far a point is from breaking something, and what fraction of the leg can surely be flown before it may touch.
#[derive(Clone, Copy)]
struct Room {
    clearance_m: f64,
    fraction: f64,
}

impl Speed {
    fn over_ground(self, clearance_m: f64) -> Room {
        Room::new(clearance_m, self.ground_m)
    }

    fn climbing(self, clearance_m: f64) -> Room {
        Room::new(clearance_m, self.climb_m)
    }
}

impl Room {
    fn new(clearance_m: f64, leg_m: f64) -> Room {
        let free_m = clearance_m - TOUCH_M - GREY_M;
        let fraction = if free_m > 0.0 { free_m / leg_m } else { 0.0 };
        Room {
            clearance_m,
            fraction,
        }
    }

    /// What is broken when either is.
    fn nearer(self, other: Room) -> Room {
        Room {
            clearance_m: self.clearance_m.min(other.clearance_m),
            fraction: self.fraction.min(other.fraction),
        }
    }

    /// What is broken when both are.
    fn farther(self, other: Room) -> Room {
        Room {
            clearance_m: self.clearance_m.max(other.clearance_m),
            fraction: self.fraction.max(other.fraction),
        }
    }
}

/// Where a leg first may touch, and a point where it surely does.
fn walk(least_step: f64, room: impl Fn(f64) -> Room) -> Option<(f64, Option<f64>)> {
    let mut possibly = None;
    let mut steps_since = 0;
    let mut t = 0.0;
    loop {
        let Room {
            clearance_m,
            fraction,
        } = room(t);
        if clearance_m <= TOUCH_M - GREY_M {
            return Some((possibly.unwrap_or(t), Some(t)));
        }
        if clearance_m <= TOUCH_M + GREY_M {
            possibly.get_or_insert(t);
        }
        if t >= 1.0 {
            return possibly.map(|possibly| (possibly, None));
        }
        // Once it may have touched, any later point that surely does tells the rest. A leg that stays that near for
        // long is not walked to its end in fractions of a millimetre.
        steps_since += u32::from(possibly.is_some());
        let least_step = if steps_since > FINE_STEPS {
            COARSE_STEP.max(least_step)
        } else {
            least_step
        };
        t = (t + fraction.max(least_step)).min(1.0);
    }
}

/// The point at a fraction of a leg.
fn along(from: &Waypoint, to: &Waypoint, t: f64) -> Waypoint {
    let east_deg = normal_deg(to.longitude_deg - from.longitude_deg);
    Waypoint {
        latitude_deg: (1.0 - t) * from.latitude_deg + t * to.latitude_deg,
        longitude_deg: normal_deg(from.longitude_deg + t * east_deg),
        altitude_m: (1.0 - t) * from.altitude_m + t * to.altitude_m,
    }
}
