//! Any bytes into the decoders of both directions and profiles.

#![no_main]
#![allow(dead_code)]

#[path = "../../../tests/examples/figures/bytes/mod.rs"]
mod bytes;
#[path = "../../../tests/tests/plausible.rs"]
mod plausible;

libfuzzer_sys::fuzz_target!(|data: &[u8]| bytes::script::decode(data));
