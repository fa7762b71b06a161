//! The DSP's virtual ports (`docs/protocol.md` section 6).
//!
//! The tables list what may be written; what a port does is up to the DSP. All ports of the tables can be read and
//! written; [`WAYPOINT_COUNT`] can only be read and stands in neither.

use Access::{Always, Bridge, OnGround};

/// 16-bit port: how many waypoints the DSP took; bit 15 is always set.
pub const WAYPOINT_COUNT: u16 = 10_003;

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

/// Defines the ports of one width: of each the constant that is its number, and its row in the table.
macro_rules! ports {
    (
        $(#[$about:meta])+ $table:ident: $kind:ty;
        $($(#[$meta:meta])+ $port:ident = $number:literal, $make:ident $name:literal in $range:tt, at boot $boot:literal, $access:ident;)+
    ) => {
        $($(#[$meta])+ pub const $port: u16 = $number;)+

        $(#[$about])+
        pub const $table: &[$kind] = &[$($make($port, $name, $range, $boot, $access),)+];
    };
}

ports! {
    /// All 16-bit ports, ascending.
    PORTS_16: Port16;
    /// 16-bit port: the status mask.
    STATUS_MASK = 10_000, unsigned "status_mask" in (0, 65_535), at boot 0, Bridge;
    /// 16-bit port: status period, ms.
    STATUS_PERIOD_MS = 10_001, unsigned "status_period_ms" in (1, 10_000), at boot 20, Always;
    /// 16-bit port: flow control period, ms.
    FLOW_CONTROL_PERIOD_MS = 10_002, unsigned "flow_control_period_ms" in (10, 1000), at boot 100, Always;
    /// 16-bit port: after how long without a message from the PC the DSP empties its path buffer, ms; 0 never.
    PC_TIMEOUT_MS = 10_004, unsigned "pc_timeout_ms" in (0, 60_000), at boot 0, Bridge;
    /// 16-bit port: write 1 to take off.
    TAKE_OFF = 10_121, unsigned "take_off" in (1, 1), at boot 0, Bridge;
    /// 16-bit port: write 1 to land.
    LAND = 10_122, unsigned "land" in (1, 1), at boot 0, Bridge;
    /// 16-bit port: trim of the collective pitch, µs, signed.
    TRIM_COLLECTIVE_US = 10_200, signed "trim_collective_us" in (-500, 500), at boot 0, OnGround;
    /// 16-bit port: trim of the roll cyclic, µs, signed.
    TRIM_ROLL_US = 10_201, signed "trim_roll_us" in (-500, 500), at boot 0, OnGround;
    /// 16-bit port: trim of the pitch cyclic, µs, signed.
    TRIM_PITCH_US = 10_202, signed "trim_pitch_us" in (-500, 500), at boot 0, OnGround;
    /// 16-bit port: trim of the tail rotor, µs, signed.
    TRIM_TAIL_US = 10_203, signed "trim_tail_us" in (-500, 500), at boot 0, OnGround;
    /// 16-bit port: trim of the throttle, µs, signed.
    TRIM_THROTTLE_US = 10_204, signed "trim_throttle_us" in (-500, 500), at boot 0, OnGround;
    /// 16-bit port: rotor speed set point, rpm.
    ROTOR_SPEED_RPM = 10_210, unsigned "rotor_speed_rpm" in (500, 3000), at boot 1500, OnGround;
}

ports! {
    /// All 32-bit ports, ascending.
    PORTS_32: Port32;
    /// 32-bit port: cruise speed, m/s.
    CRUISE_SPEED_MPS = 20_000, float "cruise_speed_mps" in (0.1, 20.0), at boot 5.0, Always;
    /// 32-bit port: climb speed, m/s.
    CLIMB_SPEED_MPS = 20_001, float "climb_speed_mps" in (0.1, 5.0), at boot 2.0, Always;
    /// 32-bit port: acceptance radius of a waypoint, m.
    ACCEPTANCE_RADIUS_M = 20_002, float "acceptance_radius_m" in (0.1, 50.0), at boot 0.5, Always;
    /// 32-bit port: gain of the position loop, 1/s.
    POSITION_GAIN = 20_010, float "position_gain" in (0.05, 5.0), at boot 0.8, OnGround;
    /// 32-bit port: gain of the velocity loop, 1/s.
    VELOCITY_GAIN = 20_011, float "velocity_gain" in (0.05, 10.0), at boot 2.0, OnGround;
    /// 32-bit port: gain of the attitude loop, 1/s.
    ATTITUDE_GAIN = 20_012, float "attitude_gain" in (0.5, 20.0), at boot 6.0, OnGround;
    /// 32-bit port: gain of the yaw loop, 1/s.
    YAW_GAIN = 20_013, float "yaw_gain" in (0.05, 10.0), at boot 1.5, OnGround;
    /// 32-bit port: take-off altitude above the point of take-off, m.
    TAKE_OFF_ALTITUDE_M = 20_121, float "take_off_altitude_m" in (0.5, 200.0), at boot 10.0, Always;
}

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
