//! The path buffer: the waypoints that the DSP has taken and not yet reached.

use std::collections::VecDeque;

use super::vector::Vector;

/// Places of the path buffer (`docs/protocol.md` section 8.4). A waypoint that finds it full is refused.
pub const PATH_PLACES: usize = 16;

/// A waypoint in the buffer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathPoint {
    /// Running number of the waypoint since the simulator started, from 0.
    pub number: u64,
    /// Where it is in the flat world, m.
    pub position_m: Vector,
}

/// The waypoints still to fly, in order. One keeps its place until it is reached.
#[derive(Clone, Debug, Default)]
pub struct PathBuffer {
    points: VecDeque<PathPoint>,
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
        self.points.push_back(PathPoint { number, position_m });
        Some(number)
    }

    /// The first waypoint that is not reached.
    pub fn front(&self) -> Option<PathPoint> {
        self.points.front().copied()
    }

    /// Where the newest waypoint is that is not reached.
    pub fn newest(&self) -> Option<Vector> {
        self.points.back().map(|point| point.position_m)
    }

    /// Takes out the first waypoint.
    pub fn pop_front(&mut self) -> Option<PathPoint> {
        self.points.pop_front()
    }

    /// The waypoints that come after number `number`, in order.
    pub fn after(&self, number: u64) -> impl Iterator<Item = PathPoint> {
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
}
