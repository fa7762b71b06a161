//! Any bytes for the reader of lists of waypoints, and everything that is done with the plan.

#![no_main]

#[path = "../../../crates/plans/tests/plans/reading.rs"]
mod reading;

libfuzzer_sys::fuzz_target!(|data: &[u8]| reading::use_plan("x.waypoints", data));
