//! Sends frames over a line that damages them, and counts what a receiver takes for a message.

use std::ops::AddAssign;

use dsp_protocol::{DecodeError, Decoded, Decoder, Downlink, Frame, Profile, Uplink};
use fastrand::Rng;

use super::damage::{Damage, Line};
use super::traffic::Traffic;

/// Messages that are made up at a time. The line damages each of them several times in other ways.
const MESSAGES: usize = 256;
/// How often each of them is sent before there are new ones; at low rates most of them arrive unhurt.
const ROUNDS: usize = 64;

/// What became of damaged frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Frames that were damaged.
    pub damaged: u64,
    /// What had the bounds of a frame afterwards, so that its check field was judged.
    pub judged: u64,
    /// Judged frames whose check field was right.
    pub passed: u64,
    /// Damaged frames that were taken for a message.
    pub accepted: u64,
    /// Damaged frames with a value that cannot be.
    pub implausible: u64,
    /// Good frames after a damaged one that did not arrive.
    pub lost: u64,
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Tally) {
        self.damaged += other.damaged;
        self.judged += other.judged;
        self.passed += other.passed;
        self.accepted += other.accepted;
        self.implausible += other.implausible;
        self.lost += other.lost;
    }
}

/// Damages `frames` frames in one way, half of them in each direction.
pub fn measure(profile: Profile, damage: Damage, frames: u64, seed: u64) -> Tally {
    let mut random = Rng::with_seed(seed);
    let up = frames / 2;
    let mut tally = one_direction::<Downlink>(profile, damage, frames - up, &mut random);
    tally += one_direction::<Uplink>(profile, damage, up, &mut random);
    tally
}

fn one_direction<M: Traffic>(
    profile: Profile,
    damage: Damage,
    frames: u64,
    random: &mut Rng,
) -> Tally {
    let mut tally = Tally::default();
    let mut line = Line::new(damage, random);
    let mut receiver = Receiver::<M>::new(profile);
    let mut bytes = Vec::new();
    loop {
        let messages: Vec<(M, Frame)> = (0..MESSAGES)
            .map(|_| {
                let frame = M::random(random).frame(profile, random);
                (receiver.understand(&frame), frame)
            })
            .collect();
        for _ in 0..ROUNDS * MESSAGES {
            if tally.damaged == frames {
                return tally;
            }
            let mut any = || &messages[random.usize(..MESSAGES)];
            let ((_, frame), (_, other), next) = (any(), any(), any());
            if line.send(profile, frame, other, random, &mut bytes) {
                tally.damaged += 1;
                receiver.hear(&bytes, next, &mut tally);
            }
        }
    }
}

struct Receiver<M> {
    decoder: Decoder<M>,
}

impl<M: Traffic> Receiver<M> {
    fn new(profile: Profile) -> Self {
        Receiver {
            decoder: Decoder::with_profile(profile),
        }
    }

    /// The message that a good frame carries, its values rounded to the steps of the wire.
    fn understand(&mut self, frame: &Frame) -> M {
        match self.decoder.decode(frame.as_bytes()) {
            (_, Decoded::Message(message)) => message,
            (_, other) => panic!("{other:?} instead of a message"),
        }
    }

    /// Hears what is left of a frame, and a good one after it.
    fn hear(&mut self, damaged: &[u8], next: &(M, Frame), tally: &mut Tally) {
        let mut rest = damaged;
        loop {
            let (taken, decoded) = self.decoder.decode(rest);
            rest = &rest[taken..];
            match decoded {
                Decoded::Incomplete => break,
                Decoded::Message(message) => {
                    tally.judged += 1;
                    tally.passed += 1;
                    tally.accepted += 1;
                    tally.implausible += u64::from(message.is_implausible());
                }
                Decoded::Rejected(DecodeError::Checksum) => tally.judged += 1,
                Decoded::Rejected(DecodeError::Padding | DecodeError::Value) => {
                    tally.judged += 1;
                    tally.passed += 1;
                }
                Decoded::Rejected(_) => {}
            }
        }
        let (message, frame) = next;
        let mut rest = frame.as_bytes();
        let mut arrived = false;
        while !rest.is_empty() {
            let (taken, decoded) = self.decoder.decode(rest);
            rest = &rest[taken..];
            arrived |= matches!(decoded, Decoded::Message(got) if got == *message);
        }
        tally.lost += u64::from(!arrived);
    }
}
