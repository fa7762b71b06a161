//! What the CRC of the extended profile promises (`docs/protocol.md` section 11): first proved for every frame whose
//! bounds an error leaves alone, then tried on frames with errors of every kind.
//!
//! The proofs rest on the CRC's linearity: which errors it misses depends on the places of the flipped bits alone,
//! never on the message. The error in a bit of the message changes the CRC by a *syndrome*; a bit of the CRC field is
//! its own syndrome; an error is missed when all its syndromes cancel out.

use std::fmt::Debug;

use fastrand::Rng;

use crate::common::{self, receive_all};
use dsp_protocol::{
    Command, Decoded, Direction, Downlink, MAX_FRAME_LEN, Profile, Received, Sequence, Uplink,
    crc32,
};
use proptest::prelude::*;

/// Bytes of the CRC field.
const CRC_LEN: usize = 5;
/// Bits that a burst may have.
const BURST: usize = 32;

/// The syndromes of the bits of a frame of the greatest length, in the order of the line, the lowest bit of a byte
/// first. There is none for the bits 7, which move the bounds, nor for the unused bits of the CRC field, which are seen
/// by themselves.
fn syndromes() -> Vec<(usize, u32)> {
    let zeros = [0; MAX_FRAME_LEN - CRC_LEN];
    let of_data = (0..zeros.len() * 8).filter(|bit| bit % 8 < 7).map(|bit| {
        let mut flipped = zeros;
        flipped[bit / 8] ^= 1 << (bit % 8);
        (bit, crc32(&flipped) ^ crc32(&zeros))
    });
    let of_crc = (0..u32::BITS as usize).map(|bit| {
        let byte = MAX_FRAME_LEN - 1 - bit / 7;
        (byte * 8 + bit % 7, 1 << bit)
    });
    let mut syndromes: Vec<_> = of_data.chain(of_crc).collect();
    syndromes.sort_unstable();
    syndromes
}

#[test]
fn up_to_five_flipped_bits_never_cancel_out() {
    let syndromes: Vec<u32> = syndromes().into_iter().map(|(_, value)| value).collect();
    // One, three and five: an odd number of odd syndromes has an odd number of bits, hence some.
    assert!(syndromes.iter().all(|value| value.count_ones() % 2 == 1));
    // Two cancel out when they are equal; four when two pairs of them are.
    let mut pairs: Vec<u32> = Vec::new();
    for (i, a) in syndromes.iter().enumerate() {
        pairs.extend(syndromes[..i].iter().map(|b| a ^ b));
    }
    pairs.sort_unstable();
    assert_ne!(pairs[0], 0);
    assert!(pairs.windows(2).all(|pair| pair[0] != pair[1]));
}

#[test]
fn no_burst_of_32_bits_cancels_out() {
    let syndromes = syndromes();
    for first in 0..=MAX_FRAME_LEN * 8 - BURST {
        let window = first..first + BURST;
        let inside = syndromes.iter().filter(|(bit, _)| window.contains(bit));
        // Elimination: syndromes that cancel out leave nothing of one of them.
        let mut basis = [0_u32; 32];
        for (bit, value) in inside {
            let mut rest = *value;
            while let Some(leading) = rest.checked_ilog2() {
                let place = &mut basis[leading as usize];
                if *place == 0 {
                    *place = rest;
                    break;
                }
                rest ^= *place;
            }
            assert_ne!(rest, 0, "bit {bit} of a burst from bit {first}");
        }
    }
}

/// Flips the bits of `frame` at these places of the line.
fn flip(frame: &[u8], bits: impl IntoIterator<Item = usize>) -> Vec<u8> {
    let mut flipped = frame.to_vec();
    for bit in bits {
        flipped[bit / 8] ^= 1 << (bit % 8);
    }
    flipped
}

/// Between one and five different places in a frame of `bits` bits.
fn some_bits(random: &mut Rng, bits: usize) -> Vec<usize> {
    let count = 1 + random.usize(..5);
    let mut places = Vec::new();
    while places.len() < count {
        let place = random.usize(..bits);
        if !places.contains(&place) {
            places.push(place);
        }
    }
    places
}

/// The places of a burst of up to 32 bits: its first and its last bit are flipped, and those between at random.
fn burst(random: &mut Rng, bits: usize) -> Vec<usize> {
    let len = 1 + random.usize(..BURST.min(bits));
    let first = random.usize(..bits - len + 1);
    let last = first + len - 1;
    (first..=last)
        .filter(|bit| [first, last].contains(bit) || random.usize(..2) == 1)
        .collect()
}

/// Nothing comes out of a frame with these flipped bits, and the next frame arrives.
fn check<M: Direction + Debug + PartialEq>(frame: &[u8], bits: &[usize], next: (&[u8], M)) {
    let mut stream = flip(frame, bits.iter().copied());
    stream.extend_from_slice(next.0);
    let received = receive_all::<M>(Profile::Extended, [stream.as_slice()]);
    let (last, before) = received.split_last().expect("the next frame arrives");
    let rejected = |received: &Decoded<Received<M>>| matches!(received, Decoded::Rejected(_));
    assert!(before.iter().all(rejected), "{bits:?}: {received:?}");
    assert!(
        matches!(last, Decoded::Message(received) if received.message == next.1),
        "{bits:?}: {received:?}"
    );
}

proptest! {
    #![proptest_config(common::config(300))]

    #[test]
    fn flipped_bits_and_bursts_are_never_taken_for_a_message(
        down in common::downlink(),
        up in common::uplink(),
        own: u8,
        answered: u8,
        seed in 1..u64::MAX,
    ) {
        let (own, answered) = (Sequence::new(own), Sequence::new(answered));
        let mut random = Rng::with_seed(seed);
        let down_frame = down.encode_in(Profile::Extended, own, answered);
        let up_frame = up.encode_in(Profile::Extended, own);
        for damage in [some_bits, burst] {
            for _ in 0..100 {
                let frame = down_frame.as_bytes();
                let bits = damage(&mut random, frame.len() * 8);
                check(frame, &bits, (frame, down));
                let frame = up_frame.as_bytes();
                let bits = damage(&mut random, frame.len() * 8);
                check(frame, &bits, (frame, up));
            }
        }
    }
}

/// Every error of one and of two bits in short frames, those that move the bounds among them.
#[test]
fn every_pair_of_flipped_bits_in_a_short_frame_is_seen() {
    let up = Uplink::Command(Command::Following { on: true });
    let down = Downlink::Ack { command: 7 };
    let number = Sequence::new(0x35);
    let up_frame = up.encode_in(Profile::Extended, number);
    let down_frame = down.encode_in(Profile::Extended, number, number);
    for a in 0..up_frame.as_bytes().len() * 8 {
        for b in 0..=a {
            let bits = if a == b { vec![a] } else { vec![b, a] };
            check(up_frame.as_bytes(), &bits, (up_frame.as_bytes(), up));
            check(down_frame.as_bytes(), &bits, (down_frame.as_bytes(), down));
        }
    }
}
