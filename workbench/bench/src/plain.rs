//! A sample as the bytes that it consists of, for the peers that carry bytes.

use ipc_types::payload::HeroTelemetry;

/// Bytes of a sample.
pub const LEN: usize = size_of::<HeroTelemetry>();

/// Words of a sample, for those who copy it word by word.
pub const WORDS: usize = LEN / 8;

const _: () = assert!(LEN == WORDS * 8 && align_of::<HeroTelemetry>() == 8);

/// The bytes of `sample`.
pub fn to_bytes(sample: &HeroTelemetry) -> [u8; LEN] {
    // SAFETY: `ipc-types` asserts when it is compiled that the struct has no padding, so that all its bytes are
    // initialized; the sizes are equal, or this would not compile.
    #[allow(unsafe_code)]
    unsafe {
        std::mem::transmute(*sample)
    }
}

/// The sample with these bytes.
pub fn from_bytes(bytes: [u8; LEN]) -> HeroTelemetry {
    // SAFETY: the struct holds only numbers, for which every bit pattern is valid; the sizes are equal.
    #[allow(unsafe_code)]
    unsafe {
        std::mem::transmute(bytes)
    }
}

/// The words of `sample`.
pub fn to_words(sample: &HeroTelemetry) -> [u64; WORDS] {
    // SAFETY: as for the bytes.
    #[allow(unsafe_code)]
    unsafe {
        std::mem::transmute(*sample)
    }
}

/// The sample with these words.
pub fn from_words(words: [u64; WORDS]) -> HeroTelemetry {
    // SAFETY: as for the bytes.
    #[allow(unsafe_code)]
    unsafe {
        std::mem::transmute(words)
    }
}
