//! Configuration, `relay.toml`: one file for robots, stations and routers, as it is written.
//!
//! Every value has a default; the annotated example `gateways/relay/relay.toml` shows them all and is tested to parse to them.
//!
//! | file | what is in it |
//! |---|---|
//! | `sections` | every section but `[topics]`, and which side of the relay has which endpoints |
//! | `topics` | `[topics]`: which samples, how often |
//! | `names` | what is a name, and what is an address of the network |
//! | `check` | what no single value shows, as [`Fault`](runtime::config::Fault)s with their lines |

mod check;
mod names;
mod sections;
mod topics;

pub use names::{Endpoint, MAX_NAME, check_name, is_host_name};
pub use sections::{
    CommandsConfig, Config, LinkLoss, MAX_ROBOTS, RemoteRobot, Ros2Config, SecurityConfig, Side,
    Through,
};
pub use topics::{Priority, TopicPlan, TopicsConfig, check_pattern};

/// The file that is read when none is named; it may be absent.
pub const DEFAULT_FILE: &str = "relay.toml";

#[cfg(test)]
mod tests;
