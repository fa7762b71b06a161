//! What was encoded is decoded: every value of every message survives the line within the step of its type.

use dsp_protocol::downlink::Status;
use dsp_protocol::{
    Command, DecodeError, Decoded, Decoder, Direction, Downlink, MAX_CLASSIC_FRAME_LEN,
    MAX_FRAME_LEN, Profile, Received, Sequence, StatusMask, Uplink, Waypoint,
};
use proptest::prelude::*;

use crate::common;

/// Decodes `bytes`, which must be one message and nothing else.
fn decode_one<M: Direction + std::fmt::Debug>(bytes: &[u8]) -> M {
    let mut decoder = Decoder::new();
    let (taken, decoded) = decoder.decode(bytes);
    assert_eq!(taken, bytes.len());
    match decoded {
        Decoded::Message(message) => message,
        other => panic!("{other:?} instead of a message"),
    }
}

/// Decodes `bytes`, which must be one message of the extended profile and nothing else.
fn receive_one<M: Direction + std::fmt::Debug>(bytes: &[u8]) -> Received<M> {
    let mut decoder = Decoder::with_profile(Profile::Extended);
    let (taken, decoded) = decoder.receive(bytes);
    assert_eq!(taken, bytes.len());
    match decoded {
        Decoded::Message(received) => received,
        other => panic!("{other:?} instead of a message"),
    }
}

proptest! {
    #![proptest_config(common::config(1000))]

    #[test]
    fn downlink_on_the_grid_comes_back_as_itself(message in common::downlink()) {
        prop_assert_eq!(decode_one::<Downlink>(message.encode().as_bytes()), message);
    }

    #[test]
    fn uplink_on_the_grid_comes_back_as_itself(message in common::uplink()) {
        prop_assert_eq!(decode_one::<Uplink>(message.encode().as_bytes()), message);
    }

    #[test]
    fn downlink_comes_back_with_its_numbers(message in common::downlink(), own: u8, answered: u8) {
        let (own, answered) = (Sequence::new(own), Sequence::new(answered));
        let frame = message.encode_in(Profile::Extended, own, answered);
        let is_ack = matches!(
            message,
            Downlink::Ack { .. } | Downlink::Ack16 { .. } | Downlink::Ack32 { .. }
        );
        let longer = if is_ack { 7 } else { 6 };
        prop_assert_eq!(frame.as_bytes().len(), message.encode().as_bytes().len() + longer);
        prop_assert_eq!(receive_one(frame.as_bytes()), Received {
            message,
            sequence: Some(own),
            acknowledges: is_ack.then_some(answered),
        });
    }

    #[test]
    fn uplink_comes_back_with_its_number(message in common::uplink(), own: u8) {
        let sequence = Sequence::new(own);
        let frame = message.encode_in(Profile::Extended, sequence);
        prop_assert_eq!(frame.as_bytes().len(), message.encode().as_bytes().len() + 6);
        prop_assert_eq!(receive_one(frame.as_bytes()), Received {
            message,
            sequence: Some(sequence),
            acknowledges: None,
        });
    }

    #[test]
    fn a_receiver_of_the_other_profile_knows_what_it_is(down in common::downlink(), up in common::uplink()) {
        for (sender, receiver) in [
            (Profile::Classic, Profile::Extended),
            (Profile::Extended, Profile::Classic),
        ] {
            let frame = down.encode_in(sender, Sequence::FIRST, Sequence::FIRST);
            let (_, decoded) = Decoder::<Downlink>::with_profile(receiver).receive(frame.as_bytes());
            prop_assert_eq!(decoded, Decoded::Rejected(DecodeError::OtherProfile));
            let frame = up.encode_in(sender, Sequence::FIRST);
            let (_, decoded) = Decoder::<Uplink>::with_profile(receiver).receive(frame.as_bytes());
            prop_assert_eq!(decoded, Decoded::Rejected(DecodeError::OtherProfile));
        }
    }

    #[test]
    fn every_frame_is_as_long_as_its_mask_says(status in common::status()) {
        let frame = Downlink::Status(status).encode();
        prop_assert_eq!(frame.as_bytes().len(), status.mask().status_frame_len());
    }

    #[test]
    fn withdrawn_groups_are_gone_and_the_others_stay(status in common::status(), groups: u16) {
        let mut left = status;
        left.withdraw(StatusMask(groups));
        prop_assert_eq!(left.mask().0, status.mask().0 & !groups);
        left.withdraw(StatusMask(!groups));
        prop_assert_eq!(left, Status { flying: status.flying, ..Status::default() });
    }

    #[test]
    fn every_bit_pattern_of_a_float_comes_back(bits in any::<u32>()) {
        let value = f32::from_bits(bits);
        let ack = Downlink::Ack32 { command: 2, value };
        let Downlink::Ack32 { value: acked, .. } = decode_one(ack.encode().as_bytes()) else {
            panic!("another message");
        };
        prop_assert_eq!(acked.to_bits(), bits);
        let write = Uplink::Command(Command::Write32 { port: 20_000, value });
        let Uplink::Command(Command::Write32 { value: written, .. }) =
            decode_one(write.encode().as_bytes())
        else {
            panic!("another message");
        };
        prop_assert_eq!(written.to_bits(), bits);
    }
}

#[test]
fn a_nan_is_written_as_zero() {
    let waypoint = Waypoint {
        latitude_deg: f64::NAN,
        longitude_deg: 1.0,
        altitude_m: f64::NAN,
    };
    let expected = Waypoint {
        latitude_deg: 0.0,
        altitude_m: 0.0,
        ..waypoint
    };
    assert_eq!(
        decode_one::<Uplink>(Uplink::Waypoint(waypoint).encode().as_bytes()),
        Uplink::Waypoint(expected)
    );
}

#[test]
fn the_longest_frame_fills_the_buffer_exactly() {
    assert_eq!(StatusMask::ALL.status_frame_len(), MAX_CLASSIC_FRAME_LEN);
    assert_eq!(MAX_CLASSIC_FRAME_LEN + 6, MAX_FRAME_LEN);
}
