//! `ril plan`, and the altitudes of `ril takeoff` and `ril goto`: in the shell, and with a simulated robot.

mod altitudes;
pub mod check;
mod fly;
