//! The relay as its users have it: its program, its messages, and what other implementations read of it.
//!
//! One program for all of these suites, because linking one with Zenoh takes half a minute. `security` is a program of
//! its own: its floods take the processor from whatever runs at the same moment, and these suites wait for missions
//! that are flown.

mod check_config;
mod flight;
mod ros2;
mod security_bytes;
mod wire;
