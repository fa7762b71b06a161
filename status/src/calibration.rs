//! From the raw numbers of sensors and servos to SI units: straight lines, whose figures come from the configuration.

use serde::{Deserialize, Serialize};

runtime::ranged! {
    fn zero_adc(f64) in -1.0e6..=1.0e6;
    fn m_per_step(f64) in -1.0e3..=1.0e3;
    fn deg_per_step(f64) in -360.0..=360.0;
    fn centre_us(f64) in 500.0..=2500.0;
    fn half_travel_us(f64) in 1.0..=2000.0;
}

/// All calibrations. The defaults are those of the simulated helicopter.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Calibration {
    /// Sonar to height over ground.
    pub sonar: Sonar,
    /// Barometric altimeter to altitude.
    pub barometer: Barometer,
    /// Potentiometer to the camera's pan, right positive.
    pub pan: Potentiometer,
    /// Potentiometer to the camera's tilt, up positive.
    pub tilt: Potentiometer,
    /// Pulse width to the servo's travel, the same for all channels of pilot and actuation.
    pub servo: Servo,
}

/// Height over ground by sonar; by default 0 … 10.24 m over the 12 bits of the converter.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Sonar {
    /// Converter value at 0 m.
    #[serde(deserialize_with = "zero_adc")]
    pub zero_adc: f64,
    /// Metres for each step of the converter.
    #[serde(deserialize_with = "m_per_step")]
    pub m_per_step: f64,
}

impl Default for Sonar {
    fn default() -> Self {
        Sonar {
            zero_adc: 0.0,
            m_per_step: 0.0025,
        }
    }
}

impl Sonar {
    /// Height over ground, m.
    pub fn height_m(&self, adc: u32) -> f32 {
        linear(adc, self.zero_adc, self.m_per_step) as f32
    }
}

/// Altitude by the barometer; by default −125 … 898.75 m over the 12 bits of the converter.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Barometer {
    /// Converter value at 0 m.
    #[serde(deserialize_with = "zero_adc")]
    pub zero_adc: f64,
    /// Metres for each step of the converter.
    #[serde(deserialize_with = "m_per_step")]
    pub m_per_step: f64,
}

impl Default for Barometer {
    fn default() -> Self {
        Barometer {
            zero_adc: 500.0,
            m_per_step: 0.25,
        }
    }
}

impl Barometer {
    /// Altitude, m.
    pub fn altitude_m(&self, adc: u32) -> f32 {
        linear(adc, self.zero_adc, self.m_per_step) as f32
    }
}

/// An angle by a potentiometer; by default −90° … 90° over the 12 bits of the converter.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Potentiometer {
    /// Converter value at 0°.
    #[serde(deserialize_with = "zero_adc")]
    pub zero_adc: f64,
    /// Degrees for each step of the converter; negative for a potentiometer that turns the other way.
    #[serde(deserialize_with = "deg_per_step")]
    pub deg_per_step: f64,
}

impl Default for Potentiometer {
    fn default() -> Self {
        Potentiometer {
            zero_adc: 2048.0,
            deg_per_step: 90.0 / 2048.0,
        }
    }
}

impl Potentiometer {
    /// Angle, rad, −π … π.
    pub fn angle_rad(&self, adc: u32) -> f32 {
        angle_rad(linear(adc, self.zero_adc, self.deg_per_step))
    }
}

/// Travel of a servo by its pulse width.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Servo {
    /// Pulse width in the middle of the travel, µs.
    #[serde(deserialize_with = "centre_us")]
    pub centre_us: f64,
    /// From the middle to either end, µs.
    #[serde(deserialize_with = "half_travel_us")]
    pub half_travel_us: f64,
}

impl Default for Servo {
    fn default() -> Self {
        Servo {
            centre_us: 1500.0,
            half_travel_us: 500.0,
        }
    }
}

impl Servo {
    /// −1 … 1 at the ends of the travel. A pulse beyond them gives more: it is shown, not hidden.
    pub fn travel(&self, pulse_us: u32) -> f32 {
        linear(pulse_us, self.centre_us, 1.0 / self.half_travel_us) as f32
    }
}

/// The angle of `deg` degrees in radians, brought into −π … π. Angles within −180° … 180° keep their sign.
pub fn angle_rad(deg: f64) -> f32 {
    let wrapped = if deg.abs() <= 180.0 {
        deg
    } else {
        (deg + 180.0).rem_euclid(360.0) - 180.0
    };
    wrapped.to_radians() as f32
}

fn linear(raw: u32, zero: f64, per_step: f64) -> f64 {
    (f64::from(raw) - zero) * per_step
}

#[cfg(test)]
mod tests {
    use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};

    use super::*;

    #[test]
    fn the_defaults_are_the_documented_lines() {
        let calibration = Calibration::default();
        for (adc, expected_m) in [(0, 0.0), (400, 1.0), (4095, 10.2375)] {
            assert_eq!(calibration.sonar.height_m(adc), expected_m);
        }
        for (adc, expected_m) in [(0, -125.0), (500, 0.0), (700, 50.0), (4095, 898.75)] {
            assert_eq!(calibration.barometer.altitude_m(adc), expected_m);
        }
        for (adc, expected_rad) in [(0, -FRAC_PI_2), (2048, 0.0), (3072, FRAC_PI_4)] {
            assert_eq!(calibration.pan.angle_rad(adc), expected_rad);
            assert_eq!(calibration.tilt.angle_rad(adc), expected_rad);
        }
        for (pulse_us, expected) in [(1000, -1.0), (1500, 0.0), (2000, 1.0), (2500, 2.0)] {
            assert_eq!(calibration.servo.travel(pulse_us), expected);
        }
    }

    #[test]
    fn angles_come_into_one_turn() {
        for (deg, expected_rad) in [
            (0.0, 0.0),
            (90.0, FRAC_PI_2),
            (180.0, PI),
            (-180.0, -PI),
            (270.0, -FRAC_PI_2),
            (360.0, 0.0),
            (-270.0, FRAC_PI_2),
            (765.0, FRAC_PI_4),
        ] {
            assert_eq!(angle_rad(deg), expected_rad, "{deg}");
        }
        assert!(angle_rad(f64::NAN).is_nan());
        assert!(angle_rad(f64::INFINITY).is_nan());
    }
}
