//! The values of the virtual ports (`docs/protocol.md` section 6). Take-off and landing live elsewhere: what they
//! read as is what the helicopter does.

use dsp_protocol::port::{self, PORTS_16, PORTS_32};

use crate::helicopter::Settings;
use crate::helicopter::control::Gains;
use crate::helicopter::path::Limits;
use crate::helicopter::sensors::Trims;

/// A port that does not exist in this width, or a value that it does not take.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no such port, or a value outside its range")]
pub struct InvalidPort;

/// All ports, in the order of the tables of [`dsp_protocol::port`].
#[derive(Clone, Debug, PartialEq)]
pub struct Ports {
    bits_16: [u16; PORTS_16.len()],
    values_32: [f32; PORTS_32.len()],
}

impl Default for Ports {
    /// The values at boot.
    fn default() -> Self {
        let mut ports = Ports {
            bits_16: [0; PORTS_16.len()],
            values_32: [0.0; PORTS_32.len()],
        };
        for (bits, port) in ports.bits_16.iter_mut().zip(PORTS_16) {
            // The boot value of a movement is zero, which cannot be written.
            *bits = port.bits_of(port.boot).unwrap_or(0);
        }
        for (value, port) in ports.values_32.iter_mut().zip(PORTS_32) {
            *value = port.boot;
        }
        ports
    }
}

impl Ports {
    /// Reads a 16-bit port; `None` if there is none with this number.
    pub fn read_16(&self, number: u16) -> Option<u16> {
        let index = PORTS_16.iter().position(|port| port.number == number)?;
        self.bits_16.get(index).copied()
    }

    /// Reads a 32-bit port; `None` if there is none with this number.
    pub fn read_32(&self, number: u16) -> Option<f32> {
        let index = PORTS_32.iter().position(|port| port.number == number)?;
        self.values_32.get(index).copied()
    }

    /// Writes a 16-bit port.
    ///
    /// # Errors
    /// There is none with this number, or the value lies outside its range; nothing has changed.
    pub fn write_16(&mut self, number: u16, bits: u16) -> Result<(), InvalidPort> {
        let mut ports = PORTS_16.iter().zip(&mut self.bits_16);
        let (_, place) = ports
            .find(|(port, _)| port.number == number && port.accepts(bits))
            .ok_or(InvalidPort)?;
        *place = bits;
        Ok(())
    }

    /// Writes a 32-bit port.
    ///
    /// # Errors
    /// As [`write_16`](Self::write_16).
    pub fn write_32(&mut self, number: u16, value: f32) -> Result<(), InvalidPort> {
        let mut ports = PORTS_32.iter().zip(&mut self.values_32);
        let (_, place) = ports
            .find(|(port, _)| port.number == number && port.accepts(value))
            .ok_or(InvalidPort)?;
        *place = value;
        Ok(())
    }

    /// What the ports mean to the helicopter.
    pub fn settings(&self) -> Settings {
        let word = |number| self.read_16(number).unwrap_or_default();
        let float = |number| f64::from(self.read_32(number).unwrap_or_default());
        Settings {
            limits: Limits {
                cruise_mps: float(port::CRUISE_SPEED_MPS),
                climb_mps: float(port::CLIMB_SPEED_MPS),
                acceptance_radius_m: float(port::ACCEPTANCE_RADIUS_M),
            },
            gains: Gains {
                position_per_s: float(port::POSITION_GAIN),
                velocity_per_s: float(port::VELOCITY_GAIN),
                attitude_per_s: float(port::ATTITUDE_GAIN),
                yaw_per_s: float(port::YAW_GAIN),
            },
            take_off_height_m: float(port::TAKE_OFF_ALTITUDE_M),
            rotor_rpm: f64::from(word(port::ROTOR_SPEED_RPM)),
            trims: Trims {
                collective_us: word(port::TRIM_COLLECTIVE_US).cast_signed(),
                roll_us: word(port::TRIM_ROLL_US).cast_signed(),
                pitch_us: word(port::TRIM_PITCH_US).cast_signed(),
                tail_us: word(port::TRIM_TAIL_US).cast_signed(),
                throttle_us: word(port::TRIM_THROTTLE_US).cast_signed(),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_port_keeps_what_was_written_however_often_it_is_read() {
        let mut ports = Ports::default();
        for port in PORTS_16 {
            let bits = port.bits_of(port.max).unwrap();
            assert_eq!(ports.write_16(port.number, bits), Ok(()));
            for _ in 0..3 {
                assert_eq!(ports.read_16(port.number), Some(bits), "{}", port.name);
            }
        }
        for port in PORTS_32 {
            assert_eq!(ports.write_32(port.number, port.min), Ok(()));
            for _ in 0..3 {
                assert_eq!(ports.read_32(port.number), Some(port.min), "{}", port.name);
            }
        }
    }

    #[test]
    fn a_value_out_of_range_or_a_port_of_the_other_width_changes_nothing() {
        let mut ports = Ports::default();
        for (number, bits) in [
            (port::STATUS_PERIOD_MS, 0),
            (port::STATUS_PERIOD_MS, 10_001),
            (port::TRIM_ROLL_US, 501),
            (port::CRUISE_SPEED_MPS, 1),
            (9, 1),
        ] {
            assert_eq!(ports.write_16(number, bits), Err(InvalidPort), "{number}");
        }
        for (number, value) in [
            (port::CRUISE_SPEED_MPS, 20.1),
            (port::CRUISE_SPEED_MPS, f32::NAN),
            (port::STATUS_MASK, 1.0),
            (9, 1.0),
        ] {
            assert_eq!(ports.write_32(number, value), Err(InvalidPort), "{number}");
        }
        assert_eq!(ports, Ports::default());
        assert_eq!(ports.read_16(port::CRUISE_SPEED_MPS), None);
        assert_eq!(ports.read_32(port::STATUS_MASK), None);
    }

    #[test]
    fn every_setting_comes_from_its_port() {
        let mut ports = Ports::default();
        ports
            .write_16(port::TRIM_TAIL_US, (-7_i16).cast_unsigned())
            .unwrap();
        ports.write_16(port::ROTOR_SPEED_RPM, 1_700).unwrap();
        ports.write_32(port::YAW_GAIN, 2.5).unwrap();
        ports.write_32(port::CLIMB_SPEED_MPS, 4.0).unwrap();
        let boot = Ports::default().settings();
        let mut expected = boot;
        expected.trims.tail_us = -7;
        expected.rotor_rpm = 1_700.0;
        expected.gains.yaw_per_s = 2.5;
        expected.limits.climb_mps = 4.0;
        assert_eq!(ports.settings(), expected);
        assert_eq!(boot.limits.cruise_mps, 5.0);
        assert_eq!(boot.take_off_height_m, 10.0);
    }
}
