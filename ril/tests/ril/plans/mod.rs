//! `ril plan`, and the altitudes of `ril takeoff` and `ril goto`: in the shell, and with a simulated robot.

mod altitudes;
mod check;
mod fly;
