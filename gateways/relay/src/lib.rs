//! The relay: a robot's telemetry on other machines, and requests back, over Zenoh.
//!
//! One relay runs beside each robot, the *robot side*, and one at each ground station, the *station side*. The station
//! side provides the robot's services on its machine, so that every program of the RIL works there as on the robot.
//! `docs/network.md` is for those that use it.
//!
//! Everything that decides is a value without thread, socket or clock:
//!
//! * [`clock`]: what the other machine's clock shows, and how surely;
//! * [`orders`]: requests that are executed at most once, and answered with one final report, through any loss;
//! * [`telemetry`]: what is sent of a topic, and what was lost where;
//! * [`message`], [`names`], [`request`]: what relays send one another, and where;
//! * [`ros2`]: the same topics for nodes of ROS 2, without ROS on the robot;
//! * [`config`]: the file `relay.toml`;
//! * [`access`]: which certificate may do what; [`certify`] makes certificates.
//!
//! [`robot`] and [`station`] put these together and move bytes; [`network`] is Zenoh.

pub mod access;
mod budget;
mod certificate_files;
pub mod certify;
pub mod cli;
pub mod clock;
pub mod config;
mod failure;
pub mod message;
pub mod names;
pub mod network;
pub mod orders;
mod own_topics;
pub mod pace;
mod random;
pub mod request;
pub mod robot;
pub mod ros2;
pub mod station;
pub mod telemetry;

pub use failure::Failure;
