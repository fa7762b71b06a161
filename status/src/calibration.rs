//! The straight lines by which [`translate`](mod@crate::translate) makes SI units of the raw numbers of sensors and
//! servos: figures of the configuration.

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
