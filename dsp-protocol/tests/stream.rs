//! Streams of bytes as a line delivers them: cut anywhere, damaged anywhere, or nothing but noise.

mod common;

use std::fmt::Debug;

use common::{Random, decode_all};
use dsp_protocol::downlink::{Attitude, Geographic, References, ServoPulses, Status};
use dsp_protocol::header::is_header;
use dsp_protocol::{
    Command, Decoded, Decoder, Direction, Downlink, DspErrorCode, FlowControl, Framed, Refusal,
    Uplink, Waypoint,
};
use proptest::collection::vec;
use proptest::prelude::*;

fn messages<M: Copy>(decoded: &[Decoded<M>]) -> Vec<M> {
    decoded
        .iter()
        .filter_map(|decoded| match decoded {
            Decoded::Message(message) => Some(*message),
            _ => None,
        })
        .collect()
}

/// However `bytes` are cut, they give the same.
fn check_chunking<M: Direction + Debug + PartialEq>(bytes: &[u8]) {
    let whole = decode_all::<M>([bytes]);
    for size in [1, 2, 3, 7, 64] {
        assert_eq!(decode_all::<M>(bytes.chunks(size)), whole, "by {size}");
    }
    for cut in 0..=bytes.len() {
        let (front, back) = bytes.split_at(cut);
        assert_eq!(decode_all::<M>([front, back]), whole, "cut at {cut}");
        assert_eq!(
            decode_all::<M>([front, &[], back]),
            whole,
            "cut at {cut}, an empty slice between"
        );
    }
}

/// A piece of a stream: a frame, the beginning of one, or noise.
fn pieces<M: Debug + Clone>(
    message: impl Strategy<Value = M>,
    encode: fn(&M) -> Vec<u8>,
) -> impl Strategy<Value = Vec<u8>> {
    let piece = (
        message,
        any::<prop::sample::Index>(),
        vec(any::<u8>(), 0..6),
        0..10u8,
    )
        .prop_map(move |(message, cut, noise, kind)| {
            let mut frame = encode(&message);
            match kind {
                0 => noise,
                1 => {
                    frame.truncate(cut.index(frame.len()));
                    frame
                }
                2 => {
                    let at = cut.index(frame.len());
                    frame[at] ^= 1 << (at % 8);
                    frame
                }
                _ => frame,
            }
        });
    vec(piece, 0..8).prop_map(|pieces| pieces.concat())
}

fn downlink_bytes(message: &Downlink) -> Vec<u8> {
    message.encode().as_bytes().to_vec()
}

fn uplink_bytes(message: &Uplink) -> Vec<u8> {
    message.encode().as_bytes().to_vec()
}

proptest! {
    #![proptest_config(common::config(60))]

    #[test]
    fn a_downlink_stream_means_the_same_however_it_is_cut(
        bytes in pieces(common::downlink(), downlink_bytes)
    ) {
        check_chunking::<Downlink>(&bytes);
    }

    #[test]
    fn an_uplink_stream_means_the_same_however_it_is_cut(
        bytes in pieces(common::uplink(), uplink_bytes)
    ) {
        check_chunking::<Uplink>(&bytes);
    }
}

proptest! {
    #![proptest_config(common::config(2000))]

    #[test]
    fn no_message_after_noise_is_lost(
        noise in vec(any::<u8>(), 0..300),
        sent in vec(common::downlink(), 1..5),
    ) {
        let mut bytes = noise;
        sent.iter().for_each(|message| bytes.extend(downlink_bytes(message)));
        let got = messages(&decode_all::<Downlink>([bytes.as_slice()]));
        // The noise may hold a message by chance; it comes first.
        prop_assert!(got.ends_with(&sent), "{got:?}");
    }

    #[test]
    fn damage_inside_one_frame_costs_that_message_alone(
        before in vec(common::downlink(), 0..3),
        hit in common::downlink(),
        after in vec(common::downlink(), 0..3),
        at in any::<prop::sample::Index>(),
        gone in 0..10usize,
        noise in vec(any::<u8>(), 0..10),
    ) {
        let mut damaged = downlink_bytes(&hit);
        let at = at.index(damaged.len());
        let end = damaged.len().min(at + gone);
        damaged.splice(at..end, noise);
        let mut bytes: Vec<u8> = before.iter().flat_map(downlink_bytes).collect();
        bytes.extend(damaged);
        bytes.extend(after.iter().flat_map(downlink_bytes));
        let got = messages(&decode_all::<Downlink>([bytes.as_slice()]));
        prop_assert!(got.starts_with(&before), "{got:?}");
        prop_assert!(got.ends_with(&after), "{got:?}");
    }
}

/// Frames of every kind, with values whose bytes have bits of both sorts.
fn downlink_frames() -> Vec<Vec<u8>> {
    let pulses = ServoPulses {
        collective_us: 1500,
        roll_us: 1100,
        pitch_us: 1900,
        tail_us: 1523,
        throttle_us: 1012,
    };
    let status = Status {
        flying: true,
        time_ms: Some(123_456),
        geographic: Some(Geographic {
            latitude_deg: 40.416_812_3,
            longitude_deg: -3.703_790_2,
            altitude_m: 657.318,
        }),
        gps_quality: Some(4),
        attitude: Some(Attitude {
            pitch_deg: -2.5,
            roll_deg: 11.75,
            yaw_deg: -179.99,
        }),
        pilot_pwm: Some(pulses),
        rotor_rpm: Some(1487),
        references: Some(References::default()),
        ..Status::default()
    };
    [
        Downlink::Status(Status::default()),
        Downlink::Status(status),
        Downlink::FlowControl(FlowControl::Stop),
        Downlink::FlowControl(FlowControl::Send),
        Downlink::Ack { command: 5 },
        Downlink::Ack16 {
            command: 0,
            value: 10_000,
        },
        Downlink::Ack32 {
            command: 2,
            value: 0.8,
        },
        Downlink::Error(DspErrorCode(102)),
    ]
    .iter()
    .map(downlink_bytes)
    .collect()
}

fn uplink_frames() -> Vec<Vec<u8>> {
    let place = Waypoint {
        latitude_deg: 40.416_812_3,
        longitude_deg: -3.703_790_2,
        altitude_m: 657.318,
    };
    [
        Uplink::Command(Command::Read16 { port: 10_000 }),
        Uplink::Command(Command::Write16 {
            port: 10_000,
            value: 0xA5C3,
        }),
        Uplink::Command(Command::Read32 { port: 20_000 }),
        Uplink::Command(Command::Write32 {
            port: 20_010,
            value: 0.8,
        }),
        Uplink::Command(Command::ClearErrors),
        Uplink::Command(Command::ActivateStatus),
        Uplink::Command(Command::InvalidatePath),
        Uplink::Command(Command::Following { on: true }),
        Uplink::Waypoint(place),
    ]
    .iter()
    .map(uplink_bytes)
    .collect()
}

/// Whether the length of `frame` follows from its byte `at`, apart from the header.
fn gives_length(frame: &[u8], at: usize) -> bool {
    match frame[0] {
        dsp_protocol::header::STATUS => (1..=3).contains(&at),
        dsp_protocol::header::COMMAND => at == 1,
        _ => false,
    }
}

/// Section 10 of `docs/protocol.md`, for each bit of `frame`, which `next` follows:
/// - a bit of the payload or the checksum that leaves the bounds of the message alone is always seen by the checksum;
/// - the header's bits never give another message, and the bytes behind it are discarded with it;
/// - bit 7 of any other byte breaks the message off;
/// - in every case the frame itself is refused, and `next` arrives.
fn check_flips<M: Direction + Debug + PartialEq + Copy>(frame: &[u8], next: &[u8]) {
    let expected_next = decode_all::<M>([next]);
    for at in 0..frame.len() {
        for bit in 0..8 {
            if gives_length(frame, at) && bit < 7 {
                continue;
            }
            let mut flipped = frame.to_vec();
            flipped[at] ^= 1 << bit;
            flipped.extend_from_slice(next);
            let decoded = decode_all::<M>([flipped.as_slice()]);
            let first = match (at, bit) {
                (0, 7) => Refusal::Stray,
                (0, _) => Refusal::UnknownHeader,
                (_, 7) => Refusal::Truncated,
                _ => Refusal::Checksum,
            };
            let place = format!("bit {bit} of byte {at} of {frame:02X?}");
            assert_eq!(decoded[0], Decoded::Refused(first), "{place}");
            assert!(decoded.ends_with(&expected_next), "{place}: {decoded:?}");
            // A header made of a payload byte is the only way to something else than one refusal and the next message.
            if at == 0 || bit < 7 {
                assert_eq!(decoded.len(), 2, "{place}: {decoded:?}");
            }
        }
    }
}

#[test]
fn a_flipped_bit_that_leaves_the_bounds_alone_is_always_refused() {
    for frame in downlink_frames() {
        for next in downlink_frames() {
            check_flips::<Downlink>(&frame, &next);
        }
    }
    for frame in uplink_frames() {
        for next in uplink_frames() {
            check_flips::<Uplink>(&frame, &next);
        }
    }
}

#[test]
fn a_group_added_to_the_mask_by_a_flipped_bit_is_always_refused() {
    let next = downlink_bytes(&Downlink::Ack { command: 3 });
    let frame = downlink_bytes(&Downlink::Status(Status::default()));
    for bit in 0..16 {
        let mut flipped = frame.clone();
        flipped[3 - bit / 7] ^= 1 << (bit % 7);
        flipped.extend_from_slice(&next);
        assert_eq!(
            decode_all::<Downlink>([flipped.as_slice()]),
            [
                Decoded::Refused(Refusal::Truncated),
                Decoded::Message(Downlink::Ack { command: 3 })
            ],
            "bit {bit}"
        );
    }
}

/// A flipped bit that takes a group out of the mask leaves a shorter message, whose checksum is a byte at random: section
/// 10 says that it is missed once in 128 times.
#[test]
fn a_group_taken_out_of_the_mask_is_missed_about_once_in_128_times() {
    const FRAMES: usize = 20_000;
    let mut random = Random::new(1);
    let mut missed = 0;
    for _ in 0..FRAMES {
        let status = Status {
            time_ms: Some(random.next() as u32),
            sonar_adc: Some(random.below(4096) as u16),
            ..Status::default()
        };
        let mut bytes = downlink_bytes(&Downlink::Status(status));
        bytes[3] ^= 1; // The time's bit.
        missed += messages(&decode_all::<Downlink>([bytes.as_slice()])).len();
    }
    let expected = FRAMES / 128;
    assert!(
        (expected / 2..expected * 2).contains(&missed),
        "{missed} of {FRAMES}"
    );
}

/// Feeds the decoder noise in random slices; every byte must be taken once, and every call must make progress.
fn check_noise<M: Direction>(seed: u64, byte: impl Fn(&mut Random) -> u8) -> [usize; 2] {
    const TOTAL: usize = 2_000_000;
    let mut random = Random::new(seed);
    let mut decoder = Decoder::<M>::new();
    let mut slice = Vec::new();
    let (mut fed, mut taken, mut found) = (0, 0, [0; 2]);
    while fed < TOTAL {
        slice.clear();
        let len = random.below(400);
        slice.extend((0..len).map(|_| byte(&mut random)));
        fed += len;
        let mut rest = slice.as_slice();
        let mut empty_refusals = 0;
        loop {
            let (used, decoded) = decoder.decode(rest);
            rest = &rest[used..];
            taken += used;
            empty_refusals = if used == 0 { empty_refusals + 1 } else { 0 };
            match decoded {
                Decoded::Incomplete => break,
                Decoded::Message(_) => found[0] += 1,
                Decoded::Refused(_) => found[1] += 1,
            }
            // Both the first call of a slice and an interrupting header may end a message without taking a byte.
            assert!(empty_refusals < 2, "no progress");
        }
    }
    assert_eq!(taken, fed);
    found
}

#[test]
fn frames_come_out_as_they_went_in_whole_or_in_pieces() {
    let frames = downlink_frames();
    let stream = frames.concat();
    for size in [1, 5, stream.len()] {
        let mut decoder = Decoder::<Downlink>::new();
        let mut got = Vec::new();
        for mut rest in stream.chunks(size) {
            loop {
                let (taken, framed) = decoder.next_frame(rest);
                rest = &rest[taken..];
                match framed {
                    Framed::Incomplete => break,
                    Framed::Frame(frame) => got.push(frame.to_vec()),
                    Framed::Refused(refusal) => panic!("{refusal:?}"),
                }
            }
        }
        assert_eq!(got, frames, "by {size}");
    }
}

#[test]
fn a_frame_with_a_value_that_cannot_be_is_still_a_frame() {
    // Flow control with request 2, and its checksum.
    let bytes = [0xAA, 0x02, 0x2C];
    assert_eq!(
        Decoder::<Downlink>::new().next_frame(&bytes),
        (3, Framed::Frame(&bytes))
    );
    assert_eq!(
        Decoder::<Downlink>::new().decode(&bytes),
        (3, Decoded::Refused(Refusal::Value))
    );
}

#[test]
fn noise_never_panics_and_every_byte_is_accounted_for() {
    let noise = |random: &mut Random| random.next() as u8;
    // Mostly payload with a real header now and then, so that whole frames come about and their checksum is judged.
    let frames = |random: &mut Random| {
        const HEADERS: [u8; 8] = [0xE9, 0xAA, 0xC3, 0xCC, 0xA5, 0xE6, 0xF0, 0x99];
        match random.below(12) {
            0 => HEADERS[random.below(HEADERS.len())],
            1..4 => random.below(9) as u8,
            _ => random.below(128) as u8,
        }
    };
    for [_, refused] in [
        check_noise::<Downlink>(1, noise),
        check_noise::<Uplink>(2, noise),
    ] {
        assert!(refused > 0);
    }
    for [messages, refused] in [
        check_noise::<Downlink>(3, frames),
        check_noise::<Uplink>(4, frames),
    ] {
        assert!(messages > 0 && refused > 0, "{messages}, {refused}");
    }
}

#[test]
fn no_slice_makes_extent_or_parse_panic() {
    let mut random = Random::new(5);
    for _ in 0..200_000 {
        let len = random.below(140);
        let bytes: Vec<u8> = (0..len).map(|_| random.next() as u8).collect();
        let header_first = bytes.first().is_some_and(|byte| is_header(*byte));
        // Noise is no frame: whatever these say, a message needs a header of its direction.
        assert!(header_first || Downlink::parse(&bytes).is_err());
        assert!(header_first || Uplink::parse(&bytes).is_err());
        let _ = (Downlink::extent(&bytes), Uplink::extent(&bytes));
    }
}
