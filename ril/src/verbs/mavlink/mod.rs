//! `ril run mavlink`: the helicopter as a MAVLink vehicle.
//!
//! The crate `mavlink-gateway` speaks the protocol, as a pure value. Here are `run`: the process; `shell`: its loop and its socket; `ports`:
//! what it reads and orders of the robot; `store`: the file of the mission; `config`: `mavlink.toml`.

mod config;
mod ports;
pub mod run;
mod shell;
mod store;
