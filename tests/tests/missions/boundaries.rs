//! Flights of chance along the boundaries of a fence: polygons and circles, floor and ceiling, in wind and gusts, with
//! a speed that is raised in the middle of a path, and by DSPs that fly beside the path. The helicopter never leaves
//! the fence, judged by where it truly is and by other formulas than the bridge's; and a path that stays well inside is
//! never held.

use std::time::Duration;

use dsp_protocol::port;
use dsp_sim::helicopter::vector::Vector;
use ipc_types::code::{Reason, SafetyRule, Stage};
use ipc_types::payload::{MovementData, ParameterRequest};

use bridge::BridgeConfig;
use bridge::safety::fence::{Fence, Speeds};
use dsp_protocol::Waypoint;

use crate::missions::config::WorldConfig;
use crate::missions::dice::Dice;
use crate::missions::operator::{Step, fly, point};
use crate::missions::seeds::sums;
use crate::missions::world::{Beside, World};

/// How often the truth is looked at: at 8 m/s the helicopter goes 0.4 m meanwhile.
const LOOK: Duration = Duration::from_millis(50);

/// How long a path is flown beside where it leads.
const BESIDE: Duration = Duration::from_secs(25);

/// How long the helicopter is watched after the end of a path: for longer than it brakes.
const AFTERWARDS: Duration = Duration::from_secs(4);

/// So many paths are drawn to find one that may be flown.
const DRAWS: u32 = 40;

/// Well inside: with twice the margin, and at three quarters of the braking.
const WELL_INSIDE: (f64, f64) = (4.0, 1.9);

sums! {
    /// What flights along boundaries have seen.
    pub struct Bounded {
        pub flights: u64,
        pub refused: u64,
        /// Refused only because there was no room to stop.
        pub refused_ahead: u64,
        pub flown: u64,
        /// Of those flown: well inside, and not made faster on their way.
        pub well_inside: u64,
        /// Paths that were held before the fence.
        pub held: u64,
        /// Held paths of a DSP that flew beside the path.
        pub held_beside: u64,
        /// Held paths that were flown as they were ordered, and not well inside.
        pub held_as_ordered: u64,
    }
    "{flights} flights; {refused} paths refused, {refused_ahead} of them because there was no room to stop; {flown} flown, \
     {well_inside} of them well inside; {held} held before the fence, {held_beside} of them beside the path, {held_as_ordered} \
     of them flown as they were ordered; 0 outside"
}

/// An outline in the flat world.
enum Shape {
    Circle { centre: Vector, radius_m: f64 },
    Polygon(Vec<Vector>),
}

impl Shape {
    /// A circle, or a star-shaped polygon that a circle of 0.6 of its radius fits into.
    fn draw(dice: &mut Dice, centre: Vector, radius_m: f64) -> Shape {
        if dice.once_in(2) {
            return Shape::Circle { centre, radius_m };
        }
        let corners = dice.count(4, 9);
        let corner = |index| {
            let jitter = dice.within(-0.3, 0.3);
            let angle = (index as f64 + jitter) / corners as f64 * std::f64::consts::TAU;
            let length_m = radius_m * dice.within(0.75, 1.0);
            centre + point(angle.sin() * length_m, angle.cos() * length_m, 0.0)
        };
        Shape::Polygon((0..corners).map(corner).collect())
    }

    /// Whether the point is inside: the crossings of a ray to the east are odd.
    fn contains(&self, at: Vector) -> bool {
        match self {
            Shape::Circle { centre, radius_m } => {
                (at.x - centre.x).hypot(at.y - centre.y) < *radius_m
            }
            Shape::Polygon(corners) => {
                let edges = corners.iter().zip(corners.iter().cycle().skip(1));
                let crosses = |(a, b): &(&Vector, &Vector)| {
                    (a.y > at.y) != (b.y > at.y)
                        && at.x < a.x + (at.y - a.y) / (b.y - a.y) * (b.x - a.x)
                };
                edges.filter(crosses).count() % 2 == 1
            }
        }
    }
}

/// A fence in the flat world.
struct Site {
    floor_m: f64,
    ceiling_m: f64,
    /// Whether it must be left alone, and the height above which it does not count.
    areas: Vec<(bool, Shape, f64)>,
}

impl Site {
    fn draw(dice: &mut Dice) -> Site {
        let radius_m = dice.within(50.0, 120.0);
        let field = Shape::draw(dice, point(0.0, 0.0, 0.0), radius_m);
        let mut areas = vec![(false, field, f64::INFINITY)];
        for _ in 0..dice.count(0, 2) {
            let (east_m, north_m) = (dice.within(-90.0, 90.0), dice.within(-90.0, 90.0));
            let radius_m = dice.within(5.0, 25.0);
            // The take-off is at home.
            if east_m.hypot(north_m) > radius_m + 5.0 {
                let shape = Shape::draw(dice, point(east_m, north_m, 0.0), radius_m);
                let top_m = if dice.once_in(2) {
                    dice.within(12.0, 30.0)
                } else {
                    f64::INFINITY
                };
                areas.push((true, shape, top_m));
            }
        }
        Site {
            floor_m: dice.within(2.0, 5.0),
            ceiling_m: dice.within(20.0, 45.0),
            areas,
        }
    }

    fn is_outside(&self, at: Vector) -> bool {
        let is_in = |(_, shape, top_m): &&(bool, Shape, f64)| at.z < *top_m && shape.contains(at);
        let mut inside = self.areas.iter().filter(is_in);
        let is_excluded = inside.clone().any(|(is_exclusion, ..)| *is_exclusion);
        at.z < self.floor_m
            || at.z > self.ceiling_m
            || is_excluded
            || !inside.any(|(is_exclusion, ..)| !is_exclusion)
    }

    /// `[fence]` of the bridge.
    fn toml(&self, config: &WorldConfig) -> String {
        let frame = *World::new(config).simulator.helicopter().world();
        let home_m = config.simulator.model.home.altitude_m;
        let at = |point: &Vector| {
            let place = frame.to_geographic(*point);
            format!("[{:.9}, {:.9}]", place.latitude_deg, place.longitude_deg)
        };
        let (floor_m, ceiling_m) = (home_m + self.floor_m, home_m + self.ceiling_m);
        let mut text = format!("floor_m = {floor_m:.6}\nceiling_m = {ceiling_m:.6}\n");
        for (index, (is_exclusion, shape, top_m)) in self.areas.iter().enumerate() {
            let kind = if *is_exclusion {
                "exclusion"
            } else {
                "inclusion"
            };
            text += &format!("[[fence.area]]\nname = \"{index}\"\nkind = \"{kind}\"\n");
            text += &match shape {
                Shape::Circle { centre, radius_m } => {
                    format!("centre = {}\nradius_m = {radius_m:.6}\n", at(centre))
                }
                Shape::Polygon(corners) => {
                    let corners: Vec<String> = corners.iter().map(at).collect();
                    format!("polygon = [{}]\n", corners.join(", "))
                }
            };
            if top_m.is_finite() {
                text += &format!("ceiling_m = {:.6}\n", home_m + top_m);
            }
        }
        text
    }
}

fn fence(table: &str) -> Fence {
    let parsed: BridgeConfig =
        runtime::config::parse(&format!("[fence]\n{table}"), "a test").expect("a geofence");
    parsed.fence
}

/// One flight of up to five paths.
pub fn fly_bounded(seed: u64) -> Bounded {
    fly_with_room(seed, "")
}

/// One flight of up to five paths with these settings of the room to stop.
fn fly_with_room(seed: u64, room: &str) -> Bounded {
    let mut dice = Dice::new(seed);
    let site = Site::draw(&mut dice);
    let speeds = Speeds {
        begin_mps: f64::INFINITY,
        cruise_mps: dice.within(1.5, 8.0),
        climb_mps: dice.within(1.0, 3.0),
    };
    let (wind_mps, gust_mps) = (dice.within(0.0, 8.0), dice.within(0.0, 1.0));
    let mut config = WorldConfig::new()
        .seed(seed)
        .wind(wind_mps, dice.within(0.0, 360.0), gust_mps)
        .parameters(&format!(
            "cruise_speed_mps = {:.3}\nclimb_speed_mps = {:.3}",
            speeds.cruise_mps, speeds.climb_mps
        ));
    config.bridge.movement.time_limit_s = 300.0;
    // A replay takes as long as the flight.
    config.is_recorded = seed.is_multiple_of(10);
    let table = site.toml(&config);
    config.bridge.fence = fence(&format!("{room}{table}"));
    let (margin_m, braking_mps2) = WELL_INSIDE;
    let well_inside = fence(&format!(
        "margin_m = {margin_m:.1}\nbraking_mps2 = {braking_mps2:.1}\n{table}"
    ));
    let mut world = World::new(&config);
    let height_m = dice.within(site.floor_m + 2.5, 12.0);
    fly(&mut world, &[Step::Start, Step::TakeOff(height_m)]);
    let mut seen = Bounded {
        flights: 1,
        ..Bounded::default()
    };
    let beside = dice.once_in(3).then(|| {
        let direction = dice.within(0.0, std::f64::consts::TAU);
        let (by_m, up_m) = (dice.within(5.0, 60.0), dice.within(-2.0, 8.0));
        point(direction.sin() * by_m, direction.cos() * by_m, up_m)
    });
    for path_id in 1..=5 {
        let body = world.simulator.helicopter().body();
        let (from, velocity_mps) = (body.position_m, body.velocity_mps);
        // At most as it may be measured.
        let hovering_mps = velocity_mps.norm() + 0.3;
        let frame = *world.simulator.helicopter().world();
        let place = |at: &Vector| {
            let place = frame.to_geographic(*at);
            Waypoint {
                latitude_deg: place.latitude_deg,
                longitude_deg: place.longitude_deg,
                altitude_m: place.altitude_m,
            }
        };
        let keeps = |fence: &Fence, path: &[Vector]| {
            let legs = std::iter::once(&from).chain(path).zip(path);
            legs.enumerate().all(|(index, (from, to))| {
                let begin_mps = if index == 0 {
                    hovering_mps
                } else {
                    f64::INFINITY
                };
                let speeds = Speeds {
                    begin_mps,
                    ..speeds
                };
                fence
                    .check_flight(&place(from), &place(to), &speeds)
                    .is_none()
            })
        };
        // Most paths are drawn until one may be flown.
        let mut path = draw_path(&mut dice, &site, from);
        let mut draws = if dice.once_in(5) { 0 } else { DRAWS };
        while draws > 0 && !keeps(&config.bridge.fence, &path) {
            path = draw_path(&mut dice, &site, from);
            draws -= 1;
        }
        // Where it begins, too: nearer to the fence than its margin a first leg has none to keep.
        let is_well_inside = keeps(&well_inside, &[from]) && keeps(&well_inside, &path);
        // In a third of the flights the DSP flies beside the path, and the fence is all that keeps it inside.
        world.beside = beside.map(Beside::new);
        // In a third of the paths somebody makes the helicopter faster than the path was checked for.
        let faster = dice.once_in(3).then(|| dice.duration(0.0, 12.0));
        let mut id = 0;
        for index in 0..path.len() {
            id = world.waypoint(path_id, &path, index);
            let word = world.witness.words(id)[0];
            if word.stage() == Some(Stage::Refused) {
                seen.refused += 1;
                seen.refused_ahead += u64::from(word.rule() == Some(SafetyRule::FenceAhead));
                assert_eq!(word.reason(), Some(Reason::FenceBreach), "{word:?}");
                assert!(!is_well_inside, "a path well inside is refused: {word:?}");
                id = 0;
                break;
            }
        }
        if id == 0 {
            continue;
        }
        seen.flown += 1;
        let begin = world.now();
        let mut faster_at = faster.map(|after| begin + after);
        while world.witness.outcome(id).is_none() {
            if faster_at.take_if(|at| world.now() >= *at).is_some() {
                world.parameter(ParameterRequest::write(0, port::CRUISE_SPEED_MPS, 8.0));
            }
            if beside.is_some() && world.now() > begin + BESIDE {
                world.movement(MovementData::hold(0));
            }
            watch(&mut world, &site, LOOK);
        }
        let outcome = world.witness.outcome(id).expect("it was awaited");
        let is_as_ordered = beside.is_none() && faster.is_none();
        let is_given_up = beside.is_some() && outcome.reason == Reason::Replaced;
        seen.well_inside += u64::from(is_well_inside && is_as_ordered);
        if !outcome.is_done() && !is_given_up {
            seen.held_beside += u64::from(beside.is_some());
            assert_eq!(outcome.reason, Reason::FenceBreach, "{outcome:?}");
            let last = world.witness.words(id);
            let word = last.last().expect("a final report");
            assert_eq!(word.rule(), Some(SafetyRule::FenceAhead), "{word:?}");
            assert!(
                !(is_well_inside && is_as_ordered),
                "held well inside: {word:?}"
            );
            seen.held += 1;
            seen.held_as_ordered += u64::from(is_as_ordered);
        }
        watch(&mut world, &site, AFTERWARDS);
        // Who sees that the DSP flies elsewhere than it is told to orders nothing more of it.
        if beside.is_some() && !outcome.is_done() && !is_given_up {
            break;
        }
        if faster.is_some() {
            let slow = ParameterRequest::write(0, port::CRUISE_SPEED_MPS, speeds.cruise_mps);
            world.parameter(slow);
            watch(&mut world, &site, Duration::from_secs(1));
        }
    }
    world.finish();
    seen
}

/// Now and then its first waypoint is almost where the helicopter is.
fn draw_path(dice: &mut Dice, site: &Site, from: Vector) -> Vec<Vector> {
    let near = |dice: &mut Dice| {
        let mut part = || dice.within(-1.0, 1.0);
        from + point(part(), part(), part())
    };
    (0..dice.count(1, 3))
        .map(|index| match index == 0 && dice.once_in(4) {
            true => near(dice),
            false => waypoint(dice, site),
        })
        .collect()
}

/// A point of the field, or a little outside of it.
fn waypoint(dice: &mut Dice, site: &Site) -> Vector {
    point(
        dice.within(-90.0, 90.0),
        dice.within(-90.0, 90.0),
        dice.within(site.floor_m + 1.0, site.ceiling_m - 1.0),
    )
}

/// Lets time pass, and looks where the helicopter is.
fn watch(world: &mut World, site: &Site, time: Duration) {
    let end = world.now() + time;
    while world.now() < end {
        world.run_for(LOOK);
        let body = world.simulator.helicopter().body();
        assert!(
            !site.is_outside(body.position_m),
            "outside at {:?}: {:?}, {:?}",
            world.now(),
            body.position_m,
            body.velocity_mps
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::missions::seeds;

    #[test]
    fn no_flight_leaves_the_fence_and_no_path_well_inside_is_held() {
        let seen = seeds::fly_each(0..60, fly_bounded);
        println!("{seen}");
        if seen.flights >= 60 {
            assert!(seen.held_beside > 0 && seen.well_inside > 0 && seen.refused_ahead > 0);
        }
    }

    /// What keeps them inside is the room to stop.
    #[test]
    fn without_room_to_stop_flights_leave_the_fence() {
        let no_room = "margin_m = 0.0\nbraking_mps2 = 20.0\nreaction_s = 0.0\n";
        let leaves = |seed: &u64| {
            let flown = std::panic::catch_unwind(|| fly_with_room(*seed, no_room));
            let reason = flown
                .err()
                .and_then(|reason| reason.downcast::<String>().ok());
            reason.is_some_and(|reason| reason.starts_with("outside at"))
        };
        assert!(
            (0..60).any(|seed| leaves(&seed)),
            "the flights prove nothing"
        );
    }
}
