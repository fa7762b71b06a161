//! What the kit may send. By default nothing that can move a rotor: the type [`Harmless`] cannot express it, and
//! [`RotorDisconnected`], which only a typed confirmation gives, is needed for the rest.
//!
//! | sent | needs |
//! |---|---|
//! | reads of any port, clear errors, activate status, invalidate path, following off | nothing |
//! | writes of ports 10000 … 10004, 20000 … 20002, 20121, and of port numbers that do not exist | nothing |
//! | waypoints, following on, writes of 10121 and 10122 | [`RotorDisconnected`] |
//! | writes of trims, rotor speed and gains: a throttle trim alone can start an electric motor | [`RotorDisconnected`] |
//! | damaged frames | as the frame that they were; [`MotionWatch`] also refuses bytes that read as a frame of the last two rows |

use dsp_protocol::{Command, Profile, Uplink, checksum, crc32, header, port};

/// What is typed to confirm that no rotor can turn.
pub const CONFIRMATION: &str = "the rotor is disconnected";

/// The proof that the operator has confirmed that no rotor can turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RotorDisconnected(());

impl RotorDisconnected {
    /// The proof, if `typed` is [`CONFIRMATION`]; spaces around it do not count.
    pub fn confirmed_by(typed: &str) -> Option<RotorDisconnected> {
        (typed.trim() == CONFIRMATION).then_some(RotorDisconnected(()))
    }

    /// Permits any message.
    pub fn permit(self, message: impl Into<AnyMessage>) -> Permitted {
        Permitted(message.into().0)
    }
}

/// A command or a waypoint, for [`RotorDisconnected::permit`].
pub struct AnyMessage(Uplink);

impl From<Command> for AnyMessage {
    fn from(command: Command) -> AnyMessage {
        AnyMessage(Uplink::Command(command))
    }
}

impl From<dsp_protocol::Waypoint> for AnyMessage {
    fn from(waypoint: dsp_protocol::Waypoint) -> AnyMessage {
        AnyMessage(Uplink::Waypoint(waypoint))
    }
}

/// A 16-bit port of which no value moves anything.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub enum QuietPort16 {
    /// Which groups a status carries.
    StatusMask = port::STATUS_MASK,
    /// Status period, ms.
    StatusPeriod = port::STATUS_PERIOD_MS,
    /// Flow control period, ms.
    FlowControlPeriod = port::FLOW_CONTROL_PERIOD_MS,
    /// Read only.
    WaypointCount = port::WAYPOINT_COUNT,
    /// PC time-out, ms. It can only make a helicopter hover.
    PcTimeout = port::PC_TIMEOUT_MS,
    /// A number that no port has.
    Unknown = 9,
    /// A port of 32 bits, which is none in this width.
    OtherWidth = port::CRUISE_SPEED_MPS,
}

/// A 32-bit port of which no value moves anything while the helicopter stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub enum QuietPort32 {
    /// Cruise speed, m/s.
    CruiseSpeed = port::CRUISE_SPEED_MPS,
    /// Climb speed, m/s.
    ClimbSpeed = port::CLIMB_SPEED_MPS,
    /// Acceptance radius, m.
    AcceptanceRadius = port::ACCEPTANCE_RADIUS_M,
    /// Height of the next take-off, m.
    TakeOffAltitude = port::TAKE_OFF_ALTITUDE_M,
    /// A number that no port has.
    Unknown = 9,
    /// A port of 16 bits, which is none in this width.
    OtherWidth = port::STATUS_MASK,
}

/// A command that moves no rotor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Harmless(Command);

impl Harmless {
    /// Empties the error queue.
    pub const CLEAR_ERRORS: Harmless = Harmless(Command::ClearErrors);
    /// Starts the status.
    pub const ACTIVATE_STATUS: Harmless = Harmless(Command::ActivateStatus);
    /// Empties the path buffer.
    pub const INVALIDATE_PATH: Harmless = Harmless(Command::InvalidatePath);
    /// Switches following off.
    pub const FOLLOWING_OFF: Harmless = Harmless(Command::Following { on: false });

    /// Reads any 16-bit port.
    pub const fn read_16(port: u16) -> Harmless {
        Harmless(Command::Read16 { port })
    }

    /// Reads any 32-bit port.
    pub const fn read_32(port: u16) -> Harmless {
        Harmless(Command::Read32 { port })
    }

    /// Writes a port that moves nothing.
    pub const fn write_16(port: QuietPort16, value: u16) -> Harmless {
        Harmless(Command::Write16 {
            port: port as u16,
            value,
        })
    }

    /// Writes a port that moves nothing.
    pub const fn write_32(port: QuietPort32, value: f32) -> Harmless {
        Harmless(Command::Write32 {
            port: port as u16,
            value,
        })
    }
}

/// A message that may be sent: harmless, or permitted by [`RotorDisconnected`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Permitted(Uplink);

impl Permitted {
    /// The message.
    pub const fn message(&self) -> &Uplink {
        &self.0
    }
}

impl From<Harmless> for Permitted {
    fn from(Harmless(command): Harmless) -> Permitted {
        Permitted(Uplink::Command(command))
    }
}

/// Bytes that are no whole, right frame, made from frames that were permitted or from nothing that a DSP can take for
/// one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Raw(Vec<u8>);

impl Raw {
    /// The bytes of a permitted frame.
    pub(crate) fn of_frame(frame: &[u8]) -> Raw {
        Raw(frame.to_vec())
    }

    /// Bytes without bit 7: `count` of them, by `seed`.
    pub fn strays(seed: u8, count: usize) -> Raw {
        let step = |index: usize| seed.wrapping_add((index as u8).wrapping_mul(29)) & 0x7F;
        Raw((0..count).map(step).collect())
    }

    /// Any bytes. [`MotionWatch`] still judges them before they are sent.
    pub fn bytes(bytes: impl Into<Vec<u8>>) -> Raw {
        Raw(bytes.into())
    }

    /// Inverts the bits of `flip` in the byte at `index`, counted from the end if it is negative.
    #[must_use]
    pub fn flip(mut self, index: isize, flip: u8) -> Raw {
        let at = if index < 0 {
            self.0.len().checked_add_signed(index)
        } else {
            usize::try_from(index).ok()
        };
        if let Some(byte) = at.and_then(|at| self.0.get_mut(at)) {
            *byte ^= flip;
        }
        self
    }

    /// Its first `count` bytes.
    #[must_use]
    pub fn cut(mut self, count: usize) -> Raw {
        self.0.truncate(count);
        self
    }

    /// What is left of it without its first `count` bytes.
    #[must_use]
    pub fn rest(mut self, count: usize) -> Raw {
        self.0.drain(..count.min(self.0.len()));
        self
    }

    /// This, and `other` behind it without a pause.
    #[must_use]
    pub fn then(mut self, other: Raw) -> Raw {
        self.0.extend(other.0);
        self
    }

    /// Replaces the check field by the one that a frame of `profile` with these bytes has.
    #[must_use]
    pub fn sealed(mut self, profile: Profile) -> Raw {
        match profile {
            Profile::Classic => {
                if let Some((check, summed)) = self.0.split_last_mut() {
                    *check = checksum(summed);
                }
            }
            Profile::Extended => {
                if let Some((summed, check)) = self.0.split_last_chunk_mut::<5>() {
                    let crc = crc32(summed);
                    *check = [28, 21, 14, 7, 0].map(|shift| (crc >> shift) as u8 & 0x7F);
                }
            }
        }
        self
    }

    /// The bytes.
    pub fn as_bytes(&self) -> &[u8] {
        &self.0
    }
}

/// Bytes of a frame that the watch looks at: header, number, kind, code, port, value.
const WATCHED: usize = 12;

/// Sees in the stream of all bytes to the DSP whatever could be read as a message that moves a rotor: with a wrong
/// check field, broken off or in the other profile, too. So a DSP that overlooks damage is not moved either.
#[derive(Clone, Debug, Default)]
pub struct MotionWatch {
    frame: Vec<u8>,
}

impl MotionWatch {
    /// Whether `bytes`, behind those before them, contain such a message. Then they do not count as sent.
    pub fn is_moved_by(&mut self, bytes: &[u8]) -> bool {
        let before = self.frame.clone();
        for byte in bytes {
            if header::is_header(*byte) {
                self.frame.clear();
            }
            if self.frame.len() < WATCHED {
                self.frame.push(*byte);
            }
            if begins_motion(&self.frame) {
                self.frame = before;
                return true;
            }
        }
        false
    }
}

/// Whether `frame`, from its header on, is the beginning of a message that can move a rotor.
fn begins_motion(frame: &[u8]) -> bool {
    let (header, payload) = match frame {
        [header::EXTENDED_UPLINK, _, kind, payload @ ..] => (header::of_kind(*kind), payload),
        [header, payload @ ..] => (*header, payload),
        [] => return false,
    };
    let number = |bytes: &[u8]| {
        let digits = bytes.iter().take(3);
        digits.fold(0u32, |value, digit| value << 7 | u32::from(*digit)) as u16
    };
    match (header, payload) {
        (header::WAYPOINT, _) => true,
        (header::COMMAND, [1 | 3, port @ ..]) if port.len() >= 3 => moves(number(port)),
        (header::COMMAND, [7, switch, ..]) => *switch != 0,
        _ => false,
    }
}

/// Whether a write of the port with this number can move a rotor or what drives it.
pub fn moves(port: u16) -> bool {
    match port {
        port::TAKE_OFF | port::LAND => true,
        // Trims and rotor speed; gains.
        10_100..=10_999 | 20_010..=20_099 => true,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use dsp_protocol::port::{Access, PORTS_16, PORTS_32};
    use dsp_protocol::{Sequence, Waypoint};

    use super::*;

    fn frames(message: Uplink) -> impl Iterator<Item = Vec<u8>> {
        Profile::ALL.into_iter().map(move |profile| {
            let frame = message.encode_in(profile, Sequence::new(77));
            frame.as_bytes().to_vec()
        })
    }

    fn is_seen(bytes: &[u8]) -> bool {
        MotionWatch::default().is_moved_by(bytes)
    }

    #[test]
    fn only_the_typed_confirmation_permits_everything() {
        for text in [
            "",
            "yes",
            "The rotor is disconnected",
            "the rotor is disconnected!",
        ] {
            assert_eq!(RotorDisconnected::confirmed_by(text), None, "{text}");
        }
        let typed = format!(" {CONFIRMATION}\n");
        assert!(RotorDisconnected::confirmed_by(&typed).is_some());
    }

    #[test]
    fn ports_that_users_may_write_only_on_the_ground_or_never_count_as_moving() {
        let quiet = [
            port::STATUS_MASK,
            port::STATUS_PERIOD_MS,
            port::FLOW_CONTROL_PERIOD_MS,
            port::PC_TIMEOUT_MS,
        ];
        for port in PORTS_16 {
            assert_eq!(
                moves(port.number),
                !quiet.contains(&port.number),
                "{port:?}"
            );
        }
        for port in PORTS_32 {
            assert_eq!(
                moves(port.number),
                port.access == Access::OnGround,
                "{port:?}"
            );
        }
    }

    #[test]
    fn the_watch_sees_every_message_that_moves_and_none_that_is_harmless() {
        let write = |port| Uplink::Command(Command::Write16 { port, value: 1 });
        let moving = [
            write(port::TAKE_OFF),
            write(port::LAND),
            write(port::TRIM_THROTTLE_US),
            Uplink::Command(Command::Following { on: true }),
            Uplink::Waypoint(Waypoint::default()),
        ];
        for message in moving {
            for frame in frames(message) {
                assert!(is_seen(&frame), "{message:?}");
                // Also when the DSP overlooks that the end is wrong, or missing.
                let last = frame.len() - 1;
                assert!(is_seen(&frame[..last]), "{message:?}");
            }
        }
        let harmless = [
            Harmless::CLEAR_ERRORS,
            Harmless::FOLLOWING_OFF,
            Harmless::INVALIDATE_PATH,
            Harmless::ACTIVATE_STATUS,
            Harmless::read_16(port::TAKE_OFF),
            Harmless::write_16(QuietPort16::StatusMask, u16::MAX),
            Harmless::write_32(QuietPort32::TakeOffAltitude, 3.0),
        ];
        for message in harmless.map(Permitted::from) {
            for frame in frames(*message.message()) {
                assert!(!is_seen(&frame), "{message:?}");
            }
        }
    }

    #[test]
    fn the_watch_sees_a_message_that_is_sent_in_pieces() {
        let write = Uplink::Command(Command::Write16 {
            port: port::TAKE_OFF,
            value: 1,
        });
        for frame in frames(write) {
            let mut watch = MotionWatch::default();
            let seen = frame.iter().filter(|byte| watch.is_moved_by(&[**byte]));
            assert!(seen.count() > 0);
        }
    }
}
