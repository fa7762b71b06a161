//! What `ril watch` knows and shows, as pure values: samples, keys and the time go in, a screen comes out.
//!
//! * [`model`]: one robot, fed with samples; [`freshness`] says how old what it knows is;
//! * [`alarms`]: what is wrong now, told once; [`journal`]: what happened;
//! * [`track`] and [`history`]: where the robot was, and its altitude and speed over time; [`chart`]: fence and path of files;
//! * [`app`]: all robots, which of them is selected, and what a key does; [`prompt`]: orders are confirmed by a word;
//! * [`view`]: draws all of that into a buffer; [`keys`] and [`paint`]: bytes of a terminal.
//!
//! Nothing here reads a clock, a port or a terminal: `commands::watch` does.

pub mod alarms;
pub mod app;
pub mod chart;
#[cfg(test)]
mod fixture;
pub mod freshness;
pub mod history;
pub mod journal;
pub mod keys;
pub mod model;
pub mod paint;
pub mod prompt;
pub mod track;
pub mod view;
