//! [`Parameter`]: the parameters that stations see, by name.
//!
//! Those of the DSP are its virtual ports. Those that no DSP has are the gateway's own: one that can be set, and some
//! that can only be read, because stations ask for them before they show the vehicle as ready. Their names are those of
//! PX4.

use std::fmt;
use std::sync::LazyLock;

use dsp_protocol::port::{self, Port};

/// Longest name that the protocol has room for.
pub const NAME: usize = 16;

/// Heights of a take-off over the ground, m, that the DSP takes.
pub const TAKE_OFF_M: std::ops::RangeInclusive<f64> = 0.5..=200.0;

/// The names of the DSP's ports that a request may write.
const PORT_NAMES: &[(u16, &str)] = &[
    (port::STATUS_PERIOD_MS, "DSP_STATUS_MS"),
    (port::FLOW_CONTROL_PERIOD_MS, "DSP_FLOW_MS"),
    (port::TRIM_COLLECTIVE_US, "DSP_TRIM_COLL_US"),
    (port::TRIM_ROLL_US, "DSP_TRIM_ROLL_US"),
    (port::TRIM_PITCH_US, "DSP_TRIM_PIT_US"),
    (port::TRIM_TAIL_US, "DSP_TRIM_TAIL_US"),
    (port::TRIM_THROTTLE_US, "DSP_TRIM_THR_US"),
    (port::ROTOR_SPEED_RPM, "DSP_ROTOR_RPM"),
    (port::CRUISE_SPEED_MPS, "DSP_CRUISE_MPS"),
    (port::CLIMB_SPEED_MPS, "DSP_CLIMB_MPS"),
    (port::ACCEPTANCE_RADIUS_M, "DSP_ACCEPT_R_M"),
    (port::POSITION_GAIN, "DSP_POS_GAIN"),
    (port::VELOCITY_GAIN, "DSP_VEL_GAIN"),
    (port::ATTITUDE_GAIN, "DSP_ATT_GAIN"),
    (port::YAW_GAIN, "DSP_YAW_GAIN"),
    (port::TAKE_OFF_ALTITUDE_M, "DSP_TAKEOFF_M"),
];

/// The gateway's own. Without those that can only be read QGroundControl opens its setup pages, "components require
/// setup".
const OWN: &[(&str, ParameterSource)] = &[
    ("MIS_TAKEOFF_ALT", ParameterSource::TakeOff),
    // PX4's airframe "helicopter"; 0 would mean that none is chosen.
    (
        "SYS_AUTOSTART",
        ParameterSource::Fixed(ParameterValue::Int(16_001)),
    ),
    // That sensors are calibrated, and that there is no compass to calibrate.
    (
        "CAL_GYRO0_ID",
        ParameterSource::Fixed(ParameterValue::Int(1)),
    ),
    (
        "CAL_ACC0_ID",
        ParameterSource::Fixed(ParameterValue::Int(1)),
    ),
    (
        "CAL_MAG0_ID",
        ParameterSource::Fixed(ParameterValue::Int(1)),
    ),
    (
        "SYS_HAS_MAG",
        ParameterSource::Fixed(ParameterValue::Int(0)),
    ),
    // That no radio of a station steers, so that none is to be calibrated.
    (
        "COM_RC_IN_MODE",
        ParameterSource::Fixed(ParameterValue::Int(1)),
    ),
    // That a battery is described. Its limits are those of the bridge.
    (
        "BAT1_N_CELLS",
        ParameterSource::Fixed(ParameterValue::Int(6)),
    ),
    (
        "BAT1_V_CHARGED",
        ParameterSource::Fixed(ParameterValue::Real(4.05)),
    ),
    (
        "BAT1_V_EMPTY",
        ParameterSource::Fixed(ParameterValue::Real(3.6)),
    ),
    // The greatest speed that a station offers.
    (
        "MPC_XY_VEL_MAX",
        ParameterSource::Fixed(ParameterValue::Real(20.0)),
    ),
];

/// A value as the protocol carries it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParameterValue {
    /// MAV_PARAM_TYPE_REAL32.
    Real(f32),
    /// MAV_PARAM_TYPE_INT32.
    Int(i32),
}

impl ParameterValue {
    /// MAV_PARAM_TYPE.
    pub fn kind(self) -> u8 {
        match self {
            ParameterValue::Int(_) => 6,
            ParameterValue::Real(_) => 9,
        }
    }

    /// Four bytes in the place of a float: an integer is not converted.
    pub fn bits(self) -> u32 {
        match self {
            ParameterValue::Int(value) => value.cast_unsigned(),
            ParameterValue::Real(value) => value.to_bits(),
        }
    }

    /// A value of this MAV_PARAM_TYPE; `None` if no parameter has that.
    pub fn of(kind: u8, bits: u32) -> Option<ParameterValue> {
        match kind {
            6 => Some(ParameterValue::Int(bits.cast_signed())),
            9 => Some(ParameterValue::Real(f32::from_bits(bits))),
            _ => None,
        }
    }

    /// The value as a number.
    pub fn number(self) -> f64 {
        match self {
            ParameterValue::Int(value) => f64::from(value),
            ParameterValue::Real(value) => f64::from(value),
        }
    }
}

impl fmt::Display for ParameterValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ParameterValue::Int(value) => value.fmt(f),
            ParameterValue::Real(value) => value.fmt(f),
        }
    }
}

/// Where the value of a parameter is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParameterSource {
    /// A port of the DSP.
    Port(Port),
    /// The height of a take-off whose command names none, m.
    TakeOff,
    /// It is always this one.
    Fixed(ParameterValue),
}

/// A parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    pub name: &'static str,
    pub source: ParameterSource,
}

impl Parameter {
    /// MAV_PARAM_TYPE.
    pub fn kind(&self) -> u8 {
        match self.source {
            ParameterSource::Port(Port::Bits16(_)) => ParameterValue::Int(0).kind(),
            ParameterSource::Port(Port::Bits32(_)) | ParameterSource::TakeOff => {
                ParameterValue::Real(0.0).kind()
            }
            ParameterSource::Fixed(value) => value.kind(),
        }
    }

    /// A number as this parameter's value.
    pub fn value(&self, number: f64) -> ParameterValue {
        match ParameterValue::of(self.kind(), 0) {
            Some(ParameterValue::Int(_)) => ParameterValue::Int(number as i32),
            _ => ParameterValue::Real(number as f32),
        }
    }

    /// The least and the greatest value that it takes; `None` if it can only be read.
    pub fn range(&self) -> Option<(f64, f64)> {
        match self.source {
            ParameterSource::Port(Port::Bits16(port)) => Some((port.min.into(), port.max.into())),
            ParameterSource::Port(Port::Bits32(port)) => Some((port.min.into(), port.max.into())),
            ParameterSource::TakeOff => Some((*TAKE_OFF_M.start(), *TAKE_OFF_M.end())),
            ParameterSource::Fixed(_) => None,
        }
    }
}

/// All of them, by their numbers. Those of the DSP come last, because they have to be read from it.
pub static ALL: LazyLock<Vec<Parameter>> = LazyLock::new(|| {
    let own = OWN.iter().map(|(name, source)| Parameter {
        name,
        source: *source,
    });
    let ports = PORT_NAMES.iter().filter_map(|(number, name)| {
        Some(Parameter {
            name,
            source: ParameterSource::Port(port_of(*number)?),
        })
    });
    own.chain(ports).collect()
});

fn port_of(number: u16) -> Option<Port> {
    let of_16 = port::port16(number).map(Port::Bits16);
    of_16.or_else(|| port::port32(number).map(Port::Bits32))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use dsp_protocol::port::{Access, PORTS_16, PORTS_32};

    use super::*;

    #[test]
    fn each_port_that_may_be_written_has_a_name_and_no_other_has() {
        let of_16 = PORTS_16.iter().map(|port| (port.number, port.access));
        let ports = of_16.chain(PORTS_32.iter().map(|port| (port.number, port.access)));
        let open = ports.filter(|(_, access)| *access != Access::Bridge);
        let open: BTreeSet<u16> = open.map(|(number, _)| number).collect();
        let named: BTreeSet<u16> = PORT_NAMES.iter().map(|(number, _)| *number).collect();
        assert_eq!(named, open);
        assert_eq!(ALL.len(), OWN.len() + PORT_NAMES.len());
        let take_off = port_of(port::TAKE_OFF_ALTITUDE_M);
        let Some(Port::Bits32(take_off)) = take_off else {
            panic!("{take_off:?}")
        };
        let range = (take_off.min.into(), take_off.max.into());
        assert_eq!(ALL[0].range(), Some(range));
    }

    #[test]
    fn names_are_short_and_different_and_a_value_keeps_its_bits() {
        let names: BTreeSet<&str> = ALL.iter().map(|one| one.name).collect();
        assert_eq!(names.len(), ALL.len());
        let is_name = |name: &&str| name.len() <= NAME && name.is_ascii();
        assert!(names.iter().all(is_name), "{names:?}");
        for value in [
            ParameterValue::Int(-500),
            ParameterValue::Real(0.1),
            ParameterValue::Real(f32::NAN),
        ] {
            let read = ParameterValue::of(value.kind(), value.bits()).unwrap();
            assert_eq!((read.kind(), read.bits()), (value.kind(), value.bits()));
        }
        assert_eq!(
            ParameterValue::of(5, 1),
            None,
            "the protocol has more types"
        );
    }
}
