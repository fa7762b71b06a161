//! The status process of the HERO's RIL: raw telemetry of the DSP in, the robot's telemetry in SI units out, and logs.

pub mod calibration;
pub mod config;
pub mod core;
pub mod group;
pub mod log;
#[cfg(test)]
mod test_samples;
pub mod translate;
