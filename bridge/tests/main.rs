//! The bridge's core, tested as one value.

#![allow(missing_docs)]

mod authority;
mod config;
mod control;
mod dsp_path;
mod fence;
mod flight;
mod hostile;
mod link;
mod orders;
mod parameters;
mod paths;
mod rig;
mod safety;
mod sender_lost;
mod steps;
mod suspended;
mod take_off_and_landing;
