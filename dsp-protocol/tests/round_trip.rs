//! What was encoded is decoded: every value of every message survives the line within the step of its type.

mod common;

use dsp_protocol::{Decoded, Decoder, Direction, Downlink, Uplink};
use proptest::prelude::*;

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

proptest! {
    #[test]
    fn downlink_on_the_grid_comes_back_as_itself(message in common::downlink()) {
        prop_assert_eq!(decode_one::<Downlink>(message.encode().as_bytes()), message);
    }

    #[test]
    fn uplink_on_the_grid_comes_back_as_itself(message in common::uplink()) {
        prop_assert_eq!(decode_one::<Uplink>(message.encode().as_bytes()), message);
    }
}
