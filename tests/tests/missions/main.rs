//! Whole missions in virtual time: the bridge's core against the simulated DSP and its helicopter, with checkers outside
//! both.
//!
//! * [`world`]: the two sides ([`config`]), the wire and one clock; [`operator`]: who flies; [`seeds`]: chance that can
//!   be repeated;
//! * checkers: [`witness`] and [`plausible`] for what consumers get, [`wire`] for what the DSP is told, [`buffer`] for what
//!   it holds, [`chain`] for what status makes of it, [`truth`] for where the helicopter is;
//! * [`recording`]: the journal of each mission, verified bit for bit by replaying it;
//! * missions: [`plain`], [`refusals`], [`settings`], [`troubles`], [`chance`], [`delivery`];
//! * [`journal`]: what a journal finds out; [`flights`]: the library of recorded flights.

mod buffer;
mod chain;
mod chance;
mod config;
mod delivery;
mod dice;
mod flights;
mod journal;
mod operator;
mod plain;
mod plausible;
mod recording;
mod refusals;
mod seeds;
mod settings;
mod troubles;
mod truth;
mod wire;
mod witness;
mod world;
