//! `ril run mavlink`: the helicopter as a MAVLink vehicle.
//!
//! The crate `mavlink-gateway` speaks the protocol, as a pure value. Here are `run`: the process; `shell`: its loop and its socket; `ports`:
//! what it reads and orders of the robot; `store`: the file of the mission; `own_topic`: what it publishes of itself; `timestamp`: the one of
//! signatures that is kept. `status` and `report` are `ril mavlink status`.

mod fence;
mod own_topic;
mod ports;
mod report;
pub mod run;
mod shell;
pub mod status;
mod store;
mod timestamp;
