//! Any bytes as a script for the bridge's core: what its line, its DSP and its operator do.

#![no_main]
#![allow(dead_code)]

#[path = "../../../tests/examples/figures/bytes/mod.rs"]
mod bytes;
#[path = "../../../tests/tests/plausible.rs"]
mod plausible;

libfuzzer_sys::fuzz_target!(|data: &[u8]| bytes::script::play(data));
