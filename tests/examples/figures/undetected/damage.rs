//! What a line does to frames.

use dsp_protocol::header::{self, kind_of, of_kind};
use dsp_protocol::{Frame, MAX_FRAME_LEN, Profile};
use fastrand::Rng;

/// A kind of damage, one row of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Damage {
    /// Each bit is flipped with this probability.
    BitErrors(f64),
    /// Each bit of the asynchronous line is flipped with this probability, start and stop bits among them.
    LineErrors(f64),
    /// A run of bits, of a length within these bounds, whose first and last are flipped and those between at random.
    Burst(usize, usize),
    /// Bytes are lost at the front, at the end or inside.
    Truncation,
    /// Bytes are lost from within a frame to within the next: the head of one and the tail of another, or the bytes
    /// between two losses: the tail of one and the head of another.
    Join,
    /// Random bytes.
    RandomBytes,
    /// The header of a message, what tells its length, and random digits for the rest.
    RandomPayload,
}

impl Damage {
    /// All kinds, in the order of the table.
    pub const ALL: [Damage; 12] = [
        Damage::BitErrors(1e-5),
        Damage::BitErrors(1e-4),
        Damage::BitErrors(1e-3),
        Damage::BitErrors(1e-2),
        Damage::LineErrors(1e-3),
        Damage::LineErrors(1e-2),
        Damage::Burst(2, 32),
        Damage::Burst(33, 256),
        Damage::Truncation,
        Damage::Join,
        Damage::RandomBytes,
        Damage::RandomPayload,
    ];

    /// The kind's name in the table.
    pub fn name(self) -> String {
        match self {
            Damage::BitErrors(rate) => format!("bit errors at {rate:e}"),
            Damage::LineErrors(rate) => format!("the same with start and stop bits at {rate:e}"),
            Damage::Burst(min, max) => format!("bursts of {min} … {max} bits"),
            Damage::Truncation => "truncation".to_owned(),
            Damage::Join => "joins of two frames".to_owned(),
            Damage::RandomBytes => "random bytes".to_owned(),
            Damage::RandomPayload => "random payloads".to_owned(),
        }
    }
}

/// A line that damages in one way.
pub struct Line {
    damage: Damage,
    /// Bits until the next one that is flipped, where each is flipped with a probability.
    unhurt_bits: usize,
    /// The bits on the line; kept for its memory alone.
    bits: Vec<bool>,
}

impl Line {
    /// A line with this damage.
    pub fn new(damage: Damage, random: &mut Rng) -> Line {
        let unhurt_bits = match damage {
            Damage::BitErrors(rate) | Damage::LineErrors(rate) => bits_until_hit(random, rate),
            _ => 0,
        };
        Line {
            damage,
            unhurt_bits,
            bits: Vec::new(),
        }
    }

    /// Sends `frame`, and where the damage needs two, `other` after it. Puts what is left into `bytes`; false when the
    /// line did no harm, and the frame, or the other one, arrives as it was.
    pub fn send(
        &mut self,
        profile: Profile,
        frame: &Frame,
        other: &Frame,
        random: &mut Rng,
        bytes: &mut Vec<u8>,
    ) -> bool {
        let sent = frame.as_bytes();
        let other = other.as_bytes();
        bytes.clear();
        match self.damage {
            Damage::BitErrors(rate) => return self.flip_bits(rate, sent, random, bytes),
            Damage::LineErrors(rate) => {
                self.flip_line_bits(rate, sent, random, bytes);
                // Behind a last stop bit that is low there is one byte more, and the frame is whole.
                return !bytes.starts_with(sent);
            }
            Damage::Burst(min, max) => {
                bytes.extend_from_slice(sent);
                burst(min, max, random, bytes);
            }
            Damage::Truncation => {
                let lost = 1 + random.usize(..sent.len() - 1);
                let first = match random.usize(..3) {
                    0 => 0,
                    1 => sent.len() - lost,
                    _ => random.usize(..sent.len() - lost + 1),
                };
                bytes.extend_from_slice(&sent[..first]);
                bytes.extend_from_slice(&sent[first + lost..]);
            }
            Damage::Join => {
                let (end, begin) = (
                    1 + random.usize(..sent.len() - 1),
                    1 + random.usize(..other.len() - 1),
                );
                if random.usize(..4) == 0 {
                    bytes.extend_from_slice(&sent[end..]);
                    bytes.extend_from_slice(&other[..begin]);
                } else {
                    bytes.extend_from_slice(&sent[..end]);
                    bytes.extend_from_slice(&other[begin..]);
                }
                return !bytes.starts_with(sent) && bytes != other;
            }
            Damage::RandomBytes => {
                let len = 1 + random.usize(..MAX_FRAME_LEN);
                bytes.extend((0..len).map(|_| random.u8(..)));
            }
            Damage::RandomPayload => {
                bytes.extend_from_slice(sent);
                return random_payload(profile, bytes, random) && bytes != sent;
            }
        }
        true
    }

    /// Sends the bits of a frame over a line that goes on from frame to frame.
    fn flip_bits(&mut self, rate: f64, sent: &[u8], random: &mut Rng, bytes: &mut Vec<u8>) -> bool {
        let bits = sent.len() * 8;
        if self.unhurt_bits >= bits {
            self.unhurt_bits -= bits;
            return false;
        }
        bytes.extend_from_slice(sent);
        while self.unhurt_bits < bits {
            bytes[self.unhurt_bits / 8] ^= 1 << (self.unhurt_bits % 8);
            self.unhurt_bits += 1 + bits_until_hit(random, rate);
        }
        self.unhurt_bits -= bits;
        true
    }

    /// Flips bits of a frame, those that frame a byte on the line included. A pause follows the frame, as between two
    /// messages.
    fn flip_line_bits(&mut self, rate: f64, sent: &[u8], random: &mut Rng, bytes: &mut Vec<u8>) {
        self.bits.clear();
        sent.iter()
            .for_each(|byte| put_on_line(*byte, &mut self.bits));
        while let Some(bit) = self.bits.get_mut(self.unhurt_bits) {
            *bit = !*bit;
            self.unhurt_bits += 1 + bits_until_hit(random, rate);
        }
        self.unhurt_bits -= self.bits.len();
        read_from_line(&self.bits, bytes);
    }
}

/// Bits of a byte on the line: a start bit, which is low, eight of data, the lowest first, and a stop bit, which is
/// high.
const LINE_BITS: usize = 10;

/// Puts a byte on the line.
fn put_on_line(byte: u8, bits: &mut Vec<bool>) {
    bits.push(false);
    bits.extend((0..8).map(|bit| byte >> bit & 1 != 0));
    bits.push(true);
}

/// What a UART makes of a line that rests high afterwards. A low bit begins a byte; where its stop bit should be and is
/// not, the byte is handed on all the same, as a port does that was not told to mark it, and the low bit begins
/// another.
fn read_from_line(bits: &[bool], bytes: &mut Vec<u8>) {
    let at = |index: usize| bits.get(index).copied().unwrap_or(true);
    let mut index = 0;
    while index < bits.len() {
        if at(index) {
            index += 1;
            continue;
        }
        bytes.push((0..8).fold(0, |byte, bit| byte | u8::from(at(index + 1 + bit)) << bit));
        index += LINE_BITS - usize::from(!at(index + LINE_BITS - 1));
    }
}

/// Flips a run of bits of `bytes`, in the order of the line, the lowest bit of a byte first.
fn burst(min: usize, max: usize, random: &mut Rng, bytes: &mut [u8]) {
    let bits = bytes.len() * 8;
    let (min, max) = (min.min(bits), max.min(bits));
    let len = min + random.usize(..max - min + 1);
    let first = random.usize(..bits - len + 1);
    let last = first + len - 1;
    for bit in first..=last {
        if bit == first || bit == last || random.bool() {
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
    }
}

/// Puts random digits in place of everything in `frame` that does not tell its length. False when that is the check
/// field alone: one that is right by chance would be the one that was sent.
fn random_payload(profile: Profile, frame: &mut [u8], random: &mut Rng) -> bool {
    let (front, kind, check) = match profile {
        Profile::Classic => (1, kind_of(frame[0]), 1),
        Profile::Extended => (3, frame[2], 5),
    };
    let tells_length = match of_kind(kind) {
        header::STATUS => 3,
        header::COMMAND => 1,
        _ => 0,
    };
    let digits = &mut frame[front + tells_length..];
    digits.fill_with(|| random.u8(..0x80));
    digits.len() > check
}

/// How many bits arrive unhurt before the next one that is flipped, when each is flipped with `probability`.
fn bits_until_hit(random: &mut Rng, probability: f64) -> usize {
    // Never 0, whose logarithm has no end.
    (random.f64_inclusive().max(f64::MIN_POSITIVE).ln() / (-probability).ln_1p()) as usize
}
