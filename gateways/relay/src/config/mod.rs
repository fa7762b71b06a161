//! Configuration, `relay.toml`: one file for robots, stations and routers, as it is written.
//!
//! Every value has a default; the annotated example `gateways/relay/relay.toml` shows them all and is tested to parse to them.
//!
//! | file | what is in it |
//! |---|---|
//! | `file` | the file as a whole |
//! | `network` | `[network]`, `[robot]`, `[router]` |
//! | `station` | `[station]` and its robots |
//! | `security` | `[security]` |
//! | `topics` | `[topics]` |
//! | `commands` | `[commands]` |
//! | `ros2` | `[ros2]` |
//! | `side` | which side of the relay has which endpoints |
//! | `name`, `endpoint` | what is a name, and what is an address of the network |
//! | `check` | what no single value shows, as [`Fault`](runtime::config::Fault)s with their lines |

mod check;
mod commands;
mod endpoint;
mod file;
mod name;
mod network;
mod ros2;
mod security;
mod side;
mod station;
mod topics;

pub use commands::{CommandsConfig, LinkLoss};
pub use endpoint::{Endpoint, is_host_name};
pub use file::Config;
pub use name::{MAX_NAME, check_name};
pub use network::{NetworkConfig, RobotConfig, RouterConfig, Through};
pub use ros2::Ros2Config;
pub use security::{Certificates, SecurityConfig};
pub use side::Side;
pub use station::{MAX_ROBOTS, RemoteRobot, StationConfig};
pub use topics::{Priority, Rule, TopicPlan, TopicsConfig, check_pattern};

/// The file that is read when none is named; it may be absent.
pub const DEFAULT_FILE: &str = "relay.toml";

#[cfg(test)]
mod tests;
