//! The path: the buffer of waypoints that the DSP has taken and not yet reached, and the straight lines and corners
//! between them.

use std::collections::VecDeque;

use super::vector::Vector;

/// Places of the path buffer (`docs/protocol.md` section 8.4). A waypoint that finds it full is refused.
pub const PATH_PLACES: usize = 16;

/// A waypoint in the buffer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BufferedWaypoint {
    /// Running number of the waypoint since the simulator started, from 0.
    pub number: u64,
    /// Where it is in the flat world, m.
    pub position_m: Vector,
}

/// The waypoints still to fly, in order. One keeps its place until it is reached.
#[derive(Clone, Debug, Default)]
pub struct PathBuffer {
    points: VecDeque<BufferedWaypoint>,
    next_number: u64,
}

impl PathBuffer {
    /// Appends a waypoint and gives its number; `None` if the buffer is full.
    pub fn push(&mut self, position_m: Vector) -> Option<u64> {
        if self.free_places() == 0 {
            return None;
        }
        let number = self.next_number;
        self.next_number += 1;
        self.points
            .push_back(BufferedWaypoint { number, position_m });
        Some(number)
    }

    /// The first waypoint that is not reached.
    pub fn front(&self) -> Option<BufferedWaypoint> {
        self.points.front().copied()
    }

    /// Where the newest waypoint is that is not reached.
    pub fn newest(&self) -> Option<Vector> {
        self.points.back().map(|point| point.position_m)
    }

    /// Takes out the first waypoint.
    pub fn pop_front(&mut self) -> Option<BufferedWaypoint> {
        self.points.pop_front()
    }

    /// The waypoints that come after number `number`, in order.
    pub fn after(&self, number: u64) -> impl Iterator<Item = BufferedWaypoint> {
        let points = self.points.iter().copied();
        points.skip_while(move |point| point.number <= number)
    }

    /// Forgets all waypoints.
    pub fn clear(&mut self) {
        self.points.clear();
    }

    /// Whether no waypoint is left.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Places that are free.
    pub fn free_places(&self) -> usize {
        PATH_PLACES - self.points.len()
    }
}

/// Acceleration of guidance along the ground, m/s²; the controller has more, to fight the wind with.
pub const HORIZONTAL_ACCELERATION_MPS2: f64 = 5.0;
/// Acceleration of guidance up and down, m/s².
pub const VERTICAL_ACCELERATION_MPS2: f64 = 4.0;
/// How much of the acceptance radius a rounded corner may use up; the rest is for wind and controller.
const CORNER_SHARE: f64 = 0.4;

/// What the ports allow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Greatest speed along the ground, m/s.
    pub cruise_mps: f64,
    /// Greatest speed up and down, m/s.
    pub climb_mps: f64,
    /// Acceptance radius of a waypoint, m.
    pub acceptance_radius_m: f64,
}

/// A straight piece of path; a length of zero has no direction.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    /// Of length 1, or zero for a line without length.
    pub direction: Vector,
    /// Length, m.
    pub length_m: f64,
}

/// Where two lines meet.
#[derive(Clone, Copy, Debug)]
pub struct Corner {
    /// Difference of the two directions: 0 straight on … 2 back again.
    pub turn: f64,
    /// Acceleration with which it is rounded, m/s².
    pub acceleration_mps2: f64,
    /// Greatest speed with which it can be rounded, m/s.
    pub max_speed_mps: f64,
}

impl Limits {
    /// Greatest acceleration in a direction of length 1.
    pub fn acceleration_along(&self, direction: Vector) -> f64 {
        along(
            direction,
            HORIZONTAL_ACCELERATION_MPS2,
            VERTICAL_ACCELERATION_MPS2,
        )
    }

    /// Greatest speed in a direction of length 1.
    pub fn speed_along(&self, direction: Vector) -> f64 {
        along(direction, self.cruise_mps, self.climb_mps)
    }
}

impl Line {
    /// The line from one point to another.
    pub fn between(from_m: Vector, to_m: Vector) -> Line {
        let way = to_m - from_m;
        match way.direction() {
            Some(direction) => Line {
                direction,
                length_m: way.norm(),
            },
            None => Line {
                direction: Vector::ZERO,
                length_m: 0.0,
            },
        }
    }
}

impl Corner {
    /// The corner between two lines, of whose first `to_go_m` may be used.
    pub fn between(before: &Line, after: &Line, to_go_m: f64, limits: &Limits) -> Corner {
        let difference = after.direction - before.direction;
        let turn = difference.norm();
        let straight_mps = limits
            .speed_along(before.direction)
            .min(limits.speed_along(after.direction));
        let direction = difference.direction().unwrap_or(Vector::ZERO);
        let acceleration_mps2 = limits.acceleration_along(direction);
        let max_speed_mps = if before.length_m == 0.0 || after.length_m == 0.0 {
            0.0
        } else if turn < 1e-6 {
            straight_mps
        } else {
            // The parabola misses the corner by (speed · turn)² / (8 · acceleration).
            let miss_m = CORNER_SHARE * limits.acceptance_radius_m;
            let by_radius_mps = (8.0 * acceleration_mps2 * miss_m).sqrt() / turn;
            // Half of the next line is for the corner at its other end.
            let room_m = to_go_m.min(after.length_m / 2.0);
            let by_room_mps = (2.0 * acceleration_mps2 * room_m / turn).sqrt();
            straight_mps.min(by_radius_mps).min(by_room_mps)
        };
        Corner {
            turn,
            acceleration_mps2,
            max_speed_mps,
        }
    }

    /// How far before the corner a blend at this speed begins, and how far after it ends, m.
    pub fn blend_m(&self, speed_mps: f64) -> f64 {
        speed_mps * speed_mps * self.turn / (2.0 * self.acceleration_mps2)
    }
}

/// How far a direction of length 1 can be stretched until its shadow reaches `horizontal` or its height `vertical`.
fn along(direction: Vector, horizontal: f64, vertical: f64) -> f64 {
    let by_shadow = horizontal / direction.horizontal_norm().max(1e-9);
    let by_height = vertical / direction.z.abs().max(1e-9);
    by_shadow.min(by_height)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteen_waypoints_fit_and_keep_their_order_and_numbers() {
        let mut path = PathBuffer::default();
        for number in 0..16 {
            assert_eq!(
                path.push(Vector::new(number as f64, 0.0, 1.0)),
                Some(number)
            );
        }
        assert_eq!(path.push(Vector::ZERO), None);
        assert_eq!(path.pop_front().map(|point| point.number), Some(0));
        assert_eq!(
            path.push(Vector::ZERO),
            Some(16),
            "a refusal takes no number"
        );
        let after: Vec<u64> = path.after(13).map(|point| point.number).collect();
        assert_eq!(after, [14, 15, 16]);
        path.clear();
        assert!(path.is_empty());
        assert_eq!(path.free_places(), PATH_PLACES);
    }

    const LIMITS: Limits = Limits {
        cruise_mps: 8.0,
        climb_mps: 2.0,
        acceptance_radius_m: 0.5,
    };

    #[test]
    fn neither_the_shadow_nor_the_height_of_a_line_is_flown_too_fast() {
        for (direction, speed_mps) in [
            (Vector::new(1.0, 0.0, 0.0), 8.0),
            (Vector::new(0.0, 0.0, -1.0), 2.0),
            (Vector::new(0.6, 0.0, 0.8), 2.5),
            (Vector::new(0.0, 0.8, 0.6), 2.0 / 0.6),
        ] {
            assert!((LIMITS.speed_along(direction) - speed_mps).abs() < 1e-9);
        }
    }

    #[test]
    fn the_sharper_a_corner_the_slower_it_is() {
        let first = Line::between(Vector::ZERO, Vector::new(20.0, 0.0, 0.0));
        let speed = |angle_deg: f64| {
            let (sin, cos) = angle_deg.to_radians().sin_cos();
            let second = Line::between(Vector::ZERO, Vector::new(20.0 * cos, 20.0 * sin, 0.0));
            let corner = Corner::between(&first, &second, first.length_m, &LIMITS);
            // The point passes within the share of the radius that corners may use.
            let miss_m =
                (corner.max_speed_mps * corner.turn).powi(2) / 8.0 / HORIZONTAL_ACCELERATION_MPS2;
            assert!(miss_m <= CORNER_SHARE * 0.5 + 1e-9);
            corner.max_speed_mps
        };
        assert_eq!(speed(0.0), 8.0);
        assert!((speed(90.0) - 2.0).abs() < 1e-6);
        assert!((speed(180.0) - 2.0_f64.sqrt()).abs() < 1e-6);
    }

    #[test]
    fn a_line_without_length_is_a_stop() {
        let first = Line::between(Vector::ZERO, Vector::new(20.0, 0.0, 0.0));
        let none = Line::between(Vector::ZERO, Vector::ZERO);
        assert_eq!(
            Corner::between(&first, &none, 20.0, &LIMITS).max_speed_mps,
            0.0
        );
        assert_eq!(
            Corner::between(&none, &first, 20.0, &LIMITS).max_speed_mps,
            0.0
        );
    }
}
