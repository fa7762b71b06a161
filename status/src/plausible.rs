//! Which groups of a sample hold plausible values (`docs/protocol.md` section 9).
//!
//! The bridge publishes no others. But any bit pattern may be in shared memory when a neighbour is faulty, and status is
//! the last check before upper layers fly by it. A group with an implausible value is treated as one that was not
//! transmitted: not valid, zero, and reported to the operator once. The limits are those of the wire's table of groups.

use dsp_protocol::Group as WireGroup;
use ipc_types::TelemetryGroup;
use ipc_types::payload::DspTelemetry;

use crate::fields;
use crate::group::GroupSet;

/// Most fields of a group.
const MAX_FIELDS: usize = 6;

/// The sample without its implausible groups, and those groups: they are marked as valid and hold a value outside the
/// limits.
pub fn plausible(dsp: &DspTelemetry) -> (DspTelemetry, GroupSet) {
    let implausible = TelemetryGroup::in_mask(dsp.valid_groups)
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
fn is_plausible(dsp: &DspTelemetry, group: TelemetryGroup) -> bool {
    let fields = fields::of(group);
    let mut values = [0.0; MAX_FIELDS];
    for (place, field) in values.iter_mut().zip(fields) {
        *place = field.value(dsp).number();
    }
    let values = values.get(..fields.len());
    values.is_some_and(|values| wire_group(group).accepts(values))
}

/// The same group in the table of the wire: both are in the order of the mask's bits.
fn wire_group(group: TelemetryGroup) -> WireGroup {
    WireGroup::ALL[group as usize]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_samples::full_sample;

    fn implausible(dsp: &DspTelemetry) -> GroupSet {
        plausible(dsp).1
    }

    #[test]
    fn the_table_of_the_wire_has_the_same_groups_with_the_same_fields_in_the_same_order() {
        for group in TelemetryGroup::ALL {
            let wire = wire_group(group);
            assert_eq!(group.name(), wire.name());
            assert!(wire.limits().len() <= MAX_FIELDS);
            let columns: Vec<_> = fields::of(group).iter().map(|field| field.name).collect();
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
        use TelemetryGroup as Group;
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
