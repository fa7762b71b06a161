//! `ril plan`, and the altitudes of `ril takeoff` and `ril goto`: in the shell, and with a simulated robot.

#[path = "../common/mod.rs"]
mod common;

mod altitudes;
mod check;
mod fly;

/// A bridge that no machine which stalls for seconds keeps from flying on.
const PATIENT: &str =
    "[link]\npc_timeout_ms = 60000\nack_timeout_ms = 5000\nsilent_after_ms = 20000\n";
