//! Vectors of the flat world around the home: x east, y north, z up, metres or their derivatives.

use std::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

/// Three numbers along east, north and up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vector {
    /// To the east.
    pub x: f64,
    /// To the north.
    pub y: f64,
    /// Up.
    pub z: f64,
}

impl Vector {
    /// No length.
    pub const ZERO: Vector = Vector::new(0.0, 0.0, 0.0);

    /// The vector with these components.
    pub const fn new(x: f64, y: f64, z: f64) -> Vector {
        Vector { x, y, z }
    }

    /// Length.
    pub fn norm(self) -> f64 {
        self.dot(self).sqrt()
    }

    /// Length of the shadow on the ground.
    pub fn horizontal_norm(self) -> f64 {
        self.x.hypot(self.y)
    }

    /// Scalar product.
    pub fn dot(self, other: Vector) -> f64 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// The vector of length 1 in the same direction; nothing for a vector too short to have one.
    pub fn direction(self) -> Option<Vector> {
        let norm = self.norm();
        (norm > 1e-9).then(|| self * (1.0 / norm))
    }

    /// The vector cut to `limit` horizontally and to `vertical_limit` vertically.
    pub fn limited(self, limit: f64, vertical_limit: f64) -> Vector {
        let horizontal = self.horizontal_norm();
        let scale = if horizontal > limit {
            limit / horizontal
        } else {
            1.0
        };
        Vector {
            x: self.x * scale,
            y: self.y * scale,
            z: self.z.clamp(-vertical_limit, vertical_limit),
        }
    }
}

impl Add for Vector {
    type Output = Vector;
    fn add(self, other: Vector) -> Vector {
        Vector::new(self.x + other.x, self.y + other.y, self.z + other.z)
    }
}

impl AddAssign for Vector {
    fn add_assign(&mut self, other: Vector) {
        *self = *self + other;
    }
}

impl Sub for Vector {
    type Output = Vector;
    fn sub(self, other: Vector) -> Vector {
        Vector::new(self.x - other.x, self.y - other.y, self.z - other.z)
    }
}

impl SubAssign for Vector {
    fn sub_assign(&mut self, other: Vector) {
        *self = *self - other;
    }
}

impl Mul<f64> for Vector {
    type Output = Vector;
    fn mul(self, factor: f64) -> Vector {
        Vector::new(self.x * factor, self.y * factor, self.z * factor)
    }
}

impl Neg for Vector {
    type Output = Vector;
    fn neg(self) -> Vector {
        self * -1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_cut_the_shadow_and_the_height_by_themselves() {
        let cut = Vector::new(6.0, 8.0, -3.0).limited(5.0, 2.0);
        assert!((cut - Vector::new(3.0, 4.0, -2.0)).norm() < 1e-12);
        let inside = Vector::new(1.0, 1.0, 1.0);
        assert_eq!(inside.limited(5.0, 2.0), inside);
    }

    #[test]
    fn a_vector_without_length_has_no_direction() {
        assert_eq!(Vector::ZERO.direction(), None);
        let up = Vector::new(0.0, 0.0, 4.0).direction();
        assert_eq!(up, Some(Vector::new(0.0, 0.0, 1.0)));
    }
}
