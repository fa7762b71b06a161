//! The layout of each group of a status (`docs/protocol.md` section 4.1), and of the waypoint (section 5.2).
//!
//! Writing and reading stand side by side: a group's two halves must name the same fields in the same order.

use crate::downlink::{
    Acceleration, AngularRate, Attitude, Geographic, GpsVelocity, PanTilt, References, ServoPulses,
    Supply, Xy,
};
use crate::frame::{Reader, Writer};
use crate::uplink::Waypoint;

/// Steps of latitude and longitude in one degree.
const POSITION_STEPS_PER_DEG: f64 = 1e7;
/// Steps of a length in one metre.
const STEPS_PER_M: f64 = 1e3;
/// Steps of a speed in one metre per second.
const STEPS_PER_MPS: f32 = 100.0;
/// Steps of an angle other than latitude and longitude in one degree.
const STEPS_PER_DEG: f32 = 100.0;
/// Steps of an acceleration in one metre per second squared.
const STEPS_PER_MPS2: f32 = 100.0;
/// Steps of an angular rate in one radian per second.
const STEPS_PER_RADPS: f32 = 1000.0;

/// A run of values with a fixed place for each.
pub(crate) trait Layout: Sized {
    /// Appends the values.
    fn write(&self, writer: &mut Writer);
    /// Takes the values; whether they were there is told by [`Reader::finish`].
    fn read(reader: &mut Reader<'_>) -> Self;
}

impl Layout for Geographic {
    fn write(&self, writer: &mut Writer) {
        writer.scaled_i32(self.latitude_deg, POSITION_STEPS_PER_DEG);
        writer.scaled_i32(self.longitude_deg, POSITION_STEPS_PER_DEG);
        writer.scaled_i32(self.altitude_m, STEPS_PER_M);
    }

    fn read(reader: &mut Reader<'_>) -> Self {
        Geographic {
            latitude_deg: reader.scaled_i32(POSITION_STEPS_PER_DEG),
            longitude_deg: reader.scaled_i32(POSITION_STEPS_PER_DEG),
            altitude_m: reader.scaled_i32(STEPS_PER_M),
        }
    }
}

impl Layout for Waypoint {
    fn write(&self, writer: &mut Writer) {
        writer.scaled_i32(self.latitude_deg, POSITION_STEPS_PER_DEG);
        writer.scaled_i32(self.longitude_deg, POSITION_STEPS_PER_DEG);
        writer.scaled_i32(self.altitude_m, STEPS_PER_M);
    }

    fn read(reader: &mut Reader<'_>) -> Self {
        Waypoint {
            latitude_deg: reader.scaled_i32(POSITION_STEPS_PER_DEG),
            longitude_deg: reader.scaled_i32(POSITION_STEPS_PER_DEG),
            altitude_m: reader.scaled_i32(STEPS_PER_M),
        }
    }
}

impl Layout for Xy {
    fn write(&self, writer: &mut Writer) {
        writer.scaled_i32(self.x_m, STEPS_PER_M);
        writer.scaled_i32(self.y_m, STEPS_PER_M);
    }

    fn read(reader: &mut Reader<'_>) -> Self {
        Xy {
            x_m: reader.scaled_i32(STEPS_PER_M),
            y_m: reader.scaled_i32(STEPS_PER_M),
        }
    }
}

impl Layout for GpsVelocity {
    fn write(&self, writer: &mut Writer) {
        writer.scaled_u16(self.horizontal_speed_mps, STEPS_PER_MPS);
        writer.scaled_i16(self.vertical_speed_mps, STEPS_PER_MPS);
        writer.scaled_u16(self.heading_deg, STEPS_PER_DEG);
    }

    fn read(reader: &mut Reader<'_>) -> Self {
        GpsVelocity {
            horizontal_speed_mps: reader.scaled_u16(STEPS_PER_MPS),
            vertical_speed_mps: reader.scaled_i16(STEPS_PER_MPS),
            heading_deg: reader.scaled_u16(STEPS_PER_DEG),
        }
    }
}

impl Layout for Attitude {
    fn write(&self, writer: &mut Writer) {
        writer.scaled_i16(self.pitch_deg, STEPS_PER_DEG);
        writer.scaled_i16(self.roll_deg, STEPS_PER_DEG);
        writer.scaled_i16(self.yaw_deg, STEPS_PER_DEG);
    }

    fn read(reader: &mut Reader<'_>) -> Self {
        Attitude {
            pitch_deg: reader.scaled_i16(STEPS_PER_DEG),
            roll_deg: reader.scaled_i16(STEPS_PER_DEG),
            yaw_deg: reader.scaled_i16(STEPS_PER_DEG),
        }
    }
}

impl Layout for Acceleration {
    fn write(&self, writer: &mut Writer) {
        writer.scaled_i16(self.x_mps2, STEPS_PER_MPS2);
        writer.scaled_i16(self.y_mps2, STEPS_PER_MPS2);
        writer.scaled_i16(self.z_mps2, STEPS_PER_MPS2);
    }

    fn read(reader: &mut Reader<'_>) -> Self {
        Acceleration {
            x_mps2: reader.scaled_i16(STEPS_PER_MPS2),
            y_mps2: reader.scaled_i16(STEPS_PER_MPS2),
            z_mps2: reader.scaled_i16(STEPS_PER_MPS2),
        }
    }
}

impl Layout for AngularRate {
    fn write(&self, writer: &mut Writer) {
        writer.scaled_i16(self.x_radps, STEPS_PER_RADPS);
        writer.scaled_i16(self.y_radps, STEPS_PER_RADPS);
        writer.scaled_i16(self.z_radps, STEPS_PER_RADPS);
    }

    fn read(reader: &mut Reader<'_>) -> Self {
        AngularRate {
            x_radps: reader.scaled_i16(STEPS_PER_RADPS),
            y_radps: reader.scaled_i16(STEPS_PER_RADPS),
            z_radps: reader.scaled_i16(STEPS_PER_RADPS),
        }
    }
}

impl Layout for ServoPulses {
    fn write(&self, writer: &mut Writer) {
        writer.u14(self.collective_us);
        writer.u14(self.roll_us);
        writer.u14(self.pitch_us);
        writer.u14(self.tail_us);
        writer.u14(self.throttle_us);
    }

    fn read(reader: &mut Reader<'_>) -> Self {
        ServoPulses {
            collective_us: reader.u14(),
            roll_us: reader.u14(),
            pitch_us: reader.u14(),
            tail_us: reader.u14(),
            throttle_us: reader.u14(),
        }
    }
}

impl Layout for Supply {
    fn write(&self, writer: &mut Writer) {
        writer.u16(self.battery_mv);
        writer.u7(self.fuel_percent);
        writer.u7(self.auto_switch);
    }

    fn read(reader: &mut Reader<'_>) -> Self {
        Supply {
            battery_mv: reader.u16(),
            fuel_percent: reader.u7(),
            auto_switch: reader.u7(),
        }
    }
}

impl Layout for PanTilt {
    fn write(&self, writer: &mut Writer) {
        writer.u14(self.pan_adc);
        writer.u14(self.tilt_adc);
    }

    fn read(reader: &mut Reader<'_>) -> Self {
        PanTilt {
            pan_adc: reader.u14(),
            tilt_adc: reader.u14(),
        }
    }
}

impl Layout for References {
    fn write(&self, writer: &mut Writer) {
        writer.scaled_i16(self.x_speed_mps, STEPS_PER_MPS);
        writer.scaled_i16(self.y_speed_mps, STEPS_PER_MPS);
        writer.scaled_i32(self.altitude_m, STEPS_PER_M);
        writer.scaled_i16(self.pitch_deg, STEPS_PER_DEG);
        writer.scaled_i16(self.roll_deg, STEPS_PER_DEG);
        writer.scaled_i16(self.yaw_deg, STEPS_PER_DEG);
    }

    fn read(reader: &mut Reader<'_>) -> Self {
        References {
            x_speed_mps: reader.scaled_i16(STEPS_PER_MPS),
            y_speed_mps: reader.scaled_i16(STEPS_PER_MPS),
            altitude_m: reader.scaled_i32(STEPS_PER_M),
            pitch_deg: reader.scaled_i16(STEPS_PER_DEG),
            roll_deg: reader.scaled_i16(STEPS_PER_DEG),
            yaw_deg: reader.scaled_i16(STEPS_PER_DEG),
        }
    }
}
