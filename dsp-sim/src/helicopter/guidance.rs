//! Where the helicopter should be at each moment: straight lines between waypoints, rounded where they meet.
//!
//! Guidance moves a point. On a line the point speeds up, cruises and brakes with one acceleration; where two lines
//! meet it leaves the first before the corner and joins the second after it, with a constant acceleration between (a
//! *blend*, a piece of parabola). The speed at a corner is chosen so that the parabola passes the waypoint well
//! within its acceptance radius and needs no more acceleration than the helicopter has. At the last waypoint the
//! point stops.
//!
//! Guidance does not look at the helicopter: it learns only which waypoints are left in the buffer. It runs at most one
//! corner ahead of them, and goes back to a waypoint that the helicopter missed.

use super::body::STEP_S;
use super::path::{
    BufferedWaypoint, Corner, Limits, Line, PATH_PLACES, PathBuffer, VERTICAL_ACCELERATION_MPS2,
};
use super::vector::Vector;

/// Lowest height of a path, m: the least take-off altitude of port 20121.
pub const MIN_PATH_HEIGHT_M: f64 = 0.5;
/// Below this height a landing goes on at touch-down speed, m.
const FLARE_HEIGHT_M: f64 = 0.3;
/// Speed of touch-down, m/s.
const TOUCH_DOWN_MPS: f64 = 0.4;
/// A landing aims this far below the ground, m, so that no offset of the controller keeps the skids in the air.
const LANDING_DEPTH_M: f64 = 1.0;
/// How long the point rests before it goes back to a waypoint that the helicopter missed, s.
const MISSED_AFTER_S: f64 = 3.0;
/// Braking ends this early, s, so that the point has the speed of a corner before it can begin to round it.
const BRAKE_MARGIN_S: f64 = 2.0 * STEP_S;
/// Least speed on a line, m/s: the square root that brakes would otherwise creep for ever.
const CREEP_MPS: f64 = 0.02;
/// Changes of motion that can happen within one step: leg to blend, blend to leg and spare ones for short legs.
const MAX_CHANGES: usize = 4;

/// The moving point.
#[derive(Clone, Debug)]
pub struct Guidance {
    position_m: Vector,
    motion: Motion,
    /// The waypoint that the point flies to, or last flew to.
    number: Option<u64>,
}

/// How the point moves.
#[derive(Clone, Copy, Debug)]
enum Motion {
    /// It rests.
    Hold { since_s: f64 },
    /// It slows down straight ahead, to rest or to descend.
    Brake { velocity_mps: Vector, descend: bool },
    /// It flies along a line.
    Leg(GuidedLeg),
    /// It goes over from one line to the next.
    Blend {
        velocity_mps: Vector,
        acceleration_mps2: Vector,
        left_s: f64,
        /// Where the blend ends, and how it goes on.
        exit_m: Vector,
        next: GuidedLeg,
    },
    /// It sinks through the ground.
    Descend { speed_mps: f64 },
}

/// A line that is being flown.
#[derive(Clone, Copy, Debug)]
struct GuidedLeg {
    /// Nothing for a climb, which no waypoint asked for.
    number: Option<u64>,
    target_m: Vector,
    line: Line,
    speed_mps: f64,
}

impl Guidance {
    /// A point at rest.
    pub fn at(position_m: Vector) -> Guidance {
        Guidance {
            position_m,
            motion: Motion::Hold { since_s: 0.0 },
            number: None,
        }
    }

    /// Where the point is, m.
    pub fn position_m(&self) -> Vector {
        self.position_m
    }

    /// Number of the waypoint that the point flies to, or rests at.
    pub fn number(&self) -> Option<u64> {
        self.number
    }

    /// Whether the point rests.
    pub fn at_rest(&self) -> bool {
        matches!(self.motion, Motion::Hold { .. })
    }

    /// Flies straight to `target_m` and rests there.
    pub fn fly_to(&mut self, target_m: Vector) {
        self.start_leg(None, target_m);
    }

    /// Comes to rest straight ahead.
    pub fn brake(&mut self) {
        self.leave_path(false);
    }

    /// Comes to rest straight ahead, then sinks until [`Guidance::at`] ends it.
    pub fn land(&mut self) {
        self.leave_path(true);
    }

    fn leave_path(&mut self, descend: bool) {
        self.number = None;
        let velocity_mps = match self.motion {
            Motion::Hold { .. } => Vector::ZERO,
            Motion::Brake { velocity_mps, .. } | Motion::Blend { velocity_mps, .. } => velocity_mps,
            Motion::Leg(leg) => leg.line.direction * leg.speed_mps,
            Motion::Descend { speed_mps } => Vector::new(0.0, 0.0, -speed_mps),
        };
        self.motion = Motion::Brake {
            velocity_mps,
            descend,
        };
    }

    /// Lets [`STEP_S`] pass.
    pub fn step(&mut self, path: &PathBuffer, limits: &Limits) {
        let mut left_s = STEP_S;
        for _ in 0..MAX_CHANGES {
            if left_s <= 0.0 {
                break;
            }
            left_s = match self.motion {
                Motion::Hold { since_s } => self.hold(path, since_s, left_s),
                Motion::Brake {
                    velocity_mps,
                    descend,
                } => self.slow_down(limits, velocity_mps, descend, left_s),
                Motion::Leg(leg) => self.follow(path, limits, leg, left_s),
                Motion::Blend { .. } => self.blend(left_s),
                Motion::Descend { speed_mps } => self.descend(limits, speed_mps, left_s),
            };
        }
    }

    /// Rests, or sets off for the next waypoint. Like all the motions it gives the time that it left over.
    fn hold(&mut self, path: &PathBuffer, since_s: f64, left_s: f64) -> f64 {
        let first = path.front();
        let next = match (first, self.number) {
            (Some(first), Some(here)) if first.number < here => {
                (since_s >= MISSED_AFTER_S).then_some(first)
            }
            (_, Some(here)) => path.after(here).next(),
            (first, None) => first,
        };
        match next {
            Some(point) => {
                self.start_leg(Some(point.number), point.position_m);
                left_s
            }
            None => {
                let since_s = since_s + left_s;
                self.motion = Motion::Hold { since_s };
                0.0
            }
        }
    }

    fn start_leg(&mut self, number: Option<u64>, target_m: Vector) {
        self.number = number;
        self.motion = Motion::Leg(GuidedLeg {
            number,
            target_m,
            line: Line::between(self.position_m, target_m),
            speed_mps: 0.0,
        });
    }

    fn slow_down(
        &mut self,
        limits: &Limits,
        velocity_mps: Vector,
        descend: bool,
        left_s: f64,
    ) -> f64 {
        let speed_mps = velocity_mps.norm();
        let direction = velocity_mps.direction().unwrap_or(Vector::ZERO);
        let slower_mps = speed_mps - limits.acceleration_along(direction) * left_s;
        if slower_mps <= 0.0 {
            self.motion = if descend {
                Motion::Descend { speed_mps: 0.0 }
            } else {
                Motion::Hold { since_s: 0.0 }
            };
            return 0.0;
        }
        // A helicopter that brakes while it sinks fast near the ground flattens out.
        let floor_m = self.position_m.z.min(MIN_PATH_HEIGHT_M);
        self.position_m += direction * ((speed_mps + slower_mps) / 2.0 * left_s);
        self.position_m.z = self.position_m.z.max(floor_m);
        self.motion = Motion::Brake {
            velocity_mps: direction * slower_mps,
            descend,
        };
        0.0
    }

    fn follow(
        &mut self,
        path: &PathBuffer,
        limits: &Limits,
        mut leg: GuidedLeg,
        left_s: f64,
    ) -> f64 {
        let to_go_m = (leg.target_m - self.position_m).dot(leg.line.direction);
        let next = next_point(path, &leg);
        let speed_mps = leg.speed_mps;
        let end = corner_speed(path, limits, &leg, to_go_m);
        let acceleration_mps2 = limits.acceleration_along(leg.line.direction);
        if let Some(next) = next {
            let line = Line::between(leg.target_m, next.position_m);
            let corner = Corner::between(&leg.line, &line, f64::INFINITY, limits);
            let blend_m = corner.blend_m(speed_mps);
            // The tolerances are for rounding. Outside them the point brakes on, if need be to a stop at the corner.
            let may_blend =
                speed_mps > 0.0 && speed_mps <= end.speed_mps * 1.001 && to_go_m > 0.95 * blend_m;
            // A helicopter that still speeds up in this step could be too fast and too near to blend in the next.
            let faster_mps = speed_mps + acceleration_mps2 * left_s;
            if may_blend && to_go_m - faster_mps * left_s < corner.blend_m(faster_mps) {
                let before_s = (to_go_m - blend_m).max(0.0) / speed_mps;
                let straight_s = before_s.min(left_s);
                self.position_m += leg.line.direction * (speed_mps * straight_s);
                if before_s < left_s {
                    self.start_blend(&leg, blend_m.min(to_go_m), next, line);
                }
                return left_s - straight_s;
            }
        }
        let margin_m = BRAKE_MARGIN_S * speed_mps;
        let brake_m = (to_go_m - end.blend_m - margin_m).max(0.0);
        let allowed_mps = end.speed_mps.powi(2) + 2.0 * acceleration_mps2 * brake_m;
        let change_mps = acceleration_mps2 * left_s;
        leg.speed_mps = limits
            .speed_along(leg.line.direction)
            .min(allowed_mps.sqrt())
            .clamp(speed_mps - change_mps, speed_mps + change_mps)
            .max(CREEP_MPS);
        let move_m = (speed_mps + leg.speed_mps) / 2.0 * left_s;
        if to_go_m <= move_m.max(1e-4) {
            self.position_m = leg.target_m;
            match next {
                Some(next) => self.start_leg(Some(next.number), next.position_m),
                None => self.motion = Motion::Hold { since_s: 0.0 },
            }
        } else {
            self.position_m += leg.line.direction * move_m;
            self.motion = Motion::Leg(leg);
        }
        0.0
    }

    /// Begins to round the corner at the end of `leg`, which is `to_go_m` away.
    fn start_blend(&mut self, leg: &GuidedLeg, to_go_m: f64, next: BufferedWaypoint, line: Line) {
        let left_s = 2.0 * to_go_m / leg.speed_mps;
        let change_mps = (line.direction - leg.line.direction) * leg.speed_mps;
        self.number = Some(next.number);
        self.motion = Motion::Blend {
            velocity_mps: leg.line.direction * leg.speed_mps,
            // Straight on, the blend has neither length nor change.
            acceleration_mps2: change_mps * (1.0 / left_s.max(1e-9)),
            left_s,
            exit_m: leg.target_m + line.direction * to_go_m,
            next: GuidedLeg {
                number: Some(next.number),
                target_m: next.position_m,
                line,
                speed_mps: leg.speed_mps,
            },
        };
    }

    fn blend(&mut self, step_s: f64) -> f64 {
        let Motion::Blend {
            velocity_mps,
            acceleration_mps2,
            left_s,
            exit_m,
            next,
        } = &mut self.motion
        else {
            return 0.0;
        };
        if *left_s <= step_s {
            let over_s = step_s - *left_s;
            self.position_m = *exit_m;
            self.motion = Motion::Leg(*next);
            return over_s;
        }
        self.position_m += *velocity_mps * step_s + *acceleration_mps2 * (step_s * step_s / 2.0);
        *velocity_mps += *acceleration_mps2 * step_s;
        *left_s -= step_s;
        0.0
    }

    fn descend(&mut self, limits: &Limits, speed_mps: f64, left_s: f64) -> f64 {
        let above_m = (self.position_m.z - FLARE_HEIGHT_M - speed_mps * left_s).max(0.0);
        let wanted_mps = (TOUCH_DOWN_MPS.powi(2) + 2.0 * VERTICAL_ACCELERATION_MPS2 * above_m)
            .sqrt()
            .min(limits.climb_mps.max(TOUCH_DOWN_MPS));
        let change_mps = VERTICAL_ACCELERATION_MPS2 * left_s;
        let speed_mps = wanted_mps.clamp(speed_mps - change_mps, speed_mps + change_mps);
        self.position_m.z = (self.position_m.z - speed_mps * left_s).max(-LANDING_DEPTH_M);
        self.motion = Motion::Descend { speed_mps };
        0.0
    }
}

/// What the end of a line demands.
#[derive(Clone, Copy, Debug, Default)]
struct LegEnd {
    speed_mps: f64,
    blend_m: f64,
}

impl LegEnd {
    /// The greatest speed at `corner` from which `line`, whose end this is, leaves room to brake.
    ///
    /// With this end's speed e and blend b, the line's length l and braking c, a margin of time m, and a blend at the
    /// corner of k·v² / 2c, it is the v that solves v² = e² + 2c · (l − b − m·v − k·v² / 2c).
    fn speed_before(&self, limits: &Limits, corner: &Corner, line: &Line) -> f64 {
        let brake_mps2 = limits.acceleration_along(line.direction);
        let factor = 1.0 + brake_mps2 * corner.turn / corner.acceleration_mps2;
        let room_m = (line.length_m - self.blend_m).max(0.0);
        let linear_mps = brake_mps2 * (BRAKE_MARGIN_S + STEP_S);
        let square = self.speed_mps.powi(2) + 2.0 * brake_mps2 * room_m;
        ((linear_mps * linear_mps + factor * square).sqrt() - linear_mps) / factor
    }
}

/// The speed at the end of the leg that is being flown, such that every corner after it can be met.
fn corner_speed(path: &PathBuffer, limits: &Limits, leg: &GuidedLeg, to_go_m: f64) -> LegEnd {
    let mut points = [leg.target_m; PATH_PLACES + 1];
    let mut last = 0;
    if next_point(path, leg).is_some() {
        let following = leg.number.into_iter().flat_map(|number| path.after(number));
        for (place, point) in points[1..].iter_mut().zip(following) {
            *place = point.position_m;
            last += 1;
        }
    }
    let mut end = LegEnd::default();
    for index in (0..last).rev() {
        let after = Line::between(points[index], points[index + 1]);
        let current = index == 0;
        let (before, room_m) = if current {
            (leg.line, to_go_m)
        } else {
            let before = Line::between(points[index - 1], points[index]);
            (before, before.length_m / 2.0)
        };
        let corner = Corner::between(&before, &after, room_m.max(0.0), limits);
        let mut speed_mps = corner
            .max_speed_mps
            .min(end.speed_before(limits, &corner, &after));
        if current {
            speed_mps = speed_mps.min(reachable_speed(limits, leg, &corner, to_go_m));
        }
        end = LegEnd {
            speed_mps,
            blend_m: corner.blend_m(speed_mps),
        };
    }
    end
}

/// The greatest speed at the corner for which the leg's present speed is not too high: a waypoint that is appended late
/// finds the point already braking to stop.
fn reachable_speed(limits: &Limits, leg: &GuidedLeg, corner: &Corner, to_go_m: f64) -> f64 {
    let brake_mps2 = limits.acceleration_along(leg.line.direction);
    let sharpness = corner.turn * brake_mps2 / corner.acceleration_mps2 - 1.0;
    if sharpness <= 1e-6 {
        return f64::INFINITY;
    }
    let spare = 2.0 * brake_mps2 * to_go_m - leg.speed_mps.powi(2);
    (spare.max(0.0) / sharpness).sqrt()
}

/// The waypoint after `leg`, unless the helicopter has yet to reach one before it.
fn next_point(path: &PathBuffer, leg: &GuidedLeg) -> Option<BufferedWaypoint> {
    let number = leg.number?;
    if path.front().is_some_and(|first| first.number < number) {
        return None;
    }
    path.after(number).next()
}

#[cfg(test)]
mod tests;
