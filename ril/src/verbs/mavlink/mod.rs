//! `ril run mavlink`: the helicopter as a MAVLink vehicle.
//!
//! The crate `mavlink-gateway` speaks the protocol, as a pure value. Here are `run`: the process; `shell`: its loop and its socket; `ports`:
//! what it reads and orders of the robot; `state`: what it keeps over restarts; `fence`: a fence of a station in the bridge's
//! file; `own_topic`: what it publishes of itself. `status` and `report` are `ril mavlink status`.

mod fence;
mod own_topic;
mod ports;
mod report;
pub mod run;
mod shell;
mod state;
pub mod status;
