//! Plots as SVG. The library `plotters` draws them; here is what is drawn.
//!
//! * [`canvas`]: sizes and the frame with its axes; [`axis`]: where ticks stand; [`colour`]: the palette;
//! * [`time`]: values over time; [`lanes`]: phases, states and requests over time; [`map`]: the flight from above;
//! * [`papers`]: all of them as files.

pub mod axis;
pub mod canvas;
pub mod colour;
pub mod lanes;
pub mod map;
pub mod papers;
pub mod time;

pub use canvas::DrawError;
