//! Scripts of stations, of time and of the bridge, against the MAVLink gateway.

#![no_main]

#[path = "../../../gateways/mavlink/tests/script.rs"]
mod script;

libfuzzer_sys::fuzz_target!(|data: &[u8]| script::play(data));
