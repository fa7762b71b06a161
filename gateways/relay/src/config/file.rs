//! [`Config`]: relay.toml as a whole.

use serde::Deserialize;

use super::commands::CommandsConfig;
use super::network::{NetworkConfig, RobotConfig, RouterConfig};
use super::ros2::Ros2Config;
use super::security::SecurityConfig;
use super::station::StationConfig;
use super::topics::TopicsConfig;

/// All of `relay.toml`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// What both sides have.
    pub network: NetworkConfig,
    /// Certificates.
    pub security: SecurityConfig,
    /// The robot's side.
    pub robot: RobotConfig,
    /// The station's side.
    pub station: StationConfig,
    /// A router between them.
    pub router: RouterConfig,
    /// Which samples.
    pub topics: TopicsConfig,
    /// Which requests.
    pub commands: CommandsConfig,
    /// ROS 2.
    pub ros2: Ros2Config,
}
