//! The relay: a robot's telemetry on other machines, and requests back, over Zenoh.
//!
//! One relay runs beside each robot, the *robot side*, and one on each ground station, the *ground side*. The ground side
//! provides the robot's services on its machine, so that every program of the RIL works there as on the robot.
//! `docs/network.md` is for those that use it.
//!
//! Everything that decides is a value without thread, socket or clock:
//!
//! * [`clock`]: what the other machine's clock shows, and how surely;
//! * [`orders`]: requests that are executed at most once, and answered with one final report, through any loss;
//! * [`ros2`]: the same topics for nodes of ROS 2, without ROS on the robot.

pub mod clock;
pub mod orders;
pub mod ros2;
