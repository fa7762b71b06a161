//! The DSP's virtual ports (`docs/protocol.md` section 6).
//!
//! The tables list what may be written; what a port does is up to the DSP. All ports of the tables can be read and
//! written; [`WAYPOINT_COUNT`] can only be read and stands in neither.

use Access::{Always, Bridge, OnGround};

/// 16-bit port: the status mask.
pub const STATUS_MASK: u16 = 10_000;
/// 16-bit port: status period, ms.
pub const STATUS_PERIOD_MS: u16 = 10_001;
/// 16-bit port: flow control period, ms.
pub const FLOW_CONTROL_PERIOD_MS: u16 = 10_002;
/// 16-bit port: how many waypoints the DSP took; bit 15 is always set.
pub const WAYPOINT_COUNT: u16 = 10_003;
/// 16-bit port: after how long without a message from the PC the DSP empties its path buffer, ms; 0 never.
pub const PC_TIMEOUT_MS: u16 = 10_004;
/// 16-bit port: write 1 to take off.
pub const TAKE_OFF: u16 = 10_121;
/// 16-bit port: write 1 to land.
pub const LAND: u16 = 10_122;
/// 16-bit port: trim of the collective pitch, µs, signed.
pub const TRIM_COLLECTIVE_US: u16 = 10_200;
/// 16-bit port: trim of the roll cyclic, µs, signed.
pub const TRIM_ROLL_US: u16 = 10_201;
/// 16-bit port: trim of the pitch cyclic, µs, signed.
pub const TRIM_PITCH_US: u16 = 10_202;
/// 16-bit port: trim of the tail rotor, µs, signed.
pub const TRIM_TAIL_US: u16 = 10_203;
/// 16-bit port: trim of the throttle, µs, signed.
pub const TRIM_THROTTLE_US: u16 = 10_204;
/// 16-bit port: rotor speed set point, rpm.
pub const ROTOR_SPEED_RPM: u16 = 10_210;
/// 32-bit port: cruise speed, m/s.
pub const CRUISE_SPEED_MPS: u16 = 20_000;
/// 32-bit port: climb speed, m/s.
pub const CLIMB_SPEED_MPS: u16 = 20_001;
/// 32-bit port: acceptance radius of a waypoint, m.
pub const ACCEPTANCE_RADIUS_M: u16 = 20_002;
/// 32-bit port: gain of the position loop, 1/s.
pub const POSITION_GAIN: u16 = 20_010;
/// 32-bit port: gain of the velocity loop, 1/s.
pub const VELOCITY_GAIN: u16 = 20_011;
/// 32-bit port: gain of the attitude loop, 1/s.
pub const ATTITUDE_GAIN: u16 = 20_012;
/// 32-bit port: gain of the yaw loop, 1/s.
pub const YAW_GAIN: u16 = 20_013;
/// 32-bit port: take-off altitude above the point of take-off, m.
pub const TAKE_OFF_ALTITUDE_M: u16 = 20_121;

/// Who may write a port, and when (`docs/protocol.md` section 6).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// The bridge alone: it belongs to the start-up sequence or to a movement.
    Bridge,
    /// Any process with the right to command, while the helicopter stands on the ground.
    OnGround,
    /// Any process with the right to command, at any time.
    Always,
}

/// A 16-bit port as section 6 lists it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Port16 {
    /// Number of the port.
    pub number: u16,
    /// Name in configuration files, with the unit if the value has one.
    pub name: &'static str,
    /// Whether the value is two's complement.
    pub signed: bool,
    /// Least value that may be written.
    pub min: i32,
    /// Greatest value that may be written.
    pub max: i32,
    /// Value at boot.
    pub boot: i32,
    /// Who may write it, and when.
    pub access: Access,
}

impl Port16 {
    /// The value that the 16 bits on the wire stand for.
    pub fn value_of(&self, bits: u16) -> i32 {
        if self.signed {
            i32::from(bits.cast_signed())
        } else {
            i32::from(bits)
        }
    }

    /// The 16 bits that stand for `value` on the wire; `None` when it may not be written.
    pub fn bits_of(&self, value: i32) -> Option<u16> {
        // Every range of the table lies within the 16 bits, so that the low half of a value in range is its pattern.
        (self.min..=self.max)
            .contains(&value)
            .then_some(value.cast_unsigned() as u16)
    }

    /// Whether the 16 bits on the wire may be written.
    pub fn accepts(&self, bits: u16) -> bool {
        (self.min..=self.max).contains(&self.value_of(bits))
    }
}

/// A 32-bit port as section 6 lists it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Port32 {
    /// Number of the port.
    pub number: u16,
    /// Name in configuration files, with the unit.
    pub name: &'static str,
    /// Least value that may be written.
    pub min: f32,
    /// Greatest value that may be written.
    pub max: f32,
    /// Value at boot.
    pub boot: f32,
    /// Who may write it, and when.
    pub access: Access,
}

impl Port32 {
    /// Whether `value` may be written: in range, hence finite.
    pub fn accepts(&self, value: f32) -> bool {
        (self.min..=self.max).contains(&value)
    }
}

/// A port of either width.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Port {
    /// A 16-bit integer port.
    Bits16(&'static Port16),
    /// A 32-bit floating-point port.
    Bits32(&'static Port32),
}

/// All 16-bit ports, ascending.
pub const PORTS_16: &[Port16] = &[
    unsigned(STATUS_MASK, "status_mask", (0, 65_535), 0, Bridge),
    unsigned(
        STATUS_PERIOD_MS,
        "status_period_ms",
        (1, 10_000),
        20,
        Always,
    ),
    unsigned(
        FLOW_CONTROL_PERIOD_MS,
        "flow_control_period_ms",
        (10, 1000),
        100,
        Always,
    ),
    unsigned(PC_TIMEOUT_MS, "pc_timeout_ms", (0, 60_000), 0, Bridge),
    unsigned(TAKE_OFF, "take_off", (1, 1), 0, Bridge),
    unsigned(LAND, "land", (1, 1), 0, Bridge),
    signed(
        TRIM_COLLECTIVE_US,
        "trim_collective_us",
        (-500, 500),
        0,
        OnGround,
    ),
    signed(TRIM_ROLL_US, "trim_roll_us", (-500, 500), 0, OnGround),
    signed(TRIM_PITCH_US, "trim_pitch_us", (-500, 500), 0, OnGround),
    signed(TRIM_TAIL_US, "trim_tail_us", (-500, 500), 0, OnGround),
    signed(
        TRIM_THROTTLE_US,
        "trim_throttle_us",
        (-500, 500),
        0,
        OnGround,
    ),
    unsigned(
        ROTOR_SPEED_RPM,
        "rotor_speed_rpm",
        (500, 3000),
        1500,
        OnGround,
    ),
];

/// All 32-bit ports, ascending.
pub const PORTS_32: &[Port32] = &[
    float(
        CRUISE_SPEED_MPS,
        "cruise_speed_mps",
        (0.1, 20.0),
        5.0,
        Always,
    ),
    float(CLIMB_SPEED_MPS, "climb_speed_mps", (0.1, 5.0), 2.0, Always),
    float(
        ACCEPTANCE_RADIUS_M,
        "acceptance_radius_m",
        (0.1, 50.0),
        0.5,
        Always,
    ),
    float(POSITION_GAIN, "position_gain", (0.05, 5.0), 0.8, OnGround),
    float(VELOCITY_GAIN, "velocity_gain", (0.05, 10.0), 2.0, OnGround),
    float(ATTITUDE_GAIN, "attitude_gain", (0.5, 20.0), 6.0, OnGround),
    float(YAW_GAIN, "yaw_gain", (0.05, 10.0), 1.5, OnGround),
    float(
        TAKE_OFF_ALTITUDE_M,
        "take_off_altitude_m",
        (0.5, 200.0),
        10.0,
        Always,
    ),
];

const fn unsigned(
    number: u16,
    name: &'static str,
    (min, max): (i32, i32),
    boot: i32,
    access: Access,
) -> Port16 {
    Port16 {
        number,
        name,
        signed: false,
        min,
        max,
        boot,
        access,
    }
}

const fn signed(
    number: u16,
    name: &'static str,
    range: (i32, i32),
    boot: i32,
    access: Access,
) -> Port16 {
    Port16 {
        signed: true,
        ..unsigned(number, name, range, boot, access)
    }
}

const fn float(
    number: u16,
    name: &'static str,
    (min, max): (f32, f32),
    boot: f32,
    access: Access,
) -> Port32 {
    Port32 {
        number,
        name,
        min,
        max,
        boot,
        access,
    }
}

/// The 16-bit port with this number.
pub fn port16(number: u16) -> Option<&'static Port16> {
    PORTS_16.iter().find(|port| port.number == number)
}

/// The 32-bit port with this number.
pub fn port32(number: u16) -> Option<&'static Port32> {
    PORTS_32.iter().find(|port| port.number == number)
}

/// The port with this name.
pub fn by_name(name: &str) -> Option<Port> {
    let bits16 = PORTS_16.iter().find(|port| port.name == name);
    let bits32 = PORTS_32.iter().find(|port| port.name == name);
    bits16.map(Port::Bits16).or(bits32.map(Port::Bits32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_are_found_by_number_and_name_and_no_two_share_either() {
        for port in PORTS_16 {
            assert_eq!(port16(port.number), Some(port));
            assert_eq!(by_name(port.name), Some(Port::Bits16(port)));
            assert_eq!(port32(port.number), None);
        }
        for port in PORTS_32 {
            assert_eq!(port32(port.number), Some(port));
            assert_eq!(by_name(port.name), Some(Port::Bits32(port)));
            assert_eq!(port16(port.number), None);
        }
        assert_eq!(by_name("no_such_port"), None);
    }

    #[test]
    fn boot_values_may_be_written_save_those_of_take_off_and_landing() {
        for port in PORTS_16 {
            let movement = [TAKE_OFF, LAND].contains(&port.number);
            assert_eq!(port.bits_of(port.boot).is_some(), !movement, "{port:?}");
        }
        for port in PORTS_32 {
            assert!(port.accepts(port.boot), "{port:?}");
        }
    }

    #[test]
    fn the_ends_of_each_range_are_in_and_their_neighbours_out() {
        for port in PORTS_16 {
            for value in [port.min, port.max] {
                let bits = port.bits_of(value).expect("an end of the range");
                assert!(port.accepts(bits), "{port:?}");
                assert_eq!(port.value_of(bits), value);
            }
            assert_eq!(port.bits_of(port.min - 1), None, "{port:?}");
            assert_eq!(port.bits_of(port.max + 1), None, "{port:?}");
        }
        for port in PORTS_32 {
            assert!(port.accepts(port.min) && port.accepts(port.max), "{port:?}");
            assert!(!port.accepts(port.min.next_down()), "{port:?}");
            assert!(!port.accepts(port.max.next_up()), "{port:?}");
            for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                assert!(!port.accepts(value), "{port:?}");
            }
        }
    }

    #[test]
    fn a_signed_port_carries_twos_complement() {
        let trim = port16(TRIM_TAIL_US).expect("in the table");
        assert_eq!(trim.bits_of(-500), Some(0xFE0C));
        assert_eq!(trim.value_of(0xFE0C), -500);
        assert!(!trim.accepts(0x8000));
        let mask = port16(STATUS_MASK).expect("in the table");
        assert_eq!(mask.value_of(0xFFFF), 65_535);
    }
}
