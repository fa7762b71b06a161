//! The step of the simulation.

/// Length of a step, s.
pub const STEP_S: f64 = 0.005;
