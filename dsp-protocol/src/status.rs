//! The status message (`docs/protocol.md` section 4.1): the flying flag and the groups that the status mask selects.

use crate::decode_error::DecodeError;
use crate::frame::{Layout, Reader, Writer};
use crate::group::{
    Acceleration, AngularRate, Attitude, Geographic, GpsVelocity, Group, PanTilt, References,
    ServoPulses, Supply, Xy, layout, with_groups,
};
use crate::mask::StatusMask;

/// The flying flag in the flags of a status.
const FLYING: u8 = 1;

/// Defines [`Status`] from the rows of [`with_groups!`].
macro_rules! status {
    ($(
        $(#[$doc:meta])*
        $group:ident = $bit:literal, $name:literal, $field:ident: $type:ident
            $(($wire:ty, $unit:literal, $limits:expr))?;
    )+) => {
        /// A status message: the flying flag and the groups that the DSP's mask selects.
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        pub struct Status {
            /// The helicopter is in the air (`heli_volando`).
            pub flying: bool,
            $($(#[$doc])* pub $field: Option<$type>,)+
        }

        impl Status {
            /// The groups that the message carries.
            pub const fn mask(&self) -> StatusMask {
                StatusMask(0 $(| if self.$field.is_some() { Group::$group.bit() } else { 0 })+)
            }

            /// Takes `groups` out of the message, as if they had not been sent.
            pub fn withdraw(&mut self, groups: StatusMask) {
                $(if groups.contains(Group::$group) {
                    self.$field = None;
                })+
            }

            /// The groups of the message that hold a value outside the limits of section 9, which stand in the tables of
            /// [`crate::group`]. A group that is not carried is not in it.
            pub fn implausible_groups(&self) -> StatusMask {
                let mut implausible = StatusMask::NONE;
                $(if self.$field.as_ref().is_some_and(|value| !layout::$group::is_plausible(value)) {
                    implausible = implausible.with(Group::$group);
                })+
                implausible
            }

            /// Appends the groups that the message carries, in the order of their bits.
            fn write_groups(&self, writer: &mut Writer) {
                $(if let Some(value) = &self.$field {
                    layout::$group::write(value, writer);
                })+
            }

            /// Takes the groups of `mask`; [`Reader::finish`] reports whether they were there.
            fn read_groups(flying: bool, mask: StatusMask, reader: &mut Reader<'_>) -> Status {
                // The fields of a struct expression are evaluated in the order in which they are written: that of the wire.
                Status {
                    flying,
                    $($field: mask.contains(Group::$group).then(|| layout::$group::read(reader)),)+
                }
            }
        }
    };
}

with_groups!(status);

impl Status {
    /// Leaves in the message only the groups that `mask` selects.
    pub fn retain(&mut self, mask: StatusMask) {
        self.withdraw(StatusMask(!mask.0));
    }

    /// Appends the payload.
    pub(crate) fn write(&self, writer: &mut Writer) {
        writer.u16(self.mask().0);
        writer.u7(if self.flying { FLYING } else { 0 });
        self.write_groups(writer);
    }

    /// Takes a status out of its payload.
    pub(crate) fn parse(mut reader: Reader<'_>) -> Result<Self, DecodeError> {
        let mask = StatusMask(reader.u16());
        let flags = reader.u7();
        let status = Status::read_groups(flags == FLYING, mask, &mut reader);
        reader.finish()?;
        if flags & !FLYING != 0 {
            return Err(DecodeError::Value);
        }
        Ok(status)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::group::FieldSpec;
    use crate::{Decoded, Decoder, Downlink, checksum};

    #[test]
    fn retaining_groups_withdraws_the_others() {
        let full = Status {
            time_ms: Some(1),
            sonar_adc: Some(2),
            ..Status::default()
        };
        let mut status = full;
        status.retain(StatusMask::NONE.with(Group::Sonar).with(Group::Xy));
        assert_eq!(status.mask(), StatusMask::NONE.with(Group::Sonar));
        status = full;
        status.retain(StatusMask::ALL);
        assert_eq!(status, full);
    }

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
                    assert_eq!(status.implausible_groups(), expected, "{field:?} {steps}");
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
            assert_eq!(status.implausible_groups(), expected, "{value}");
        }
    }

    #[test]
    fn only_the_groups_that_are_wrong_are_named() {
        assert_eq!(Status::default().implausible_groups(), StatusMask::NONE);
        let status = Status {
            time_ms: Some(u32::MAX),
            gps_quality: Some(9),
            rotor_rpm: Some(1500),
            sonar_adc: Some(5000),
            ..Status::default()
        };
        let expected = [Group::GpsQuality, Group::Sonar].into_iter().collect();
        assert_eq!(status.implausible_groups(), expected);
    }
}
