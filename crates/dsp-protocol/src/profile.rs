//! What stands around a message on the wire, in the two profiles (`docs/protocol.md` sections 2 and 11): header,
//! numbers and check field, never the values, which are the same in both.
//!
//! A profile asks one thing of a direction's messages: [`Message`], a header and a payload of a known length. That is
//! public only by name: it seals [`Direction`](crate::Direction), and no code outside this crate can reach it.

use crate::decode_error::DecodeError;
use crate::frame::{DIGIT_MASK, Frame, Reader, Writer, crc32};

/// Classic: header and checksum.
const CLASSIC_OVERHEAD: usize = 2;
/// Extended: header, sequence and kind before the payload.
const EXTENDED_FRONT: usize = 3;
/// Extended: the digits of the CRC behind the payload.
const CRC_LEN: usize = 5;
/// Extended: the last field of an acknowledgement, the sequence of the command that it answers.
const ACKNOWLEDGED_LEN: usize = 1;

pub mod header {
    //! The headers of both directions (`docs/protocol.md` section 2).
    //!
    //! | constant | byte | direction | message | length in bytes |
    //! |---|---|---|---|---|
    //! | [`STATUS`] | `0xE9` | DSP → PC | status | 6 + groups of its mask |
    //! | [`FLOW_CONTROL`] | `0xAA` | DSP → PC | flow control | 3 |
    //! | [`ACK`] | `0xC3` | DSP → PC | acknowledgement without data | 3 |
    //! | [`ACK_16`] | `0xCC` | DSP → PC | acknowledgement with 16 bits | 6 |
    //! | [`ACK_32`] | `0xA5` | DSP → PC | acknowledgement with 32 bits | 8 |
    //! | [`ERROR`] | `0xE6` | DSP → PC | error | 5 |
    //! | [`COMMAND`] | `0xF0` | PC → DSP | command | 3 … 11, by its code |
    //! | [`WAYPOINT`] | `0x99` | PC → DSP | waypoint | 17 |
    //!
    //! | [`EXTENDED_DOWNLINK`] | `0xDA` | DSP → PC | any, in the extended profile | 6 or 7 more |
    //! | [`EXTENDED_UPLINK`] | `0xB3` | PC → DSP | any, in the extended profile | 6 more |
    //!
    //! The seven low bits of each are a word of the Hamming(7,4) code: at least three bits differ between any two. In
    //! the extended profile the seven low bits of a message's header are its *kind*.

    /// DSP → PC: status (`ESTADOS`).
    pub const STATUS: u8 = 0xE9;
    /// DSP → PC: flow control (`CONTROLFLUJO`).
    pub const FLOW_CONTROL: u8 = 0xAA;
    /// DSP → PC: acknowledgement without data (`COMMANDACK`).
    pub const ACK: u8 = 0xC3;
    /// DSP → PC: acknowledgement with 16 bits (`COMMANDACK16`).
    pub const ACK_16: u8 = 0xCC;
    /// DSP → PC: acknowledgement with 32 bits (`COMMANDACK32`).
    pub const ACK_32: u8 = 0xA5;
    /// DSP → PC: error (`DSPERROR`).
    pub const ERROR: u8 = 0xE6;
    /// PC → DSP: command.
    pub const COMMAND: u8 = 0xF0;
    /// PC → DSP: waypoint.
    pub const WAYPOINT: u8 = 0x99;
    /// DSP → PC: every message in the extended profile.
    pub const EXTENDED_DOWNLINK: u8 = 0xDA;
    /// PC → DSP: every message in the extended profile.
    pub const EXTENDED_UPLINK: u8 = 0xB3;

    /// Whether `byte` is a header: the only bytes with their most significant bit set.
    pub const fn is_header(byte: u8) -> bool {
        byte & 0x80 != 0
    }

    /// Whether `header` is that of one of the three acknowledgements.
    pub const fn is_acknowledgement(header: u8) -> bool {
        matches!(header, ACK | ACK_16 | ACK_32)
    }

    /// The kind, in the extended profile, of the message with the classic `header`.
    pub const fn kind_of(header: u8) -> u8 {
        header & 0x7F
    }

    /// The classic header of the message with this kind in the extended profile.
    pub const fn of_kind(kind: u8) -> u8 {
        kind | 0x80
    }
}

/// What a direction's messages are between the bytes that a profile puts around them. Messages are distinguished by
/// their classic header, in either profile.
pub trait Message: Sized {
    /// The header of all messages of this direction in the extended profile.
    const EXTENDED_HEADER: u8;

    /// The message's classic header.
    fn header(&self) -> u8;

    /// Appends the payload.
    fn write(&self, writer: &mut Writer);

    /// How long the payload of the message with this `header` is, as far as its first bytes show. `payload` may be
    /// shorter than that, or reach beyond it.
    fn payload_len(header: u8, payload: &[u8]) -> FrameLen;

    /// Takes the message with this `header` out of its payload; the errors are those of [`crate::Direction::parse`].
    fn read(header: u8, reader: Reader<'_>) -> Result<Self, DecodeError>;
}

/// What is known of the length of a frame, or of its payload, from the first bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameLen {
    /// The whole frame has this many bytes, at most [`MAX_FRAME_LEN`](crate::MAX_FRAME_LEN).
    Exactly(usize),
    /// The length is known once this many bytes are there; more than the prefix has.
    AtLeast(usize),
    /// No message begins like this.
    Unknown(DecodeError),
}

impl FrameLen {
    /// The length of a frame whose payload has this length: `front` bytes lie before it, `overhead` bytes around it.
    pub(crate) fn within(self, front: usize, overhead: usize) -> FrameLen {
        match self {
            FrameLen::Exactly(len) => FrameLen::Exactly(len + overhead),
            FrameLen::AtLeast(len) => FrameLen::AtLeast(len + front),
            FrameLen::Unknown(error) => FrameLen::Unknown(error),
        }
    }
}

/// How messages are framed. Both ends of a line are configured to speak the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Profile {
    /// A header for each message and a 7-bit sum (section 2).
    #[default]
    Classic,
    /// One header for each direction, a sequence number, a kind and a CRC-32 (section 11).
    Extended,
}

impl Profile {
    /// Both profiles.
    pub const ALL: [Profile; 2] = [Profile::Classic, Profile::Extended];

    /// The name in configuration files and logs.
    pub const fn name(self) -> &'static str {
        match self {
            Profile::Classic => "classic",
            Profile::Extended => "extended",
        }
    }

    /// The profile with this name.
    pub fn from_name(name: &str) -> Option<Profile> {
        Profile::ALL
            .into_iter()
            .find(|profile| profile.name() == name)
    }

    /// `message` as one frame. The classic profile has no place for the numbers; `acknowledges` stands in
    /// acknowledgements only.
    pub(crate) fn encode<M: Message>(
        self,
        message: &M,
        sequence: Sequence,
        acknowledges: Sequence,
    ) -> Frame {
        let header = message.header();
        match self {
            Profile::Classic => {
                let mut writer = Writer::new(header);
                message.write(&mut writer);
                writer.finish()
            }
            Profile::Extended => {
                let mut writer = Writer::new(M::EXTENDED_HEADER);
                writer.u7(sequence.number());
                writer.u7(header::kind_of(header));
                message.write(&mut writer);
                if header::is_acknowledgement(header) {
                    writer.u7(acknowledges.number());
                }
                writer.finish_with_crc()
            }
        }
    }

    /// How long the frame is that begins with `prefix`; see [`crate::Direction::frame_len`].
    pub(crate) fn frame_len<M: Message>(self, prefix: &[u8]) -> FrameLen {
        match (self, prefix) {
            (Profile::Classic, [header, ..]) if *header == M::EXTENDED_HEADER => {
                FrameLen::Unknown(DecodeError::OtherProfile)
            }
            (Profile::Classic, [header, payload @ ..]) => {
                M::payload_len(*header, payload).within(1, CLASSIC_OVERHEAD)
            }
            (Profile::Extended, [header] | [header, _]) if *header == M::EXTENDED_HEADER => {
                FrameLen::AtLeast(EXTENDED_FRONT)
            }
            (Profile::Extended, [header, _, kind, payload @ ..])
                if *header == M::EXTENDED_HEADER =>
            {
                let header = header::of_kind(*kind);
                let acknowledged = if header::is_acknowledgement(header) {
                    ACKNOWLEDGED_LEN
                } else {
                    0
                };
                M::payload_len(header, payload)
                    .within(EXTENDED_FRONT, EXTENDED_FRONT + acknowledged + CRC_LEN)
            }
            (Profile::Extended, [header, ..]) => match M::payload_len(*header, &[]) {
                FrameLen::Unknown(error) => FrameLen::Unknown(error),
                _ => FrameLen::Unknown(DecodeError::OtherProfile),
            },
            (_, []) => FrameLen::Unknown(DecodeError::UnknownHeader),
        }
    }

    /// Whether the check field at the end of a whole frame is that of the bytes before it. `sum` is that of all bytes
    /// of the frame, which its finder has already added up.
    pub(crate) fn is_sound(self, frame: &[u8], sum: u8) -> bool {
        match self {
            Profile::Classic => frame
                .last()
                .is_some_and(|check| *check == sum.wrapping_sub(*check) & DIGIT_MASK),
            Profile::Extended => frame
                .split_last_chunk()
                .is_some_and(|(summed, digits)| *digits == crc_digits(crc32(summed))),
        }
    }

    /// The message in `frame`; see [`crate::Direction::parse`].
    pub(crate) fn parse<M: Message>(self, frame: &[u8]) -> Result<Received<M>, DecodeError> {
        match (self, frame) {
            (Profile::Classic, [header, payload @ .., _]) => Ok(Received {
                message: M::read(*header, Reader::new(payload))?,
                sequence: None,
                acknowledges: None,
            }),
            (Profile::Extended, [_, sequence, kind, payload @ .., _, _, _, _, _]) => {
                let header = header::of_kind(*kind);
                let (payload, acknowledges) = match payload {
                    [payload @ .., sequence] if header::is_acknowledgement(header) => {
                        (payload, Some(Sequence::new(*sequence)))
                    }
                    payload => (payload, None),
                };
                Ok(Received {
                    message: M::read(header, Reader::new(payload))?,
                    sequence: Some(Sequence::new(*sequence)),
                    acknowledges,
                })
            }
            _ => Err(DecodeError::Truncated),
        }
    }
}

/// The number of a message in the extended profile: 0, 1 … 127, 0 ….
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(from = "u8"))]
pub struct Sequence(u8);

#[cfg(feature = "serde")]
impl From<u8> for Sequence {
    fn from(number: u8) -> Sequence {
        Sequence::new(number)
    }
}

impl Sequence {
    /// The number of the first message.
    pub const FIRST: Sequence = Sequence(0);

    /// The number whose low seven bits are those of `number`.
    pub const fn new(number: u8) -> Sequence {
        Sequence(number & 0x7F)
    }

    /// The number, 0 … 127.
    pub const fn number(self) -> u8 {
        self.0
    }

    /// The number of the message after this one.
    #[must_use]
    pub const fn next(self) -> Sequence {
        Sequence::new(self.0.wrapping_add(1))
    }

    /// How many messages lie between the one with the number `previous` and this one, 0 … 127: what a receiver of both
    /// has missed, modulo 128.
    pub const fn missed_since(self, previous: Sequence) -> u8 {
        Sequence::new(self.0.wrapping_sub(previous.0).wrapping_sub(1)).0
    }
}

/// A message and the numbers that its frame carried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Received<M> {
    /// The message.
    pub message: M,
    /// The message's own number; nothing in the classic profile.
    pub sequence: Option<Sequence>,
    /// For an acknowledgement, the number of the command that it answers; nothing in the classic profile.
    pub acknowledges: Option<Sequence>,
}

/// The CRC as it stands at the end of a frame.
fn crc_digits(crc: u32) -> [u8; CRC_LEN] {
    [28, 21, 14, 7, 0].map(|shift| (crc >> shift) as u8 & 0x7F)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_is_found_by_its_name_alone() {
        for profile in Profile::ALL {
            assert_eq!(Profile::from_name(profile.name()), Some(profile));
        }
        assert_eq!(Profile::from_name("Classic"), None);
        assert_eq!(Profile::default(), Profile::Classic);
    }

    #[test]
    fn numbers_go_round_and_tell_what_was_missed() {
        assert_eq!(Sequence::FIRST.next(), Sequence::new(1));
        assert_eq!(Sequence::new(127).next(), Sequence::FIRST);
        assert_eq!(Sequence::new(0x85).number(), 5);
        for (previous, this, missed) in [(0, 1, 0), (127, 0, 0), (126, 2, 3), (5, 5, 127)] {
            let this = Sequence::new(this);
            assert_eq!(this.missed_since(Sequence::new(previous)), missed);
        }
    }

    #[test]
    fn any_two_headers_differ_in_at_least_three_bits() {
        use header::*;
        let all = [
            STATUS,
            FLOW_CONTROL,
            ACK,
            ACK_16,
            ACK_32,
            ERROR,
            COMMAND,
            WAYPOINT,
            EXTENDED_DOWNLINK,
            EXTENDED_UPLINK,
        ];
        for (i, a) in all.iter().enumerate() {
            assert!(is_header(*a));
            for b in &all[..i] {
                assert!((a ^ b).count_ones() >= 3, "{a:#04x} and {b:#04x}");
            }
        }
    }
}
