//! Any bytes for the reader of GeoJSON, and everything that is done with the plan.

#![no_main]

#[path = "../../../crates/plans/tests/plans/reading.rs"]
mod reading;

libfuzzer_sys::fuzz_target!(|data: &[u8]| reading::use_plan("x.geojson", data));
