//! `ril run mavlink`: the helicopter as a MAVLink vehicle.
//!
//! The crate `mavlink-gateway` speaks the protocol, as a pure value. Here are `run`: the process; `shell`: its loop, its socket and
//! what it publishes of itself; `ports`: what it reads and orders of the robot; `state`: what it keeps over restarts; `keeper`: the thread
//! that writes that; `fence`: a fence of a station in the bridge's file. `status` is `ril mavlink status`.

mod fence;
mod keeper;
mod ports;
pub mod run;
mod shell;
mod state;
pub mod status;
