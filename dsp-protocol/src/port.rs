//! The DSP's virtual ports (`docs/protocol.md` section 6).

/// 16-bit port: the status mask.
pub const STATUS_MASK: u16 = 10_000;
/// 16-bit port: status period, ms.
pub const STATUS_PERIOD_MS: u16 = 10_001;
/// 16-bit port: flow control period, ms.
pub const FLOW_CONTROL_PERIOD_MS: u16 = 10_002;
/// 16-bit port: write 1 to take off.
pub const TAKE_OFF: u16 = 10_121;
/// 16-bit port: write 1 to land.
pub const LAND: u16 = 10_122;
/// 16-bit port: rotor speed set point, rpm.
pub const ROTOR_SPEED_RPM: u16 = 10_210;
/// 32-bit port: cruise speed, m/s.
pub const CRUISE_SPEED_MPS: u16 = 20_000;
/// 32-bit port: climb speed, m/s.
pub const CLIMB_SPEED_MPS: u16 = 20_001;
/// 32-bit port: acceptance radius of a waypoint, m.
pub const ACCEPTANCE_RADIUS_M: u16 = 20_002;
/// 32-bit port: take-off altitude above the point of take-off, m.
pub const TAKE_OFF_ALTITUDE_M: u16 = 20_121;

/// A 16-bit port as section 6 lists it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Port16 {
    /// Number of the port.
    pub number: u16,
    /// Name in configuration files.
    pub name: &'static str,
    /// Whether the value is two's complement.
    pub signed: bool,
    /// Least value.
    pub min: i32,
    /// Greatest value.
    pub max: i32,
    /// Value at boot.
    pub boot: i32,
}

/// A 32-bit port as section 6 lists it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Port32 {
    /// Number of the port.
    pub number: u16,
    /// Name in configuration files, with the unit.
    pub name: &'static str,
    /// Least value.
    pub min: f32,
    /// Greatest value.
    pub max: f32,
    /// Value at boot.
    pub boot: f32,
}

/// All 16-bit ports.
pub const PORTS_16: &[Port16] = &[];

/// All 32-bit ports.
pub const PORTS_32: &[Port32] = &[];
