//! Streams of bytes as a line delivers them: cut anywhere, damaged anywhere, or nothing but noise; in both profiles.

use std::fmt::Debug;

use fastrand::Rng;

use crate::common::{self, decode_all};
use dsp_protocol::downlink::{Attitude, Geographic, References, ServoPulses, Status};
use dsp_protocol::header::{self, is_header, kind_of, of_kind};
use dsp_protocol::{
    Command, DecodeError, Decoded, Decoder, Direction, Downlink, DspErrorCode, FlowControl, Framed,
    Profile, Sequence, Uplink, Waypoint,
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
fn check_chunking<M: Direction + Debug + PartialEq>(profile: Profile, bytes: &[u8]) {
    let whole = decode_all::<M>(profile, [bytes]);
    for size in [1, 2, 3, 7, 64] {
        assert_eq!(
            decode_all::<M>(profile, bytes.chunks(size)),
            whole,
            "by {size}"
        );
    }
    for cut in 0..=bytes.len() {
        let (front, back) = bytes.split_at(cut);
        assert_eq!(
            decode_all::<M>(profile, [front, back]),
            whole,
            "cut at {cut}"
        );
        assert_eq!(
            decode_all::<M>(profile, [front, &[], back]),
            whole,
            "cut at {cut}, an empty slice between"
        );
    }
}

/// A piece of a stream: a frame, the beginning of one, or noise.
fn pieces<M: Debug + Clone>(
    message: impl Strategy<Value = M>,
    encode: impl Fn(&M) -> Vec<u8>,
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

/// Numbers with bits of both sorts, which the classic profile leaves out.
const OWN: Sequence = Sequence::new(0x2A);
const ACKNOWLEDGED: Sequence = Sequence::new(0x55);

fn downlink_bytes(profile: Profile, message: &Downlink) -> Vec<u8> {
    let frame = message.encode_in(profile, OWN, ACKNOWLEDGED);
    frame.as_bytes().to_vec()
}

fn uplink_bytes(profile: Profile, message: &Uplink) -> Vec<u8> {
    message.encode_in(profile, OWN).as_bytes().to_vec()
}

fn profile() -> impl Strategy<Value = Profile> {
    prop::sample::select(&Profile::ALL[..])
}

/// A stream in one of the profiles.
fn stream<M: Debug + Clone, S: Strategy<Value = M>>(
    message: fn() -> S,
    encode: fn(Profile, &M) -> Vec<u8>,
) -> impl Strategy<Value = (Profile, Vec<u8>)> {
    let of_profile = move |profile| {
        let pieces = pieces(message(), move |message| encode(profile, message));
        pieces.prop_map(move |bytes| (profile, bytes))
    };
    profile().prop_flat_map(of_profile)
}

proptest! {
    #![proptest_config(common::config(120))]

    #[test]
    fn a_downlink_stream_means_the_same_however_it_is_cut(
        (profile, bytes) in stream(common::downlink, downlink_bytes)
    ) {
        check_chunking::<Downlink>(profile, &bytes);
    }

    #[test]
    fn an_uplink_stream_means_the_same_however_it_is_cut(
        (profile, bytes) in stream(common::uplink, uplink_bytes)
    ) {
        check_chunking::<Uplink>(profile, &bytes);
    }
}

proptest! {
    #![proptest_config(common::config(3000))]

    #[test]
    fn what_is_missing_of_a_message_is_never_too_much_and_soon_exact(
        profile in profile(),
        message in common::downlink(),
        at in any::<prop::sample::Index>(),
    ) {
        let bytes = downlink_bytes(profile, &message);
        let cut = at.index(bytes.len());
        let mut decoder = Decoder::<Downlink>::with_profile(profile);
        prop_assert_eq!(decoder.missing(), 0);
        decoder.receive(&bytes[..cut]);
        let left = if cut == 0 { 0 } else { bytes.len() - cut };
        prop_assert!(decoder.missing() <= left);
        // Header, numbers and mask.
        if cut >= 6 {
            prop_assert_eq!(decoder.missing(), left);
        }
        decoder.receive(&bytes[cut..]);
        prop_assert_eq!(decoder.missing(), 0);
    }

    #[test]
    fn no_message_after_noise_is_lost(
        profile in profile(),
        noise in vec(any::<u8>(), 0..300),
        sent in vec(common::downlink(), 1..5),
    ) {
        let mut bytes = noise;
        sent.iter().for_each(|message| bytes.extend(downlink_bytes(profile, message)));
        let got = messages(&decode_all::<Downlink>(profile, [bytes.as_slice()]));
        // The noise may hold a message by chance; it comes first.
        prop_assert!(got.ends_with(&sent), "{got:?}");
    }

    #[test]
    fn damage_inside_one_frame_costs_that_message_alone(
        profile in profile(),
        before in vec(common::downlink(), 0..3),
        hit in common::downlink(),
        after in vec(common::downlink(), 0..3),
        at in any::<prop::sample::Index>(),
        gone in 0..10usize,
        noise in vec(any::<u8>(), 0..10),
    ) {
        let bytes_of = |message: &Downlink| downlink_bytes(profile, message);
        let mut damaged = bytes_of(&hit);
        let at = at.index(damaged.len());
        let end = damaged.len().min(at + gone);
        damaged.splice(at..end, noise);
        let mut bytes: Vec<u8> = before.iter().flat_map(bytes_of).collect();
        bytes.extend(damaged);
        bytes.extend(after.iter().flat_map(bytes_of));
        let got = messages(&decode_all::<Downlink>(profile, [bytes.as_slice()]));
        prop_assert!(got.starts_with(&before), "{got:?}");
        prop_assert!(got.ends_with(&after), "{got:?}");
    }
}

/// Frames of every kind, with values whose bytes have bits of both sorts.
fn downlink_frames(profile: Profile) -> Vec<Vec<u8>> {
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
    .map(|message| downlink_bytes(profile, message))
    .collect()
}

fn uplink_frames(profile: Profile) -> Vec<Vec<u8>> {
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
    .map(|message| uplink_bytes(profile, message))
    .collect()
}

/// Whether the length of `frame` follows from its byte `at`, apart from its header and its kind.
fn gives_length(profile: Profile, frame: &[u8], at: usize) -> bool {
    let (kind, payload) = match profile {
        Profile::Classic => (kind_of(frame[0]), 1),
        Profile::Extended => (frame[2], 3),
    };
    match of_kind(kind) {
        header::STATUS => (payload..payload + 3).contains(&at),
        header::COMMAND => at == payload,
        _ => false,
    }
}

/// Section 10 of `docs/protocol.md`, for each bit of `frame`, which `next` follows:
/// - a bit of the payload or the check that leaves the bounds of the message alone is always seen by the check;
/// - the bits of header and kind never give another message, and the bytes behind it are discarded with it;
/// - bit 7 of any other byte breaks the message off;
/// - in every case the frame itself is rejected, and `next` arrives.
fn check_flips<M: Direction + Debug + PartialEq + Copy>(
    profile: Profile,
    frame: &[u8],
    next: &[u8],
) {
    let expected_next = decode_all::<M>(profile, [next]);
    for at in 0..frame.len() {
        for bit in 0..8 {
            if gives_length(profile, frame, at) && bit < 7 {
                continue;
            }
            let mut flipped = frame.to_vec();
            flipped[at] ^= 1 << bit;
            flipped.extend_from_slice(next);
            let decoded = decode_all::<M>(profile, [flipped.as_slice()]);
            let first = match (profile, at, bit) {
                (_, 0, 7) => DecodeError::Stray,
                (_, 0, _) => DecodeError::UnknownHeader,
                (_, _, 7) => DecodeError::Truncated,
                (Profile::Extended, 2, _) => DecodeError::UnknownHeader,
                _ => DecodeError::Checksum,
            };
            let place = format!("bit {bit} of byte {at} of {frame:02X?}");
            assert_eq!(decoded[0], Decoded::Rejected(first), "{place}");
            assert!(decoded.ends_with(&expected_next), "{place}: {decoded:?}");
            // A header made of a payload byte is the only way to something else than one rejection and the next
            // message.
            if at == 0 || bit < 7 {
                assert_eq!(decoded.len(), 2, "{place}: {decoded:?}");
            }
        }
    }
}

#[test]
fn a_flipped_bit_that_leaves_the_bounds_alone_is_always_rejected() {
    for profile in Profile::ALL {
        for frame in downlink_frames(profile) {
            for next in downlink_frames(profile) {
                check_flips::<Downlink>(profile, &frame, &next);
            }
        }
        for frame in uplink_frames(profile) {
            for next in uplink_frames(profile) {
                check_flips::<Uplink>(profile, &frame, &next);
            }
        }
    }
}

#[test]
fn a_group_added_to_the_mask_by_a_flipped_bit_is_always_rejected() {
    for (profile, mask_end) in [(Profile::Classic, 3), (Profile::Extended, 5)] {
        let next = downlink_bytes(profile, &Downlink::Ack { command: 3 });
        let frame = downlink_bytes(profile, &Downlink::Status(Status::default()));
        for bit in 0..16 {
            let mut flipped = frame.clone();
            flipped[mask_end - bit / 7] ^= 1 << (bit % 7);
            flipped.extend_from_slice(&next);
            assert_eq!(
                decode_all::<Downlink>(profile, [flipped.as_slice()]),
                [
                    Decoded::Rejected(DecodeError::Truncated),
                    Decoded::Message(Downlink::Ack { command: 3 })
                ],
                "bit {bit}"
            );
        }
    }
}

/// A flipped bit that takes a group out of the mask leaves a shorter message, whose check is a piece of the payload:
/// section 10 says that a sum misses that once in 128 times; a CRC would miss it once in 2³².
#[test]
fn a_group_taken_out_of_the_mask_is_missed_about_once_in_128_times_by_a_sum() {
    const FRAMES: usize = 20_000;
    for (profile, mask_end, expected) in [
        (Profile::Classic, 3, FRAMES / 128),
        (Profile::Extended, 5, 0),
    ] {
        let mut random = Rng::with_seed(1);
        let mut missed = 0;
        for _ in 0..FRAMES {
            let status = Status {
                time_ms: Some(random.u32(..)),
                sonar_adc: Some(random.u16(..4096)),
                ..Status::default()
            };
            let mut bytes = downlink_bytes(profile, &Downlink::Status(status));
            bytes[mask_end] ^= 1; // The time's bit.
            missed += messages(&decode_all::<Downlink>(profile, [bytes.as_slice()])).len();
        }
        assert!(
            (expected / 2..=expected * 2).contains(&missed),
            "{missed} of {FRAMES}"
        );
    }
}

/// Feeds the decoder noise in random slices; every byte must be taken once, and every call must make progress.
fn check_noise<M: Direction>(
    profile: Profile,
    seed: u64,
    byte: impl Fn(&mut Rng) -> u8,
) -> [usize; 2] {
    const TOTAL: usize = 2_000_000;
    let mut random = Rng::with_seed(seed);
    let mut decoder = Decoder::<M>::with_profile(profile);
    let mut slice = Vec::new();
    let (mut fed, mut taken, mut found) = (0, 0, [0; 2]);
    while fed < TOTAL {
        slice.clear();
        let len = random.usize(..400);
        slice.extend((0..len).map(|_| byte(&mut random)));
        fed += len;
        let mut rest = slice.as_slice();
        let mut empty_rejections = 0;
        loop {
            let (used, decoded) = decoder.decode(rest);
            rest = &rest[used..];
            taken += used;
            empty_rejections = if used == 0 { empty_rejections + 1 } else { 0 };
            match decoded {
                Decoded::Incomplete => break,
                Decoded::Message(_) => found[0] += 1,
                Decoded::Rejected(_) => found[1] += 1,
            }
            // Both the first call of a slice and an interrupting header may end a message without taking a byte.
            assert!(empty_rejections < 2, "no progress");
        }
    }
    assert_eq!(taken, fed);
    found
}

#[test]
fn frames_come_out_as_they_went_in_whole_or_in_pieces() {
    for profile in Profile::ALL {
        let frames = downlink_frames(profile);
        let stream = frames.concat();
        for size in [1, 5, stream.len()] {
            let mut decoder = Decoder::<Downlink>::with_profile(profile);
            let mut got = Vec::new();
            for mut rest in stream.chunks(size) {
                loop {
                    let (taken, framed) = decoder.next_frame(rest);
                    rest = &rest[taken..];
                    match framed {
                        Framed::Incomplete => break,
                        Framed::Frame(frame) => got.push(frame.to_vec()),
                        Framed::Rejected(error) => panic!("{error:?}"),
                    }
                }
            }
            assert_eq!(got, frames, "by {size}");
        }
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
        (3, Decoded::Rejected(DecodeError::Value))
    );
}

#[test]
fn noise_never_panics_and_every_byte_is_accounted_for() {
    const CLASSIC: [u8; 8] = [0xE9, 0xAA, 0xC3, 0xCC, 0xA5, 0xE6, 0xF0, 0x99];
    let noise = |random: &mut Rng| random.u8(..);
    // Mostly payload with a real header now and then, so that whole frames come about and their checksum is judged.
    let frames = |random: &mut Rng| match random.usize(..12) {
        0 => CLASSIC[random.usize(..CLASSIC.len())],
        1..4 => random.u8(..9),
        _ => random.u8(..128),
    };
    // Frames of the extended profile, where kinds are rarer to hit.
    let extended = |random: &mut Rng| match random.usize(..12) {
        0 => random.choice([0xDA, 0xB3]).unwrap(),
        1..6 => kind_of(CLASSIC[random.usize(..CLASSIC.len())]),
        _ => random.u8(..128),
    };
    for profile in Profile::ALL {
        for [_, rejected] in [
            check_noise::<Downlink>(profile, 1, noise),
            check_noise::<Uplink>(profile, 2, noise),
        ] {
            assert!(rejected > 0);
        }
    }
    for [messages, rejected] in [
        check_noise::<Downlink>(Profile::Classic, 3, frames),
        check_noise::<Uplink>(Profile::Classic, 4, frames),
    ] {
        assert!(messages > 0 && rejected > 0, "{messages}, {rejected}");
    }
    for [messages, rejected] in [
        check_noise::<Downlink>(Profile::Extended, 3, extended),
        check_noise::<Uplink>(Profile::Extended, 4, extended),
    ] {
        assert!(messages == 0 && rejected > 0, "{messages}, {rejected}");
    }
}

#[test]
fn no_slice_makes_frame_len_or_parse_panic() {
    let mut random = Rng::with_seed(5);
    for _ in 0..200_000 {
        let len = random.usize(..140);
        let bytes: Vec<u8> = (0..len).map(|_| random.u8(..)).collect();
        let header_first = bytes.first().is_some_and(|byte| is_header(*byte));
        // Noise is no frame: whatever these say, a message needs a header of its direction.
        assert!(header_first || Downlink::parse(&bytes).is_err());
        assert!(header_first || Uplink::parse(&bytes).is_err());
        let _ = (Downlink::frame_len(&bytes), Uplink::frame_len(&bytes));
    }
}
