//! Any bytes as messages of relays, and as scripts of what strangers do to the pure parts of both sides.

#![no_main]
#![allow(dead_code)]

#[path = "../../../gateways/relay/tests/security/script.rs"]
mod script;

libfuzzer_sys::fuzz_target!(|data: &[u8]| script::play(data));
