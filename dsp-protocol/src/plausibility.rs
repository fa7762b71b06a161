//! Which decoded values are implausible (`docs/protocol.md` section 9). The limits stand in the tables of [`crate::group`].

use crate::mask::StatusMask;
use crate::status::Status;

/// The groups of `status` that hold a value outside the limits of section 9. A group that is not carried is not in it.
pub fn implausible_groups(status: &Status) -> StatusMask {
    status.implausible_groups()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::group::{FieldSpec, Geographic, GpsVelocity, Group};
    use crate::{Decoded, Decoder, Downlink, checksum};

    /// A status as it comes off the line with `group` alone, whose fields hold these numbers of steps.
    fn received(group: Group, steps: &[i64]) -> Status {
        let mask = StatusMask::NONE.with(group).0;
        let mut frame = vec![0xE9];
        frame.extend([14, 7, 0].map(|shift| (mask >> shift) as u8 & 0x7F));
        frame.push(0);
        for (field, steps) in group.limits().iter().zip(steps) {
            let (bits, digits) = match field.wire {
                "u7" => (7, 1),
                "u14" => (14, 2),
                "u16" | "i16" => (16, 3),
                _ => (32, 5),
            };
            let value = steps & ((1 << bits) - 1);
            frame.extend(
                (0..digits)
                    .rev()
                    .map(|digit| (value >> (7 * digit)) as u8 & 0x7F),
            );
        }
        frame.push(checksum(&frame));
        match Decoder::<Downlink>::new().decode(&frame) {
            (_, Decoded::Message(Downlink::Status(status))) => status,
            (_, other) => panic!("{group:?} {steps:?}: {other:?}"),
        }
    }

    fn steps_of(field: &FieldSpec, value: f64) -> i64 {
        (value * f64::from(field.steps_per_unit)).round() as i64
    }

    #[test]
    fn each_field_may_reach_its_limits_and_not_be_one_step_beyond() {
        for group in Group::ALL {
            let limits = group.limits();
            let least: Vec<i64> = limits
                .iter()
                .map(|field| steps_of(field, field.min))
                .collect();
            for (index, field) in limits.iter().enumerate() {
                let check = |steps: i64, expected: StatusMask| {
                    let mut all = least.clone();
                    all[index] = steps;
                    let status = received(group, &all);
                    assert_eq!(implausible_groups(&status), expected, "{field:?} {steps}");
                };
                let (min, max) = (steps_of(field, field.min), steps_of(field, field.max));
                let implausible = StatusMask::NONE.with(group);
                check(min, StatusMask::NONE);
                check(max, StatusMask::NONE);
                let is_signed = field.wire.starts_with('i');
                if is_signed || min > 0 {
                    check(min - 1, implausible);
                }
                // Any time of the DSP's clock is plausible.
                if group != Group::Time {
                    check(max + 1, implausible);
                }
            }
        }
    }

    #[test]
    fn what_is_not_finite_is_implausible() {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let status = Status {
                geographic: Some(Geographic {
                    altitude_m: value,
                    ..Geographic::default()
                }),
                gps_velocity: Some(GpsVelocity {
                    heading_deg: value as f32,
                    ..GpsVelocity::default()
                }),
                ..Status::default()
            };
            let expected = [Group::Geographic, Group::GpsVelocity]
                .into_iter()
                .collect();
            assert_eq!(implausible_groups(&status), expected, "{value}");
        }
    }

    #[test]
    fn only_the_groups_that_are_wrong_are_named() {
        assert_eq!(implausible_groups(&Status::default()), StatusMask::NONE);
        let status = Status {
            time_ms: Some(u32::MAX),
            gps_quality: Some(9),
            rotor_rpm: Some(1500),
            sonar_adc: Some(5000),
            ..Status::default()
        };
        let expected = [Group::GpsQuality, Group::Sonar].into_iter().collect();
        assert_eq!(implausible_groups(&status), expected);
    }
}
