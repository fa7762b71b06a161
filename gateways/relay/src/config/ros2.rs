//! `[ros2]`: the same topics for nodes of ROS 2.

use serde::Deserialize;

runtime::ranged! {
    fn domain_id(u32) in 0..=232;
}

/// `[ros2]`
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Ros2Config {
    /// Whether the topics are there in the form of ROS 2 too.
    pub enabled: bool,
    /// `ROS_DOMAIN_ID`.
    #[serde(deserialize_with = "domain_id")]
    pub domain_id: u32,
    /// Whether standard messages are made of `hero_telemetry`.
    pub standard_messages: bool,
}

impl Default for Ros2Config {
    fn default() -> Self {
        Ros2Config {
            enabled: false,
            domain_id: 0,
            standard_messages: true,
        }
    }
}
