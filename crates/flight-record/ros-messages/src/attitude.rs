//! Attitude in the axes of ROS 2.

use std::f64::consts::FRAC_PI_2;

use ipc_types::TelemetryGroup;
use ipc_types::payload::{HeroAttitude, HeroTelemetry};

/// The attitude; `None` if the telemetry has none.
pub(crate) fn orientation(telemetry: &HeroTelemetry) -> Option<Quaternion> {
    let is_valid = telemetry.valid(TelemetryGroup::Attitude);
    is_valid.then(|| Quaternion::of(&telemetry.attitude))
}

/// A rotation from the body (forward, left, up) to the world (east, north, up): x, y, z, w.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Quaternion(pub(crate) [f64; 4]);

impl Quaternion {
    /// No rotation.
    pub(crate) const IDENTITY: Quaternion = Quaternion([0.0, 0.0, 0.0, 1.0]);

    /// The rotation that an attitude is.
    pub(crate) fn of(attitude: &HeroAttitude) -> Quaternion {
        let roll = f64::from(attitude.roll_rad);
        // About the axis to the left, nose down is positive.
        let pitch = -f64::from(attitude.pitch_rad);
        // From east, counter-clockwise.
        let yaw = FRAC_PI_2 - f64::from(attitude.yaw_rad);
        let (sr, cr) = (roll / 2.0).sin_cos();
        let (sp, cp) = (pitch / 2.0).sin_cos();
        let (sy, cy) = (yaw / 2.0).sin_cos();
        Quaternion([
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ])
    }

    /// A vector of the body in the axes of the world.
    pub(crate) fn rotate(self, vector: [f64; 3]) -> [f64; 3] {
        let Quaternion([x, y, z, w]) = self;
        // v + 2 w (q × v) + 2 q × (q × v)
        let once = cross([x, y, z], vector).map(|element| 2.0 * element);
        let twice = cross([x, y, z], once);
        std::array::from_fn(|axis| vector[axis] + w * once[axis] + twice[axis])
    }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
