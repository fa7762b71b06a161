//! The fields of a sample by group: what they are called in a log, where their values are, and which are plausible
//! (`docs/protocol.md` section 9).
//!
//! Values are those that the bridge published, in the DSP's own units: a log is of the input (`log.conf`).
//!
//! The bridge publishes no implausible values. But any bit pattern may be in shared memory when a neighbour is faulty,
//! and status is the last check before upper layers fly by it. A group with an implausible value is treated as one that
//! was not transmitted: not valid, zero, and reported to the operator once. The limits are those of the wire's table of
//! groups.

use std::fmt;
use std::str::FromStr;

use dsp_protocol::Group as WireGroup;
use ipc_types::TelemetryGroup as Group;
use ipc_types::payload::DspTelemetry;

use crate::group::GroupSet;

/// One field, which is a column of a log.
pub struct Field {
    /// The name in the first line, with the unit as suffix.
    pub name: &'static str,
    /// The name in the sample, as `ril echo dsp` shows it, at its dots.
    path: &'static [&'static str],
    value: fn(&DspTelemetry) -> Value,
    set: fn(&mut DspTelemetry, &str) -> bool,
}

impl Field {
    /// The name in the sample, as `ril echo dsp` shows it, such as `geographic.latitude_deg`.
    pub fn path(&self) -> String {
        self.path.join(".")
    }

    /// The value in `sample`.
    pub fn value(&self, sample: &DspTelemetry) -> Value {
        (self.value)(sample)
    }

    /// Puts the value of a log's cell into `sample`; false when it is no value of this field.
    pub fn read(&self, cell: &str, sample: &mut DspTelemetry) -> bool {
        (self.set)(sample, cell)
    }
}

fn set<T: FromStr>(place: &mut T, cell: &str) -> bool {
    cell.parse().map(|value| *place = value).is_ok()
}

/// A value, shown with as few digits as give back the same number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// An integer.
    Integer(u64),
    /// A single-precision number.
    Single(f32),
    /// A double-precision number.
    Double(f64),
    /// There is none: the cell is empty.
    None,
}

impl Value {
    /// The value as a number; NaN if there is none. Exact for all but integers beyond 2⁵³.
    pub fn number(self) -> f64 {
        match self {
            Value::Integer(value) => value as f64,
            Value::Single(value) => value.into(),
            Value::Double(value) => value,
            Value::None => f64::NAN,
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Integer(value) => value.fmt(f),
            Value::Single(value) => value.fmt(f),
            Value::Double(value) => value.fmt(f),
            Value::None => Ok(()),
        }
    }
}

macro_rules! from_number {
    ($($number:ty => $variant:ident),+) => {
        $(
            impl From<$number> for Value {
                fn from(value: $number) -> Value {
                    Value::$variant(value.into())
                }
            }
        )+
    };
}

from_number!(u8 => Integer, u32 => Integer, u64 => Integer, f32 => Single, f64 => Double);

impl From<Option<u32>> for Value {
    fn from(value: Option<u32>) -> Value {
        value.map_or(Value::None, Value::from)
    }
}

/// `"name" = path.to.value, …` as a slice of fields.
macro_rules! fields {
    ($($name:literal = $($path:ident).+),+ $(,)?) => {
        &[$(Field {
            name: $name,
            path: &[$(stringify!($path)),+],
            value: |sample| sample.$($path).+.into(),
            set: |sample, cell| set(&mut sample.$($path).+, cell),
        }),+]
    };
}

/// The columns that every log begins with: they are valid in every sample.
pub const ALWAYS: &[Field] = fields! {
    "flying" = flying,
    "sequence" = sequence,
    "received_ns" = received_ns,
};

/// The columns of the DSP's errors: how many there were since the bridge began, and the code of the last one as the DSP
/// sent it. They are valid in every sample; before the first error there is no code.
pub const DSP_ERRORS: &[Field] = &[
    Field {
        name: "dsp_errors",
        path: &["dsp_errors"],
        value: |sample| sample.dsp_errors.into(),
        set: |sample, cell| set(&mut sample.dsp_errors, cell),
    },
    Field {
        name: "last_dsp_error_code",
        path: &["last_dsp_error_code"],
        value: |sample| sample.last_dsp_error().into(),
        set: |sample, cell| cell.is_empty() || set(&mut sample.last_dsp_error_code, cell),
    },
];

/// All fields that can be columns.
pub fn all() -> impl Iterator<Item = &'static Field> {
    let of_groups = Group::ALL.into_iter().flat_map(of);
    ALWAYS.iter().chain(of_groups).chain(DSP_ERRORS)
}

/// The fields of a group, in the order of the wire.
pub fn of(group: Group) -> &'static [Field] {
    match group {
        Group::Time => fields! { "dsp_time_ms" = dsp_time_ms },
        Group::Geographic => fields! {
            "latitude_deg" = geographic.latitude_deg,
            "longitude_deg" = geographic.longitude_deg,
            "altitude_m" = geographic.altitude_m,
        },
        Group::Xy => fields! { "x_m" = xy.x_m, "y_m" = xy.y_m },
        Group::GpsVelocity => fields! {
            "gps_horizontal_speed_mps" = gps_velocity.horizontal_speed_mps,
            "gps_vertical_speed_mps" = gps_velocity.vertical_speed_mps,
            "gps_heading_deg" = gps_velocity.heading_deg,
        },
        Group::GpsQuality => fields! { "gps_quality" = gps_quality },
        Group::Attitude => fields! {
            "pitch_deg" = attitude.pitch_deg,
            "roll_deg" = attitude.roll_deg,
            "yaw_deg" = attitude.yaw_deg,
        },
        Group::Acceleration => fields! {
            "acceleration_x_mps2" = acceleration.x_mps2,
            "acceleration_y_mps2" = acceleration.y_mps2,
            "acceleration_z_mps2" = acceleration.z_mps2,
        },
        Group::AngularRate => fields! {
            "angular_rate_x_radps" = angular_rate.x_radps,
            "angular_rate_y_radps" = angular_rate.y_radps,
            "angular_rate_z_radps" = angular_rate.z_radps,
        },
        Group::PilotPwm => fields! {
            "pilot_collective_us" = pilot_pwm.collective_us,
            "pilot_roll_us" = pilot_pwm.roll_us,
            "pilot_pitch_us" = pilot_pwm.pitch_us,
            "pilot_tail_us" = pilot_pwm.tail_us,
            "pilot_throttle_us" = pilot_pwm.throttle_us,
        },
        Group::Sonar => fields! { "sonar_adc" = sonar_adc },
        Group::Supply => fields! {
            "battery_mv" = supply.battery_mv,
            "fuel_percent" = supply.fuel_percent,
            "auto_switch" = supply.auto_switch,
        },
        Group::PanTilt => fields! {
            "pan_adc" = pan_tilt.pan_adc,
            "tilt_adc" = pan_tilt.tilt_adc,
        },
        Group::RotorSpeed => fields! { "rotor_rpm" = rotor_rpm },
        Group::Barometer => fields! { "barometer_adc" = barometer_adc },
        Group::Actuation => fields! {
            "actuation_collective_us" = actuation.collective_us,
            "actuation_roll_us" = actuation.roll_us,
            "actuation_pitch_us" = actuation.pitch_us,
            "actuation_tail_us" = actuation.tail_us,
            "actuation_throttle_us" = actuation.throttle_us,
        },
        Group::References => fields! {
            "reference_x_speed_mps" = references.x_speed_mps,
            "reference_y_speed_mps" = references.y_speed_mps,
            "reference_altitude_m" = references.altitude_m,
            "reference_pitch_deg" = references.pitch_deg,
            "reference_roll_deg" = references.roll_deg,
            "reference_yaw_deg" = references.yaw_deg,
        },
    }
}

/// Most fields of a group.
const MAX_FIELDS: usize = 6;

/// The sample without its implausible groups, and those groups: they are marked as valid and hold a value outside the
/// limits.
pub fn plausible(dsp: &DspTelemetry) -> (DspTelemetry, GroupSet) {
    let implausible = Group::in_mask(dsp.valid_groups)
        .filter(|group| !is_plausible(dsp, *group))
        .fold(0, |mask, group| mask | group.bit());
    let plausible = DspTelemetry {
        valid_groups: dsp.valid_groups & !implausible,
        flying: u8::from(dsp.is_flying()),
        ..*dsp
    };
    (plausible, GroupSet(implausible))
}

/// Whether all values of `group` lie within the limits.
fn is_plausible(dsp: &DspTelemetry, group: Group) -> bool {
    let fields = of(group);
    let mut values = [0.0; MAX_FIELDS];
    for (place, field) in values.iter_mut().zip(fields) {
        *place = field.value(dsp).number();
    }
    let values = values.get(..fields.len());
    values.is_some_and(|values| wire_group(group).accepts(values))
}

/// The group of the wire's table that stands for `group`: both are in the order of the mask's bits.
fn wire_group(group: Group) -> WireGroup {
    WireGroup::ALL[group as usize]
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use ipc_types::payload::{FieldKind, FieldLayout, SharedStruct};

    use super::*;
    use crate::test_samples::full_sample;

    fn leaves(fields: &[FieldLayout]) -> usize {
        let leaf = |field: &FieldLayout| match field.kind {
            FieldKind::Struct(nested) => field.len.unwrap_or(1) * leaves(nested.fields),
            FieldKind::Number(_) => 1,
        };
        fields.iter().map(leaf).sum()
    }

    #[test]
    fn no_field_of_the_sample_is_forgotten() {
        // epoch_ns, sent_ns and its uncertainty, valid_groups, dsp_boots and references.reserved are of no group.
        let of_no_group = 6;
        let columns: usize = Group::ALL.map(|group| of(group).len()).iter().sum();
        assert_eq!(
            columns + ALWAYS.len() + DSP_ERRORS.len() + of_no_group,
            leaves(DspTelemetry::FIELDS)
        );
    }

    #[test]
    fn names_are_unique_and_need_no_quoting() {
        let names: Vec<_> = all().map(|field| field.name).collect();
        let unique: BTreeSet<_> = names.iter().collect();
        assert_eq!(unique.len(), names.len());
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        assert!(names.iter().all(|name| name.chars().all(plain)));
    }

    #[test]
    fn numbers_are_shown_so_that_they_come_back() {
        for (value, expected) in [
            (Value::from(7_u8), "7"),
            (Value::from(u64::MAX), "18446744073709551615"),
            (Value::from(0.1_f32), "0.1"),
            (Value::from(-45.123_456_7_f64), "-45.1234567"),
            (Value::from(10.0_f64), "10"),
            (Value::from(None::<u32>), ""),
        ] {
            assert_eq!(value.to_string(), expected);
        }
    }

    fn implausible(dsp: &DspTelemetry) -> GroupSet {
        plausible(dsp).1
    }

    #[test]
    fn the_table_of_the_wire_has_the_same_groups_with_the_same_fields_in_the_same_order() {
        for group in Group::ALL {
            let wire = wire_group(group);
            assert_eq!(group.name(), wire.name());
            assert!(wire.limits().len() <= MAX_FIELDS);
            let columns: Vec<_> = of(group).iter().map(|field| field.name).collect();
            let names: Vec<_> = wire.limits().iter().map(|field| field.name).collect();
            assert_eq!(columns.len(), names.len(), "{group}");
            // A column's name may have a prefix that distinguishes it from those of other groups.
            let same = |(column, name): (&&str, &&str)| column.ends_with(*name);
            assert!(
                columns.iter().zip(&names).all(same),
                "{columns:?}: {names:?}"
            );
        }
    }

    #[test]
    fn implausible_values_are_found_and_others_left_alone() {
        assert_eq!(implausible(&full_sample()), GroupSet::default());
        type Change = fn(&mut DspTelemetry);
        let cases: [(Group, &[Change]); 10] = [
            (
                Group::Geographic,
                &[
                    |dsp| dsp.geographic.latitude_deg = 4e4,
                    |dsp| dsp.geographic.longitude_deg = f64::NAN,
                    |dsp| dsp.geographic.altitude_m = f64::INFINITY,
                ],
            ),
            (Group::Xy, &[|dsp| dsp.xy.y_m = -1e6]),
            (
                Group::GpsVelocity,
                &[
                    |dsp| dsp.gps_velocity.horizontal_speed_mps = -1.0,
                    |dsp| dsp.gps_velocity.heading_deg = 361.0,
                ],
            ),
            (Group::GpsQuality, &[|dsp| dsp.gps_quality = 9]),
            (Group::Attitude, &[|dsp| dsp.attitude.pitch_deg = -91.0]),
            (Group::PilotPwm, &[|dsp| dsp.pilot_pwm.tail_us = u32::MAX]),
            (Group::Sonar, &[|dsp| dsp.sonar_adc = 4096]),
            (Group::Supply, &[|dsp| dsp.supply.auto_switch = 2]),
            (Group::RotorSpeed, &[|dsp| dsp.rotor_rpm = 4001]),
            (
                Group::References,
                &[|dsp| dsp.references.yaw_deg = f32::NAN],
            ),
        ];
        for (group, changes) in cases {
            for change in changes {
                let mut dsp = full_sample();
                change(&mut dsp);
                assert_eq!(implausible(&dsp), GroupSet::from_iter([group]));
                // A group that is not valid holds nothing that could be implausible.
                dsp.valid_groups &= !group.bit();
                assert_eq!(implausible(&dsp), GroupSet::default());
            }
        }
    }
}
