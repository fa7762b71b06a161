//! The geofence: where the helicopter may be, checked for each leg before it is flown (requirement H7).
//!
//! A [`Fence`] has a floor, a ceiling, and areas: polygons and circles that must not be left (inclusion) or entered
//! (exclusion), each with a floor and a ceiling of its own. It is made once, from `[fence]` of `bridge.toml`, and never
//! changes. It knows legs, and neither movements nor links.
//!
//! # Exact meaning
//! * Each point of a leg is judged, not only its ends. A leg is straight in latitude, longitude and altitude.
//! * Each point must lie inside at least one inclusion area, if there is any. Inclusion areas that only touch have a
//!   gap between them; let them overlap where the helicopter shall pass.
//! * No point may lie inside an exclusion area. It may pass above its ceiling and below its floor.
//! * A flight must leave room to stop before the boundary ([`Fence::check_flight`], [`Fence::check_ahead`]).
//! * **Touching is a breach**, also of floors and ceilings. Closer than [`TOUCH_M`] counts as touching.
//! * Edges of a polygon are straight in latitude and longitude, like the legs. So nothing that is computed about them
//!   depends on a map projection. Circles and amounts are measured on a flat map around the middle of their area: at
//!   latitude φ, a circle of radius r is wrong by at most 0.4 · r² · tan φ / 6371 km (r = 1 km: 0.06 m at 45°, 0.7 m at
//!   85°; r = 10 km: 6 m at 45°). This is why areas are bounded by [`MAX_EXTENT_M`] and [`MAX_LATITUDE_DEG`].
//! * A leg that is straight on this map leaves the great circle between its ends by at most L² · tan φ / (8 · 6371 km):
//!   0.02 m for 1 km at 45°, 2 m for 10 km.
//!
//! ```
//! use bridge::safety::fence::{Fence, FenceRule};
//! use dsp_protocol::Waypoint;
//!
//! let fence: Fence = runtime::config::parse(
//!     "[[area]]\nname = \"mast\"\nkind = \"exclusion\"\ncentre = [37.0, -6.0]\nradius_m = 50.0\nceiling_m = 80.0",
//!     "fence.toml",
//! )?;
//! let at = |longitude_deg, altitude_m| Waypoint { latitude_deg: 37.0, longitude_deg, altitude_m };
//!
//! let breach = fence.check_leg(&at(-6.01, 60.0), &at(-5.99, 60.0)).unwrap();
//! assert_eq!(breach.rule, FenceRule::Exclusion);
//! assert_eq!(fence.area_name(breach.area.unwrap()), Some("mast"));
//! // The leg passes through the middle. The nearest way out is up.
//! assert!((breach.amount_m - 20.0).abs() < 0.01);
//!
//! assert_eq!(fence.check_leg(&at(-6.01, 90.0), &at(-5.99, 90.0)), None);
//! # Ok::<(), runtime::config::ConfigError>(())
//! ```

mod ahead;
mod area;
mod config;
mod leg;
mod room;

use std::cmp::Ordering;

use dsp_protocol::Waypoint;
use serde::{Deserialize, Serialize};

pub use area::{Area, AreaConfig, AreaKind};
pub use config::{FenceConfig, MAX_AREAS, MAX_VERTICES};
pub use leg::{MAX_EXTENT_M, MAX_LATITUDE_DEG, TOUCH_M};
pub use room::{Room, Speeds, Velocity};

use area::Band;
use leg::{Span, ground_length_m, point_between, rest, where_between};

/// How many points of the part of a leg in breach are looked at to find the worst one.
const SAMPLES: u32 = 128;

/// How often the place of the worst point is halved: a leg of 100 km is then known to 10⁻⁶ m.
const REFINEMENTS: u32 = 32;

/// Where the helicopter may be. The default allows everything.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(try_from = "FenceConfig", into = "FenceConfig")]
pub struct Fence {
    band: Band,
    areas: Vec<Area>,
    room: Room,
}

/// How a leg breaks the fence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Breach {
    /// What it breaks first on its way.
    pub rule: FenceRule,
    /// How far the leg's worst point lies beyond the boundary, metres; 0 when the leg only touches it.
    ///
    /// * Floor, ceiling: metres below or above it at the leg's lower or higher end.
    /// * Exclusion: metres from the point to the nearest way out of the area, through a side, floor or ceiling.
    /// * Inclusion: metres from the point to the nearest inclusion area, in three dimensions.
    /// * Unjudgeable: 0.
    ///
    /// The worst point of exclusion and inclusion is searched at both ends and at 128 evenly spaced points of what is
    /// in breach, and then between the neighbours of the worst of them. The amount is never too large, and at most
    /// 1/256 of the length in breach too small.
    pub amount_m: f64,
    /// The area of an exclusion, by its place in the configuration from 0; for an inclusion, the area nearest to the
    /// worst point. [`Fence::area_name`] names it.
    pub area: Option<usize>,
}

impl Breach {
    /// How a waypoint lies below the ground of the take-off, whose telemetry altitude is `ground_m`: as a floor that
    /// may be touched.
    ///
    /// A telemetry altitude that was meant as a height above take-off, such as 5 m where telemetry shows 10 m on the
    /// ground, leads into the ground. A field that falls away from the place of the take-off is the exception, and its
    /// operator says so (`safety.below_take_off`).
    pub fn of_ground(to: &Waypoint, ground_m: f64) -> Option<Breach> {
        let amount_m = ground_m - to.altitude_m;
        (amount_m > 0.0).then_some(Breach {
            rule: FenceRule::Ground,
            amount_m,
            area: None,
        })
    }

    /// The breach of a leg that cannot be judged.
    const UNJUDGEABLE: Breach = Breach {
        rule: FenceRule::Unjudgeable,
        amount_m: 0.0,
        area: None,
    };
}

/// The rules of a fence. Of several that are broken at the same point, the first one in this order is reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FenceRule {
    /// A coordinate is no number or out of range (±90°, ±180°, ±100 km of altitude), or, with areas, the leg is longer
    /// than [`MAX_EXTENT_M`] or begins or ends beyond [`MAX_LATITUDE_DEG`]. What cannot be judged is not allowed.
    Unjudgeable,
    /// At or below the fence's floor.
    Floor,
    /// At or above the fence's ceiling.
    Ceiling,
    /// In or on an exclusion area.
    Exclusion,
    /// Not inside any inclusion area.
    Inclusion,
    /// Below the ground of the take-off ([`Breach::of_ground`]).
    Ground,
    /// Inside, but with too little room to stop before the boundary ([`Fence::check_flight`]).
    Ahead,
}

/// A rule that a leg breaks, and where: never without a span.
struct BrokenRule {
    rule: FenceRule,
    area: Option<usize>,
    spans: Vec<Span>,
}

impl BrokenRule {
    /// Which of two the leg meets first.
    fn by_place(&self, other: &BrokenRule) -> Ordering {
        self.spans[0].from.total_cmp(&other.spans[0].from)
    }
}

/// The table that makes this fence.
impl From<Fence> for FenceConfig {
    fn from(fence: Fence) -> FenceConfig {
        let (floor_m, ceiling_m) = fence.limits();
        FenceConfig {
            floor_m,
            ceiling_m,
            margin_m: fence.room.margin_m,
            braking_mps2: fence.room.braking_mps2,
            reaction_s: fence.room.reaction_s,
            area: fence.areas,
        }
    }
}

impl TryFrom<FenceConfig> for Fence {
    type Error = String;

    fn try_from(config: FenceConfig) -> Result<Fence, String> {
        let (band, areas, room) = config.checked()?;
        Ok(Fence { band, areas, room })
    }
}

impl Fence {
    /// Floor and ceiling that hold everywhere, metres.
    pub fn limits(&self) -> (Option<f64>, Option<f64>) {
        let end = |altitude_m: f64| altitude_m.is_finite().then_some(altitude_m);
        (end(self.band.floor_m), end(self.band.ceiling_m))
    }

    /// What each area was made of, in their order.
    pub fn area_configs(&self) -> impl Iterator<Item = &AreaConfig> {
        self.areas.iter().map(Area::config)
    }

    /// First breach along the straight leg from `from` to `to`, both included.
    ///
    /// It takes time in proportion to the fence's edges, and allocates for what it finds.
    pub fn check_leg(&self, from: &Waypoint, to: &Waypoint) -> Option<Breach> {
        if self.is_empty() {
            return None;
        }
        if !self.can_judge(from, to) {
            return Some(Breach::UNJUDGEABLE);
        }
        self.first_breach(from, to, 0.0)
    }

    /// First breach along a leg that can be judged, of the fence drawn in by `margin_m`.
    fn first_breach(&self, from: &Waypoint, to: &Waypoint, margin_m: f64) -> Option<Breach> {
        // `min_by` returns the first one of equals, which is the order of the rules.
        let broken_rules = self.broken_rules(from, to, margin_m);
        let first = broken_rules.min_by(BrokenRule::by_place)?;
        Some(self.measure(&first, from, to, margin_m))
    }

    /// Every breach along the same leg, one for each rule and exclusion area, in the order in which the leg meets them:
    /// for a plan, whose author wants to know all of them at once.
    pub fn breaches_of_leg(&self, from: &Waypoint, to: &Waypoint) -> Vec<Breach> {
        if self.is_empty() {
            return Vec::new();
        }
        if !self.can_judge(from, to) {
            return vec![Breach::UNJUDGEABLE];
        }
        let mut broken_rules: Vec<BrokenRule> = self.broken_rules(from, to, 0.0).collect();
        broken_rules.sort_by(BrokenRule::by_place);
        let measure = |broken| self.measure(broken, from, to, 0.0);
        broken_rules.iter().map(measure).collect()
    }

    /// First breach of a whole path flown from `start`, and the number of its leg. The leg from `start` to the first
    /// waypoint has the number 1.
    pub fn check_path<'a>(
        &self,
        start: &Waypoint,
        path: impl IntoIterator<Item = &'a Waypoint>,
    ) -> Option<(usize, Breach)> {
        let mut from = *start;
        path.into_iter().enumerate().find_map(|(index, to)| {
            let breach = self.check_leg(&from, to);
            from = *to;
            breach.map(|breach| (index + 1, breach))
        })
    }

    /// How a single point breaks the fence.
    pub fn check_point(&self, at: &Waypoint) -> Option<Breach> {
        self.check_leg(at, at)
    }

    /// Whether the fence allows everything.
    pub fn is_empty(&self) -> bool {
        self.areas.is_empty() && self.band == Band::default()
    }

    /// How many areas the fence has.
    pub fn areas(&self) -> usize {
        self.areas.len()
    }

    /// The name of an area, by its place in the configuration from 0.
    pub fn area_name(&self, index: usize) -> Option<&str> {
        self.areas.get(index).map(Area::name)
    }

    fn can_judge(&self, from: &Waypoint, to: &Waypoint) -> bool {
        let known = |at: &Waypoint| {
            at.latitude_deg.abs() <= 90.0
                && at.longitude_deg.abs() <= 180.0
                && at.altitude_m.abs() <= MAX_EXTENT_M
        };
        let on_map = |at: &Waypoint| at.latitude_deg.abs() <= MAX_LATITUDE_DEG;
        known(from)
            && known(to)
            && (self.areas.is_empty()
                || (on_map(from) && on_map(to) && ground_length_m(from, to) <= MAX_EXTENT_M))
    }

    fn broken_rules(
        &self,
        from: &Waypoint,
        to: &Waypoint,
        margin_m: f64,
    ) -> impl Iterator<Item = BrokenRule> {
        let margin_m = TOUCH_M + margin_m;
        self.altitude_rules(from, to, margin_m)
            .chain(self.exclusion_rules(from, to, margin_m))
            .chain(self.inclusion_rule(from, to, margin_m))
    }

    fn altitude_rules(
        &self,
        from: &Waypoint,
        to: &Waypoint,
        margin_m: f64,
    ) -> impl Iterator<Item = BrokenRule> + use<> {
        let (start_m, climb_m) = (from.altitude_m, to.altitude_m - from.altitude_m);
        let too_low_m = self.band.floor_m + margin_m;
        let too_high_m = self.band.ceiling_m - margin_m;
        let infinity = f64::INFINITY;
        [
            (
                FenceRule::Floor,
                where_between(start_m, climb_m, -infinity, too_low_m),
            ),
            (
                FenceRule::Ceiling,
                where_between(start_m, climb_m, too_high_m, infinity),
            ),
        ]
        .into_iter()
        .filter_map(|(rule, line)| {
            Some(BrokenRule {
                rule,
                area: None,
                spans: vec![line?.and(Span::WHOLE)?],
            })
        })
    }

    fn exclusion_rules(
        &self,
        from: &Waypoint,
        to: &Waypoint,
        margin_m: f64,
    ) -> impl Iterator<Item = BrokenRule> {
        self.of_kind(AreaKind::Exclusion)
            .filter_map(move |(index, area)| {
                let mut spans = Vec::new();
                area.where_inside(from, to, margin_m, &mut spans);
                (!spans.is_empty()).then_some(BrokenRule {
                    rule: FenceRule::Exclusion,
                    area: Some(index),
                    spans,
                })
            })
    }

    fn inclusion_rule(&self, from: &Waypoint, to: &Waypoint, margin_m: f64) -> Option<BrokenRule> {
        self.of_kind(AreaKind::Inclusion).next()?;
        let mut inside = Vec::new();
        for (_, area) in self.of_kind(AreaKind::Inclusion) {
            area.where_inside(from, to, margin_m, &mut inside);
        }
        let spans = rest(&mut inside);
        (!spans.is_empty()).then_some(BrokenRule {
            rule: FenceRule::Inclusion,
            area: None,
            spans,
        })
    }

    fn of_kind(&self, kind: AreaKind) -> impl Iterator<Item = (usize, &Area)> {
        self.areas
            .iter()
            .enumerate()
            .filter(move |(_, area)| area.kind() == kind)
    }

    fn measure(
        &self,
        broken: &BrokenRule,
        from: &Waypoint,
        to: &Waypoint,
        margin_m: f64,
    ) -> Breach {
        let BrokenRule { rule, area, spans } = broken;
        let mut area = *area;
        let amount_m = match (rule, area) {
            (FenceRule::Floor, _) => {
                self.band.floor_m + margin_m - from.altitude_m.min(to.altitude_m)
            }
            (FenceRule::Ceiling, _) => {
                from.altitude_m.max(to.altitude_m) + margin_m - self.band.ceiling_m
            }
            (_, Some(index)) => {
                let depth_m = |fraction| {
                    self.areas[index].depth_m(&point_between(from, to, fraction), margin_m)
                };
                depth_m(worst_point(spans, depth_m))
            }
            (_, None) => {
                let nearest =
                    |fraction| self.nearest_inclusion(&point_between(from, to, fraction), margin_m);
                let worst = worst_point(spans, |fraction| nearest(fraction).1);
                let (index, amount_m) = nearest(worst);
                area = index;
                amount_m
            }
        };
        Breach {
            rule: *rule,
            amount_m: amount_m.max(0.0),
            area,
        }
    }

    /// The inclusion area that is nearest to a point, and metres from it to there.
    fn nearest_inclusion(&self, at: &Waypoint, margin_m: f64) -> (Option<usize>, f64) {
        self.of_kind(AreaKind::Inclusion)
            .map(|(index, area)| (Some(index), area.excess_m(at, margin_m)))
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or((None, 0.0))
    }
}

/// The fraction of the leg at which `amount_m` is largest, of all that the spans cover.
///
/// An amount changes by at most one metre per metre of the leg, and is 0 where a span ends inside the leg. So the
/// samples miss at most half of their spacing.
fn worst_point(spans: &[Span], amount_m: impl Fn(f64) -> f64) -> f64 {
    let (Some(first), Some(last)) = (spans.first(), spans.last()) else {
        return 0.0;
    };
    let spacing = spans.iter().map(|span| span.length()).sum::<f64>() / f64::from(SAMPLES);
    let mut worst = (first.from, amount_m(first.from));
    let mut consider = |fraction: f64| {
        let amount_m = amount_m(fraction);
        if amount_m > worst.1 {
            worst = (fraction, amount_m);
        }
        worst.0
    };
    consider(last.to);
    // The samples are spaced evenly over the spans put end to end, so a hundred short spans cost no more than a long
    // one.
    let mut before = 0.0;
    let mut sample = 0;
    for span in spans {
        while sample < SAMPLES {
            let into_span = (f64::from(sample) + 0.5) * spacing - before;
            if into_span > span.length() {
                break;
            }
            consider(span.from + into_span);
            sample += 1;
        }
        before += span.length();
    }
    let mut step = spacing;
    let mut centre = consider(last.to);
    for _ in 0..REFINEMENTS {
        consider((centre - step).max(0.0));
        centre = consider((centre + step).min(1.0));
        step /= 2.0;
    }
    centre
}
