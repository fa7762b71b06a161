//! Any bytes as the file of a MAVLink mission, and as its items.

#![no_main]

#[path = "../../../gateways/mavlink/tests/mission_file.rs"]
mod mission_file;

libfuzzer_sys::fuzz_target!(|data: &[u8]| mission_file::check(data));
