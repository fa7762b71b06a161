//! Messages from the DSP to the PC (`docs/protocol.md` section 4). The status, above all, is the flying flag and the
//! groups that the status mask selects (section 4.1).

use crate::decode_error::DecodeError;
use crate::decoder::Direction;
use crate::error_code::DspErrorCode;
use crate::frame::{Frame, Layout, Reader, Writer};
use crate::group::{Group, StatusMask, layout, with_groups};
use crate::profile::{FrameLen, Message, Profile, Sequence, header};

pub use crate::group::{
    Acceleration, AngularRate, Attitude, Geographic, GpsVelocity, PanTilt, References, ServoPulses,
    Supply, Xy,
};

/// Bytes of a status' payload that hold its mask, from which its length follows.
const STATUS_MASK_LEN: usize = 3;
/// The greatest code of a command, hence of an acknowledgement.
const MAX_COMMAND_CODE: u8 = 7;

/// One message from the DSP. Each variant carries only its own fields.
#[expect(
    clippy::large_enum_variant,
    reason = "most messages are a status, and a box would allocate for each"
)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Downlink {
    /// Periodic state of the helicopter (`ESTADOS`).
    Status(Status),
    /// May the next waypoint be sent (`CONTROLFLUJO`).
    FlowControl(FlowControl),
    /// A command arrived (`COMMANDACK`).
    Ack {
        /// Code of the command, 0 … 7.
        command: u8,
    },
    /// A 16-bit port was read (`COMMANDACK16`).
    Ack16 {
        /// Code of the command, 0 … 7.
        command: u8,
        /// Value of the port.
        value: u16,
    },
    /// A 32-bit port was read (`COMMANDACK32`).
    Ack32 {
        /// Code of the command, 0 … 7.
        command: u8,
        /// Value of the port.
        value: f32,
    },
    /// An error that the DSP noticed (`DSPERROR`).
    Error(DspErrorCode),
}

impl Downlink {
    /// The message as one frame of the classic profile.
    pub fn encode(&self) -> Frame {
        self.encode_in(Profile::Classic, Sequence::FIRST, Sequence::FIRST)
    }

    /// The message as one frame of `profile`, with its own number `sequence`. An acknowledgement also carries the
    /// number of the command that it `acknowledges`; other messages leave it out, and the classic profile both.
    pub fn encode_in(&self, profile: Profile, sequence: Sequence, acknowledges: Sequence) -> Frame {
        profile.encode(self, sequence, acknowledges)
    }
}

impl Direction for Downlink {}

impl Message for Downlink {
    const EXTENDED_HEADER: u8 = header::EXTENDED_DOWNLINK;

    fn header(&self) -> u8 {
        match self {
            Downlink::Status(_) => header::STATUS,
            Downlink::FlowControl(_) => header::FLOW_CONTROL,
            Downlink::Ack { .. } => header::ACK,
            Downlink::Ack16 { .. } => header::ACK_16,
            Downlink::Ack32 { .. } => header::ACK_32,
            Downlink::Error(_) => header::ERROR,
        }
    }

    fn write(&self, writer: &mut Writer) {
        match *self {
            Downlink::Status(ref status) => status.write(writer),
            Downlink::FlowControl(FlowControl::Stop) => writer.u7(0),
            Downlink::FlowControl(FlowControl::Send) => writer.u7(1),
            Downlink::Ack { command } => writer.u7(command),
            Downlink::Ack16 { command, value } => {
                writer.u7(command);
                writer.u16(value);
            }
            Downlink::Ack32 { command, value } => {
                writer.u7(command);
                writer.f32(value);
            }
            Downlink::Error(DspErrorCode(code)) => writer.u16(code),
        }
    }

    fn payload_len(header: u8, payload: &[u8]) -> FrameLen {
        match (header, payload) {
            (header::STATUS, [high, middle, low, ..]) => {
                FrameLen::Exactly(mask_of([*high, *middle, *low]).status_payload_len())
            }
            (header::STATUS, _) => FrameLen::AtLeast(STATUS_MASK_LEN),
            (header::FLOW_CONTROL | header::ACK, _) => FrameLen::Exactly(1),
            (header::ERROR, _) => FrameLen::Exactly(3),
            (header::ACK_16, _) => FrameLen::Exactly(4),
            (header::ACK_32, _) => FrameLen::Exactly(6),
            _ => FrameLen::Unknown(DecodeError::UnknownHeader),
        }
    }

    fn read(header: u8, mut reader: Reader<'_>) -> Result<Self, DecodeError> {
        // The fields of a struct expression are evaluated in the order in which they are written: that of the wire.
        let message = match header {
            header::STATUS => return Status::parse(reader).map(Downlink::Status),
            header::FLOW_CONTROL => return FlowControl::parse(reader).map(Downlink::FlowControl),
            header::ACK => Downlink::Ack {
                command: reader.u7(),
            },
            header::ACK_16 => Downlink::Ack16 {
                command: reader.u7(),
                value: reader.u16(),
            },
            header::ACK_32 => Downlink::Ack32 {
                command: reader.u7(),
                value: reader.f32(),
            },
            header::ERROR => Downlink::Error(DspErrorCode(reader.u16())),
            _ => return Err(DecodeError::UnknownHeader),
        };
        reader.finish()?;
        match message {
            Downlink::Ack { command }
            | Downlink::Ack16 { command, .. }
            | Downlink::Ack32 { command, .. }
                if command > MAX_COMMAND_CODE =>
            {
                Err(DecodeError::Value)
            }
            _ => Ok(message),
        }
    }
}

/// The mask in the first bytes of a status' payload. Its unused bits do not count here: the length follows from the 16
/// bits of the mask, and the frame is rejected for its padding once its checksum is known to be right.
fn mask_of([high, middle, low]: [u8; 3]) -> StatusMask {
    StatusMask(u16::from(high) << 14 | u16::from(middle) << 7 | u16::from(low))
}

/// The DSP's request for waypoints (`peticion_de_tx`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlowControl {
    /// The path buffer is full.
    Stop,
    /// One new waypoint may be sent.
    Send,
}

impl FlowControl {
    fn parse(mut reader: Reader<'_>) -> Result<Self, DecodeError> {
        let request = reader.u7();
        reader.finish()?;
        match request {
            0 => Ok(FlowControl::Stop),
            1 => Ok(FlowControl::Send),
            _ => Err(DecodeError::Value),
        }
    }
}

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

            /// The groups of the message that hold a value outside the limits of section 9, which stand in the tables
            /// of [`crate::group`]. A group that is not carried is not in it.
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
                // The fields of a struct expression are evaluated in the order in which they are written: that of the
                // wire.
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
    use crate::{Decoded, Decoder, checksum};

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
