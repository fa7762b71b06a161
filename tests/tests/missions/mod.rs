//! Whole missions in virtual time: the bridge's core against the simulated DSP and its helicopter, with checkers
//! outside both.
//!
//! * [`world`]: the two sides ([`config`]), the wire and one clock; [`operator`]: who flies; [`seeds`]: chance that can
//!   be repeated, drawn by [`dice`];
//! * checkers: [`witness`] for what consumers get, [`wire`] for what the DSP is told, [`buffer`] for what it holds,
//!   [`chain`] for what status makes of it, [`truth`] for where the helicopter is;
//! * [`recording`]: the journal of each mission, verified bit for bit by replaying it;
//! * missions: `plain`, `settings`, `troubles`, [`chance`], [`delivery`], [`boundaries`];
//! * `journal`: what a journal finds out; `flights`: the library of recorded flights.

pub mod boundaries;
pub mod buffer;
pub mod chain;
pub mod chance;
pub mod config;
pub mod delivery;
pub mod dice;
pub mod operator;
pub mod recording;
pub mod seeds;
pub mod truth;
pub mod wire;
pub mod witness;
pub mod world;

#[cfg(test)]
mod flights;
#[cfg(test)]
mod journal;
#[cfg(test)]
mod plain;
#[cfg(test)]
mod settings;
#[cfg(test)]
mod troubles;
