//! The kit against right and wrong DSPs, in virtual time: no port, no waiting.

mod dsp;
mod fault;
mod harness;
mod lossy;
mod mutants;
mod replay;
mod right;
mod safety;
mod sentences;
