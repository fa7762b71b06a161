//! `ril plan`, and the altitudes of `ril takeoff` and `ril goto`: in the shell, and with a simulated robot.

#[path = "../common/mod.rs"]
mod common;

mod altitudes;
mod check;
mod fly;
