//! The status message (`docs/protocol.md` section 4.1): the flying flag and the groups that the status mask selects.

use crate::decode_error::DecodeError;
use crate::field::Layout;
use crate::frame::{Reader, Writer};
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

            /// The groups of the message that hold a value outside the limits of section 9.
            pub(crate) fn implausible_groups(&self) -> StatusMask {
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
}
