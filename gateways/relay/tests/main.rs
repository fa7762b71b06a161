//! The relay as its users have it: its program, its messages, and what other implementations read of it.
//!
//! One program for all of these suites, because linking one with Zenoh takes half a minute. `security` is a program of its own:
//! its floods take the processor from whatever runs at the same moment, and these suites wait for missions that are flown.

#[path = "../examples/field/ages.rs"]
#[allow(dead_code)]
mod ages;
#[path = "../examples/field/air.rs"]
#[allow(dead_code)]
mod air;
#[path = "flight/bridge_log.rs"]
mod bridge_log;
mod check_config;
mod field;
mod flight;
#[path = "flight/machine.rs"]
mod machine;
#[path = "../examples/field/mission.rs"]
mod mission;
#[path = "../examples/field/outages.rs"]
mod outages;
mod ros2;
mod security_bytes;
#[path = "../examples/field/site.rs"]
#[allow(dead_code)]
mod site;
#[path = "../examples/field/tunnel.rs"]
#[allow(dead_code)]
mod tunnel;
mod wire;
